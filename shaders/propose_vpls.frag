// What a group of the pool, a column, would bring to a tile, a row: the root of the sum of squares over a few samples of
// the tile, without shadows and in no unit.
#include "lib/pool/samples.glsl"
#include "lib/lights/vpl_kernel.glsl"

layout(binding = UNIT_GROUPS) uniform sampler2D groups;
layout(binding = UNIT_POSITIONS) uniform sampler2D positions;
layout(binding = UNIT_SAMPLE_NORMALS) uniform sampler2D sample_normals;
uniform ivec2 grid;  // samples
uniform vec2 shift;  // of the probes within their quarters of the tile
uniform float area;  // makes the kernel a number without unit

layout(location = 0) out float score;

void main() {
    int group = int(gl_FragCoord.x), tile = int(gl_FragCoord.y);
    vec4 at = texelFetch(groups, ivec2(group, 0), 0), normal = texelFetch(groups, ivec2(group, 1), 0);
    float sum = 0.0;
    for (int i = 0; i < 4; ++i) {
        vec2 place = (vec2(tile % TILES, tile / TILES) + 0.5 * (vec2(i & 1, i >> 1) + shift)) / float(TILES);
        Sample s = read_sample(positions, sample_normals, min(ivec2(place * vec2(grid)), grid - 1));
        vec3 from = s.position - at.xyz;
        float brings = vpl_kernel(from, normal.xyz, s.normal, s.shading_normal, POOL_EDGE, normal.w) * area;
        brings = s.depth > 0.0 ? min(brings, 1e15) : 0.0;  // its square is a float
        sum += brings * brings;
    }
    score = at.w * sqrt(sum);
}
