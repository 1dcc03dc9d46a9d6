#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Renders the scenes of bench/peers with Mitsuba 3 and with Virga, from the same files, and tells whether the pictures agree.

Both renderers make independent replicates (seeds 1, 2, ..., or from --first-seed on). Of each scene:
  bias     (V - M) / M of the pictures' means, with its standard error from the replicates: what the comparison can tell
  p        of Welch's t-test that both have the same mean; smallest of the three channels, Sidak-corrected
  p blocks the same of 4 x 4 blocks of the picture: differences that cancel in the mean
  relMSE   mean (V - M)^2 / (M^2 + 0.01) of the mean pictures, and the part of it that the noise of both explains
The pictures' outermost pixels do not count. A renderer that refuses a scene has a row that says so.

Of each scene Virga also renders a wrong twin (bench/peer_controls.py), which has to differ from Mitsuba's picture of the right one.

Writes out/peers.json and, with --document, docs/results/peers.md. Exit code 1 if a scene was refused, a p-value is below 0.0001,
or that of a wrong twin is not.
"""

import argparse
import json
import math
import pathlib
import re
import resource
import shutil
import subprocess
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import peer_controls
import peer_data
from peer_statistics import agreement

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCENES = ROOT / "bench/peers"
OUT = ROOT / "out/peers"
SIGNIFICANT = 1e-4


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", metavar="NAME", help="this scene alone; repeatable")
    parser.add_argument("--replicates", type=int, default=8, metavar="N", help="independent pictures of each renderer (default 8)")
    parser.add_argument("--spp", type=int, default=256, metavar="N", help="samples a pixel of each of them (default 256)")
    parser.add_argument("--first-seed", type=int, default=1, metavar="N", help="of the replicates' seeds (default 1)")
    parser.add_argument("--variant", default="scalar_rgb", help="Mitsuba's variant (default scalar_rgb)")
    parser.add_argument("--virga", type=pathlib.Path, default=ROOT / "build/release/virga", help="the program to test")
    parser.add_argument("--document", action="store_true", help="write docs/results/peers.md")
    return parser.parse_args()


class Refused(Exception):
    """A renderer does not take a scene."""


def prepare():
    """The scenes with their data beside them."""
    OUT.mkdir(parents=True, exist_ok=True)
    for file in SCENES.glob("*.xml"):
        shutil.copy(file, OUT)
    peer_data.write_all(OUT)


def run_mitsuba(scene, options):
    """Replicates in a process of its own: a renderer that aborts is a row of the table."""
    target = OUT / f"{scene.stem}-mitsuba.npy"
    command = [sys.executable, ROOT / "bench/peer_mitsuba.py", scene, target, options.variant, options.spp, options.replicates,
               options.first_seed]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode != 0:
        lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
        raise Refused(lines[-1].replace(f"{OUT}/", "") if lines else f"exit code {done.returncode}")
    return np.load(target), float(done.stdout.split()[-1])


def cpu_seconds_of_children():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def run_virga(scene, options):
    pictures, seconds = [], 0
    for seed in range(options.first_seed, options.first_seed + options.replicates):
        picture = OUT / f"{scene.stem}-virga.exr"
        command = [options.virga, "render", scene, "--spp", options.spp, "--seed", seed, "-o", picture, "--quiet"]
        before = cpu_seconds_of_children()
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
        seconds += cpu_seconds_of_children() - before
        if done.returncode != 0:
            first = next((line for line in done.stderr.splitlines() if "error:" in line), f"exit code {done.returncode}")
            raise Refused(first.split("error: ")[-1].replace(f"{OUT}/", ""))
        pictures.append(peer_data.read_picture(picture))
    return np.array(pictures), seconds


def measure(scene, options):
    row = {"scene": scene.stem, "what": comment_of(scene)}
    pictures = {}
    for name, run in (("mitsuba", run_mitsuba), ("virga", run_virga)):
        try:
            pictures[name], row[f"{name}_seconds"] = run(scene, options)
        except Refused as problem:
            row[f"{name}_refused"] = str(problem)
    if len(pictures) == 2:
        row |= agreement(pictures["virga"], pictures["mitsuba"])
        row["verdict"] = "differs" if min(row["p"], row["p_blocks"]) < SIGNIFICANT else "agrees"
        row["control"] = measure_control(scene, pictures["mitsuba"], options)
    else:
        row["verdict"] = "refused"
    return row


def measure_control(scene, right, options):
    twin, what = peer_controls.write_wrong_twin(scene)
    found = agreement(run_virga(twin, options)[0], right)
    p = min(found["p"], found["p_blocks"])
    return {"what": what, "bias": found["bias"], "p": p, "noticed": p < SIGNIFICANT}


def comment_of(scene):
    return re.search(r"<!--\s*(.*?)\s*-->", scene.read_text(), re.DOTALL)[1]


def text_of(row):
    if row["verdict"] == "refused":
        return "; ".join(f"{n} refuses it: {row[f'{n}_refused']}" for n in ("mitsuba", "virga") if f"{n}_refused" in row)
    control = row["control"]
    return (f"{100 * row['bias']:+.3f} % +- {100 * row['bias_error']:.3f} %, p {row['p']:.3g}, blocks {row['p_blocks']:.3g}, "
            f"{row['verdict']}; {control['what']}: p {control['p']:.3g}{'' if control['noticed'] else ', NOT NOTICED'}")


def versions(options):
    import mitsuba
    virga = subprocess.run([options.virga, "--version"], capture_output=True, text=True).stdout.strip()
    return {"virga": virga, "mitsuba": f"Mitsuba {mitsuba.__version__}, {options.variant}"}


def table_row(row):
    start = f"| [{row['scene']}](../../bench/peers/{row['scene']}.xml) | {row['what']} |"
    if row["verdict"] == "refused":
        return f"{start} {text_of(row)} | | | | | | |"
    control = row["control"]
    wrong = f"{control['what']}: {max(control['p'], 1e-15):.0e}" + ("" if control["noticed"] else ", **not noticed**")
    return (f"{start} {100 * row['bias']:+.3f} ± {100 * row['bias_error']:.3f} % | {row['p']:.2g} | {row['p_blocks']:.2g} "
            f"| {wrong} | {row['relmse']:.1e} ({row['relmse_noise']:.1e}) | {row['virga_seconds']:.1f} | {row['mitsuba_seconds']:.1f} |")


def document(rows, named, options):
    introduction = (SCENES / "introduction.md").read_text()
    counts = {v: sum(r["verdict"] == v for r in rows) for v in ("agrees", "differs", "refused")}
    spread = max((r["bias_error"] for r in rows if "bias_error" in r), default=math.nan)
    noticed = sum(r["control"]["noticed"] for r in rows if "control" in r)
    lines = [introduction.rstrip(), "", "## Results", "",
             f"{named['virga']} and {named['mitsuba']}; {options.replicates} replicates of {options.spp} samples a pixel of both, "
             f"{peer_data.SIZE[0]} x {peer_data.SIZE[1]} pixels. {len(rows)} scenes: {counts['agrees']} agree, {counts['differs']} "
             f"differ, {counts['refused']} refused. The largest standard error of a bias is {100 * spread:.2f} %: four times that "
             f"would be found in every scene. Each scene has a wrong twin, which Virga renders with the same seeds: {noticed} of them "
             "differ from Mitsuba's picture of the right one.", "",
             "| scene | | bias of the mean | p | p of blocks | wrong twin: its smallest p | relMSE (of noise) | Virga [CPU s] | Mitsuba [CPU s] |",
             "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    lines += [table_row(row) for row in rows]
    lines += ["", "Seconds are CPU seconds of all replicates on one machine, Virga's with program start and scene loading; "
              "scenes this small say little about speed.", ""]
    target = ROOT / "docs/results/peers.md"
    target.parent.mkdir(exist_ok=True)
    target.write_text("\n".join(lines))


def selected(options):
    names = sorted(file.stem for file in SCENES.glob("*.xml"))
    for name in options.only or []:
        if name not in names:
            sys.exit(f"error: there is no scene {name}; available: {', '.join(names)}")
    return [OUT / f"{name}.xml" for name in names if not options.only or name in options.only]


def main():
    options = parse_arguments()
    if not options.virga.exists():
        sys.exit("error: build Virga first: scripts/build.sh release virga")
    prepare()
    rows = []
    for scene in selected(options):
        rows.append(measure(scene, options))
        print(f"{scene.stem:24} {text_of(rows[-1])}", flush=True)
    named = versions(options)
    OUT.with_suffix(".json").write_text(json.dumps({"versions": named, "spp": options.spp, "replicates": options.replicates,
                                                    "rows": rows}, indent=2) + "\n")
    if options.document:
        document(rows, named, options)
    agree = sum(row["verdict"] == "agrees" for row in rows)
    noticed = sum(row["control"]["noticed"] for row in rows if "control" in row)
    print(f"{agree} of {len(rows)} scenes agree, {noticed} wrong twins differ")
    sys.exit(0 if agree == noticed == len(rows) else 1)


if __name__ == "__main__":
    main()
