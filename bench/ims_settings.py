#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What each approximation of `ims` costs in truth, and what each way of sub-sampling costs in time. Writes docs/results/ims.md.

The systematic error is relMSE against an unbiased picture, less the noise of both as their replicates estimate it. It may come out
a little below 0 where there is none; unclamped lights have a variance without bound, and their noise is not well known. Scenes: see bench/scenes.py.
"""

import argparse
import json
import os
import pathlib
import subprocess

from scenes import OUT, ROOT, VIRGA, fail, unpack_scenes

APPROXIMATIONS = [
    ("none: the eye path compensates", ""),
    ("none: sampled compensation", "compensation=sampled"),
    ("none: one level, then unclamped lights", "compensation=sampled levels=1 ending=unclamped"),
    ("one level, then reduced clamping", "compensation=sampled levels=1 ending=reduced"),
    ("one level, then nothing", "compensation=sampled levels=1 ending=nothing"),
    ("two levels, then nothing", "compensation=sampled levels=2 ending=nothing"),
    ("no compensation", "compensation=none"),
    ("transmittance from the local mean", "compensation=sampled transmittance=mean"),
    ("no visibility of virtual lights", "visibility=none"),
    ("fast, every 4th pixel", "mode=fast spacing=4"),
    ("fast, every 8th pixel", "mode=fast spacing=8"),
    ("fast, every 16th pixel", "mode=fast spacing=16"),
]
# V_1 (P_1 + V_2 P_2) = 320 walks for each pixel.
STRATEGIES = [("1 / 64, 4 / 64", "v1=1 p1=64 v2=4 p2=64"), ("4 / 16, 4 / 16", "v1=4 p1=16 v2=4 p2=16"),
              ("16 / 4, 4 / 4", "v1=16 p1=4 v2=4 p2=4"), ("64 / 1, 4 / 1", "v1=64 p1=1 v2=4 p2=1")]

PAGE = """# What the approximations of ims cost

Written by `bench/ims_settings.py`, {size} x {size} pixels, clamping radius {radius} in all. Systematic error: relMSE against an unbiased picture, less the noise
of both; bias: mean signed relative difference.

| approximation | scene | systematic relMSE | bias |
| --- | --- | --- | --- |
{approximations}

Ways to compensate at equal cost, V_1 (P_1 + V_2 P_2) = 320 walks at two levels, then unclamped lights; V_1 / P_1, V_2 / P_2. k = seconds x relMSE of the noise, relative to the
first.

| new vertices / walks for each | scene | k |
| --- | --- | --- |
{strategies}
"""


def render(scene, settings, output, options, stop):
    stats = OUT / "ims.json"
    command = [VIRGA, "render", scene, "-m", "ims", "-o", output, "--size", f"{options.size}x{options.size}", "--stats", stats, "-q"]
    for word in settings.split():
        command += ["--set", f"ims.{word}"]
    done = subprocess.run([str(word) for word in command + stop], capture_output=True, text=True)
    if done.returncode != 0:
        fail(done.stderr.strip())
    return json.loads(stats.read_text())


def compared(image, reference):
    done = subprocess.run([str(VIRGA), "compare", str(image), str(reference), "--json"], capture_output=True, text=True)
    if done.returncode != 0:
        fail(done.stderr.strip())
    return json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default=os.environ.get("VIRGA_BENCH_SCENES"), metavar="DIR", help="default: $VIRGA_BENCH_SCENES")
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--radius", default="0.3")
    parser.add_argument("--seconds", type=float, default=8, help="that each picture may take")
    options = parser.parse_args()
    if not options.scenes or not VIRGA.exists():
        fail("name the folder of the scenes by --scenes or VIRGA_BENCH_SCENES, and build Virga first")
    scratch = unpack_scenes(options.scenes)
    approximations, strategies = [], []
    for name in ("fog", "smoke"):
        scene, reference, image = scratch / f"{name}.xml", OUT / f"ims-reference-{name}.exr", OUT / f"ims-{name}.exr"
        truth = render(scene, "", reference, options, ["--seed", "77", "--time", 3 * options.seconds])["estimated_relmse"]
        for title, settings in APPROXIMATIONS:
            noise = render(scene, f"radius={options.radius} {settings}", image, options, ["--time", options.seconds])["estimated_relmse"]
            result = compared(image, reference)
            approximations.append(f"| {title} | {name} | {result['relmse'] - noise - truth:.4f} | {100 * result['bias']:.1f} % |")
            print(approximations[-1], flush=True)
        first = None
        for title, settings in STRATEGIES:
            common = f"radius={options.radius} compensation=sampled levels=2 paths=1 "
            stats = render(scene, common + settings, image, argparse.Namespace(size=options.size // 4), ["--passes", "16"])
            k = stats["estimated_relmse"] * stats["seconds"]["render_cpu"]
            first = first or k
            strategies.append(f"| {title} | {name} | {k / first:.2f} |")
            print(strategies[-1], flush=True)
    page = PAGE.format(size=options.size, radius=options.radius, approximations="\n".join(approximations),
                       strategies="\n".join(strategies))
    (ROOT / "docs/results/ims.md").write_text(page)


if __name__ == "__main__":
    main()
