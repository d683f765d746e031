// Which parts of surfaces are there: alpha is compared with the threshold of the material. Texels are read and filtered
// here, and not by the hardware, so that maps, the camera and rays (SurfacePoints.look_up_coverage) agree.

struct Coverage {
    float alpha;   // factor on the image
    float cutoff;  // below 0: nothing is cut
    float first;   // of the image's texels, in fours; below 0: no image
    float nearest;
    vec2 size;
    vec2 wrap;  // 0: repeat, 1: mirror, 2: clamp
};

layout(std430, binding = 6) readonly buffer Coverages { Coverage coverages[]; };
layout(std430, binding = 7) readonly buffer CoverageTexels { uint coverage_texels[]; };  // rows from the top, four a word

int wrapped(int i, int size, float wrap) {
    if (wrap == 2.0) return clamp(i, 0, size - 1);
    int period = wrap == 1.0 ? 2 * size : size, within = i % period;
    within += within < 0 ? period : 0;
    return within < size ? within : period - 1 - within;
}

float coverage_texel(Coverage c, ivec2 place) {
    ivec2 size = ivec2(c.size);
    int i = wrapped(place.y, size.y, c.wrap.y) * size.x + wrapped(place.x, size.x, c.wrap.x);
    return float(coverage_texels[int(c.first) + (i >> 2)] >> (8 * (i & 3)) & 255u) / 255.0;
}

// Of the material at `uv`, v upwards.
bool is_cut(int material, vec2 uv) {
    Coverage c = coverages[material];
    if (c.first < 0.0) return c.alpha < c.cutoff;
    vec2 at = vec2(uv.x, 1.0 - uv.y);
    at = mix(at - floor(at), at, notEqual(c.wrap, vec2(0.0))) * c.size - 0.5;
    if (c.nearest > 0.0) return c.alpha * coverage_texel(c, ivec2(floor(at + 0.5))) < c.cutoff;
    ivec2 corner = ivec2(floor(at));
    vec2 part = at - vec2(corner);
    float rows[2];
    for (int y = 0; y < 2; ++y)
        rows[y] = mix(coverage_texel(c, corner + ivec2(0, y)), coverage_texel(c, corner + ivec2(1, y)), part.x);
    return c.alpha * mix(rows[0], rows[1], part.y) < c.cutoff;
}
