// Depth alone.
#include "lib/frame.glsl"

void main() {
    WRITE_DEPTH(frame.near);
}
