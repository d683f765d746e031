// A compute shader that runs once for each texel of a rectangle (Program.dispatch in deferred_ir/gl/shaders.py).

layout(local_size_x = WORK_GROUP, local_size_y = WORK_GROUP) in;
uniform ivec4 rectangle;  // x, y, width, height

ivec2 find_texel() {
    return rectangle.xy + ivec2(gl_GlobalInvocationID.xy);
}

// The groups at two of its edges reach beyond it.
bool is_inside(ivec2 texel) {
    return all(lessThan(texel, rectangle.xy + rectangle.zw));
}
