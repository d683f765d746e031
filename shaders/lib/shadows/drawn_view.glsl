// For shaders that draw maps: view `number` of what the pass draws, VPLs of the bound block or views of direct lights.
#include "lib/shadows/light_view.glsl"
#include "lib/shadows/vpl_view.glsl"

View drawn_view(int number) {
#if DRAWS_VPLS
    return vpl_view(vpls[number]);
#else
    return views[number];
#endif
}
