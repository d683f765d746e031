// Shows a texture of any format in the window: the picture as it is, and what passes wrote so that it can be seen.
// KIND: 0 colours in 8 bits, 1 linear colours, 2 reversed depth, 3 whole numbers. LAYERS: 1 for an array.

#if KIND == 3
#define SAMPLER usampler2D
#elif LAYERS
#define SAMPLER sampler2DArray
#else
#define SAMPLER sampler2D
#endif

layout(binding = 0) uniform SAMPLER shown;
uniform ivec2 corner;    // of the target in the window
uniform ivec2 target;    // its size, pixels
uniform ivec2 source;    // lower left texel
uniform ivec2 extent;    // texels shown
uniform int layer;
uniform float gain;
uniform int depth_linear;  // show the distance, not its inverse
uniform int split;       // pixels from the left that are left out
out vec4 color;

vec3 encoded(vec3 linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308)));
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy) - corner;
    if (at.x < split) discard;
    ivec2 texel = source + at * extent / target;
#if KIND == 3
    uint n = texelFetch(shown, texel, 0).r * 2654435769u;  // neighbouring numbers get colours far apart (Knuth 6.4)
    color = vec4(n == 0u ? vec3(0.0) : vec3(n >> 24, n >> 16 & 255u, n >> 8 & 255u) / 255.0, 1.0);
#else
#if LAYERS
    vec4 value = texelFetch(shown, ivec3(texel, layer), 0);
#else
    vec4 value = texelFetch(shown, texel, 0);
#endif
#if KIND == 0
    color = vec4(value.rgb, 1.0);
#elif KIND == 1
    color = vec4(encoded(value.rgb * gain), 1.0);
#else
    // value.r is near / distance, near a fraction of the scene's diagonal. Either what is near is bright, or what is far.
    float near = value.r / NEAR_FRACTION;
    float grey = depth_linear == 1 ? gain / max(near, 1e-6) : 0.1 * gain * near;
    color = vec4(vec3(value.r > 0.0 ? grey : 0.0), 1.0);
#endif
#endif
}
