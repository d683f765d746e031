// The pool as a texture (passes/vpl_pool.py): three texels a VPL. Its position, and its luminous power over the pool's; its
// normal, and the square of the clamp distance; its emission, and the power of its group up to it over all of the group's.

// The square of the clamp distance is below 0 for a VPL at infinity (lib/lights/vpl_kernel.glsl).

const int VPLS_PER_ROW = 256;

ivec2 pool_place(int vpl, int texel) {
    return ivec2(3 * (vpl % VPLS_PER_ROW) + texel, vpl / VPLS_PER_ROW);
}
