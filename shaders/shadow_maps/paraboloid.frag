// Depth in a paraboloid map, near / distance, fragment by fragment: of a split triangle by its plane, exactly; of one
// that is small in the map by the point between its corners; of one that is drawn straight, though it may be large, by the
// plane that derivatives tell.
#include "lib/shadows/drawn_view.glsl"
#include "lib/shadows/projection.glsl"
#include "lib/shadows/paraboloid_varyings.glsl"
#if CUT
#include "lib/surface/coverage.glsl"
#endif

in Part PART part;

#if SPLIT || STRAIGHT
// From the light, in its frame.
vec3 seen_direction(View view) {
    vec2 p = part.ndc * view.curve * view.tan_half;
    float square = dot(p, p);
    return vec3(2.0 * p, 1.0 - square) / (1.0 + square);
}
#endif

#if SPLIT
void main() {
    View view = drawn_view(part.view);
    vec3 direction = seen_direction(view);
    float depth = max(dot(part.plane.xyz, direction), part.plane.w);
    vec2 p = part.ndc * view.curve * view.tan_half;
    vec3 inside = max(direction * part.edges, vec3(p, 1.0) * part.chords);
    bool outside = any(lessThan(inside, vec3(-part.gap)));
    // No near plane: where a wall beside the light stands on the light's own, that would cut off its foot.
    if (outside || direction.z <= 0.0) discard;
#if CUT
    vec3 place = part.cut_places * direction;
    if (is_cut(part.cut_material, place.xy / place.z)) discard;
#endif
    gl_FragDepth = min(depth, 1.0);
}
#elif STRAIGHT
void main() {
    View view = drawn_view(part.view);
    vec3 direction = seen_direction(view);
    vec2 across = vec2(dot(part.seen, view.x_axis), dot(part.seen, view.y_axis)) * view.tan_half;
    vec3 to_point = vec3(across, dot(part.seen, view.z_axis));
    vec3 normal = cross(dFdx(to_point), dFdy(to_point));
    float inverse = inversesqrt(max(dot(to_point, to_point), TINY)), h = dot(normal, to_point) * inverse;
    float along = dot(normal, direction) * sign(h);
    // A straight edge near the light's own plane cuts across the map, where the triangle's plane is far away or behind.
    if (along < 0.5 * abs(h)) discard;
    // A triangle seen edge-on, or too small in the map to tell its plane.
    float nearer = abs(h) > 1e-30 ? min(along / abs(h), 2.0) : 1.0;
    float depth = frame.near * inverse * nearer;
    if (direction.z <= depth) discard;  // closer than the near plane
    gl_FragDepth = depth;
}
#else
void main() {
    gl_FragDepth = min(frame.near * inversesqrt(max(dot(part.seen, part.seen), TINY)), 1.0);
}
#endif
