// Cuts a triangle at the plane of a light, behind which nothing shows, and says how finely what is left has to be split to
// be nearly straight in the light's paraboloid map. The outline moves out by as much as it may still bend (paraboloid.tese),
// so that the parts cover all of the triangle; paraboloid.frag discards what they cover beyond it.
#include "lib/shadows/drawn_view.glsl"
#include "lib/shadows/projection.glsl"
#include "lib/shadows/paraboloid_varyings.glsl"

layout(vertices = 1) out;

flat in int view_of_corner[];
in vec3 corner[];
#if CUT
in vec3 cut_of_corner[];
patch out mat3 cut_places;  // as in lib/shadows/paraboloid_varyings.glsl
patch out int cut_material;
#endif
patch out int view_of_patch;
patch out vec3 corners[4];  // unit, from the light to what is left of the triangle; the last two may be one
patch out vec4 inwards[4];  // normals of the planes through the light and the edge to the next corner; angles of the edges
patch out float turn;       // 1 if the corners go round their normals' way, else -1
patch out float margin;     // how far to move the outline, an angle
patch out mat3 edges;       // these four as in lib/shadows/paraboloid_varyings.glsl
patch out mat3 chords;
patch out vec4 plane;
patch out float gap;

const float HIGHEST = 64.0;    // OpenGL promises so many parts
const float ROUNDING = 10.0;   // of the near plane's distance: positions of the scene are no better known
const float WIDEST = 0.05;     // margin: so far behind the light's plane directions still have a place in the map
const float EDGE_ON = 1e-4;    // sine: no closer to the light's own plane can a surface be told from it
const float PART_BEND = 4.0;   // texels that a part's side may bend
const float SHARP_BEND = 1.0;  // the same beside a sharp corner
const float UNDIVIDED = 0.02;  // texels: a side that bends by less is not divided
const float GAP = 0.01;        // texels over the sides, lest rounding opens a gap to the neighbour
const float NARROW = 0.05;     // texels: of a triangle no wider than this roundings choose the plane

vec3 unit(vec3 v) {
    return v * inversesqrt(max(dot(v, v), TINY));
}

bool before(vec3 a, vec3 b) {
    return a.x < b.x || a.x == b.x && (a.y < b.y || a.y == b.y && a.z < b.z);
}

// Normal of the plane through the light, a and b. Swapping a and b flips its sign and no other bit, so triangles that share
// an edge leave no gap.
vec3 across(vec3 a, vec3 b) {
    return before(b, a) ? -unit(cross(b, a)) : unit(cross(a, b));
}

// Where the way from a point in front of the light to one behind it meets the light's plane: one distance is above 0, the
// other is not, so they differ.
vec3 cut(vec3 front, vec3 behind, float along_front, float along_behind) {
    return mix(front, behind, along_front / (along_front - along_behind));
}

// An edge is a piece of a great circle as the light sees it, with the normal `inward.xyz` and the angle `inward.w`, and of a
// circle in the map: over an angle t it bends by t^2 / 8 of that circle's radius, the hemisphere's over dot(normal, z_axis).
// All as angles in the middle of the map, where a texel is largest.
float bend(View view, vec4 inward) {
    return inward.w * inward.w * abs(dot(inward.xyz, view.z_axis)) / 4.0;
}

// Square of the angle, nearly, of the longest side that is straight in the map, as all are of triangles that are drawn
// whole (MapParams.reach): neighbours that share a side leave no gap, whichever way each is drawn.
float straight_side(float texel) {
    return 1.01 * min(4.0 * BEND * texel, 1.0 / (LEAST_REACH * LEAST_REACH));
}

// Whether paraboloid.tese moves a corner by less than the margin.
bool is_sharp(vec3 before, vec3 behind) {
    return 1.0 + dot(before, behind) < BLUNT;
}

// What gives 1 / distance of the line through a and b by a dot product with a unit direction, the same across the line.
vec3 plane_along(vec3 a, vec3 b) {
    vec3 way = b - a, foot = a - way * (dot(a, way) / max(dot(way, way), TINY));
    return foot / max(dot(foot, foot), TINY);
}

// The line of the map through start and end, unit directions in the light's frame: see lib/shadows/paraboloid_varyings.glsl. One is in front of
// the light and the other near it (straight_side), so neither points straight back, where 1 + z is 0.
vec3 line(vec3 start, vec3 end) {
    vec2 from = start.xy / (1.0 + start.z), way = end.xy / (1.0 + end.z) - from;
    vec2 left = vec2(-way.y, way.x) * (turn * inversesqrt(max(dot(way, way), TINY)));
    return vec3(left, -dot(left, from));
}

void main() {
    View view = drawn_view(view_of_corner[0]);
    view_of_patch = view_of_corner[0];
    vec3 a = corner[0], b = corner[1], c = corner[2];
    vec3 sizes = vec3(length(a), length(b), length(c));
    vec3 along = vec3(dot(a, view.z_axis), dot(b, view.z_axis), dot(c, view.z_axis));
    vec3 normal = cross(b - a, c - a);
    float h = dot(normal, a);
    bool seen_edge_on = abs(h) <= ROUNDING * frame.near * length(normal);
    // Behind the light, or on its own surface, or without any area in the map, where h is 0.
    if (seen_edge_on || all(lessThanEqual(along, max(EDGE_ON * sizes, vec3(frame.near))))) {
        gl_TessLevelOuter[0] = gl_TessLevelOuter[1] = gl_TessLevelOuter[2] = gl_TessLevelOuter[3] = 0.0;
        return;
    }
    mat3 to_frame = transpose(mat3(view.x_axis * view.tan_half, view.y_axis * view.tan_half, view.z_axis));
    turn = h < 0.0 ? -1.0 : 1.0;
#if CUT
    // Weights of the corners in a direction, over a common factor, are its products with these.
    float unit_size = 1.0 / max(sizes.x, max(sizes.y, sizes.z));  // not 0: the triangle is not seen edge-on
    vec3 p = a * unit_size, q = b * unit_size, r = c * unit_size;
    mat3 across_corners = mat3(cross(q, r), cross(r, p), cross(p, q));
    mat3 values = mat3(vec3(cut_of_corner[0].xy, 1.0), vec3(cut_of_corner[1].xy, 1.0), vec3(cut_of_corner[2].xy, 1.0));
    cut_places = values * transpose(to_frame * across_corners);
    cut_material = int(cut_of_corner[0].z + 0.5);
#endif
    float texel = texel_angle(view), longest = 0.0;
    vec3 depths = normal / h, triangle[3] = vec3[3](a, b, c), units[3] = vec3[3](unit(a), unit(b), unit(c));
    float longest_straight = straight_side(texel);
    for (int i = 0; i < 3; ++i) {
        int next = (i + 1) % 3;
        vec3 side = across(triangle[i], triangle[next]), way = units[next] - units[i];
        float square = dot(way, way);
        edges[i] = to_frame * side * turn;
        bool beyond = edges[i].z < 0.0 && square <= longest_straight && max(along[i], along[next]) > 0.0;
        chords[i] = beyond ? line(to_frame * units[i], to_frame * units[next]) : vec3(0.0, 0.0, -1.0);
        if (square > longest) {
            longest = square;
            vec3 third = units[(i + 2) % 3];
            // Across the light from the longest side it is the third corner of what lies low over all of the map.
            bool opposite = dot(third, units[i] + units[next]) < 0.0;
            bool narrow = !opposite && abs(dot(side, third)) < NARROW * texel;
            depths = narrow ? plane_along(triangle[i], triangle[next]) : normal / h;
            gap = narrow ? 0.0 : GAP * texel;  // else a needle would be as wide
        }
    }
    plane = frame.near * vec4(to_frame * depths, 1.0 / max(max(sizes.x, max(sizes.y, sizes.z)), TINY));

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
    for (int i = 0; i < 4; ++i) {
        vec3 start = left[i], end = left[(i + 1) % 4];
        corners[i] = start;
        inwards[i] = vec4(across(start, end) * turn, atan(length(cross(start, end)), dot(start, end)));
    }
    bool is_cut = along.z <= 0.0;
    margin = 0.0;
    for (int i = 0; i < 4; ++i) {
        int next = (i + 1) % 4;
        vec3 inward = inwards[i].xyz, way = left[next] - left[i];
        bool sharp = is_sharp(inwards[(i + 3) % 4].xyz, inward) || is_sharp(inward, inwards[next].xyz);
        float most = bend(view, inwards[i]), count = 1.0;
        if (dot(inward, view.z_axis) < 0.0 && dot(way, way) <= longest_straight) {
            if (is_cut) margin = max(margin, most);
        } else {
            // Beside a sharp corner, which moves less than the margin, the outline has to be the farther off.
            float tolerated = min((sharp ? SHARP_BEND : PART_BEND) * texel, WIDEST);
            count = clamp(ceil(sqrt(most / tolerated)), sharp && most > UNDIVIDED * texel ? 2.0 : 1.0, HIGHEST);
            margin = max(margin, (sharp ? 4.0 : 1.0) * most / (count * count));
        }
        gl_TessLevelOuter[next] = count;
    }
    margin += 0.1 * texel;
    gl_TessLevelInner[0] = gl_TessLevelInner[1] = 1.0;  // the parts cover what their outline encloses, however they fold
}
