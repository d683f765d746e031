// One light a pixel, drawn by a hash: what the shadow maps say of the pair, and how much light depends on it.
#include "lib/camera/frame.glsl"
#include "lib/surface/gbuffer.glsl"
#include "lib/lights/direct.glsl"
#include "lib/lights/vpl.glsl"
#include "lib/shadows/atlas.glsl"
#include "lib/shadows/light_visibility.glsl"
#include "lib/shadows/vpl_visibility.glsl"

layout(binding = UNIT_SHADOWS) uniform sampler2DArrayShadow shadows;

layout(binding = UNIT_DEPTH) uniform sampler2D depth;
layout(binding = UNIT_NORMALS) uniform sampler2D normals;
uniform bool direct;  // light 0 for all pixels; else one of the VPLs
uniform int start;    // number of this block's first VPL
uniform int total;    // VPLs in all blocks
uniform uint seed;

in vec2 ndc;
layout(location = 0) out vec4 pairs;   // number of the light or VPL, visibility, luminance of the unshadowed irradiance, depth
layout(location = 1) out vec4 facing;  // geometric normal

// PCG in three dimensions (Jarzynski and Olano 2020).
uint hash(uvec3 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    return v.z + v.x * v.y;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float d = texelFetch(depth, pixel, 0).r;
    int number = direct ? 0 : int(hash(uvec3(pixel, seed)) % uint(total));
    int i = number - start;
    if (d <= 0.0 || i < 0 || i >= VPLS_PER_BLOCK) discard;  // background, or another block's draw
    vec3 position = unproject(ndc, d);
    vec4 code = texelFetch(normals, pixel, 0);
    vec3 shading_normal = from_octahedral(code.xy), normal = from_octahedral(code.zw);
    vec3 irradiance;
    float visible;
    if (direct) {
        irradiance = light_irradiance(lights[0], position, normal, shading_normal);
        visible = light_visibility(shadows, lights[0], position, normal);
    } else {
        irradiance = vpl_irradiance(vpls[i], position, normal, shading_normal);
        visible = vpl_visibility(shadows, vpls[i], position, normal);
    }
    pairs = vec4(number, visible, dot(irradiance, vec3(0.2126, 0.7152, 0.0722)), d);
    facing = vec4(normal, 0.0);
}
