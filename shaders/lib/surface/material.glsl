// Numbers of materials (deferred_ir/frame/uploads/material_records.py), and the gloss that follows from them.
#include "lib/surface/brdf.glsl"

struct MaterialNumbers {
    float metallic;
    float roughness;
    float specular;
    float normal_scale;
    vec3 head_on;  // reflectance of its coat head-on, before `specular`
    float unused;
};

layout(std430, binding = 3) readonly buffer Numbers { MaterialNumbers material_numbers[]; };

const float MIN_ALPHA = 1e-3;

// What gloss follows from, and the albedo, which is that of the diffuse part. metallic, roughness: as textures say.
Gloss make_gloss(int material, vec3 base_color, float metallic, float roughness, out vec3 albedo) {
    float weight = material_numbers[material].specular, coat = (1.0 - metallic) * weight;
    vec3 head_on = material_numbers[material].head_on;
    albedo = (1.0 - metallic) * base_color;
    Gloss gloss;
    gloss.f0 = coat * head_on + metallic * base_color;
    gloss.f90 = coat + metallic;
    gloss.taken = weight * vec2(max(max(head_on.r, head_on.g), head_on.b), 1.0);
    gloss.alpha = max(roughness * roughness, MIN_ALPHA);
    return gloss;
}
