// The surface of each sample: position and view depth, and both normals as the G-buffer has them.
#include "lib/camera/frame.glsl"
#include "lib/surface/pixel.glsl"

layout(binding = UNIT_DEPTH) uniform sampler2D depth;
layout(binding = UNIT_NORMALS) uniform sampler2D normals;
layout(binding = 0, r32ui) uniform readonly uimage2D pixels;

layout(location = TARGET_POSITIONS) out vec4 position;
layout(location = TARGET_SAMPLE_NORMALS) out vec4 code;

void main() {
    ivec2 size = textureSize(depth, 0);
    uint number = imageLoad(pixels, ivec2(gl_FragCoord.xy)).r;
    position = code = vec4(0.0);
    if (number == 0xffffffffu) return;
    ivec2 pixel = ivec2(number % uint(size.x), number / uint(size.x));
    float d = texelFetch(depth, pixel, 0).r;
    if (d <= 0.0) return;
    position = vec4(unproject(centre_ndc(pixel, size), d), frame.near / d);
    code = texelFetch(normals, pixel, 0);
}
