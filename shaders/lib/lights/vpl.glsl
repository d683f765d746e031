// VPLs (deferred_ir/frame/vpl_buffer.py): their records, a block at a time, and the irradiance from one without its
// shadow.
#include "lib/lights/light.glsl"

struct Vpl {
    vec3 position;
    float one_minus_cos;  // 1 - cos of the half cone angle
    vec3 x_axis;          // of its view, divided by tan_half
    float tan_half;       // tangent of the half cone angle; 0: the VPL lies at infinity, and its view is parallel
    vec3 y_axis;
    float clamp_squared;  // 1/d^2 is taken as 1/max(d^2, this)
    vec3 z_axis;          // unit; its surface's normal
    float tile;           // of the shadow atlas
    vec3 emission;
    float curve;          // c / (1 + c), c the cosine of the half cone angle; of a parallel view 1 over its depth
};

layout(std140, binding = VPLS_BINDING) uniform Vpls { Vpl vpls[VPLS_PER_BLOCK]; };

#include "lib/lights/vpl_kernel.glsl"

#ifndef PARALLEL  // 0: no VPL lies at infinity
#define PARALLEL 1
#endif

// The way from a VPL to a surface.
vec3 way_from(Vpl vpl, vec3 position) {
#if PARALLEL
    if (vpl.tan_half == 0.0) return vpl.z_axis;
#endif
    return position - vpl.position;
}

// I(w) = E_i cos(theta_y) inside a round cone, dark outside. From infinity E_i is the irradiance on a plane that faces it.
vec3 vpl_irradiance(Vpl vpl, vec3 position, vec3 normal, vec3 shading_normal) {
    vec3 from = way_from(vpl, position);
    return vpl.emission * vpl_kernel(from, vpl.z_axis, normal, shading_normal, 1.0 - vpl.one_minus_cos, vpl.clamp_squared);
}
