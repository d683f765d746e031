// What a fragment of the scene is: position, normals and reflectance (docs/conventions.md, Materials and Surfaces).
// World space. Buffers and defines come from deferred_ir/frame/uploads/scene_buffers.py.
#include "lib/camera/frame.glsl"
#include "lib/surface/textures.glsl"
#if GLOSSY || NORMAL_TEXTURES
#include "lib/surface/material.glsl"
#endif
#if CUT
#include "lib/surface/coverage.glsl"
#endif

layout(std430, binding = 0) readonly buffer Faces { vec4 faces[]; };          // geometric normal, material's number
layout(std430, binding = 1) readonly buffer Materials { vec4 materials[]; };  // base colour, linear RGB
uniform int first_face;  // of this draw call: gl_PrimitiveID starts at 0 in each

#if EMITS
layout(std430, binding = 2) readonly buffer Emissions { vec4 emissions[]; };  // linear RGB, 1: from both sides
#endif

in vec3 world_position;
#if HAS_NORMALS
in vec3 world_normal;
#endif
#if HAS_COLORS
in vec3 vertex_color;
#endif
#if HAS_TANGENTS
in vec4 world_tangent;
#endif

struct Surface {
    vec3 position;
    vec3 normal;          // geometric, turned to the viewer
    vec3 shading_normal;  // in its hemisphere
    vec3 albedo;          // base colour
    int material;
#if GLOSSY
    float metallic;
    float roughness;
#endif
};

int face_number() {
    return first_face + gl_PrimitiveID;
}

#if HAS_TANGENTS && NORMAL_TEXTURES
// The normal turned as the material's normal map says; `normal` is unit, on the side of the file's normals.
vec3 bent_normal(int material, vec3 normal) {
    vec3 place = texture_place(material, NORMAL);
    if (place.z < 0.0 || world_tangent.xyz == vec3(0.0)) return normal;
    vec3 map = texture(normal_texture, place).xyz * 2.0 - 1.0;
    map.xy *= material_numbers[material].normal_scale;
    vec3 across = cross(normal, world_tangent.xyz) * (world_tangent.w < 0.0 ? -1.0 : 1.0);
    vec3 bent = world_tangent.xyz * map.x + across * map.y + normal * map.z;
    float square = dot(bent, bent);
    return square > 1e-12 ? bent * inversesqrt(square) : normal;
}
#endif

#if CUT
// Whether the surface is not there.
bool is_cut() {
    int material = int(faces[face_number()].w);
#if BASE_COLOR_TEXTURES
    return is_cut(material, texture_place(material, BASE_COLOR).xy);
#else
    return is_cut(material, vec2(0.0));
#endif
}
#endif

Surface surface() {
    vec4 face = faces[face_number()];
    Surface s;
#if ONE_MATERIAL
    s.material = 0;
#else
    s.material = int(face.w);
#endif
    s.position = world_position;
    s.normal = dot(face.xyz, frame.camera - world_position) < 0.0 ? -face.xyz : face.xyz;
    s.shading_normal = s.normal;
#if HAS_NORMALS || HAS_TANGENTS && NORMAL_TEXTURES
    vec3 n = face.xyz;
#if HAS_NORMALS
    float size = dot(world_normal, world_normal);
    if (size > 1e-12) n = world_normal * inversesqrt(size);  // zero where the file has no normal: the face's counts
#endif
#if HAS_TANGENTS && NORMAL_TEXTURES
    n = bent_normal(s.material, n);
#endif
    s.shading_normal = dot(n, s.normal) < 0.0 ? -n : n;
#endif
    s.albedo = materials[s.material].rgb;
#if HAS_COLORS
    s.albedo *= vertex_color;
#endif
#if BASE_COLOR_TEXTURES
    vec3 place = texture_place(s.material, BASE_COLOR);
#if !ALL_TEXTURED
    if (place.z >= 0.0)
#endif
        s.albedo *= texture(base_color_texture, place).rgb;
#endif
#if GLOSSY
    s.metallic = material_numbers[s.material].metallic;
    s.roughness = material_numbers[s.material].roughness;
#if METALLIC_ROUGHNESS_TEXTURES
    vec3 numbers_place = texture_place(s.material, METALLIC_ROUGHNESS);
    if (numbers_place.z >= 0.0) {
        vec3 found = texture(metallic_roughness_texture, numbers_place).rgb;
        s.roughness *= found.g;
        s.metallic *= found.b;
    }
#endif
#endif
    return s;
}

// What the surface emits to the camera, as radiance.
vec3 emitted() {
#if EMITS
    vec4 face = faces[face_number()], emission = emissions[int(face.w)];
    if (emission.w == 0.0 && dot(face.xyz, frame.camera - world_position) < 0.0) return vec3(0.0);
#if EMISSION_TEXTURES
    vec3 place = texture_place(int(face.w), EMISSION);
    if (place.z >= 0.0) emission.rgb *= texture(emission_texture, place).rgb;
#endif
    return emission.rgb;
#else
    return vec3(0.0);
#endif
}
