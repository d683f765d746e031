// What a fragment of the scene is: position, normals and reflectance (docs/conventions.md, Materials and Surfaces).
// World space. Buffers and defines come from deferred_ir/frame/scene_buffers.py.
#include "lib/camera/frame.glsl"

layout(std430, binding = 0) readonly buffer Faces { vec4 faces[]; };          // geometric normal, material's number
layout(std430, binding = 1) readonly buffer Materials { vec4 materials[]; };  // albedo, linear RGB
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
#if HAS_UVS
in vec2 texture_uv;
layout(binding = 15) uniform sampler2D albedo_texture;
#if !ALL_TEXTURED
uniform bool textured;
#endif
#if EMITS
layout(binding = 14) uniform sampler2D emission_texture;
uniform bool emission_textured;
#endif
#endif

struct Surface {
    vec3 position;
    vec3 normal;          // geometric, turned to the viewer
    vec3 shading_normal;  // in its hemisphere
    vec3 albedo;
};

int face_number() {
    return first_face + gl_PrimitiveID;
}

Surface surface() {
    vec4 face = faces[face_number()];
    Surface s;
    s.position = world_position;
    s.normal = dot(face.xyz, frame.camera - world_position) < 0.0 ? -face.xyz : face.xyz;
    s.shading_normal = s.normal;
#if HAS_NORMALS
    float size = dot(world_normal, world_normal);
    if (size > 1e-12) {  // zero where the file has no normal: the face's counts
        vec3 n = world_normal * inversesqrt(size);
        s.shading_normal = dot(n, s.normal) < 0.0 ? -n : n;
    }
#endif
#if ONE_MATERIAL
    s.albedo = materials[0].rgb;
#else
    s.albedo = materials[int(face.w)].rgb;
#endif
#if HAS_COLORS
    s.albedo *= vertex_color;
#endif
#if HAS_UVS
#if !ALL_TEXTURED
    if (textured)
#endif
        s.albedo *= texture(albedo_texture, texture_uv).rgb;
#endif
    return s;
}

// What the surface emits to the camera, as radiance.
vec3 emitted() {
#if EMITS
    vec4 face = faces[face_number()], emission = emissions[int(face.w)];
    if (emission.w == 0.0 && dot(face.xyz, frame.camera - world_position) < 0.0) return vec3(0.0);
#if HAS_UVS
    if (emission_textured) emission.rgb *= texture(emission_texture, texture_uv).rgb;
#endif
    return emission.rgb;
#else
    return vec3(0.0);
#endif
}
