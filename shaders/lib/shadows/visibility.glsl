// How much of a light arrives at a fragment, for passes with an input `shadows`: SPOT_VISIBILITY(light) or
// VPL_VISIBILITY(light), in [0, 1], of the fragment's `position` and geometric `normal`; 1 where no maps are connected.
// Soft shadows need an input `blockers` as well, the same maps, and DISC, which tells whether the spotlight is a disc.
#if HAS_SHADOWS
#include "lib/shadows/atlas.glsl"
#include "lib/shadows/soft.glsl"
layout(binding = UNIT_SHADOWS) uniform sampler2DArrayShadow shadows;
#define VPL_VISIBILITY(light) vpl_visibility(shadows, light, position, normal)
#define SPOT_VISIBILITY(light) spot_visibility(shadows, light, position, normal)
#ifdef UNIT_BLOCKERS
#if SOFT && DISC
layout(binding = UNIT_BLOCKERS) uniform sampler2DArray blockers;
#undef SPOT_VISIBILITY
#define SPOT_VISIBILITY(light) spot_visibility(shadows, blockers, light, position, normal)
#endif
#endif
#else
#define VPL_VISIBILITY(light) 1.0
#define SPOT_VISIBILITY(light) 1.0
#endif
