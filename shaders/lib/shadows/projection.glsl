// Shadow maps: where a view sees a point, and how far. Writer and readers share it.
//
// A planar map covers the view's cone by a perspective projection, with reversed depth along its axis
// (lib/camera/depth.glsl). A paraboloid map (Brabec et al. 2002), which can be as wide as the hemisphere, is the
// stereographic projection of the directions: the cone's edge is the circle of radius 1, and the depth is
// near / distance. A parallel map covers a box, with depth from 1 where light enters to 0 where the box ends.
#include "lib/camera/frame.glsl"
#include "lib/lights/light.glsl"
#include "lib/shadows/view.glsl"

// What the map's coordinates of a point at `d` from the view are divided by: its depth along the axis in a planar map.
float planar_divisor(View view, vec3 d) {
    return dot(d, view.z_axis);
}

float paraboloid_divisor(View view, vec3 d) {
    return view.curve * (length(d) + dot(d, view.z_axis));
}

// A texel of the paraboloid map as an angle, where it is largest, in the middle of the map.
float texel_angle(View view) {
    return 4.0 * view.curve * view.tan_half / view.size;
}

float parallel_depth(View view, vec3 d) {
    return 1.0 - dot(d, view.z_axis) * view.curve;
}

// Clip position in the view's planar or parallel map.
vec4 flat_clip(View view, vec3 position) {
    vec3 d = position - view.position;
    if (view.projection == PARALLEL_VIEW)
        return clip_position(vec2(dot(d, view.x_axis), dot(d, view.y_axis)), parallel_depth(view, d), 1.0);
    return clip_position(vec2(dot(d, view.x_axis), dot(d, view.y_axis)), frame.near, planar_divisor(view, d));
}

// A point as a map knows it. slope: change of depth, a texel to the right and up, on the plane of the point's face.
// bend: what makes it curved in a paraboloid map (see `receiver_plane`); 0 in a planar one. reach: how far from the middle
// of a paraboloid map, 1 at its sides, four texels about a place are all drawn.
struct Receiver {
    vec2 texel;  // in texels from the map's lower left corner
    float depth;
    vec2 slope;
    vec4 bend;
    float reach;
};

// The point is lifted off its face by `offset` texels of the map: its depth and those in the map come
// from different roundings. No world units are involved.
vec3 lifted(View view, vec3 from, vec3 normal, float offset, float divisor) {
    return from + normal * (2.0 * offset / view.size * view.tan_half * divisor);
}

// Distance of the view behind the plane of the face; where the plane goes through it no light arrives, and a
// millionth of the way to the point stands for 0, or TINY where the point is the view's own.
float plane_distance(vec3 d, vec3 normal) {
    return min(dot(normal, d), -1e-6 * length(d) - TINY);
}

Receiver planar_receiver(View view, vec3 position, vec3 normal, float offset) {
    vec3 from = position - view.position;
    vec3 d = lifted(view, from, normal, offset, planar_divisor(view, from));
    float w = max(planar_divisor(view, d), frame.near);  // behind the near plane nothing was drawn, and cosines are 0
    vec2 n = vec2(dot(normal, view.x_axis), dot(normal, view.y_axis));
    Receiver r;
    r.texel = (vec2(dot(d, view.x_axis), dot(d, view.y_axis)) / w * 0.5 + 0.5) * view.size;
    r.depth = frame.near / w;
    // 1/w is linear in the map over a plane.
    r.slope = n * (2.0 / view.size * frame.near * view.tan_half * view.tan_half / plane_distance(d, normal));
    r.bend = vec4(0.0);
    r.reach = 0.0;
    return r;
}

Receiver paraboloid_receiver(View view, vec3 position, vec3 normal, float offset) {
    vec3 from = position - view.position;
    vec3 d = lifted(view, from, normal, offset, paraboloid_divisor(view, from));
    float inverse = inversesqrt(max(dot(d, d), TINY)), cosine = dot(d, view.z_axis) * inverse;
    float h = plane_distance(d, normal), tan_quarter = view.curve * view.tan_half;
    vec2 n = vec2(dot(normal, view.x_axis), dot(normal, view.y_axis)) * view.tan_half;
    // Behind the view nothing was drawn, and cosines are 0.
    vec2 ndc = vec2(dot(d, view.x_axis), dot(d, view.y_axis)) * (inverse / (view.curve * max(1.0 + cosine, 0.5)));
    Receiver r;
    r.texel = (ndc * 0.5 + 0.5) * view.size;
    r.depth = frame.near * inverse;
    // On a plane at distance h, 1/distance is dot(normal, direction) / h: this is its derivative.
    r.slope = (n - ndc * (tan_quarter * (dot(normal, view.z_axis) + h * inverse)))
            * (2.0 / view.size * frame.near * tan_quarter * (1.0 + cosine) / h);
    float step = 2.0 / view.size * tan_quarter, square = 0.5 * (1.0 + cosine) * step * step;
    r.bend = vec4(ndc * (tan_quarter * step * (1.0 + cosine)), square,
                  square * frame.near * (dot(normal, view.z_axis) / h + inverse));
    // At the rim of the hemisphere, 1 / tan_quarter from the middle, drawing ends: four texels are 2 sqrt(2) / size away
    // at most. tan_quarter is that of a quarter of the cone's angle, which is not 0.
    r.reach = min(1.0 / tan_quarter - 2.83 / view.size, 1.0);
    return r;
}

Receiver parallel_receiver(View view, vec3 position, vec3 normal, float offset) {
    float width = inversesqrt(dot(view.x_axis, view.x_axis)), texel = 2.0 / view.size * width;  // world units
    vec3 d = position - view.position + normal * (offset * texel);
    Receiver r;
    r.texel = (vec2(dot(d, view.x_axis), dot(d, view.y_axis)) * 0.5 + 0.5) * view.size;
    r.depth = parallel_depth(view, d);
    // On the plane of the face the depth along the axis changes by -(normal . x) / (normal . axis) of a step across.
    vec2 n = vec2(dot(normal, view.x_axis), dot(normal, view.y_axis)) * width;
    r.slope = n * (texel * view.curve / min(dot(normal, view.z_axis), -1e-6));
    r.bend = vec4(0.0);
    r.reach = 0.0;
    return r;
}

// The depth to compare with: the nearest that the point's plane reaches in the four texels about `texel`, where it has
// `depth` and `slope`; never farther than the point itself.
vec3 nearest_of_four(Receiver r, vec2 texel, float depth, vec2 slope) {
    vec2 f = fract(texel - 0.5), nearer = max(-f * slope, (1.0 - f) * slope);
    return vec3(texel, max(r.depth, depth + nearer.x + nearer.y));
}

// The plane of the receiver's face `offset` texels away: x, y the slope there, z the depth. In a planar map 1/w is linear
// on a plane. In a paraboloid map the coordinates p are tangents of half the angle, and 1/distance on a plane is a quotient
// of two quadratics in p: `divisor` is (1 + |p|^2) at the offset over (1 + |p|^2) here, so it is above 0.
vec3 receiver_plane(Receiver r, vec2 offset) {
    float square = dot(offset, offset), divisor = 1.0 + dot(r.bend.xy, offset) + r.bend.z * square;
    float rise = (dot(r.slope, offset) - r.bend.w * square) / divisor;
    vec2 slope = (r.slope - 2.0 * r.bend.w * offset - rise * (r.bend.xy + 2.0 * r.bend.z * offset)) / divisor;
    return vec3(slope, r.depth + rise);
}

// Where to compare, in texels, and the depth to compare with, `offset` texels away. Kept half a texel inside, so that a 2x2
// comparison never leaves the map or tile. Beyond the disc of a paraboloid map lies what the view does not see.
vec3 comparison(Receiver r, float size, vec2 offset) {
    vec2 texel = r.texel + offset, ndc = texel * (2.0 / size) - 1.0;
    if (r.reach > 0.0) texel -= ndc * (1.0 - min(r.reach * inversesqrt(max(dot(ndc, ndc), TINY)), 1.0)) * (0.5 * size);
    texel = clamp(texel, 0.5, size - 0.5);
    vec3 plane = receiver_plane(r, texel - r.texel);
    return nearest_of_four(r, texel, plane.z, plane.xy);
}

vec3 comparison(Receiver r, float size) {
    if (r.reach > 0.0) return comparison(r, size, vec2(0.0));
    return nearest_of_four(r, clamp(r.texel, 0.5, size - 0.5), r.depth, r.slope);
}

// The point `position` of a face with the geometric normal `normal`, lifted off it by `offset` texels.
Receiver receiver(View view, vec3 position, vec3 normal, float offset) {
    if (view.projection == PARALLEL_VIEW) return parallel_receiver(view, position, normal, offset);
    if (view.projection == PARABOLOID_VIEW) return paraboloid_receiver(view, position, normal, offset);
    return planar_receiver(view, position, normal, offset);
}
