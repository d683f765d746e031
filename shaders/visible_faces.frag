// Which face shows in each pixel, plus one: coincident faces both pass an equality test on depth, and would add twice.
#include "lib/camera/frame.glsl"

uniform int first_face;
layout(location = 0) out uint face;

void main() {
    face = uint(first_face + gl_PrimitiveID + 1);
    WRITE_DEPTH(frame.near);
}
