#include "lib/compute.glsl"
#include "list_vpls/list.glsl"

layout(binding = IMAGE_NUMBERS, r32ui) uniform writeonly uimage2D numbers;
layout(binding = IMAGE_LIST_POSITIONS, rgba32f) uniform writeonly image2D positions;
layout(binding = IMAGE_LIST_NORMALS, rgba32f) uniform writeonly image2D normals;
layout(binding = IMAGE_LIST_EMISSIONS, rgba32f) uniform writeonly image2D emissions;

void main() {
    ivec2 texel = find_texel();
    if (!is_inside(texel)) return;
    Listed drawn = draw_entry(texel.x, texel.y);
    imageStore(numbers, texel, uvec4(drawn.number));
    imageStore(positions, texel, drawn.position);
    imageStore(normals, texel, drawn.normal);
    imageStore(emissions, texel, drawn.emission);
}
