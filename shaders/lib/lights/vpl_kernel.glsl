// The irradiance from a VPL over its emission, without its shadow; deferred_ir/vpls/kernel.py says the same.
#include "lib/lights/light.glsl"

#ifndef CLAMPED  // 0: no clamp_squared is above 0
#define CLAMPED 1
#endif

// The way from a VPL to a surface. For one at infinity `clamp_squared` is below 0: minus the square of a distance at which
// it would bring the same light everywhere.
vec3 way_from(vec3 vpl_position, vec3 vpl_normal, vec3 position, float clamp_squared) {
    return clamp_squared < 0.0 ? vpl_normal * sqrt(-clamp_squared) : position - vpl_position;
}

// from: from the VPL to the surface. edge: cosine of half the cone's angle. No root: this is the innermost loop.
float vpl_kernel(vec3 from, vec3 vpl_normal, vec3 normal, vec3 shading_normal, float edge, float clamp_squared) {
    float square = dot(from, from);
    float leaving = max(dot(vpl_normal, from), 0.0);
    float inside = step(edge * edge * square, leaving * leaving);
    float cosines = leaving * receiving(-from, normal, shading_normal);
#if CLAMPED
    float held = max(square, clamp_squared);
#else
    float held = square;
#endif
    // The cosines bring a distance each. Two divisions: the fourth power of a small distance would vanish.
    return inside * cosines / max(square, TINY) / max(held, TINY);
}
