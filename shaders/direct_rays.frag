// Where a pixel's shadow ray to a direct light starts, and how strongly it would light the pixel.
#include "lib/surface/pixel.glsl"
#include "lib/lights/direct.glsl"

layout(binding = UNIT_DEPTH) uniform sampler2D depth;
layout(binding = UNIT_NORMALS) uniform sampler2D normals;
uniform int number;             // of the light in its block
uniform float offset;           // off the surface, at least
uniform float relative_offset;  // of the largest coordinate, as Tracer.lift says

in vec2 ndc;
layout(location = 0) out vec4 start;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float d = texelFetch(depth, pixel, 0).r;
    start = vec4(0.0);
    if (d <= 0.0) return;
    Pixel p = read_pixel(normals, pixel, ndc, d);
    vec3 far = abs(p.position);
    float lift = max(offset, relative_offset * max(max(far.x, far.y), far.z));
    start = vec4(p.position + p.normal * lift, light_strength(lights[number], p.position, p.normal, p.shading_normal));
}
