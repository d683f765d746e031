// The least that a lighting pass must do: project each pixel into each light's map and compare once, without shading.
// The point is not lifted off its face either: what the bias costs counts as the pass's own.
#include "lib/camera/frame.glsl"
#include "lib/shadows/atlas.glsl"
#include "lib/shadows/light_view.glsl"
#include "lib/shadows/projection.glsl"
#include "lib/shadows/vpl_view.glsl"

layout(binding = UNIT_SHADOWS) uniform sampler2DArrayShadow shadows;
layout(binding = UNIT_DEPTH) uniform sampler2D depth;
uniform int direct;  // direct lights to add up
uniform int count;   // VPLs of this block

in vec2 ndc;
layout(location = 0) out vec4 radiance;  // how many lights reach the pixel

float seen_from(View view, vec3 position) {
    return compared(shadows, view.rectangle, view.size,
                    comparison(receiver(view, position, vec3(0.0), 0.0), view.size));
}

void main() {
    float d = texelFetch(depth, ivec2(gl_FragCoord.xy), 0).r;
    if (d <= 0.0) {  // background
        radiance = vec4(0.0);
        return;
    }
    vec3 position = unproject(ndc, d);
    float seen = 0.0;
    for (int i = 0; i < direct; ++i) seen += seen_from(light_view(lights[i], position), position);
    for (int i = 0; i < count; ++i) seen += seen_from(vpl_view(vpls[i]), position);
    radiance = vec4(seen);
}
