// Irradiance from a spotlight (deferred_ir/scene/lights/spotlight.py). lib/lights/direct.glsl, which includes this file,
// declares the record.

// I(w) = E cos(theta) cone(theta), cone = clamp(4 (cos theta - cos(fov/2)) / (1 - cos(fov/2)), 0, 1). Returns
// the irradiance over E.
float spotlight_strength(DirectLight light, vec3 position, vec3 normal, vec3 shading_normal) {
    vec3 to = light.position - position;
    float inverse_square = 1.0 / max(dot(to, to), TINY);
    float inverse = sqrt(inverse_square);
    vec3 off = to * inverse + light.axis;
    float off_axis = 0.5 * dot(off, off);  // 1 - cos theta without cancellation
    // one_minus_cos is above 0, for the cone is open.
    float cone = clamp(4.0 * (light.one_minus_cos - off_axis) / light.one_minus_cos, 0.0, 1.0);
    float cosines = max(1.0 - off_axis, 0.0) * receiving(to, normal, shading_normal) * inverse;
    return cone * cosines * inverse_square;
}
