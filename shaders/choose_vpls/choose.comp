#include "lib/compute.glsl"
#include "choose_vpls/choose.glsl"

layout(binding = IMAGE_CHOICES, rgba32ui) uniform writeonly uimage2DArray choices;
layout(binding = IMAGE_WEIGHTS, rgba32f) uniform writeonly image2DArray weights;

void main() {
    ivec2 texel = find_texel();
    if (!is_inside(texel)) return;
    Choices chosen = choose_vpls(texel);
    for (int layer = 0; layer < CHOICE_LAYERS; ++layer) {
        imageStore(choices, ivec3(texel, layer), chosen.places[layer]);
        imageStore(weights, ivec3(texel, layer), chosen.weights[layer]);
    }
}
