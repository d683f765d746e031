// The scene as one light sees it, into a plain depth map of its own.
#include "lib/shadows/projection.glsl"

uniform int light_number;  // in this block
in vec3 position;

void main() {
    gl_Position = planar_clip(lights[light_number], position);
}
