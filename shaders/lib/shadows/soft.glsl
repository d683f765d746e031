// Soft shadows of a spotlight that is a disc: blocker search, penumbra, filter (Fernando 2005). lib/shadows/atlas.glsl or
// lib/shadows/single.glsl, included before, says how a map is read.
//
// Points are held as v / depth, v a vector in the view's axes: (x, y, 1) by tangents in a planar map, the unit
// direction in a paraboloid. The line from the receiver r through a blocker b meets the disc's plane at
// near (r.z b.xy - b.z r.xy) / (r.z depth_b - b.z depth_r), in both.
#include "lib/shadows/filter.glsl"

vec3 map_vector(View view, vec2 texel) {
    vec2 ndc = texel * (2.0 / view.size) - 1.0;
    if (view.projection != PARABOLOID_VIEW) return vec3(ndc * view.tan_half, 1.0);
    vec2 p = ndc * (view.curve * view.tan_half);
    return vec3(2.0 * p, 1.0 - dot(p, p)) / (1.0 + dot(p, p));
}

// v points forwards: at the receiver, from where it is moved within the plane across the view's axis.
vec2 map_texel(View view, vec3 v) {
    float divisor = view.projection == PARABOLOID_VIEW ? view.curve * (length(v) + v.z) : v.z;
    return (v.xy / (divisor * view.tan_half) * 0.5 + 0.5) * view.size;
}

// If the surface in the map `offset` texels away lies between the receiver and a disc of `radius`: the receiver's distance
// from the plane of the disc over that surface's. Else 0.
float blocker(DEPTHS map, View view, Receiver r, vec3 v, vec2 offset, float radius) {
    vec2 texel = floor(clamp(r.texel + offset, 0.5, view.size - 0.5)) + 0.5;
    float depth = depth_at(map, view.rectangle, ivec2(texel));
    vec3 b = map_vector(view, texel);
    float nearer = v.z * depth - b.z * r.depth;
    vec2 off = frame.near * (v.z * b.xy - b.z * v.xy);
    bool between = nearer > 0.0 && b.z > 0.0 && dot(off, off) <= radius * radius * nearer * nearer;
    // The receiver's own face is none. `between` says that b.z is above 0; a receiver's depth is.
    return between && depth > receiver_plane(r, texel - r.texel).z ? v.z * depth / (b.z * r.depth) : 0.0;
}

// If the surface in a parallel map `offset` texels away hides a part of the disc: the depth between. Else 0.
float parallel_blocker(DEPTHS map, View view, Receiver r, vec2 offset, float texels) {
    vec2 texel = floor(clamp(r.texel + offset, 0.5, view.size - 0.5)) + 0.5;
    float between = depth_at(map, view.rectangle, ivec2(texel)) - r.depth;
    bool hides = length(texel - r.texel) <= texels * between;
    return hides && between + r.depth > receiver_plane(r, texel - r.texel).z ? between : 0.0;
}

// As `soft_visibility` below, for light from infinity, from a disc of the sky; slope: tangent of half its angle.
float parallel_visibility(MAP map, DEPTHS depths, View view, float slope, Receiver r, float noise, vec2 start) {
    float texels = slope * 0.5 * view.size * length(view.x_axis) / view.curve;  // of a penumbra, over the depth between
    float most = 0.0;
    vec2 direction = start;
    for (int i = 0; i < SEARCH_TAPS; ++i) {
        vec2 offset = direction * (texels * (1.0 - r.depth) * exp2(-9.0 * (float(i) + noise) / float(SEARCH_TAPS)));
        most = max(most, parallel_blocker(depths, view, r, offset, 4.0 * texels));
        direction = turned(direction);
    }
    most = max(most, parallel_blocker(depths, view, r, vec2(0.0), texels));
    if (most <= 0.0) return -1.0;
    float sum = 0.0, found = 0.0;
    direction = start;
    for (int i = 0; i < SEARCH_TAPS; ++i) {
        vec2 offset = direction * (texels * most * sqrt(float(i) / float(SEARCH_TAPS)));
        float one = parallel_blocker(depths, view, r, offset, texels);
        sum += one;
        found += float(one > 0.0);
        direction = turned(direction);
    }
    if (found == 0.0) return -1.0;
    float lit = 0.0;
    direction = start;
    for (int i = 0; i < SOFT_TAPS; ++i) {
        vec2 offset = direction * (texels * sum / found * spread(i, SOFT_TAPS));
        lit += compared(map, view.rectangle, view.size, comparison(r, view.size, offset));
        direction = turned(direction);
    }
    return lit / float(SOFT_TAPS);
}

// -1 where nothing that hides a part of the disc is found: the penumbra is narrower than the search can see.
float soft_visibility(MAP map, DEPTHS depths, View view, float radius, Receiver r) {
    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));  // Jimenez 2014
    vec2 start = vec2(cos(6.28318531 * noise), sin(6.28318531 * noise)), direction = start;
    if (view.projection == PARALLEL_VIEW) return parallel_visibility(map, depths, view, radius, r, noise, start);
    vec3 v = map_vector(view, r.texel), point = v * (frame.near / r.depth);
    // How close to the light lies what may hide a part of the disc? Taps at all scales, from all of the map on down over
    // nine octaves; for a disc four times as wide, so that they meet things of which only a rim is in the way.
    float nearest = blocker(depths, view, r, v, vec2(0.0), radius);
    for (int i = 0; i < SEARCH_TAPS; ++i) {
        float away = view.size * exp2(-9.0 * (float(i) + noise) / float(SEARCH_TAPS));
        nearest = max(nearest, blocker(depths, view, r, v, direction * away, 4.0 * radius));
        direction = turned(direction);
    }
    if (nearest <= 1.0) return -1.0;
    float window = length(map_texel(view, point + vec3(radius * (nearest - 1.0), 0.0, 0.0)) - r.texel);
    // Their mean, over the part of the map where things so close could hide a part.
    float sum = 0.0, found = 0.0;
    direction = start;
    for (int i = 0; i < SEARCH_TAPS; ++i) {
        float one = blocker(depths, view, r, v, direction * (window * sqrt(float(i) / float(SEARCH_TAPS))), radius);
        sum += one;
        found += float(one > 0.0);
        direction = turned(direction);
    }
    if (found == 0.0) return -1.0;
    float reach = radius * (sum / found - 1.0);
    // From the receiver to points of the disc, past a blocker at that distance.
    float lit = 0.0;
    direction = start;
    for (int i = 0; i < SOFT_TAPS; ++i) {
        vec2 offset = map_texel(view, point + vec3(direction * (reach * spread(i, SOFT_TAPS)), 0.0)) - r.texel;
        lit += compared(map, view.rectangle, view.size, comparison(r, view.size, offset));
        direction = turned(direction);
    }
    return lit / float(SOFT_TAPS);
}
