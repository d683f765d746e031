// What shows where no surface does.
#include "lib/camera/frame.glsl"
#include "lib/lights/environment.glsl"

layout(binding = UNIT_PRIMITIVES) uniform usampler2D primitives;
layout(binding = UNIT_ENVIRONMENT) uniform sampler2D environment;
in vec2 ndc;
layout(location = 0) out vec4 radiance;

void main() {
    if (texelFetch(primitives, ivec2(gl_FragCoord.xy), 0).r != 0u) discard;
    vec3 ray = frame.ray[0].xyz * ndc.x + frame.ray[1].xyz * ndc.y + frame.ray[2].xyz;
    radiance = vec4(environment_radiance(environment, ray), 0.0);
}
