// How much of a light arrives at a fragment, for passes with an input `shadows`: VISIBILITY(light, SPOT) or
// VISIBILITY(light, VPL), in [0, 1], of the fragment's `position` and geometric `normal`; 1 where no maps are connected.
#if HAS_SHADOWS
#include "lib/atlas.glsl"
#include "lib/filter.glsl"
layout(binding = UNIT_SHADOWS) uniform sampler2DArrayShadow shadows;
#define VISIBILITY(light, kind) FILTERED(shadows, light, kind, position, normal)
#else
#define VISIBILITY(light, kind) 1.0
#endif
