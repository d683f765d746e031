// glTF's metallic-roughness model: deferred_ir/scene/surfaces/brdf.py says what it is, and computes the same.

struct Gloss {
    vec3 f0;     // reflectance head-on
    float f90;   // at grazing angles
    vec2 taken;  // fractions of diffuse light that a coat takes head-on and at grazing angles
    float alpha; // width of the lobe
};

const float LEAST_COSINE = 1e-4, PI = 3.14159265;

// (1 - |v . h|)^5
float weigh_grazing(float cosine) {
    float off = 1.0 - min(abs(cosine), 1.0), square = off * off;
    return square * square * off;
}

// About the share of light that gloss reflects, by which reflections are divided while they are filtered.
vec3 share_reflectance(Gloss gloss, float cosine) {
    return max(mix(gloss.f0, vec3(gloss.f90), weigh_grazing(cosine)), 0.02);
}

// GGX: the sine by a cross product, since 1 - cos^2 has no digits left in a narrow lobe.
float distribute(float alpha, vec3 normal, vec3 middle) {
    vec3 side = cross(normal, middle);
    float along = alpha * dot(normal, middle), part = dot(side, side) + along * along;
    return alpha * alpha / (PI * part * part);
}

// Smith's separable shadowing of one direction, over twice its cosine.
float shadow(float alpha, float cosine) {
    float square = alpha * alpha;
    return 1.0 / (cosine + sqrt(square + (1.0 - square) * cosine * cosine));
}

// The cosine-weighted mean of what is left of the diffuse part; cosine: of one direction.
float mean_kept(Gloss gloss, float cosine) {
    float x = 0.02816558 + cosine * (-0.07988039 + cosine * (0.08654912 + cosine * (-0.043782 + cosine * 0.00903063)));
    return 1.0 - mix(gloss.taken.x, gloss.taken.y, x);
}

// The glossy part of the BRDF, 1/sr. Vectors are unit. kept: what is left of the diffuse part. alpha: of the lobe, which
// may be wider than the surface's own.
vec3 glossy_brdf(Gloss gloss, float alpha, vec3 normal, vec3 to_viewer, vec3 to_light, out float kept) {
    vec3 middle = to_viewer + to_light;
    middle *= inversesqrt(max(dot(middle, middle), 1e-30));  // 0 where the light lies straight behind
    float x = weigh_grazing(dot(to_viewer, middle)), light = dot(normal, to_light);
    kept = 1.0 - mix(gloss.taken.x, gloss.taken.y, x);
    if (light <= 0.0) return vec3(0.0);
    float viewer = max(abs(dot(normal, to_viewer)), LEAST_COSINE);
    float lobe = distribute(alpha, normal, middle) * shadow(alpha, viewer) * shadow(alpha, max(light, LEAST_COSINE));
    return mix(gloss.f0, vec3(gloss.f90), x) * lobe;
}
