# SPDX-License-Identifier: Apache-2.0
"""SCENE TARGET.npy VARIANT SPP REPLICATES [name=value ...]: pictures by Mitsuba 3 with the seeds 1, 2, ... Prints the seconds of rendering."""

import sys
import time

import mitsuba as mi
import numpy as np


def main():
    scene, target, variant, spp, replicates = sys.argv[1:6]
    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)
    loaded = mi.load_file(scene, **dict(pair.split("=", 1) for pair in sys.argv[6:]))
    start = time.monotonic()
    pictures = [np.array(mi.render(loaded, spp=int(spp), seed=seed))[..., :3] for seed in range(1, int(replicates) + 1)]
    np.save(target, np.array(pictures))
    print(time.monotonic() - start)


main()
