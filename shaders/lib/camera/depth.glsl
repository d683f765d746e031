// Reversed depth with the far plane at infinity: depth = near / w, w the distance along the view axis; 1 at the near
// plane, 0 infinitely far. Floats are densest near 0, where a projection packs the distance, so the two cancel.

// Clip position of a point with clip x and y `xy` at view distance w.
vec4 clip_position(vec2 xy, float near, float w) {
#if CLIP_CONTROL
    return vec4(xy, near, w);
#else
    return vec4(xy, 2.0 * near - w, w);  // clip z runs from -w to w; fragments write their depth themselves
#endif
}

// In fragment shaders; gl_FragCoord.w is 1/w.
#if CLIP_CONTROL
#define WRITE_DEPTH(near)
#else
#define WRITE_DEPTH(near) gl_FragDepth = (near) * gl_FragCoord.w
#endif
