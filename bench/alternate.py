# SPDX-License-Identifier: Apache-2.0
"""ROUNDS SCENE BINARY BINARY... -- RENDER-OPTIONS: CPU time of rendering, relative to the first binary's.

The binaries take turns, so that what else the machine does hits all alike.
"""

import json
import subprocess
import sys
import tempfile

import numpy as np


def render_seconds(binary, scene, options, folder):
    subprocess.run([binary, "render", scene, "-q", "-o", f"{folder}/x.exr", "--stats", f"{folder}/x.json", *options], check=True)
    with open(f"{folder}/x.json") as stats:
        return json.load(stats)["seconds"]["render_cpu"]


def main():
    end = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    rounds, scene, binaries, options = int(sys.argv[1]), sys.argv[2], sys.argv[3:end], sys.argv[end + 1 :]
    seconds = np.zeros((rounds, len(binaries)))
    with tempfile.TemporaryDirectory() as folder:
        for i in range(rounds):
            for j in range(len(binaries))[:: 1 if i % 2 == 0 else -1]:
                seconds[i, j] = render_seconds(binaries[j], scene, options, folder)
    ratios = seconds / seconds[:, :1]
    for j, binary in enumerate(binaries):
        low, median, high = np.quantile(ratios[:, j], [0.25, 0.5, 0.75])
        least = seconds[:, j].min()
        print(f"{binary}: ratio {median:.3f} (quartiles {low:.3f} to {high:.3f}), least {least:.3f} s, ratio of the least {least / seconds[:, 0].min():.3f}")


if __name__ == "__main__":
    main()
