// Radiance from the direct lights and one block of VPLs; further blocks are added by blending.
#include "lib/surface/pixel.glsl"
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

vec3 irradiance_of(Vpl vpl, Pixel p) {
    return vpl_irradiance(vpl, p.position, p.normal, p.shading_normal) * visibility(vpl, p);
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
    vec3 irradiance = vec3(0.0);
#if HAS_DIRECT
#if DIRECT_OVER_EMISSION
    if (first) irradiance = lights[0].emission * texelFetch(direct, pixel, 0).r;
#else
    if (first) irradiance = texelFetch(direct, pixel, 0).rgb;
#endif
#else
    for (int i = 0; i < min(light_count, LIGHTS_PER_BLOCK); ++i)  // of a known bound: a loop of one is none
        irradiance += light_irradiance(lights[i], p.position, p.normal, p.shading_normal) * visibility(lights[i], p);
#endif
#if HAS_INDIRECT  // with the near field in it
#if HAS_BLEND && SCALE > 1
    irradiance += blended(indirect, texelFetch(blend, pixel, 0).r, pixel, offset);
#else
    irradiance += texelFetch(indirect, pixel, 0).rgb;
#endif
#if HAS_LONELY
    irradiance += texelFetch(lonely, pixel, 0).rgb;
#endif
#else
#if HAS_NEAR_FIELD
    if (first) irradiance += texelFetch(near_field, pixel, 0).rgb;
#endif
#if HAS_TILES  // only VPLs that may light the tile, in their order
    ivec2 tile = tile_of(pixel, textureSize(depth, 0));
    for (int first = 0; first < count; first += LIGHT_GROUP) {
        uvec2 lit = texelFetch(tiles, tile_texel(tile, block, first), 0).rg;
        for (; lit.x != 0u; lit.x &= lit.x - 1u) irradiance += irradiance_of(vpls[first + findLSB(lit.x)], p);
        for (; lit.y != 0u; lit.y &= lit.y - 1u) irradiance += irradiance_of(vpls[first + 32 + findLSB(lit.y)], p);
    }
#else
    for (int i = 0; i < count; ++i) irradiance += irradiance_of(vpls[i], p);
#endif
#endif
    radiance = vec4(texelFetch(albedo, pixel, 0).rgb * irradiance * INVERSE_PI, 1.0);
#if HAS_EMISSION
    if (first) radiance.rgb += texelFetch(emission, pixel, 0).rgb;
#endif
}
