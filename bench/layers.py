#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the tests that hold each layer of `path` against the brute-force tracer with more samples than they take by default, and writes
docs/results/layers.md: how far off each layer of each scene is, and how well that is known.

--effort N (default 6) makes N times as many passes and samples, and the tests ask for precisions sqrt(N) times finer: the environment
variable VIRGA_LAYER_EFFORT. --log FILE reads what such a run printed instead of running the tests; repeatable, and of a test that is
in several of them the last one counts. Exit code 1 if a test fails, or none was found.
"""

import argparse
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
TESTS = ROOT / "build/release/tests/test_methods"
PAGE = ROOT / "docs/results/layers.md"
LAYERS = ["emission", "direct_surface", "direct_media", "caustic_surface", "caustic_media", "surface_to_surface", "media_to_surface",
          "surface_to_media", "media_to_media"]
FILES = {"Layers": "layers_test.cpp", "LayersOfMedia": "layers_media_test.cpp", "LayersOfMaterials": "layers_materials_test.cpp"}

INTRODUCTION = """# Layers of `path` against brute force

This page is written by `bench/layers.py`. Each layer of `path` is compared to a tracer that shares no code with it, meets lights by chance alone
and knows neither connections nor weights ([brute_force.h](../../tests/methods/brute_force.h)); in the scenes named after lights, to `path` itself with
a small or far lamp in the light's place. `VIRGA_LAYER_EFFORT={effort:g}` of [layers_checks.h](../../tests/methods/layers_checks.h): {effort:g} times as many passes and
samples as the tests take by default, at least.

A number is how far the mean over the picture is off, and its standard error, both in % of the layer's mean: {cells} of them. {summary}
"""


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--effort", type=float, default=6, metavar="N", help="times the tests' passes and samples (default 6)")
    parser.add_argument("--log", type=pathlib.Path, action="append", metavar="FILE", help="output of such a run; repeatable")
    return parser.parse_args()


def run_tests(effort):
    command = [TESTS, "--gtest_filter=" + ":".join(f"{suite}.*" for suite in FILES)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ | {"VIRGA_LAYER_EFFORT": str(effort)})
    text = ""
    for line in process.stdout:
        print(line, end="", flush=True)
        text += line
    process.wait()
    return text


def read(text):
    """{(suite, test): {layer: (difference, standard error, p)}}, the differences in percent, of tests that ended; and which failed."""
    found, failed, layers = {}, set(), {}
    for line in text.splitlines():
        if re.match(r"\[ RUN", line):
            layers = {}
        elif m := re.match(r"(\w+) +level \S+, off by (\S+) \+- (\S+) %, p (\S+)", line):
            layers[m[1]] = tuple(float(word) for word in m.groups()[1:])
        elif m := re.match(r"\[ +(OK|FAILED) +\] (\w+)\.(\w+) \(", line):
            found[m[2], m[3]] = layers
            (failed.add if m[1] == "FAILED" else failed.discard)(f"{m[2]}.{m[3]}")
    return found, failed


def scene_name(test):
    """Words, of a test's name."""
    words = re.sub(r"(?<=\w)(?=[A-Z])", " ", test.replace("AndWhatIsWrongInIt", "")).lower()
    return words.replace("is a ", "as a ").replace("are a ", "as a ")


def cell(finding):
    return f"{finding[0]:+.2f} ± {finding[1]:.2f}" if finding else ""


def summary(cells):
    sigmas = [abs(difference) / error for difference, error, _ in cells]
    errors = sorted(error for _, error, _ in cells)
    return (f"The standard errors are {errors[-1]:.2f} % at most, {errors[len(errors) // 2]:.2f} % in the middle. The largest difference is "
            f"{max(sigmas):.1f} standard errors, the mean square of all {sum(s * s for s in sigmas) / len(sigmas):.2f} of theirs (1 is expected). "
            f"Of {len(cells)} p-values of quarters and channels, each already times the number of tests in it, the smallest is "
            f"{min(p for _, _, p in cells):.2g}.")


def page(found, effort):
    cells = [finding for layers in found.values() for finding in layers.values()]
    lines = [INTRODUCTION.format(effort=effort, cells=len(cells), summary=summary(cells))]
    for suite, file in FILES.items():
        lines += [f"## [{file}](../../tests/methods/{file})", "", "| | " + " | ".join(f"`{layer}`" for layer in LAYERS) + " |",
                  "| --- " * (1 + len(LAYERS)) + "|"]
        lines += [f"| {scene_name(test)} | " + " | ".join(cell(layers.get(layer)) for layer in LAYERS) + " |"
                  for (of, test), layers in found.items() if of == suite]
        lines.append("")
    return "\n".join(lines)


def main():
    options = parse_arguments()
    text = "\n".join(file.read_text() for file in options.log) if options.log else run_tests(options.effort)
    found, failed = read(text)
    if not found:
        sys.exit("error: no test of layers ended; build them first: scripts/build.sh release test_methods")
    PAGE.write_text(page(found, options.effort))
    print(f"{PAGE.relative_to(ROOT)}: {len(found)} scenes; failed: {', '.join(sorted(failed)) or 'none'}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
