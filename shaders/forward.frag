// Radiance from the spotlight, or from LIGHTS_PER_DRAW VPLs or fewer, each with a depth map of its own; blending adds up
// the draws.
#include "lib/surface.glsl"
#include "lib/light.glsl"
#if HAS_SPOT || HAS_VPLS
#include "lib/shadow.glsl"
#endif

layout(binding = UNIT_PRIMITIVES) uniform usampler2D primitives;
#if SPOT && HAS_SPOT
layout(binding = UNIT_MAPS) uniform sampler2DShadow spot;
#elif !SPOT && HAS_VPLS
layout(binding = UNIT_MAPS) uniform sampler2DShadow vpls[LIGHTS_PER_DRAW];
#endif
#if !SPOT
uniform int first;  // of this draw, in this block
uniform int count;  // lights of this draw
#endif

layout(location = 0) out vec4 radiance;

#if HAS_SPOT || HAS_VPLS
float visibility(sampler2DShadow map, Receiver receiver, float size) {
    vec3 at = comparison(receiver, size);
    return texture(map, vec3(at.xy / size, at.z));
}
#endif

void main() {
    if (texelFetch(primitives, ivec2(gl_FragCoord.xy), 0).r != uint(face_number() + 1)) discard;
    Surface s = surface();
    vec3 irradiance = vec3(0.0);
#if SPOT
    irradiance = spot_irradiance(lights[0], s.position, s.normal, s.shading_normal);
#if HAS_SPOT
    irradiance *= visibility(spot, SPOT_RECEIVER(lights[0], s.position, s.normal, SPOT_SIZE, SPOT_OFFSET), SPOT_SIZE);
#endif
#else
    for (int i = 0; i < LIGHTS_PER_DRAW; ++i) {
        if (i >= count) break;
        vec3 arriving = vpl_irradiance(lights[first + i], s.position, s.normal, s.shading_normal);
#if HAS_VPLS
        arriving *= visibility(vpls[i], VPL_RECEIVER(lights[first + i], s.position, s.normal, VPL_SIZE, VPL_OFFSET), VPL_SIZE);
#endif
        irradiance += arriving;
    }
#endif
    radiance = vec4(s.albedo * irradiance * INVERSE_PI, 1.0);
    WRITE_DEPTH(frame.near);
}
