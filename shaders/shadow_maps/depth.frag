// Depth alone, of what is there.
#include "lib/camera/frame.glsl"
#if CUT
#include "lib/surface/coverage.glsl"
in vec3 corner;  // place in the image, and material
#endif

void main() {
#if CUT
    if (is_cut(int(corner.z + 0.5), corner.xy)) discard;
#endif
#if DRAWN_PROJECTION == 2 && !CLIP_CONTROL  // parallel: w is 1
    gl_FragDepth = gl_FragCoord.z;
#else
    WRITE_DEPTH(frame.near);
#endif
}
