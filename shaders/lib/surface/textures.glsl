// The textures of materials: where they are read, and what they say. A slot is one of SLOTS in
// deferred_ir/scene/surfaces/materials.py; its texture is a layer of the array that the draw call binds.

#if HAS_UVS
in vec2 texture_uv;
#endif
#if HAS_SECOND_UVS
in vec2 second_texture_uv;
#endif

const int BASE_COLOR = 0, EMISSION = 1, METALLIC_ROUGHNESS = 2, NORMAL = 3;

#define ANY_TEXTURES (BASE_COLOR_TEXTURES || EMISSION_TEXTURES || METALLIC_ROUGHNESS_TEXTURES || NORMAL_TEXTURES)
#if ANY_TEXTURES
layout(std430, binding = 4) readonly buffer Layers { vec4 material_layers[]; };  // by slot; below 0: no texture
#if !PLAIN_UVS
struct UvTransform {
    vec4 u;  // row of an affine map; the set of coordinates
    vec4 v;
};
layout(std430, binding = 5) readonly buffer Transforms { UvTransform uv_transforms[]; };
#endif

// Where a material's texture is read, and its layer.
vec3 texture_place(int material, int slot) {
#if HAS_UVS
    vec2 uv = texture_uv;
#else
    vec2 uv = vec2(0.0);
#endif
#if !PLAIN_UVS
    UvTransform t = uv_transforms[material * 4 + slot];
#if HAS_SECOND_UVS
    if (t.u.w > 0.0) uv = second_texture_uv;
#endif
    uv = vec2(dot(t.u.xyz, vec3(uv, 1.0)), dot(t.v.xyz, vec3(uv, 1.0)));
#endif
    return vec3(uv, material_layers[material][slot]);
}
#endif

#if BASE_COLOR_TEXTURES
layout(binding = 15) uniform sampler2DArray base_color_texture;
#endif
#if EMISSION_TEXTURES
layout(binding = 14) uniform sampler2DArray emission_texture;
#endif
#if METALLIC_ROUGHNESS_TEXTURES
layout(binding = 13) uniform sampler2DArray metallic_roughness_texture;
#endif
#if NORMAL_TEXTURES
layout(binding = 12) uniform sampler2DArray normal_texture;
#endif
