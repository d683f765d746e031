// Encoding of the G-buffer's material, in four 16-bit channels, and of its normals: two unit vectors as octahedral maps, in the four 16-bit channels of one texel
// (Cigolle et al. 2014).

const float MOST = 65535.0;  // of 16 bits

vec4 encode_material(float roughness, float metallic, int number) {
    return vec4(roughness, metallic, vec2(number & 65535, number >> 16) / MOST);
}

int material_number(vec4 code) {
    ivec2 parts = ivec2(code.zw * MOST + 0.5);
    return parts.x + (parts.y << 16);
}

vec2 octahedral(vec3 n) {
    n /= abs(n.x) + abs(n.y) + abs(n.z);  // a unit vector: the sum is at least 1
    vec2 folded = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
    return (n.z < 0.0 ? folded : n.xy) * 0.5 + 0.5;
}

// Along the normal, of any length.
vec3 octahedron(vec2 code) {
    vec2 p = code * 2.0 - 1.0;
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    float fold = max(-n.z, 0.0);
    n.xy -= vec2(n.x < 0.0 ? -fold : fold, n.y < 0.0 ? -fold : fold);
    return n;
}

vec3 from_octahedral(vec2 code) {
    return normalize(octahedron(code));
}

#ifndef SMOOTH  // 0: the scene has no shading normals, so both are one
#define SMOOTH 1
#endif

// Decodes a texel of `normals`.
void decode_normals(vec4 code, out vec3 shading, out vec3 geometric) {
    geometric = from_octahedral(code.zw);
#if SMOOTH
    shading = from_octahedral(code.xy);
#else
    shading = geometric;
#endif
}

vec4 encode_normals(vec3 shading, vec3 geometric) {
    return vec4(octahedral(shading), octahedral(geometric));
}

// The code of a normal, rounded to 12 bits.
vec2 round_normal(vec2 code) {
    return floor(code * 4095.0 + 0.5) * (1.0 / 4095.0);
}
