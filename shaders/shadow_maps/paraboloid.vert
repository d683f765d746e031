// The scene as a light's paraboloid map sees it: triangles that are small in the map go there as they are, others to
// paraboloid.tesc.
#if LAYER_FROM_VERTEX && !SPLIT
#extension GL_ARB_shader_viewport_layer_array : require
#endif
#include "lib/shadows/projection.glsl"
#if SPLIT
flat out int light_of_corner;
out vec3 corner;  // from the light
#else
#include "lib/shadows/paraboloid.glsl"
#endif

in int light_index;  // in its block; one an instance
in vec3 position;

void main() {
    Light light = lights[light_index];
    vec3 d = position - map_origin(light);
#if SPLIT
    light_of_corner = light_index;
    corner = d;
#else
    part.seen = d;
    vec2 map_ndc = place(light, d);
#if STRAIGHT
    part.ndc = map_ndc;
    part.light = light_index;
#endif
#endif
}
