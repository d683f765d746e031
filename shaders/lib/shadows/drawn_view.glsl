// For shaders that draw maps: view `number` of what the pass draws, VPLs of the bound block or views of direct lights; all of
// the projection DRAWN_PROJECTION.
#include "lib/shadows/light_view.glsl"
#include "lib/shadows/vpl_view.glsl"

View drawn_view(int number) {
#if DRAWS_VPLS
    View view = vpl_view(vpls[number]);
#else
    View view = views[number];
#endif
    view.projection = float(DRAWN_PROJECTION);
    return view;
}
