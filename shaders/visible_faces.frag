// Which face shows in each pixel, plus one: coincident faces both pass an equality test on depth, and would add twice.
#include "lib/camera/frame.glsl"
#if CUT
#include "lib/surface/surface.glsl"
#else
uniform int first_face;
#endif

layout(location = 0) out uint face;

void main() {
#if CUT
    if (is_cut()) discard;
#endif
    face = uint(first_face + gl_PrimitiveID + 1);
    WRITE_DEPTH(frame.near);
}
