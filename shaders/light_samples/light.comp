#include "lib/compute.glsl"
#include "light_samples/light.glsl"

layout(binding = IMAGE_IRRADIANCE, rgba32f) uniform writeonly image2D irradiance;

void main() {
    ivec2 texel = find_texel();
    if (is_inside(texel)) imageStore(irradiance, texel, light_sample(texel));
}
