// The least that a lighting pass must do: project each pixel into each light's map and compare once, without shading.
// The point is not lifted off its face either: what the bias costs counts as the pass's own.
#include "lib/camera/frame.glsl"
#include "lib/lights/light.glsl"
#include "lib/shadows/atlas.glsl"

layout(binding = UNIT_SHADOWS) uniform sampler2DArrayShadow shadows;
layout(binding = UNIT_DEPTH) uniform sampler2D depth;
uniform int first;  // light of this block to start with; 1 where light 0 is the spotlight
uniform int count;  // lights of this block

#define SEEN(light, kind) \
    compared(shadows, atlas_tile(light), kind##_SIZE, \
             comparison(kind##_RECEIVER(light, position, vec3(0.0), kind##_SIZE, 0.0), kind##_SIZE))

in vec2 ndc;
layout(location = 0) out vec4 radiance;  // how many lights reach the pixel

void main() {
    float d = texelFetch(depth, ivec2(gl_FragCoord.xy), 0).r;
    if (d <= 0.0) {  // background
        radiance = vec4(0.0);
        return;
    }
    vec3 position = unproject(ndc, d);
    float seen = 0.0;
    if (first == 1) seen = SEEN(lights[0], SPOT);
    for (int i = first; i < count; ++i) seen += SEEN(lights[i], VPL);
    radiance = vec4(seen);
}
