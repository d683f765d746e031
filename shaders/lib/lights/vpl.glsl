// VPLs (deferred_ir/frame/vpl_buffer.py): their records, a block at a time, and the irradiance from one without its
// shadow.
#include "lib/lights/light.glsl"

struct Vpl {
    vec3 position;
    float one_minus_cos;  // 1 - cos of the half cone angle
    vec3 x_axis;          // of its view, divided by tan_half
    float tan_half;       // tangent of the half cone angle
    vec3 y_axis;
    float clamp_squared;  // 1/d^2 is taken as 1/max(d^2, this)
    vec3 z_axis;          // unit; its surface's normal
    float tile;           // of the shadow atlas
    vec3 emission;
    float curve;          // c / (1 + c), c the cosine of the half cone angle: scales paraboloid maps
};

layout(std140, binding = VPLS_BINDING) uniform Vpls { Vpl vpls[VPLS_PER_BLOCK]; };

#ifndef CLAMPED  // 0: no VPL's clamp_squared is above 0
#define CLAMPED 1
#endif

// I(w) = E_i cos(theta_y) inside a round cone, dark outside. No root: this is the innermost loop.
vec3 vpl_irradiance(Vpl vpl, vec3 position, vec3 normal, vec3 shading_normal) {
    vec3 from = position - vpl.position;
    float square = dot(from, from);
    float leaving = max(dot(vpl.z_axis, from), 0.0), edge = 1.0 - vpl.one_minus_cos;
    float inside = step(edge * edge * square, leaving * leaving);
    float cosines = leaving * receiving(-from, normal, shading_normal);
#if CLAMPED
    float held = max(square, vpl.clamp_squared);
#else
    float held = square;
#endif
    // The cosines bring a distance each. Two divisions: the fourth power of a small distance would vanish.
    return vpl.emission * (inside * cosines / max(square, TINY) / max(held, TINY));
}
