// The least that a lighting pass must do: project each pixel into each light's map and compare once, without shading.
// The point is not lifted off its face either: what the bias costs counts as the pass's own.
#include "lib/frame.glsl"
#include "lib/light.glsl"
#include "lib/atlas.glsl"

layout(binding = UNIT_SHADOWS) uniform sampler2DArrayShadow shadows;
layout(binding = UNIT_DEPTH) uniform sampler2D depth;
uniform int first;  // light of this block to start with; 1 where light 0 is the spotlight
uniform int count;  // lights of this block

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
    if (first == 1) seen = atlas_visibility(shadows, lights[0], SPOT_RECEIVER(lights[0], position, vec3(0.0), SPOT_SIZE, 0.0), SPOT_SIZE);
    for (int i = first; i < count; ++i)
        seen += atlas_visibility(shadows, lights[i], VPL_RECEIVER(lights[i], position, vec3(0.0), VPL_SIZE, 0.0), VPL_SIZE);
    radiance = vec4(seen);
}
