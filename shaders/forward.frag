// Radiance from one direct light, or from LIGHTS_PER_DRAW VPLs or fewer, each with a depth map of its own; blending adds
// up the draws.
#include "lib/surface/surface.glsl"
#include "lib/surface/reflected.glsl"
#include "lib/lights/direct.glsl"
#include "lib/lights/vpl.glsl"
#if HAS_LIGHT_MAPS && HAS_VPL_MAPS
#include "lib/shadows/single.glsl"
#include "lib/shadows/light_visibility.glsl"
#include "lib/shadows/vpl_visibility.glsl"
#endif

layout(binding = UNIT_PRIMITIVES) uniform usampler2D primitives;
#if DIRECT && HAS_LIGHT_MAPS
layout(binding = UNIT_MAPS) uniform sampler2DShadow light_maps;
#if HAS_BLOCKERS && SOFT && DISC
layout(binding = UNIT_BLOCKERS) uniform sampler2D blockers;
#endif
#elif !DIRECT && HAS_VPL_MAPS
layout(binding = UNIT_MAPS) uniform sampler2DShadow vpl_maps[LIGHTS_PER_DRAW];
#endif
#if DIRECT
uniform int number;       // of the light in its block
uniform int view_number;  // of the bound map's view, which adds its light where it looks
#else
#if GLOSSY
uniform float vpl_spread;  // see reflect_light
#endif
uniform int numbers[LIGHTS_PER_DRAW];  // of this draw's VPLs, in this block
uniform int count;
#endif

layout(location = 0) out vec4 radiance;

#if !DIRECT
// Adds VPL `i` of the draw, and its shadow by its own map.
#if HAS_VPL_MAPS
#define VISIBILITY(i) vpl_visibility(vpl_maps[i], vpls[numbers[i]], p.position, p.normal)
#else
#define VISIBILITY(i) 1.0
#endif
#define ADD_VPL(i) if (i < count) add_vpl(r, p, vpls[numbers[i]], VISIBILITY(i));

void add_vpl(inout Reflected r, Pixel p, Vpl vpl, float visibility) {
    vec3 arriving = vpl_irradiance(vpl, p.position, p.normal, p.shading_normal) * visibility;
#if GLOSSY
    reflect_light(r, p, arriving, -way_from(vpl, p.position), vpl_spread);
#else
    r.irradiance += arriving;
#endif
}
#endif

void main() {
    if (texelFetch(primitives, ivec2(gl_FragCoord.xy), 0).r != uint(face_number() + 1)) discard;
    Surface s = surface();
    Pixel p;
    p.position = s.position;
    p.normal = s.normal;
    p.shading_normal = s.shading_normal;
    vec3 color = s.albedo;
#if GLOSSY
    p.to_viewer = normalize(frame.camera - s.position);
    p.gloss = make_gloss(s.material, s.albedo, s.metallic, s.roughness, color);
#endif
    Reflected r = nothing_reflected();
#if DIRECT
#if HAS_LIGHT_MAPS
    if (choose_view(lights[number], s.position) != view_number) discard;
#endif
    vec3 arriving = light_irradiance(lights[number], s.position, s.normal, s.shading_normal);
#if HAS_LIGHT_MAPS && HAS_BLOCKERS && SOFT && DISC
    arriving *= light_visibility(light_maps, blockers, lights[number], s.position, s.normal);
#elif HAS_LIGHT_MAPS
    arriving *= light_visibility(light_maps, lights[number], s.position, s.normal);
#endif
#if GLOSSY
    vec3 to = way_to(lights[number], s.position);
    reflect_light(r, p, arriving, to, light_spread(lights[number], to));
#else
    r.irradiance = arriving;
#endif
#else
    // One by one: a map by a number that is no constant makes llvmpipe (Mesa 22.3) take an array texture for one, and crash.
    ADD_VPL(0)
#if LIGHTS_PER_DRAW > 1
    ADD_VPL(1)
#endif
#if LIGHTS_PER_DRAW > 2
    ADD_VPL(2)
#endif
#if LIGHTS_PER_DRAW > 3
    ADD_VPL(3)
#endif
#if LIGHTS_PER_DRAW > 4
    ADD_VPL(4)
#endif
#if LIGHTS_PER_DRAW > 5
    ADD_VPL(5)
#endif
#if LIGHTS_PER_DRAW > 6
    ADD_VPL(6)
#endif
#if LIGHTS_PER_DRAW > 7
    ADD_VPL(7)
#endif
#endif
    radiance = vec4(reflected_radiance(r, color), 1.0);
    WRITE_DEPTH(frame.near);
}
