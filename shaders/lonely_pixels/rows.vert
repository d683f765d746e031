// A triangle over as many rows as the list has pixels for; the rows beyond are clipped away.
#include "lib/shares/lonely.glsl"

out float gl_ClipDistance[1];

void main() {
    ivec2 size = imageSize(thin);
    uint rows = (imageLoad(count, ivec2(0)).r + uint(size.x) - 1u) / uint(size.x);
    vec2 ndc = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID & 2) * 2 - 1);
    gl_Position = vec4(ndc, 0.0, 1.0);
    gl_ClipDistance[0] = 2.0 * float(rows) / float(size.y) - 1.0 - ndc.y;
}
