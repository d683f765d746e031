// Chooses the layer where the vertex shader cannot.
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;

in gl_PerVertex {
    vec4 gl_Position;
    float gl_ClipDistance[4];
} gl_in[];
out gl_PerVertex {
    vec4 gl_Position;
    float gl_ClipDistance[4];
};
flat in int layer[];
#if CUT
in vec3 corner_of_vertex[];
out vec3 corner;
#endif

void main() {
    for (int i = 0; i < 3; ++i) {
        gl_Layer = layer[0];
        gl_Position = gl_in[i].gl_Position;
        for (int side = 0; side < 4; ++side)
            gl_ClipDistance[side] = gl_in[i].gl_ClipDistance[side];
#if CUT
        corner = corner_of_vertex[i];
#endif
        EmitVertex();
    }
    EndPrimitive();
}
