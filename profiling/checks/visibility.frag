// One light a pixel, drawn by a hash: what the shadow maps say of the pair, and how much light depends on it.
#include "lib/camera/frame.glsl"
#include "lib/surface/gbuffer.glsl"
#include "lib/lights/light.glsl"
#include "lib/shadows/visibility.glsl"

layout(binding = UNIT_DEPTH) uniform sampler2D depth;
layout(binding = UNIT_NORMALS) uniform sampler2D normals;
uniform bool spotlight;  // light 0 for all pixels; else one of the VPLs behind it
uniform int start;       // number of this block's first light
uniform int total;       // lights in all blocks
uniform uint seed;

in vec2 ndc;
layout(location = 0) out vec4 pairs;   // the light's number, visibility, luminance of the unshadowed irradiance, depth
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
    int number = spotlight ? 0 : 1 + int(hash(uvec3(pixel, seed)) % uint(total - 1));
    int i = number - start;
    if (d <= 0.0 || i < 0 || i >= LIGHTS_PER_BLOCK) discard;  // background, or another block's draw
    vec3 position = unproject(ndc, d);
    vec4 code = texelFetch(normals, pixel, 0);
    vec3 shading_normal = from_octahedral(code.xy), normal = from_octahedral(code.zw);
    vec3 irradiance;
    float visible;
    if (spotlight) {
        irradiance = spot_irradiance(lights[0], position, normal, shading_normal);
        visible = SPOT_VISIBILITY(lights[0]);
    } else {
        irradiance = vpl_irradiance(lights[i], position, normal, shading_normal);
        visible = VPL_VISIBILITY(lights[i]);
    }
    pairs = vec4(number, visible, dot(irradiance, vec3(0.2126, 0.7152, 0.0722)), d);
    facing = vec4(normal, 0.0);
}
