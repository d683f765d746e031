// Irradiance from a punctual spot (deferred_ir/scene/lights/spot.py) over its intensity along the axis.

float spot_strength(DirectLight light, vec3 position, vec3 normal, vec3 shading_normal) {
    vec3 to = light.position - position;
    float square = max(dot(to, to), TINY), inverse = inversesqrt(square);
    vec3 off = to * inverse + light.axis;
    // 1 - cos theta without cancellation.
    float edge = clamp((light.one_minus_cos - 0.5 * dot(off, off)) / light.soft_edge, 0.0, 1.0);
    return edge * edge * receiving(to, normal, shading_normal) * inverse / square;
}
