# SPDX-License-Identifier: Apache-2.0
"""SCENE TARGET.npy VARIANT SPP REPLICATES FIRST_SEED [name=value ...]: pictures by Mitsuba 3 with the seeds from the first on. Prints the
CPU seconds of rendering."""

import sys
import time

import mitsuba as mi
import numpy as np


def main():
    scene, target, variant = sys.argv[1:4]
    spp, replicates, first = (int(word) for word in sys.argv[4:7])
    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)
    loaded = mi.load_file(scene, **dict(pair.split("=", 1) for pair in sys.argv[7:]))
    start = time.process_time()
    pictures = [np.array(mi.render(loaded, spp=spp, seed=seed))[..., :3] for seed in range(first, first + replicates)]
    np.save(target, np.array(pictures))
    print(time.process_time() - start)


main()
