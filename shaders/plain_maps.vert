// The scene as one light sees it, into a plain depth map of its own.
#include "lib/shadow.glsl"

uniform int light_number;  // in this block
in vec3 position;

void main() {
    gl_Position = planar_clip(lights[light_number], position);
}
