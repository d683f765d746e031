// Views: from where a shadow map is drawn, how it projects, and where it lies (deferred_ir/shadows/views.py). Direct
// lights have theirs in a buffer, VPLs in their own records (lib/shadows/vpl_view.glsl).

const float PARABOLOID_VIEW = 1.0, PARALLEL_VIEW = 2.0;  // `projection`; else planar

struct View {
    vec3 position;
    float curve;       // paraboloid: c / (1 + c), c the cosine of the half cone angle; parallel: 1 over its depth
    vec3 x_axis;       // right and up, divided by tan_half, or by half the width of a parallel view
    float tan_half;    // tangent of the half cone angle; 0 in a parallel view
    vec3 y_axis;
    float size;        // edge of the map, texels
    vec3 z_axis;       // unit; where it looks
    float projection;
    vec4 rectangle;    // xy: lower left corner of the map, z: its edge, in [0, 1] of a layer of the atlas; w: the layer
};
