// Places a vertex in a paraboloid map: for paraboloid.vert and paraboloid.tese. Between vertices edges are
// straight in the map, so triangles have to be small there.
#include "lib/shadows/drawn_view.glsl"
#include "lib/shadows/projection.glsl"
#include "lib/shadows/paraboloid_varyings.glsl"

// Cosine: parts of triangles are cut off this far behind the hemisphere's rim; fragments are cut at the rim itself.
const float RIM = -0.3;

#if LAYER_FROM_VERTEX
out float gl_ClipDistance[5];
#else
out gl_PerVertex {  // as the geometry shader reads it
    vec4 gl_Position;
    float gl_ClipDistance[5];
};
flat out int layer;
#endif
out Part PART part;

// d: from the view. Returns NDC in the map.
vec2 place(View view, vec3 d) {
    float size = length(d), along = dot(d, view.z_axis);
    // Behind the rim, which is clipped, the divisor goes to 0.
    float divisor = view.curve * max(size + along, 0.25 * size + TINY);
    vec2 map_ndc = vec2(dot(d, view.x_axis), dot(d, view.y_axis)) / divisor;
    gl_Position = vec4(map_ndc, 0.5, 1.0);
#if SPLIT
    gl_ClipDistance[0] = along - RIM * size;
#else
    gl_ClipDistance[0] = along - frame.near;
#endif
    // The four sides of the map.
    gl_ClipDistance[1] = 1.0 + map_ndc.x;
    gl_ClipDistance[2] = 1.0 - map_ndc.x;
    gl_ClipDistance[3] = 1.0 + map_ndc.y;
    gl_ClipDistance[4] = 1.0 - map_ndc.y;
#ifdef ATLAS_SIZE
    gl_Position = in_rectangle(gl_Position, view.rectangle);
#if LAYER_FROM_VERTEX
    gl_Layer = int(view.rectangle.w);
#else
    layer = int(view.rectangle.w);
#endif
#endif
    return map_ndc;
}
