// The parts of a triangle, each corner where its direction lies in the map.
#if LAYER_FROM_VERTEX
#extension GL_ARB_shader_viewport_layer_array : require
#endif
#include "lib/paraboloid.glsl"

layout(triangles, equal_spacing, ccw) in;

flat in int light_of_patch[];
in vec3 from_light[];
patch in mat3 edges;
patch in vec4 plane;

void main() {
    part.light = light_of_patch[0];
    part.edges = edges;
    part.plane = plane;
    part.ndc = place(lights[light_of_patch[0]],
                     from_light[0] * gl_TessCoord.x + from_light[1] * gl_TessCoord.y + from_light[2] * gl_TessCoord.z);
}
