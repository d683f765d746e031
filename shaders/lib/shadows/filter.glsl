// How much of a light arrives at a receiver, by comparisons of 2x2 texels spread over a disc of the map (Reeves et al.
// 1987). lib/shadows/atlas.glsl or lib/shadows/single.glsl, included before, says how a map is read.
#include "lib/shadows/projection.glsl"

const vec2 GOLDEN = vec2(-0.737368878, 0.675490294);  // cosine and sine of the golden angle, pi (3 - sqrt(5))

// Vogel's disc: points `direction` * spread(i, taps), with the direction turned on from point to point.
vec2 turned(vec2 direction) {
    return mat2(GOLDEN.x, GOLDEN.y, -GOLDEN.y, GOLDEN.x) * direction;
}

float spread(int i, int taps) {
    return sqrt((float(i) + 0.5) / float(taps));
}

// kernel: diameter of the disc, texels; at 1 the hardware's comparison alone.
float filtered(MAP map, View view, Receiver receiver, float kernel, int taps) {
    if (kernel <= 1.0) return compared(map, view.rectangle, view.size, comparison(receiver, view.size));
    float lit = 0.0;
    vec2 direction = vec2(0.5 * (kernel - 1.0), 0.0);
    for (int i = 0; i < taps; ++i) {
        lit += compared(map, view.rectangle, view.size, comparison(receiver, view.size, direction * spread(i, taps)));
        direction = turned(direction);
    }
    return lit / float(taps);
}
