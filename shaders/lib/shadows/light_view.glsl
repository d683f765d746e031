// The views of direct lights.
#include "lib/lights/direct.glsl"
#include "lib/shadows/view.glsl"

layout(std140, binding = VIEWS_BINDING) uniform Views { View views[VIEWS_PER_BLOCK]; };

View light_view(DirectLight light) {
    View view = views[int(light.view)];
#ifdef VIEWS_PARABOLOID  // where all are of one kind
    view.paraboloid = float(VIEWS_PARABOLOID);
#endif
    return view;
}
