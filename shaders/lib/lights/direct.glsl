// Direct lights (deferred_ir/frame/direct_lights.py): their records, and the irradiance from one without its shadow.
#include "lib/lights/light.glsl"

struct DirectLight {
    vec3 position;
    float one_minus_cos;  // 1 - cos of the half cone angle
    vec3 axis;            // unit; where the light shines
    float radius;         // of its disc
    vec3 emission;
    float view;           // number of its first view in `views`
};

layout(std140, binding = LIGHTS_BINDING) uniform Lights { DirectLight lights[LIGHTS_PER_BLOCK]; };

#include "lib/lights/kinds/spotlight.glsl"

// The only place that tells kinds of lights apart: irradiance over emission.
float light_strength(DirectLight light, vec3 position, vec3 normal, vec3 shading_normal) {
    return spotlight_strength(light, position, normal, shading_normal);
}

vec3 light_irradiance(DirectLight light, vec3 position, vec3 normal, vec3 shading_normal) {
    return light.emission * light_strength(light, position, normal, shading_normal);
}
