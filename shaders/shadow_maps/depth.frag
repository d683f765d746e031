// Depth alone.
#include "lib/camera/frame.glsl"

void main() {
#if DRAWN_PROJECTION == 2 && !CLIP_CONTROL  // parallel: w is 1
    gl_FragDepth = gl_FragCoord.z;
#else
    WRITE_DEPTH(frame.near);
#endif
}
