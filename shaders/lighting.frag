// Radiance from the spotlight and one block of lights; further blocks are added by blending.
#include "lib/camera/frame.glsl"
#include "lib/surface/gbuffer.glsl"
#include "lib/lights/light.glsl"
#include "lib/shadows/visibility.glsl"

layout(binding = UNIT_DEPTH) uniform sampler2D depth;
layout(binding = UNIT_NORMALS) uniform sampler2D normals;
layout(binding = UNIT_ALBEDO) uniform sampler2D albedo;
#if HAS_SPOTLIGHT
layout(binding = UNIT_SPOTLIGHT) uniform sampler2D spotlight;
#endif
#if HAS_INDIRECT
layout(binding = UNIT_INDIRECT) uniform sampler2D indirect;
#if HAS_THIN
layout(binding = UNIT_THIN) uniform sampler2D thin;
#endif
#elif HAS_NEAR_FIELD
layout(binding = UNIT_NEAR_FIELD) uniform sampler2D near_field;
#endif
uniform int first;  // light of this block to start with; 1 where light 0 is the spotlight
uniform int count;  // lights of this block, where they are not in `indirect` already

in vec2 ndc;
layout(location = 0) out vec4 radiance;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float d = texelFetch(depth, pixel, 0).r;
    if (d <= 0.0) {  // background
        radiance = vec4(0.0);
        return;
    }
    vec3 position = unproject(ndc, d);
    vec4 code = texelFetch(normals, pixel, 0);
    vec3 shading_normal, normal;
    decode_normals(code, shading_normal, normal);
    vec3 irradiance = vec3(0.0);
#if HAS_SPOTLIGHT
    if (first == 1) irradiance = lights[0].emission * texelFetch(spotlight, pixel, 0).r;
#else
    if (first == 1)
        irradiance = spot_irradiance(lights[0], position, normal, shading_normal)
                   * SPOT_VISIBILITY(lights[0]);
#endif
#if HAS_INDIRECT  // with the near field in it
    irradiance += texelFetch(indirect, pixel, 0).rgb;
#if HAS_THIN
    irradiance += texelFetch(thin, pixel, 0).rgb;
#endif
#else
#if HAS_NEAR_FIELD
    if (first == 1) irradiance += texelFetch(near_field, pixel, 0).rgb;
#endif
    for (int i = first; i < count; ++i)
        irradiance += vpl_irradiance(lights[i], position, normal, shading_normal)
                    * VPL_VISIBILITY(lights[i]);
#endif
    radiance = vec4(texelFetch(albedo, pixel, 0).rgb * irradiance * INVERSE_PI, 1.0);
}
