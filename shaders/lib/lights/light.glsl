// The light model (deferred_ir/scene/lights/spot.py, docs/conventions.md): irradiance on a surface from the spotlight or a VPL,
// without shadows. World space.

struct Light {
    vec3 position;
    float one_minus_cos;  // 1 - cos of the half cone angle
    vec3 x_axis;          // of the light's map, divided by tan_half
    float tan_half;
    vec3 y_axis;
    float clamp_squared;  // VPLs: 1/d^2 is taken as 1/max(d^2, this); the spotlight: see disc_radius
    vec3 z_axis;          // unit; where the light looks
    float tile;           // its tile in the atlas; below 0: a whole layer
    vec3 emission;
    float curve;          // c / (1 + c), c the cosine of the half cone angle: scales paraboloid maps
};

// One block of the light buffer. The first block's light 0 is the spotlight.
layout(std140, binding = 1) uniform Lights { Light lights[LIGHTS_PER_BLOCK]; };

float disc_radius(Light spotlight) {
    return spotlight.clamp_squared;
}

#ifndef CLAMPED  // 0: no VPL's clamp_squared is above 0
#define CLAMPED 1
#endif

const float INVERSE_PI = 0.318309886;
const float TINY = 1e-37;  // keeps a squared distance off 0, where position and light coincide and the cosines are 0

// Cosine at the surface towards `to` over |to|; 0 where the light lies behind its face or its shading normal.
float receiving(vec3 to, vec3 normal, vec3 shading_normal) {
    return dot(normal, to) > 0.0 ? max(dot(shading_normal, to), 0.0) : 0.0;
}

// I(w) = E cos(theta) cone(theta), cone = clamp(4 (cos theta - cos(fov/2)) / (1 - cos(fov/2)), 0, 1).
vec3 spot_irradiance(Light light, vec3 position, vec3 normal, vec3 shading_normal) {
    vec3 to = light.position - position;
    float inverse_square = 1.0 / max(dot(to, to), TINY);
    float inverse = sqrt(inverse_square);
    vec3 off = to * inverse + light.z_axis;
    float off_axis = 0.5 * dot(off, off);  // 1 - cos theta without cancellation
    // one_minus_cos is above 0, for the cone is open.
    float cone = clamp(4.0 * (light.one_minus_cos - off_axis) / light.one_minus_cos, 0.0, 1.0);
    float cosines = max(1.0 - off_axis, 0.0) * receiving(to, normal, shading_normal) * inverse;
    return light.emission * (cone * cosines * inverse_square);
}

// I(w) = E_i cos(theta_y) inside a round cone, dark outside. No root: this is the innermost loop.
vec3 vpl_irradiance(Light light, vec3 position, vec3 normal, vec3 shading_normal) {
    vec3 from = position - light.position;
    float square = dot(from, from);
    float leaving = max(dot(light.z_axis, from), 0.0), edge = 1.0 - light.one_minus_cos;
    float inside = step(edge * edge * square, leaving * leaving);
    float cosines = leaving * receiving(-from, normal, shading_normal);
#if CLAMPED
    float held = max(square, light.clamp_squared);
#else
    float held = square;
#endif
    // The cosines bring a distance each. Two divisions: the fourth power of a small distance would vanish.
    return light.emission * (inside * cosines / max(square, TINY) / max(held, TINY));
}
