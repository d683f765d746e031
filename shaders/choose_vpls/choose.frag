#include "choose_vpls/choose.glsl"

layout(location = TARGET_CHOICES) out uvec4 choices[CHOICE_LAYERS];
layout(location = TARGET_WEIGHTS) out vec4 weights[CHOICE_LAYERS];

void main() {
    Choices chosen = choose_vpls(ivec2(gl_FragCoord.xy));
    choices = chosen.places;
    weights = chosen.weights;
}
