// Shadow maps: where a light sees a point, and how far. Writer and readers share it. Planar maps over the light's cone,
// reversed depth (lib/depth.glsl).
#include "lib/frame.glsl"
#include "lib/light.glsl"

// Clip position in the light's map.
vec4 light_clip(Light light, vec3 position) {
    vec3 d = position - light.position;
    return clip_position(vec2(dot(d, light.x_axis), dot(d, light.y_axis)), frame.near, dot(d, light.z_axis));
}

// xy: NDC in the light's map; z: depth to compare. The point is lifted off its face by `offset` texels of a map of `size`
// texels, because a texel holds one depth for all of its footprint; no world units are involved.
vec3 shadow_lookup(Light light, vec3 position, vec3 normal, float size, float offset) {
    vec3 from = position - light.position;
    vec3 d = from + normal * (2.0 * offset / size * light.tan_half * dot(light.z_axis, from));
    float w = max(dot(d, light.z_axis), frame.near);  // behind the near plane nothing was drawn, and cosines are 0
    return vec3(dot(d, light.x_axis), dot(d, light.y_axis), frame.near) / w;
}

// Map coordinates in [0, 1], kept half a texel inside, so that a 2x2 comparison never leaves the map or tile.
vec2 map_uv(vec2 ndc, float size) {
    return clamp(ndc * 0.5 + 0.5, 0.5 / size, 1.0 - 0.5 / size);
}
