// The view of a VPL, in a tile of the atlas, or in a map of its own: planar or paraboloid as VPL_PARABOLOID says. Where
// projections are MIXED, one that shines into the whole hemisphere has a paraboloid, and one at infinity a parallel view.
#ifndef MIXED
#define MIXED 1
#endif
#include "lib/lights/vpl.glsl"
#include "lib/shadows/view.glsl"
#ifdef ATLAS_SIZE
#include "lib/shadows/atlas.glsl"
#endif

View vpl_view(Vpl vpl) {
    View view;
    view.position = vpl.position;
    view.curve = vpl.curve;
    view.x_axis = vpl.x_axis;
    view.tan_half = vpl.tan_half;
    view.y_axis = vpl.y_axis;
    view.size = float(VPL_SIZE);
    view.z_axis = vpl.z_axis;
    view.projection = VPL_PARABOLOID == 1 ? PARABOLOID_VIEW : 0.0;
#if MIXED
    if (vpl.one_minus_cos >= 1.0) view.projection = PARABOLOID_VIEW;
    if (vpl.tan_half == 0.0) view.projection = PARALLEL_VIEW;
#endif
#ifdef ATLAS_SIZE
    view.rectangle = tile_rectangle(vpl.tile);
#else
    view.rectangle = vec4(0.0, 0.0, 1.0, 0.0);
#endif
    return view;
}
