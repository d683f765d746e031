// How much of a light arrives at a receiver, by comparisons of 2x2 texels spread over a disc of the map (Reeves et al.
// 1987). lib/shadows/atlas.glsl or lib/shadows/single.glsl, included before, says how a map is read.

const vec2 GOLDEN = vec2(-0.737368878, 0.675490294);  // cosine and sine of the golden angle, pi (3 - sqrt(5))

// Vogel's disc: points `direction` * spread(i, taps), with the direction turned on from point to point.
vec2 turned(vec2 direction) {
    return mat2(GOLDEN.x, GOLDEN.y, -GOLDEN.y, GOLDEN.x) * direction;
}

float spread(int i, int taps) {
    return sqrt((float(i) + 0.5) / float(taps));
}

// kernel: diameter of the disc, texels; at 1 the hardware's comparison alone.
float filtered(MAP map, Light light, Receiver receiver, float size, float kernel, int taps) {
    vec4 place = map_place(light);
    if (kernel <= 1.0) return compared(map, place, size, comparison(receiver, size));
    float lit = 0.0;
    vec2 direction = vec2(0.5 * (kernel - 1.0), 0.0);
    for (int i = 0; i < taps; ++i) {
        lit += compared(map, place, size, comparison(receiver, size, direction * spread(i, taps)));
        direction = turned(direction);
    }
    return lit / float(taps);
}

float vpl_visibility(MAP map, Light light, vec3 position, vec3 normal) {
    Receiver receiver = VPL_RECEIVER(light, position, normal, VPL_SIZE, VPL_OFFSET);
    return filtered(map, light, receiver, VPL_SIZE, VPL_KERNEL, VPL_TAPS);
}

float spot_visibility(MAP map, Light light, vec3 position, vec3 normal) {
    Receiver receiver = SPOT_RECEIVER(light, position, normal, SPOT_SIZE, SPOT_OFFSET);
    return filtered(map, light, receiver, SPOT_SIZE, SPOT_KERNEL, SPOT_TAPS);
}
