// The scene as one view sees it, into a plain depth map of its own.
#include "lib/shadows/drawn_view.glsl"
#include "lib/shadows/projection.glsl"

uniform int view_number;  // in this block
in vec3 position;
#if CUT
in vec3 cut_corner;
out vec3 corner;
#endif

void main() {
#if CUT
    corner = cut_corner;
#endif
    gl_Position = flat_clip(drawn_view(view_number), position);
}
