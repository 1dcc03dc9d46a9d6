#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds Virga against the references of Mitsuba's own tests of participating media, by those tests' own criterion.

The scenes and references lie in $VIRGA_ASSETS/scenes/mitsuba-media-tests (Mitsuba's data repository). Each scene is rendered at
the size of its reference. Per pixel and channel, a two-sided z-test that both have the same mean; significance 0.01,
Sidak-corrected over the pixels; 99.75 % of the values must pass.

The variance in the test is that of Virga's mean, from 128 replicates, plus that of the reference's: `*_var.exr` is the
variance of one sample (measured: docs/results/peers.md), and a reference is taken to be of REFERENCE_SAMPLES. As in Mitsuba's tests,
a variance of one sample is 1e-4 at least. Scenes without a reference are held against Mitsuba 3 on the spot, with its volpathmis.

Mitsuba 3 itself is held against the references with --mitsuba, in a column of its own: the references are by Mitsuba 2.

--control makes Virga's picture 5 % brighter before the test, which then must fail. Exit code 1 if a scene fails or is refused.
Scenes with a plugin that Virga does not have are left out.
"""

import argparse
import math
import os
import pathlib
import statistics
import subprocess
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from peer_data import bitmap, read_picture

ROOT = pathlib.Path(__file__).resolve().parent.parent
OUT = ROOT / "out/mitsuba-media-tests"
REFERENCE_SAMPLES = 16384
LEAST_VARIANCE = 1e-4  # of one sample
SIGNIFICANCE = 0.01
MUST_PASS = 0.9975
RUNS = 16  # of Virga, each of 8 replicates: a variance from a few replicates would make the z-test a t-test
REPLICATES = 64  # of Mitsuba


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--assets", default=os.environ.get("VIRGA_ASSETS"), help="folder with scenes/ (default: $VIRGA_ASSETS)")
    parser.add_argument("--spp", type=int, default=1024, metavar="N", help="Virga's samples a pixel (default 1024)")
    parser.add_argument("--mitsuba-spp", type=int, default=1024, metavar="N", help="Mitsuba's (default 1024)")
    parser.add_argument("--only", action="append", metavar="NAME", help="scenes whose name contains this; repeatable")
    parser.add_argument("--mitsuba", action="store_true", help="hold Mitsuba 3 against the references, too")
    parser.add_argument("--virga", type=pathlib.Path, default=ROOT / "build/release/virga", help="the program to test")
    parser.add_argument("--control", action="store_true", help="negative control: Virga's pictures are made 5 %% brighter")
    options = parser.parse_args()
    if not options.assets:
        parser.error("name the folder of the scenes by --assets or VIRGA_ASSETS")
    return options


class Refused(Exception):
    """A renderer does not take a scene."""


class Picture:
    """A mean and the variance of that mean, (row, column, channel)."""

    def __init__(self, mean, variance):
        self.mean, self.variance = mean.astype(float), variance.astype(float)


def read_layers(path):
    """Virga's EXR with --layers: the beauty and its variance."""
    parts = dict(bitmap()(str(path)).split())
    beauty, variance = (np.array(parts[name])[..., :3].astype(float) for name in ("<root>", "variance"))
    return beauty, variance


def render_virga(scene, size, seed, options):
    target = OUT / f"{scene.stem}-virga.exr"
    command = [options.virga, "render", scene, "--size", f"{size[0]}x{size[1]}", "--spp", options.spp // RUNS, "--seed", seed,
               "--layers", "-o", target, "-q"]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode != 0:
        first = next((line for line in done.stderr.splitlines() if "error:" in line), f"exit code {done.returncode}")
        raise Refused(first.split("error: ")[-1])
    return read_layers(target)


def run_virga(scene, size, options):
    runs = [render_virga(scene, size, seed, options) for seed in range(1, RUNS + 1)]
    mean = sum(beauty for beauty, _ in runs) / RUNS
    variance = sum(variance for _, variance in runs) / RUNS**2
    return Picture(1.05 * mean if options.control else mean, variance)


def run_mitsuba(scene, size, options, integrator="volpathmis"):
    """Replicates of Mitsuba 3: the variance of their mean."""
    target = OUT / f"{scene.stem}-mitsuba.npy"
    spp = max(1, options.mitsuba_spp // REPLICATES)
    command = [sys.executable, ROOT / "bench/peer_mitsuba.py", scene, target, "scalar_rgb", spp, REPLICATES, 1,
               f"res={size[0]}", f"integrator={integrator}"]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode != 0:
        raise Refused("Mitsuba: " + (done.stderr.strip().splitlines() or ["failed"])[-1])
    pictures = np.load(target).astype(float)
    return Picture(pictures.mean(axis=0), pictures.var(axis=0, ddof=1) / REPLICATES)


def reference_of(scene):
    name = scene.stem.rsplit("_", 1)[0]
    files = [scene.parent / f"refs/{name}_ref_rgb{end}.exr" for end in ("", "_var")]
    if not files[0].exists():
        return None
    mean, sample = (read_picture(file) for file in files)
    return Picture(mean, np.maximum(sample, LEAST_VARIANCE) / REFERENCE_SAMPLES)


def z_test(a, b, floor):
    """Part of the values that pass, relative difference of the means, its standard error, and chi^2 per value."""
    variance = np.maximum(a.variance, floor) + b.variance
    z = (a.mean - b.mean) / np.sqrt(variance)
    alpha = 1 - (1 - SIGNIFICANCE) ** (1 / (z.shape[0] * z.shape[1]))
    limit = statistics.NormalDist().inv_cdf(1 - alpha / 2)
    error = math.sqrt(variance.sum()) / variance.size
    return {"pass": float((np.abs(z) < limit).mean()), "bias": float(a.mean.mean() / b.mean.mean() - 1),
            "bias_error": error / b.mean.mean(), "chi": float((z**2).mean())}


def judged(picture, reference, spp):
    return z_test(picture, reference, LEAST_VARIANCE / spp)


def text_of(result):
    verdict = "passes" if result["pass"] >= MUST_PASS else "FAILS"
    return (f"{100 * result['pass']:7.2f} % {100 * result['bias']:+7.3f} +- {100 * result['bias_error']:.3f} % {result['chi']:8.2f}  {verdict}")


def measure(scene, options):
    """True if the scene passes, None if it needs a plugin that Virga does not have."""
    reference, name = reference_of(scene), "reference"
    try:
        if reference is None:
            size = (48, 48)
            reference, name = run_mitsuba(scene, size, options), "Mitsuba 3"
        size = (reference.mean.shape[1], reference.mean.shape[0])
        if options.mitsuba and name == "reference":
            own = judged(run_mitsuba(scene, size, options, "volpath"), reference, options.mitsuba_spp)
            print(f"{scene.stem:52} {'Mitsuba 3 against the reference':34} {text_of(own)}", flush=True)
        result = judged(run_virga(scene, size, options), reference, options.spp)
    except Refused as problem:
        lacking = "is not supported" in str(problem)
        print(f"{scene.stem:52} {'left out' if lacking else 'refused'}: {problem}", flush=True)
        return None if lacking else False
    print(f"{scene.stem:52} {'Virga against ' + ('the reference' if name == 'reference' else name):34} {text_of(result)}", flush=True)
    return result["pass"] >= MUST_PASS


def main():
    options = parse_arguments()
    folder = pathlib.Path(options.assets) / "scenes/mitsuba-media-tests/tests/scenes/participating_media"
    scenes = [s for s in sorted(folder.glob("test_*.xml")) if not options.only or any(o in s.stem for o in options.only)]
    if not scenes:
        sys.exit(f"error: no scenes in {folder}")
    OUT.mkdir(parents=True, exist_ok=True)
    print(f"{'scene':52} {'':34} {'pass':>9} {'difference of the means':>25} {'chi^2':>6}")
    passed = [measure(scene, options) for scene in scenes]
    tried = [p for p in passed if p is not None]
    print(f"{sum(tried)} of {len(tried)} scenes pass, {len(passed) - len(tried)} left out")
    sys.exit(0 if tried and all(tried) else 1)


if __name__ == "__main__":
    main()
