"""Virtual point lights (VPLs): casting, resampling, reuse over frames, interleaving, and sums by rays. No OpenGL."""
