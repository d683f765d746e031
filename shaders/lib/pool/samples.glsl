// Samples, the pixels that ask for indirect light (deferred_ir/pool/layout.py): their surfaces.
#include "lib/surface/gbuffer.glsl"

struct Sample {
    vec3 position;
    float depth;  // of view; 0 where there is no sample, or nothing was seen
    vec3 normal;  // geometric
    vec3 shading_normal;
};

Sample read_sample(sampler2D positions, sampler2D normals, ivec2 place) {
    Sample s;
    vec4 at = texelFetch(positions, place, 0);
    s.position = at.xyz;
    s.depth = at.w;
    decode_normals(texelFetch(normals, place, 0), s.shading_normal, s.normal);
    return s;
}

