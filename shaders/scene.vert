// The scene seen by the camera.
#include "lib/camera/frame.glsl"

in vec3 position;
#if HAS_NORMALS
in vec3 normal;
out vec3 world_normal;
#endif
#if HAS_COLORS
in vec3 color;
out vec3 vertex_color;
#endif
#if HAS_UVS
in vec2 uv;
out vec2 texture_uv;
#endif
#if HAS_SECOND_UVS
in vec2 second_uv;
out vec2 second_texture_uv;
#endif
#if HAS_TANGENTS
in vec4 tangent;
out vec4 world_tangent;
#endif
out vec3 world_position;
invariant gl_Position;  // a prepass and the passes that test against it must agree to the last bit

void main() {
    world_position = position;
#if HAS_NORMALS
    world_normal = normal;
#endif
#if HAS_COLORS
    vertex_color = color;
#endif
#if HAS_UVS
    texture_uv = uv;
#endif
#if HAS_SECOND_UVS
    second_texture_uv = second_uv;
#endif
#if HAS_TANGENTS
    world_tangent = tangent;
#endif
    gl_Position = project(position);
}
