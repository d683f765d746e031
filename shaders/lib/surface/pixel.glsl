// What a pixel of the G-buffer shows. World space.
#include "lib/camera/frame.glsl"
#include "lib/surface/gbuffer.glsl"

struct Pixel {
    vec3 position;
    vec3 normal;  // geometric
    vec3 shading_normal;
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
