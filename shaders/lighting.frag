// Radiance from the direct lights and one block of VPLs; further blocks are added by blending.
#include "lib/surface/reflected.glsl"
#include "lib/lights/direct.glsl"
#include "lib/lights/vpl.glsl"
#if HAS_SHADOWS
#include "lib/shadows/atlas.glsl"
#include "lib/shadows/light_visibility.glsl"
#include "lib/shadows/vpl_visibility.glsl"
layout(binding = UNIT_SHADOWS) uniform sampler2DArrayShadow shadows;
#if HAS_BLOCKERS && SOFT && DISC
layout(binding = UNIT_BLOCKERS) uniform sampler2DArray blockers;
#endif
#endif

#if HAS_TILES
#include "lib/lights/tiles.glsl"
layout(binding = UNIT_TILES) uniform usampler2D tiles;
uniform int block;  // number of the bound block of VPLs
#endif

layout(binding = UNIT_DEPTH) uniform sampler2D depth;
layout(binding = UNIT_NORMALS) uniform sampler2D normals;
layout(binding = UNIT_ALBEDO) uniform sampler2D albedo;
#if HAS_MATERIAL
layout(binding = UNIT_MATERIAL) uniform sampler2D material;
#endif
#if HAS_REFLECTIONS
layout(binding = UNIT_REFLECTIONS) uniform sampler2D reflections;
#endif
#if HAS_EMISSION
layout(binding = UNIT_EMISSION) uniform sampler2D emission;
#endif
#if HAS_ENVIRONMENT
#include "lib/lights/environment.glsl"
layout(binding = UNIT_ENVIRONMENT) uniform sampler2D environment;
#endif
#if HAS_DIRECT
layout(binding = UNIT_DIRECT) uniform sampler2D direct;
#endif
#if HAS_INDIRECT
layout(binding = UNIT_INDIRECT) uniform sampler2D indirect;
#if HAS_BLEND  // of samples
#include "lib/pool/blend.glsl"
layout(binding = UNIT_BLEND) uniform usampler2D blend;
uniform ivec2 offset;
#endif
#if HAS_LONELY
layout(binding = UNIT_LONELY) uniform sampler2D lonely;
#endif
#elif HAS_NEAR_FIELD
layout(binding = UNIT_NEAR_FIELD) uniform sampler2D near_field;
#endif
uniform bool first;       // draw of a pixel
uniform int light_count;  // of the block
uniform int count;        // VPLs of the block, where they are not in `indirect` already
#if GLOSSY
uniform float vpl_spread;  // see reflect_light
#endif

in vec2 ndc;
layout(location = 0) out vec4 radiance;

float visibility(DirectLight light, Pixel p) {
#if !HAS_SHADOWS
    return 1.0;
#elif HAS_BLOCKERS && SOFT && DISC
    return light_visibility(shadows, blockers, light, p.position, p.normal);
#else
    return light_visibility(shadows, light, p.position, p.normal);
#endif
}

float visibility(Vpl vpl, Pixel p) {
#if HAS_SHADOWS
    return vpl_visibility(shadows, vpl, p.position, p.normal);
#else
    return 1.0;
#endif
}

void add_vpl(inout Reflected r, Vpl vpl, Pixel p) {
    vec3 arriving = vpl_irradiance(vpl, p.position, p.normal, p.shading_normal) * visibility(vpl, p);
#if GLOSSY
    reflect_light(r, p, arriving, -way_from(vpl, p.position), vpl_spread);
#else
    r.irradiance += arriving;
#endif
}

void add_light(inout Reflected r, DirectLight light, vec3 arriving, Pixel p) {
#if GLOSSY
    vec3 to = way_to(light, p.position);
    reflect_light(r, p, arriving, to, light_spread(light, to));
#else
    r.irradiance += arriving;
#endif
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float d = texelFetch(depth, pixel, 0).r;
    if (d <= 0.0) {  // background
        radiance = vec4(0.0);
#if HAS_ENVIRONMENT
        vec3 ray = frame.ray[0].xyz * ndc.x + frame.ray[1].xyz * ndc.y + frame.ray[2].xyz;
        if (first) radiance.rgb = environment_radiance(environment, ray);
#endif
        return;
    }
    Pixel p = read_pixel(normals, pixel, ndc, d);
    vec3 color = texelFetch(albedo, pixel, 0).rgb;
    Reflected r = nothing_reflected();
#if GLOSSY
    read_gloss(p, texelFetch(material, pixel, 0), color);
#endif
#if HAS_DIRECT
#if DIRECT_OVER_EMISSION
    if (first) add_light(r, lights[0], lights[0].emission * texelFetch(direct, pixel, 0).r, p);
#else
    if (first) reflect_irradiance(r, p, texelFetch(direct, pixel, 0).rgb);
#endif
#else
    for (int i = 0; i < min(light_count, LIGHTS_PER_BLOCK); ++i)  // of a known bound: a loop of one is none
        add_light(r, lights[i],
                  light_irradiance(lights[i], p.position, p.normal, p.shading_normal) * visibility(lights[i], p), p);
#endif
#if HAS_INDIRECT  // with the near field in it
#if HAS_BLEND && SCALE > 1
    reflect_irradiance(r, p, blended(indirect, texelFetch(blend, pixel, 0).r, pixel, offset));
#else
    reflect_irradiance(r, p, texelFetch(indirect, pixel, 0).rgb);
#endif
#if HAS_LONELY
    reflect_irradiance(r, p, texelFetch(lonely, pixel, 0).rgb);
#endif
#else
#if HAS_NEAR_FIELD
    if (first) reflect_irradiance(r, p, texelFetch(near_field, pixel, 0).rgb);
#endif
#if HAS_TILES  // only VPLs that may light the tile, in their order
    ivec2 tile = tile_of(pixel, textureSize(depth, 0));
    for (int first = 0; first < count; first += LIGHT_GROUP) {
        uvec2 lit = texelFetch(tiles, tile_texel(tile, block, first), 0).rg;
        for (; lit.x != 0u; lit.x &= lit.x - 1u) add_vpl(r, vpls[first + findLSB(lit.x)], p);
        for (; lit.y != 0u; lit.y &= lit.y - 1u) add_vpl(r, vpls[first + 32 + findLSB(lit.y)], p);
    }
#else
    for (int i = 0; i < count; ++i) add_vpl(r, vpls[i], p);
#endif
#endif
#if GLOSSY && HAS_REFLECTIONS
    vec3 share = share_reflectance(p.gloss, dot(p.shading_normal, p.to_viewer));
    if (first) r.glossy += texelFetch(reflections, pixel, 0).rgb * share;
#endif
    radiance = vec4(reflected_radiance(r, color), 1.0);
#if HAS_EMISSION
    if (first) radiance.rgb += texelFetch(emission, pixel, 0).rgb;
#endif
}
