// Depth alone.
#include "lib/camera/frame.glsl"

void main() {
    WRITE_DEPTH(frame.near);
}
