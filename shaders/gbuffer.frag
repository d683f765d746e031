#include "lib/surface.glsl"
#include "lib/gbuffer.glsl"

layout(location = 0) out vec4 normals;
layout(location = 1) out vec4 albedo;

void main() {
    Surface s = surface();
    normals = encode_normals(s.shading_normal, s.normal);
    albedo = vec4(s.albedo, 1.0);
    WRITE_DEPTH(frame.near);
}
