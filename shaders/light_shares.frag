// Irradiance from the VPLs `first` to `end` of a block on the pixels or samples of one share, in its sub-buffer.
#include "lib/shares/askers.glsl"
#include "lib/lights/vpl.glsl"
#include "lib/shares/places.glsl"
#if HAS_RAYS
#include "lib/shares/ray_masks.glsl"
#elif HAS_SHADOWS
#include "lib/shadows/atlas.glsl"
#include "lib/shadows/vpl_visibility.glsl"
layout(binding = UNIT_SHADOWS) uniform sampler2DArrayShadow shadows;
#endif
#if HAS_NEAR_FIELD
layout(binding = UNIT_NEAR_FIELD) uniform sampler2D near_field;
#endif

uniform ivec2 share;
uniform bool begins;  // the first of a share's draws, which later ones are added to
uniform int first;
uniform int end;
uniform int before;  // of VPLs of its share before this block; below 0 where the block begins with those of others

layout(location = 0) out vec4 irradiance;

// Of VPL i of the block.
float visibility(int i, Pixel p) {
#if HAS_RAYS
    return ray_visibility(before + i);
#elif HAS_SHADOWS
    return vpl_visibility(shadows, vpls[i], p.position, p.normal);
#else
    return 1.0;
#endif
}

void main() {
    ivec2 place = whole_place(ivec2(gl_FragCoord.xy), share, askers_size());
    Pixel p;
    if (!read_asker(place, p)) {  // background
        irradiance = vec4(0.0);
        return;
    }
    vec3 sum = vec3(0.0);
    for (int i = first; i < end; ++i)
        sum += vpl_irradiance(vpls[i], p.position, p.normal, p.shading_normal) * visibility(i, p);
    sum *= float(INTERLEAVE * INTERLEAVE);
#if HAS_NEAR_FIELD
    if (begins) sum += texelFetch(near_field, place, 0).rgb;  // to be filtered with the rest
#endif
    irradiance = vec4(sum, 0.0);
}
