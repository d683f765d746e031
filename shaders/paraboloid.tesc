// Cuts a triangle at the plane of a light, behind which nothing shows, and says how finely what is left has to be split to
// be nearly straight in the light's paraboloid map. The outline moves out by as much as it may still bend (paraboloid.tese),
// so that the parts cover all of the triangle; paraboloid.frag discards what they cover beyond it.
#include "lib/shadow.glsl"

layout(vertices = 1) out;

flat in int light_of_corner[];
in vec3 corner[];
patch out int light_of_patch;
patch out vec3 corners[4];  // unit, from the light to what is left of the triangle; the last two may be one
patch out vec4 inwards[4];  // normals of the planes through the light and the edge to the next corner; angles of the edges
patch out float turn;       // 1 if the corners go round their normals' way, else -1
patch out float margin;     // how far to move the outline, an angle
patch out mat3 edges;       // planes through the light and an edge; a direction within the triangle is on their inner sides
patch out vec4 plane;       // xyz: depth is its dot product with the direction in the light's frame; w: the least depth

const float HIGHEST = 64.0;   // OpenGL promises so many parts
const float ROUNDING = 1e-3;  // of the near plane's distance: positions of the scene are no better known
const float WIDEST = 0.05;    // margin: so far behind the light's plane directions still have a place in the map
const float EDGE_ON = 1e-4;   // sine: no closer to the light's own plane can a surface be told from it

vec3 unit(vec3 v) {
    return v * inversesqrt(max(dot(v, v), TINY));
}

bool before(vec3 a, vec3 b) {
    return a.x < b.x || a.x == b.x && (a.y < b.y || a.y == b.y && a.z < b.z);
}

// Normal of the plane through the light, a and b: that of b and a is its opposite to the last bit, so neighbours that share
// an edge leave no gap.
vec3 across(vec3 a, vec3 b) {
    return before(b, a) ? -unit(cross(b, a)) : unit(cross(a, b));
}

// Where the way from a point in front of the light to one behind it meets the light's plane.
vec3 cut(vec3 front, vec3 behind, float along_front, float along_behind) {
    return mix(front, behind, along_front / (along_front - along_behind));
}

// An edge is a piece of a great circle as the light sees it, with the normal `inward.xyz` and the angle `inward.w`, and of a
// circle in the map: over an angle t it bends by t^2 / 8 of that circle's radius, the hemisphere's over dot(normal, z_axis).
// All as angles in the middle of the map, where a texel is largest.
float bend(Light light, vec4 inward) {
    return inward.w * inward.w * abs(dot(inward.xyz, light.z_axis)) / 4.0;
}

void main() {
    Light light = lights[light_of_corner[0]];
    light_of_patch = light_of_corner[0];
    vec3 a = corner[0], b = corner[1], c = corner[2];
    vec3 sizes = vec3(length(a), length(b), length(c));
    vec3 along = vec3(dot(a, light.z_axis), dot(b, light.z_axis), dot(c, light.z_axis));
    vec3 normal = cross(b - a, c - a);
    float h = dot(normal, a);
    bool seen_edge_on = abs(h) <= ROUNDING * frame.near * length(normal);
    // Behind the light, or on its own surface, or without any area in the map.
    if (seen_edge_on || all(lessThanEqual(along, max(EDGE_ON * sizes, vec3(frame.near))))) {
        gl_TessLevelOuter[0] = gl_TessLevelOuter[1] = gl_TessLevelOuter[2] = gl_TessLevelOuter[3] = 0.0;
        return;
    }
    mat3 to_frame = transpose(mat3(light.x_axis * light.tan_half, light.y_axis * light.tan_half, light.z_axis));
    turn = h < 0.0 ? -1.0 : 1.0;
    edges = to_frame * mat3(across(a, b), across(b, c), across(c, a)) * turn;
    plane = vec4(to_frame * normal * (frame.near / h), frame.near / max(max(sizes.x, max(sizes.y, sizes.z)), TINY));

    // Turned so that the corners in front of the light come first: all, two or one.
    for (int turned = 0; turned < 2; ++turned) {
        if (along.x > 0.0 && (along.z <= 0.0 || along.y > 0.0)) break;
        vec3 first = a;
        a = b;
        b = c;
        c = first;
        along = along.yzx;
    }
    vec3 d = c;
    if (along.z <= 0.0) {
        d = cut(a, c, along.x, along.z);
        c = along.y > 0.0 ? cut(b, c, along.y, along.z) : d;
        if (along.y <= 0.0) b = cut(a, b, along.x, along.y);
    }
    vec3 left[4] = vec3[4](unit(a), unit(b), unit(c), unit(d));
    float texel = texel_angle(light), tolerated = min(BEND * texel, WIDEST);
    margin = 0.0;
    for (int i = 0; i < 4; ++i) {
        vec3 start = left[i], end = left[(i + 1) % 4];
        corners[i] = start;
        vec4 inward = vec4(across(start, end) * turn, atan(length(cross(start, end)), dot(start, end)));
        inwards[i] = inward;
        float most = bend(light, inward), count = clamp(ceil(sqrt(most / tolerated)), 1.0, HIGHEST);
        margin = max(margin, most / (count * count));
        gl_TessLevelOuter[(i + 1) % 4] = count;
    }
    margin += 0.1 * texel;
    gl_TessLevelInner[0] = gl_TessLevelInner[1] = 1.0;  // the parts cover what their outline encloses, however they fold
}
