// What a pixel of the G-buffer shows. World space.
#include "lib/camera/frame.glsl"
#include "lib/surface/gbuffer.glsl"

#ifndef GLOSSY
#define GLOSSY 0
#endif
#if GLOSSY
#include "lib/surface/material.glsl"
#endif

struct Pixel {
    vec3 position;
    vec3 normal;  // geometric
    vec3 shading_normal;
#if GLOSSY
    vec3 to_viewer;
    Gloss gloss;
#endif
};

// NDC of a pixel's centre in a frame of `size` pixels.
vec2 centre_ndc(ivec2 pixel, ivec2 size) {
    return (vec2(pixel) + 0.5) / vec2(size) * 2.0 - 1.0;
}

// The surface in `pixel`, whose centre lies at `ndc` and whose reversed depth is above 0.
Pixel read_pixel(sampler2D normals, ivec2 pixel, vec2 ndc, float depth) {
    Pixel p;
    p.position = unproject(ndc, depth);
    decode_normals(texelFetch(normals, pixel, 0), p.shading_normal, p.normal);
    return p;
}

#if GLOSSY
// Takes a pixel's gloss from the G-buffer's material and base colour, and leaves the albedo of the latter.
void read_gloss(inout Pixel p, vec4 code, inout vec3 color) {
    p.to_viewer = normalize(frame.camera - p.position);
    vec3 base_color = color;
    p.gloss = make_gloss(material_number(code), base_color, code.g, code.r, color);
}
#endif
