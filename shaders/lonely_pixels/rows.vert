// A triangle over as many rows as the list of lonely pixels fills; the rows beyond are clipped away.
layout(binding = UNIT_LONELY_PIXELS) uniform usampler2D lonely_pixels;
layout(binding = UNIT_LONELY_COUNT) uniform usampler2D lonely_count;

out float gl_ClipDistance[1];

void main() {
    ivec2 size = textureSize(lonely_pixels, 0);
    uint pair = 2u * uint(size.x), rows = (texelFetch(lonely_count, ivec2(0), 0).r + pair - 1u) / pair * 2u;
    vec2 ndc = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID & 2) * 2 - 1);
    gl_Position = vec4(ndc, 0.0, 1.0);
    gl_ClipDistance[0] = 2.0 * float(rows) / float(size.y) - 1.0 - ndc.y;
}
