// What surfaces emit to the camera.
#include "lib/surface/surface.glsl"

layout(binding = UNIT_PRIMITIVES) uniform usampler2D primitives;
layout(location = 0) out vec4 radiance;

void main() {
    if (texelFetch(primitives, ivec2(gl_FragCoord.xy), 0).r != uint(face_number() + 1)) discard;
    radiance = vec4(emitted(), 1.0);
    WRITE_DEPTH(frame.near);
}
