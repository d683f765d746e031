// How much of a direct light arrives at a point, in [0, 1]: of its map, filtered as the pass says; with the map's own
// depths as well, by soft shadows.
#include "lib/shadows/light_view.glsl"
#include "lib/shadows/soft.glsl"

float light_visibility(MAP map, DirectLight light, vec3 position, vec3 normal) {
    View view = light_view(light, position);
    return filtered(map, view, receiver(view, position, normal, SPOT_OFFSET), SPOT_KERNEL, SPOT_TAPS);
}

float light_visibility(MAP map, DEPTHS depths, DirectLight light, vec3 position, vec3 normal) {
    View view = light_view(light, position);
    Receiver at = receiver(view, position, normal, SPOT_OFFSET);
    float soft = soft_visibility(map, depths, view, light.radius, at);
    return soft >= 0.0 ? soft : filtered(map, view, at, SPOT_KERNEL, SPOT_TAPS);
}
