// Direct lights (deferred_ir/frame/direct_lights.py): their records, a block at a time, and the irradiance from one without
// its shadow.
#include "lib/lights/light.glsl"

struct DirectLight {
    vec3 position;
    float one_minus_cos;  // 1 - cos of the half cone angle
    vec3 axis;            // unit; where the light shines
    float radius;         // of its disc or ball; of one at infinity the tangent of half its angle
    vec3 emission;
    float view;           // number of its first view in `views`
    float kind;           // of LIGHT_KINDS
    float view_count;
    float soft_edge;      // 1 - cos over which a spot's edge falls
    float unused;
};

layout(std140, binding = LIGHTS_BINDING) uniform Lights { DirectLight lights[LIGHTS_PER_BLOCK]; };

#ifdef LIGHT_KINDS  // not where only views matter
// For each kind, a file: NAME_strength, the irradiance over emission.
#include "lib/lights/kinds/"

// STRENGTH_0 and so on are those functions of the kinds that the scene has, eight at most.
float light_strength(DirectLight light, vec3 position, vec3 normal, vec3 shading_normal) {
#if LIGHT_KINDS > 1
    if (light.kind == 1.0) return STRENGTH_1(light, position, normal, shading_normal);
#endif
#if LIGHT_KINDS > 2
    if (light.kind == 2.0) return STRENGTH_2(light, position, normal, shading_normal);
#endif
#if LIGHT_KINDS > 3
    if (light.kind == 3.0) return STRENGTH_3(light, position, normal, shading_normal);
#endif
#if LIGHT_KINDS > 4
    if (light.kind == 4.0) return STRENGTH_4(light, position, normal, shading_normal);
#endif
#if LIGHT_KINDS > 5
    if (light.kind == 5.0) return STRENGTH_5(light, position, normal, shading_normal);
#endif
#if LIGHT_KINDS > 6
    if (light.kind == 6.0) return STRENGTH_6(light, position, normal, shading_normal);
#endif
#if LIGHT_KINDS > 7
    if (light.kind == 7.0) return STRENGTH_7(light, position, normal, shading_normal);
#endif
    return STRENGTH_0(light, position, normal, shading_normal);
}

// The way to a light, or against its light if it lies at infinity: without a cone, but with an axis.
vec3 way_to(DirectLight light, vec3 position) {
    return light.one_minus_cos == 0.0 && light.axis != vec3(0.0) ? -light.axis : light.position - position;
}

// Of a light with an area: the square of half the angle of its radius.
float light_spread(DirectLight light, vec3 to) {
    return 0.25 * light.radius * light.radius / max(dot(to, to), TINY);
}

vec3 light_irradiance(DirectLight light, vec3 position, vec3 normal, vec3 shading_normal) {
    return light.emission * light_strength(light, position, normal, shading_normal);
}
#endif
