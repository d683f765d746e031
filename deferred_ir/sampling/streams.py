"""Every stream of random numbers that a frame draws from, by what it decides.

All are keyed by the frame's seed, so that a frame can be drawn again. NumPy pads short keys with zeros: [seed] and
[seed, 0] are the same stream.
"""

from __future__ import annotations

import numpy as np

Stream = np.random.Generator


def frame_seed(seed: int, frame: int) -> int:
    """Return the seed of frame number `frame` among those averaged under `seed`: `seed` itself, then 31-bit numbers.

    These are mixed from both arguments, so that frames under one seed repeat none of those under another.
    """
    return seed if frame == 0 else int(np.random.SeedSequence([seed, frame]).generate_state(1)[0] >> 1)


def light_disc(seed: int) -> Stream:
    """Return the stream that shuffles where on the light's disc VPL paths start."""
    return np.random.default_rng([seed, 0])


def dealing(seed: int) -> Stream:
    """Return the stream that deals rays to lights."""
    return np.random.default_rng([seed, 0, 3])


def light_points(seed: int) -> int:
    """Return the pattern's seed for points that stand for lights."""
    return seed + 15485863


def light_disc_pattern(seed: int) -> int:
    """Return the pattern's seed for points on the light's disc; that of the directions is `seed` itself."""
    return seed + 104729


def bounce(seed: int, number: int) -> Stream:
    """Return the stream that chooses and shuffles the paths of VPL bounce `number`, from 1."""
    return np.random.default_rng([seed, number])


def bounce_pattern(seed: int, number: int) -> int:
    """Return the pattern's seed for the directions of VPL bounce `number`, from 1."""
    return seed + number * 7919


def resampling(seed: int) -> Stream:
    """Return the stream that chooses VPLs among candidates."""
    return np.random.default_rng([seed, 65537])


def resampling_pattern(seed: int) -> int:
    """Return the pattern's seed for the pixels that say which candidates matter."""
    return seed + 65537


def sample_grid(seed: int) -> Stream:
    """Return the stream that places the grid of pixels that ask for indirect light."""
    return np.random.default_rng([seed, 0, 2])


def pool_groups(seed: int) -> Stream:
    """Return the stream that chooses which VPL of the pool stands for each group."""
    return np.random.default_rng([seed, 1, 2])


def pool_probes(seed: int) -> Stream:
    """Return the stream that places the samples at which an image's tiles score VPLs."""
    return np.random.default_rng([seed, 2, 2])


def residual_blocks(seed: int) -> Stream:
    """Return the stream that deals the rays of the clamping residual to the pixels of a block."""
    return np.random.default_rng(seed)


def residual_rays(seed: int, task: int) -> Stream:
    """Return the stream of the rays of the clamping residual in one task."""
    return np.random.default_rng([seed, task])


def shadow_blocks(seed: int) -> Stream:
    """Return the stream that deals the rays to a disc light to the pixels of a block."""
    return np.random.default_rng([seed, 0, 1])


def shadow_rays(seed: int, task: int) -> Stream:
    """Return the stream of the rays to a disc light in one task."""
    return np.random.default_rng([seed, 1 + task, 1])


def reflections(seed: int, task: int) -> Stream:
    """Return the stream of the rays of reflections in one task."""
    return np.random.default_rng([seed, task, 4])


def incremental_vpls(seed: int) -> Stream:
    """Return the stream that places the sites of VPLs that outlive their frame."""
    return np.random.default_rng(seed)


def lost_light(seed: int) -> Stream:
    """Return the stream of the rays that estimate what clamp and cone lose."""
    return np.random.default_rng(seed)
