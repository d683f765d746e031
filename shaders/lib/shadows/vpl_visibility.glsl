// How much of a VPL arrives at a point, in [0, 1]: of its map, filtered as the pass says.
#include "lib/shadows/vpl_view.glsl"
#include "lib/shadows/filter.glsl"

float vpl_visibility(MAP map, Vpl vpl, vec3 position, vec3 normal) {
    View view = vpl_view(vpl);
    return filtered(map, view, receiver(view, position, normal, VPL_OFFSET), VPL_KERNEL, VPL_TAPS);
}
