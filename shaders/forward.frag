// Radiance from the spotlight, or from LIGHTS_PER_DRAW VPLs or fewer, each with a depth map of its own; blending adds up
// the draws.
#include "lib/surface/surface.glsl"
#include "lib/lights/light.glsl"
#if HAS_SPOT || HAS_VPLS
#include "lib/shadows/single.glsl"
#include "lib/shadows/soft.glsl"
#endif

layout(binding = UNIT_PRIMITIVES) uniform usampler2D primitives;
#if DIRECT && HAS_SPOT
layout(binding = UNIT_MAPS) uniform sampler2DShadow spot;
#if HAS_BLOCKERS && SOFT && DISC
layout(binding = UNIT_BLOCKERS) uniform sampler2D blockers;
#endif
#elif !DIRECT && HAS_VPLS
layout(binding = UNIT_MAPS) uniform sampler2DShadow vpls[LIGHTS_PER_DRAW];
#endif
#if !DIRECT
uniform int numbers[LIGHTS_PER_DRAW];  // of this draw's lights, in this block
uniform int count;
#endif

layout(location = 0) out vec4 radiance;

void main() {
    if (texelFetch(primitives, ivec2(gl_FragCoord.xy), 0).r != uint(face_number() + 1)) discard;
    Surface s = surface();
    vec3 irradiance = vec3(0.0);
#if DIRECT
    irradiance = spot_irradiance(lights[0], s.position, s.normal, s.shading_normal);
#if HAS_SPOT && HAS_BLOCKERS && SOFT && DISC
    irradiance *= spot_visibility(spot, blockers, lights[0], s.position, s.normal);
#elif HAS_SPOT
    irradiance *= spot_visibility(spot, lights[0], s.position, s.normal);
#endif
#else
    for (int i = 0; i < LIGHTS_PER_DRAW; ++i) {
        if (i >= count) break;
        vec3 arriving = vpl_irradiance(lights[numbers[i]], s.position, s.normal, s.shading_normal);
#if HAS_VPLS
        arriving *= vpl_visibility(vpls[i], lights[numbers[i]], s.position, s.normal);
#endif
        irradiance += arriving;
    }
#endif
    radiance = vec4(s.albedo * irradiance * INVERSE_PI, 1.0);
    WRITE_DEPTH(frame.near);
}
