// One triangle that covers the target, and the exposure, which is the same for all of it.
#include "lib/colour.glsl"

layout(binding = UNIT_RADIANCE) uniform sampler2D radiance;
#ifndef AUTOMATIC
uniform bool automatic;
#define AUTOMATIC automatic
#endif
uniform float scale;
flat out float exposure;

const int GRID = 64;          // samples a side, spread over the image
const float MIDDLE_GREY = 0.18;

// Middle grey over the mean luminance of what is lit.
float automatic_exposure() {
    ivec2 size = textureSize(radiance, 0);
    ivec2 grid = min(size, ivec2(GRID));
    float sum = 0.0, lit = 0.0;
    for (int y = 0; y < grid.y; ++y)
        for (int x = 0; x < grid.x; ++x) {
            vec3 c = texelFetch(radiance, (ivec2(x, y) * 2 + 1) * size / (2 * grid), 0).rgb;
            float bright = luminance(c);
            sum += bright;
            lit += float(bright > 0.0);
        }
    // With next to no light the quotient overflows, and infinity times 0 is NaN; with none any exposure will do.
    return sum > 0.0 ? min(MIDDLE_GREY * lit / sum, 1e37) : 1.0;
}

void main() {
    if (bool(AUTOMATIC)) exposure = automatic_exposure();
    else exposure = scale;
    gl_Position = vec4((gl_VertexID & 1) * 4 - 1, (gl_VertexID & 2) * 2 - 1, 0.0, 1.0);
}
