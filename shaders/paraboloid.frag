// Depth in a paraboloid map, near / distance, fragment by fragment: of a split triangle by its plane, exactly; of one
// that is small in the map by the point between its corners.
#include "lib/shadow.glsl"
#include "lib/part.glsl"

in Part PART part;

#if SPLIT
const float GAP = 0.01;  // texels over the edge, lest rounding opens a gap to the neighbour

void main() {
    Light light = lights[part.light];
    float tan_quarter = light.curve * light.tan_half;
    vec2 p = part.ndc * tan_quarter;
    float square = dot(p, p);
    vec3 direction = vec3(2.0 * p, 1.0 - square) / (1.0 + square);
    float depth = max(dot(part.plane.xyz, direction), part.plane.w);
    bool outside = any(lessThan(direction * part.edges, vec3(-GAP * texel_angle(light))));
    if (outside || direction.z <= depth) discard;  // or closer than the near plane
    gl_FragDepth = depth;
}
#else
void main() {
    gl_FragDepth = min(frame.near * inversesqrt(max(dot(part.seen, part.seen), TINY)), 1.0);
}
#endif
