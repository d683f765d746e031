"""A peer for tests, in a process of its own or not: our path tracer, which prints, and fails where it is told to."""

import os
import sys
import time

import numpy as np

from deferred_ir.base.errors import SettingError
from deferred_ir.profiling.peers.peer import Rendered
from deferred_ir.truth.reference import trace_reference

INSTALL = "fake-renderer"
ABORTS, RAISES, HANGS = 1001, 1002, 1003
"""Numbers of paths for which it does."""


def available():
    return None


class Peer:
    about = "Fake 1.0"

    def __init__(self, scene, size, bounces):
        if scene.spotlight.radius > 0:
            raise SettingError("fake: has no such light")
        self.scene, self.size, self.bounces = scene, size, bounces

    def render(self, spp, seed):
        print("fake: chatter")
        print("fake: more of it", file=sys.stderr)
        if spp == ABORTS:
            os.abort()
        if spp == RAISES:
            raise RuntimeError("out of\nluck")
        if spp == HANGS:
            time.sleep(600)
        image = trace_reference(self.scene, self.size, spp=spp, bounces=self.bounces, seed=seed + 1)
        return Rendered(image.radiance.astype(np.float32), 10.0 * spp)
