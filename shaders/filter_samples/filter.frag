#include "filter_samples/filter.glsl"

layout(location = 0) out vec4 filtered;  // either of the pass's textures

void main() {
    filtered = filter_sample(ivec2(gl_FragCoord.xy));
}
