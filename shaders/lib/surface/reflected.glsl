// What a pixel reflects of light, light by light.
#include "lib/surface/pixel.glsl"
#include "lib/lights/light.glsl"

struct Reflected {
    vec3 irradiance;  // of the diffuse part
#if GLOSSY
    vec3 glossy;  // radiance
#endif
};

Reflected nothing_reflected() {
    Reflected r;
    r.irradiance = vec3(0.0);
#if GLOSSY
    r.glossy = vec3(0.0);
#endif
    return r;
}

// Adds light that arrives, as irradiance on the pixel, from `to`, of any length. Nothing is skipped where it is dark: zink
// (Mesa 22.3) crashes on a return here, inside a loop. spread: added to the square of the lobe's
// width, for a point that stands for a source with an area.
void reflect_light(inout Reflected r, Pixel p, vec3 arriving, vec3 to, float spread) {
#if GLOSSY
    float kept, alpha = min(sqrt(p.gloss.alpha * p.gloss.alpha + spread), 1.0);
    vec3 direction = to * inversesqrt(max(dot(to, to), TINY));
    r.glossy += arriving * glossy_brdf(p.gloss, alpha, p.shading_normal, p.to_viewer, direction, kept);
    r.irradiance += arriving * kept;
#else
    r.irradiance += arriving;
#endif
}

// Adds irradiance from all around of which no direction is known.
void reflect_irradiance(inout Reflected r, Pixel p, vec3 irradiance) {
#if GLOSSY
    irradiance *= mean_kept(p.gloss, max(dot(p.shading_normal, p.to_viewer), 0.0));
#endif
    r.irradiance += irradiance;
}

vec3 reflected_radiance(Reflected r, vec3 albedo) {
    vec3 radiance = albedo * r.irradiance * INVERSE_PI;
#if GLOSSY
    radiance += r.glossy;
#endif
    return radiance;
}
