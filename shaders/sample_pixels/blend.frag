// What a pixel takes of the four samples of the grid around it: seven bits each; 0 for the background. A pixel that lies on
// none of their surfaces is LONELY.
#include "lib/camera/frame.glsl"
#include "lib/surface/pixel.glsl"
#include "lib/pool/blend.glsl"

layout(binding = UNIT_DEPTH) uniform sampler2D depth;
layout(binding = UNIT_NORMALS) uniform sampler2D normals;
uniform ivec2 offset;
uniform float cosine;  // of the largest angle between normals
uniform float slack;   // how far a sample may lie off the pixel's plane, in pixels of the grid

layout(location = 0) out uvec4 blend;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), size = textureSize(depth, 0);
    float d = texelFetch(depth, pixel, 0).r;
    blend = uvec4(0u);
    if (d <= 0.0) return;
    Pixel p = read_pixel(normals, pixel, centre_ndc(pixel, size), d);
    float off = slack * float(SCALE) * frame.near / d * 2.0 * length(frame.ray[1].xyz) / float(size.y);
    Corner corner = find_corner(pixel, offset, size);
    bool found = false;
    for (int i = 0; i < 4; ++i) {
        ivec2 other = grid_pixel(corner_place(corner, i), offset, size);
        float e = texelFetch(depth, other, 0).r;
        vec3 way = unproject(centre_ndc(other, size), max(e, d * 1e-3)) - p.position, shading, geometric;
        decode_normals(texelFetch(normals, other, 0), shading, geometric);
        bool like = abs(dot(way, p.normal)) <= off && dot(shading, p.shading_normal) >= cosine;
        bool same = other == pixel || (e > 0.0 && like);  // a rounded normal's cosine to itself may be below 1
        found = found || same;
        uint share = uint(corner_weight(corner, i) * 126.0 + 1.5);  // a little even of what lies farthest
        blend.r |= same ? share << (7 * i) : 0u;
    }
    if (!found) blend.r = LONELY;
}
