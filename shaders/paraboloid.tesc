// How finely a triangle has to be split to be straight in a light's paraboloid map, edge by edge: neighbours that share
// an edge split it alike.
#include "lib/shadow.glsl"

layout(vertices = 3) out;

flat in int light_of_corner[];
in vec3 corner[];
flat out int light_of_patch[];
out vec3 from_light[];
patch out mat3 edges;  // planes through the light and an edge; a direction within the triangle is on their inner sides
patch out vec4 plane;  // xyz: depth is its dot product with the direction in the light's frame; w: the least depth

const float HIGHEST = 64.0;
const float ROUNDING = 1e-3;  // of the near plane's distance: positions of the scene are no better known
const float EDGE_ON = 1e-4;  // sine: no closer to the light's own plane can a surface be told from it

float map_size(Light light) {
    return light.tile < 0.0 ? float(SPOT_SIZE) : float(VPL_SIZE);
}

// An edge of length l, at least D from the light, bends by no more than (l/D)^2 / 8 of the hemisphere's radius in the map.
float level(Light light, vec3 a, vec3 b) {
    float za = dot(a, light.z_axis), zb = dot(b, light.z_axis);
    // What lies behind the light does not show.
    vec3 start = za < 0.0 && zb > 0.0 ? mix(a, b, za / (za - zb)) : a;
    vec3 end = zb < 0.0 && za > 0.0 ? mix(b, a, zb / (zb - za)) : b;
    vec3 way = end - start, whole = b - a;
    float nearest = clamp(-dot(start, way) / max(dot(way, way), TINY), 0.0, 1.0);
    vec3 closest = start + way * nearest;
    float bend = dot(whole, whole) / max(dot(closest, closest), TINY) * (map_size(light) / (16.0 * light.curve * light.tan_half));
    return clamp(sqrt(bend / BEND), 1.0, HIGHEST);
}

void main() {
    from_light[gl_InvocationID] = corner[gl_InvocationID];
    light_of_patch[gl_InvocationID] = light_of_corner[gl_InvocationID];
    if (gl_InvocationID != 0) return;
    Light light = lights[light_of_corner[0]];
    vec3 a = corner[0], b = corner[1], c = corner[2];
    vec3 sizes = vec3(length(a), length(b), length(c));
    vec3 along = vec3(dot(a, light.z_axis), dot(b, light.z_axis), dot(c, light.z_axis));
    vec3 normal = cross(b - a, c - a);
    float h = dot(normal, a);
    bool seen_edge_on = abs(h) <= ROUNDING * frame.near * length(normal);
    // Behind the light, or on its own surface, or without any area in the map.
    if (seen_edge_on || all(lessThanEqual(along, max(EDGE_ON * sizes, vec3(frame.near))))) {
        gl_TessLevelOuter[0] = gl_TessLevelOuter[1] = gl_TessLevelOuter[2] = 0.0;
        return;
    }
    gl_TessLevelOuter[0] = level(light, b, c);
    gl_TessLevelOuter[1] = level(light, c, a);
    gl_TessLevelOuter[2] = level(light, a, b);
    // Inside there is no edge to keep, and depth goes by the plane; but the parts must not fold over each other much.
    float most = max(max(gl_TessLevelOuter[0], gl_TessLevelOuter[1]), gl_TessLevelOuter[2]);
    gl_TessLevelInner[0] = min(most, 4.0);
    mat3 to_frame = transpose(mat3(light.x_axis * light.tan_half, light.y_axis * light.tan_half, light.z_axis));
    vec3 in_frame = to_frame * normal;
    float side = h < 0.0 ? -1.0 : 1.0;
    edges = to_frame * mat3(normalize(cross(a, b)) * side, normalize(cross(b, c)) * side, normalize(cross(c, a)) * side);
    plane = vec4(in_frame * (frame.near / h), frame.near / max(max(sizes.x, max(sizes.y, sizes.z)), TINY));
}
