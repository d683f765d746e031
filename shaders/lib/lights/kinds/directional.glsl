// Irradiance from infinity (deferred_ir/scene/lights/directional.py) over that of a plane that faces the light.

float directional_strength(DirectLight light, vec3 position, vec3 normal, vec3 shading_normal) {
    return receiving(-light.axis, normal, shading_normal);
}
