// The views of direct lights: of each, the one of its views that looks at a point most directly.
#include "lib/lights/direct.glsl"
#include "lib/shadows/view.glsl"

layout(std140, binding = VIEWS_BINDING) uniform Views { View views[VIEWS_PER_BLOCK]; };

#ifndef VIEWS_PER_LIGHT  // the most that a light has
#define VIEWS_PER_LIGHT 6
#endif

// Number of the view in this block.
int choose_view(DirectLight light, vec3 position) {
    int chosen = int(light.view);
#if VIEWS_PER_LIGHT > 1
    int count = min(int(light.view_count), VIEWS_PER_LIGHT);
    float best = dot(position - light.position, views[chosen].z_axis);
    for (int i = 1; i < count; ++i) {
        float along = dot(position - light.position, views[int(light.view) + i].z_axis);
        if (along > best) {
            best = along;
            chosen = int(light.view) + i;
        }
    }
#endif
    return chosen;
}

View light_view(DirectLight light, vec3 position) {
    View view = views[choose_view(light, position)];
#ifdef VIEWS_PROJECTION  // where all are of one kind
    view.projection = float(VIEWS_PROJECTION);
#endif
    return view;
}
