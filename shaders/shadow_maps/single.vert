// The scene as one view sees it, into a plain depth map of its own.
#include "lib/shadows/drawn_view.glsl"
#include "lib/shadows/projection.glsl"

uniform int view_number;  // in this block
in vec3 position;

void main() {
    gl_Position = flat_clip(drawn_view(view_number), position);
}
