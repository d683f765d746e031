#include "list_vpls/list.glsl"

layout(location = TARGET_NUMBERS) out uint number;
layout(location = TARGET_LIST_POSITIONS) out vec4 position;
layout(location = TARGET_LIST_NORMALS) out vec4 normal;
layout(location = TARGET_LIST_EMISSIONS) out vec4 emission;

void main() {
    Listed drawn = draw_entry(int(gl_FragCoord.x), int(gl_FragCoord.y));
    number = drawn.number;
    position = drawn.position;
    normal = drawn.normal;
    emission = drawn.emission;
}
