// Who asks for light by shares, and where their surfaces are: the pixels of the frame or, where a pass has an input
// `positions`, samples (deferred_ir/pool/layout.py). Samples of the grid ask as the pixels of a small frame do; those of
// the list have no neighbours.
#include "lib/surface/pixel.glsl"

layout(binding = UNIT_NORMALS) uniform sampler2D normals;
#if HAS_POSITIONS
layout(binding = UNIT_POSITIONS) uniform sampler2D positions;
uniform ivec2 grid;  // samples across and up
#else
layout(binding = UNIT_DEPTH) uniform sampler2D depth;
#endif

// Of the image in which shares alternate.
ivec2 askers_size() {
#if HAS_POSITIONS
    return grid;
#else
    return textureSize(depth, 0);
#endif
}

// Returns whether anybody asks at `place`, and for which surface.
bool read_asker(ivec2 place, out Pixel p) {
#if HAS_POSITIONS
    vec4 at = texelFetch(positions, place, 0);
    p.position = at.xyz;
    decode_normals(texelFetch(normals, place, 0), p.shading_normal, p.normal);
    return at.w > 0.0;
#else
    ivec2 size = textureSize(depth, 0);
    float d = texelFetch(depth, place, 0).r;
    if (d > 0.0) p = read_pixel(normals, place, centre_ndc(place, size), d);
    return d > 0.0;
#endif
}
