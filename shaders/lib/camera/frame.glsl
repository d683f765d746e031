// The frame: deferred_ir/frame/frame.py writes it. World space; NDC x right, y up, in [-1, 1].
#include "lib/camera/depth.glsl"

layout(std140, binding = 0) uniform FrameBlock {
    vec3 camera;
    float near;   // near plane of the camera and of all lights
    vec4 ray[3];  // the point at view depth 1 behind NDC (x, y) is camera + ray[0] x + ray[1] y + ray[2]
    vec4 clip[3]; // rows that take a point relative to the camera to clip x, clip y and view depth
} frame;

vec4 project(vec3 position) {
    vec3 p = position - frame.camera;
    return clip_position(vec2(dot(frame.clip[0].xyz, p), dot(frame.clip[1].xyz, p)), frame.near, dot(frame.clip[2].xyz, p));
}

// World position behind NDC (x, y) at a reversed depth above 0, which the background, at 0, is not asked for.
vec3 unproject(vec2 ndc, float depth) {
    return frame.camera + (frame.ray[0].xyz * ndc.x + frame.ray[1].xyz * ndc.y + frame.ray[2].xyz) * (frame.near / depth);
}
