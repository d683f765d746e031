// Chooses the layer of a paraboloid map where the vertex shader cannot.
#include "lib/shadows/paraboloid_varyings.glsl"

layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;

in gl_PerVertex {
    vec4 gl_Position;
    float gl_ClipDistance[5];
} gl_in[];
out gl_PerVertex {
    vec4 gl_Position;
    float gl_ClipDistance[5];
};
flat in int layer[];
in Part PART corner[];
out Part PART part;

void main() {
    for (int i = 0; i < 3; ++i) {
        gl_Layer = layer[0];
        gl_Position = gl_in[i].gl_Position;
        for (int side = 0; side < 5; ++side)
            gl_ClipDistance[side] = gl_in[i].gl_ClipDistance[side];
#if SPLIT
        part.ndc = corner[i].ndc;
        part.view = corner[i].view;
        part.edges = corner[i].edges;
        part.chords = corner[i].chords;
        part.plane = corner[i].plane;
        part.gap = corner[i].gap;
#if CUT
        part.cut_places = corner[i].cut_places;
        part.cut_material = corner[i].cut_material;
#endif
#elif STRAIGHT
        part.ndc = corner[i].ndc;
        part.view = corner[i].view;
        part.seen = corner[i].seen;
#else
        part.seen = corner[i].seen;
#endif
        EmitVertex();
    }
    EndPrimitive();
}
