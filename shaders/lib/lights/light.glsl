// What all kinds of lights share (docs/conventions.md): how a surface receives light. World space.

const float INVERSE_PI = 0.318309886;
const float TINY = 1e-37;  // keeps a squared distance off 0, where position and light coincide and the cosines are 0

// Cosine at the surface towards `to` over |to|; 0 where the light lies behind its face or its shading normal.
float receiving(vec3 to, vec3 normal, vec3 shading_normal) {
    return dot(normal, to) > 0.0 ? max(dot(shading_normal, to), 0.0) : 0.0;
}
