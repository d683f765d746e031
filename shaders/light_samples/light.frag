#include "light_samples/light.glsl"

layout(location = TARGET_IRRADIANCE) out vec4 irradiance;

void main() {
    irradiance = light_sample(ivec2(gl_FragCoord.xy));
}
