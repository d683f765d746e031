// What four groups of the pool, a column, would bring to a tile, a row: for each the root of the sum of squares over a few samples of
// the tile, without shadows and in no unit. A few samples miss what lies close to others, so the group's distance alone
// counts as well: without it, VPLs that are near and rarely drawn give bright spots.
#include "lib/pool/samples.glsl"
#include "lib/lights/vpl_kernel.glsl"

layout(binding = UNIT_GROUPS) uniform sampler2D groups;
layout(binding = UNIT_POSITIONS) uniform sampler2D positions;
layout(binding = UNIT_SAMPLE_NORMALS) uniform sampler2D sample_normals;
uniform ivec2 grid;  // samples
uniform vec2 shift;  // of the probes within their quarters of the tile
uniform float area;  // makes the kernel a number without unit

layout(location = 0) out vec4 scores;

const float AROUND = 0.05;  // part of what distance alone would bring

float score(int group, Sample probes[4], float extent) {
    vec4 at = texelFetch(groups, ivec2(group, 0), 0), normal = texelFetch(groups, ivec2(group, 1), 0);
    float sum = 0.0, around = 0.0;
    for (int i = 0; i < 4; ++i) {
        Sample s = probes[i];
        vec3 from = way_from(at.xyz, normal.xyz, s.position, normal.w);
        float brings = vpl_kernel(from, normal.xyz, s.normal, s.shading_normal, POOL_EDGE, normal.w) * area;
        float near = area / max(dot(from, from), max(0.25 * extent, max(normal.w, TINY)));
        brings = s.depth > 0.0 ? min(brings, 1e15) : 0.0;  // its square is a float
        near = s.depth > 0.0 ? min(near, 1e15) : 0.0;
        sum += brings * brings;
        around += near * near;
    }
    return at.w * (sqrt(sum) + AROUND * sqrt(around));
}

void main() {
    int column = int(gl_FragCoord.x), tile = int(gl_FragCoord.y);
    Sample probes[4];
    float extent = 0.0;  // of the tile, squared
    for (int i = 0; i < 4; ++i) {
        vec2 place = (vec2(tile % TILES, tile / TILES) + 0.5 * (vec2(i & 1, i >> 1) + shift)) / float(TILES);
        probes[i] = read_sample(positions, sample_normals, min(ivec2(place * vec2(grid)), grid - 1));
        vec3 apart = probes[i].position - probes[0].position;
        if (probes[i].depth > 0.0 && probes[0].depth > 0.0) extent = max(extent, dot(apart, apart));
    }
    for (int i = 0; i < 4; ++i) scores[i] = score(4 * column + i, probes, extent);
}
