#include "lib/surface/surface.glsl"
#include "lib/surface/gbuffer.glsl"

// A target that nothing reads is left out.
#ifdef TARGET_NORMALS
layout(location = TARGET_NORMALS) out vec4 normals;
#endif
#ifdef TARGET_ALBEDO
layout(location = TARGET_ALBEDO) out vec4 albedo;
#endif

#ifdef TARGET_EMISSION
layout(location = TARGET_EMISSION) out vec4 emission;
#endif

#ifdef TARGET_MATERIAL
layout(location = TARGET_MATERIAL) out vec4 material;
#endif

void main() {
#if CUT
    if (is_cut()) discard;
#endif
    Surface s = surface();
#ifdef TARGET_NORMALS
    normals = encode_normals(s.shading_normal, s.normal);
#endif
#ifdef TARGET_ALBEDO
    albedo = vec4(min(s.albedo, 65504.0), 1.0);  // half floats end there; infinity times a light of 0 is no number
#endif
#ifdef TARGET_EMISSION
    emission = vec4(emitted(), 1.0);
#endif
#ifdef TARGET_MATERIAL
    material = encode_material(s.roughness, s.metallic, s.material);
#endif
    WRITE_DEPTH(frame.near);
}
