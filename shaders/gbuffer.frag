#include "lib/surface.glsl"
#include "lib/gbuffer.glsl"

// A target that nothing reads is left out.
#ifdef TARGET_NORMALS
layout(location = TARGET_NORMALS) out vec4 normals;
#endif
#ifdef TARGET_ALBEDO
layout(location = TARGET_ALBEDO) out vec4 albedo;
#endif

void main() {
    Surface s = surface();
#ifdef TARGET_NORMALS
    normals = encode_normals(s.shading_normal, s.normal);
#endif
#ifdef TARGET_ALBEDO
    albedo = vec4(s.albedo, 1.0);
#endif
    WRITE_DEPTH(frame.near);
}
