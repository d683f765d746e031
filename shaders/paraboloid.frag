// Depth in a paraboloid map, near / distance, fragment by fragment: that of the triangle's plane in the direction of the
// fragment, wherever a straight edge has bent it.
#include "lib/shadow.glsl"
#include "lib/part.glsl"

in Part PART part;

void main() {
    Light light = lights[part.light];
    float tan_quarter = light.curve * light.tan_half;
    vec2 p = part.ndc * tan_quarter;
    float square = dot(p, p);
    vec3 direction = vec3(2.0 * p, 1.0 - square) / (1.0 + square);
#if SPLIT
    float size = light.tile < 0.0 ? float(SPOT_SIZE) : float(VPL_SIZE);
    float depth = max(dot(part.plane.xyz, direction), part.plane.w);
    // The parts cover more than the triangle; a hundredth of a texel keeps neighbours together.
    if (any(lessThan(direction * part.edges, vec3(-0.04 / size * tan_quarter)))) discard;
#else
    vec2 across = vec2(dot(part.seen, light.x_axis), dot(part.seen, light.y_axis)) * light.tan_half;
    vec3 to_point = vec3(across, dot(part.seen, light.z_axis));
    vec3 normal = cross(dFdx(to_point), dFdy(to_point));
    float inverse = inversesqrt(max(dot(to_point, to_point), TINY)), h = dot(normal, to_point) * inverse;
    // A triangle seen edge-on, or too small in the map to tell its plane.
    float nearer = clamp(dot(normal, direction) / (abs(h) > 1e-30 ? h : 1.0), 0.5, 2.0);
    float depth = frame.near * inverse * nearer;
#endif
    if (direction.z <= depth) discard;  // closer than the near plane
    gl_FragDepth = depth;
}
