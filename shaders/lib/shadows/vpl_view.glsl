// The view of a VPL: planar or paraboloid as VPL_PARABOLOID says, in a tile of the atlas, or in a map of its own.
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
    view.paraboloid = float(VPL_PARABOLOID);
#ifdef ATLAS_SIZE
    view.rectangle = tile_rectangle(vpl.tile);
#else
    view.rectangle = vec4(0.0, 0.0, 1.0, 0.0);
#endif
    return view;
}
