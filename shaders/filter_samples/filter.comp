#include "lib/compute.glsl"
#include "filter_samples/filter.glsl"

layout(binding = IMAGE_FILTERED, rgba32f) uniform writeonly image2D filtered;  // either of the pass's textures

void main() {
    ivec2 texel = find_texel();
    if (is_inside(texel)) imageStore(filtered, texel, filter_sample(texel));
}
