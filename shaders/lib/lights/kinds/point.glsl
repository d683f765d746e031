// Irradiance from a point (deferred_ir/scene/lights/point.py) over its intensity; a ball has that of its middle.

float point_strength(DirectLight light, vec3 position, vec3 normal, vec3 shading_normal) {
    vec3 to = light.position - position;
    float square = max(dot(to, to), TINY);
    return receiving(to, normal, shading_normal) * inversesqrt(square) / square;
}
