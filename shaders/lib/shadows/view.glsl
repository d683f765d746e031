// Views: from where a shadow map is drawn, how it projects, and where it lies (deferred_ir/shadows/views.py). Direct
// lights have theirs in a buffer, VPLs in their own records (lib/shadows/vpl_view.glsl).

struct View {
    vec3 position;
    float curve;       // c / (1 + c), c the cosine of the half cone angle: scales paraboloid maps
    vec3 x_axis;       // right and up, divided by tan_half: NDC = dot(d, axis) / dot(d, z_axis)
    float tan_half;    // tangent of the half cone angle
    vec3 y_axis;
    float size;        // edge of the map, texels
    vec3 z_axis;       // unit; where it looks
    float paraboloid;  // 1: a paraboloid map, 0: a planar one
    vec4 rectangle;    // xy: lower left corner of the map, z: its edge, in [0, 1] of a layer of the atlas; w: the layer
};
