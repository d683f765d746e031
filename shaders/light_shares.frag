// Irradiance from VPLs first to end of a block of lights, on the pixels of one share, in its sub-buffer.
#include "lib/camera/frame.glsl"
#include "lib/surface/gbuffer.glsl"
#include "lib/lights/light.glsl"
#include "lib/shadows/visibility.glsl"
#include "lib/shares/places.glsl"
#if HAS_RAYS
#include "lib/shares/ray_masks.glsl"
#define VISIBILITY(i) ray_visibility(before + i)
#else
#define VISIBILITY(i) VPL_VISIBILITY(lights[i])
#endif
#if HAS_NEAR_FIELD
layout(binding = UNIT_NEAR_FIELD) uniform sampler2D near_field;
#endif

layout(binding = UNIT_DEPTH) uniform sampler2D depth;
layout(binding = UNIT_NORMALS) uniform sampler2D normals;
uniform ivec2 share;
uniform bool begins;  // the first of a share's draws, which later ones are added to
uniform int first;
uniform int end;
uniform int before;  // of VPLs of its share before this block; below 0 where the block begins with those of others

layout(location = 0) out vec4 irradiance;  // alpha: the shading normal, for the filter

void main() {
    ivec2 size = textureSize(depth, 0);
    ivec2 pixel = whole_place(ivec2(gl_FragCoord.xy), share, size);
    float d = texelFetch(depth, pixel, 0).r;
    if (d <= 0.0) {  // background
        irradiance = vec4(0.0);
        return;
    }
    vec3 position = unproject((vec2(pixel) + 0.5) / vec2(size) * 2.0 - 1.0, d);
    vec4 code = texelFetch(normals, pixel, 0);
    vec3 shading_normal, normal;
    decode_normals(code, shading_normal, normal);
    vec3 sum = vec3(0.0);
    for (int i = first; i < end; ++i)
        sum += vpl_irradiance(lights[i], position, normal, shading_normal) * VISIBILITY(i);
    sum *= float(INTERLEAVE * INTERLEAVE);
#if HAS_NEAR_FIELD
    if (begins) sum += texelFetch(near_field, pixel, 0).rgb;  // to be filtered with the rest
#endif
    irradiance = vec4(sum, begins ? pack_normal(code.xy) : 0.0);
}
