#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures k = seconds x relMSE of renderers on benchmark scenes. Lower is better.

The error of an unbiased renderer falls as 1 / time, so k does not depend on how long it ran: k / relMSE is the time it needs.
Seconds are those of the whole process, (user + system) / threads. relMSE = mean of (a - b)^2 / (b^2 + 0.01) over pixels
and channels against a converged picture b by Virga, of another seed, kept in out/bench. The reference's own relMSE, estimated from
its replicates, is subtracted from what is measured: (a - b)^2 expects Var(a) + Var(b).

A method that is biased (ims mode=fast or frame) has no k: of it, what counts is the error after so many passes.

Each scene is rendered several times with different seeds; the median run is what counts. Writes out/bench/results.json.
"""

import argparse
import json
import os
import pathlib
import platform
import shutil
import statistics
import subprocess
import sys
import tarfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
VIRGA = ROOT / "build/release/virga"
OUT = ROOT / "out/bench"
REFERENCE_SEED = 987654321  # runs have seeds 1, 2, 3...

# Name, file, variables, samples a pixel of a run; the reference's method, and the relMSE that it is rendered to. In fog `path` would
# need an hour; `ims` is unbiased, too, and is held against `path` by the tests.
CASES = [
    ("smoke", "smoke.xml", {}, 64, "path", 2e-4),
    ("smoke-g0.6", "smoke.xml", {"g": "0.6"}, 64, "path", 4e-4),
    ("fog", "fog.xml", {}, 64, "ims", 1e-3),
]


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default=os.environ.get("VIRGA_BENCH_SCENES"), metavar="DIR",
                        help="folder with smoke.xml, fog.xml and smoke128.vol(.tar.xz); default: $VIRGA_BENCH_SCENES")
    parser.add_argument("--only", action="append", metavar="NAME", help="measure this scene alone; repeatable")
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="runs of each scene (default 3)")
    parser.add_argument("--spp", type=int, metavar="N", help="samples a pixel of a run (default: the scene's row, 64)")
    parser.add_argument("--size", type=int, default=512, metavar="N", help="width and height in pixels (default 512)")
    parser.add_argument("--threads", type=int, default=os.cpu_count(), metavar="N", help="threads (default: all)")
    parser.add_argument("--method", action="append", metavar="'NAME [setting=value]... [passes=N]'",
                        help="a method of Virga's, its settings, and passes in place of --spp; repeatable (default path)")
    parser.add_argument("--reference-error", type=float, metavar="E",
                        help="relMSE to render references to (default: the scene's row; coarser is quicker and less exact)")
    parser.add_argument("--page", metavar="FILE.md", help="also write the table as a page, as docs/results/speed.md is made")
    parser.add_argument("--mitsuba", nargs="?", const="scalar_rgb", metavar="VARIANTS",
                        help="also run Mitsuba 3 (pip install mitsuba) on the same files; variants, comma separated. Those of llvm need "
                        "LLVM 17 or newer, which $DRJIT_LIBLLVM_PATH names")
    options = parser.parse_args()
    options.method = options.method or ["path"]
    if not options.scenes:
        parser.error("name the folder of the scenes by --scenes or VIRGA_BENCH_SCENES")
    return options


def fail(message):
    sys.exit(f"error: {message}")


class CannotRun(Exception):
    """A renderer other than ours that failed: the others are measured all the same."""


def run_timed(command, **more):
    """Runs a command to its end; CPU seconds (user + system) and wall-clock seconds of it, and what subprocess.run gives."""
    before, start = os.times(), time.monotonic()
    done = subprocess.run([str(word) for word in command], **more)
    wall, after = time.monotonic() - start, os.times()
    cpu = (after.children_user - before.children_user) + (after.children_system - before.children_system)
    return cpu, wall, done


def run_ours(command):
    cpu, wall, done = run_timed(command)
    if done.returncode != 0:
        fail(f"exit code {done.returncode} of: {' '.join(str(word) for word in command)}")
    return cpu, wall


def unpack_scenes(folder):
    """A writable copy of the scenes with their volumes unpacked."""
    source, scratch = pathlib.Path(folder), OUT / "scenes"
    if not source.is_dir():
        fail(f"{source} is not a folder")
    scratch.mkdir(parents=True, exist_ok=True)
    for file in source.iterdir():
        if file.suffix == ".xml" or file.suffix == ".vol":
            shutil.copy2(file, scratch)
        elif file.name.endswith(".vol.tar.xz") and not (scratch / file.name[: -len(".tar.xz")]).exists():
            with tarfile.open(file) as archive:
                archive.extractall(scratch, filter="data") if hasattr(tarfile, "data_filter") else archive.extractall(scratch)
    return scratch


def virga_command(scene, defines, options, output, seed, stats):
    command = [VIRGA, "render", scene, "-o", output, "--seed", seed, "--stats", stats, "--quiet"]
    command += ["--size", f"{options.size}x{options.size}", "--threads", options.threads]
    for name, value in defines.items():
        command += ["-D", f"{name}={value}"]
    return command


def reference_for(name, scene, defines, method, target, options):
    """A converged picture and its own estimated relMSE. Rendered again where scene, size or target changed."""
    stem = f"reference-{name}-{options.size}-{method}-{target:g}"
    image, stats = OUT / f"{stem}.exr", OUT / f"{stem}.json"
    newest = max(f.stat().st_mtime for f in scene.parent.iterdir())
    if not (image.exists() and stats.exists() and stats.stat().st_mtime > newest):
        print(f"{name}: rendering a reference to relMSE {target:g}", file=sys.stderr, flush=True)
        command = virga_command(scene, defines, options, image, REFERENCE_SEED, stats)
        run_ours(command + ["--method", method, "--error", target])
    return image, json.loads(stats.read_text())["estimated_relmse"]


def error_against(image, reference, reference_error):
    done = subprocess.run([str(VIRGA), "compare", str(image), str(reference), "--json"], capture_output=True, text=True)
    if done.returncode != 0:
        fail(done.stderr.strip())
    result = json.loads(done.stdout)
    if result["non_finite"] > 0:
        fail(f"{image}: {result['non_finite']} pixels are not finite")
    return result["relmse"] - reference_error, result["bias"]


def run_virga(spec):
    method, *words = spec.split()
    settings = [f"{method}.{word}" for word in words if not word.startswith("passes=")]

    def run(name, scene, defines, spp, options, seed):
        image, stats = OUT / f"virga-{name}.exr", OUT / f"virga-{name}.json"
        command = virga_command(scene, defines, options, image, seed, stats)
        for setting in settings:
            command += ["--set", setting]
        cpu, wall = run_ours(command + ["--passes", spp, "--method", method])
        return image, cpu, wall

    return run


def passes_of(spec):
    """Passes that a method's words ask for, or nothing."""
    return next((int(word.split("=")[1]) for word in spec.split() if word.startswith("passes=")), None)


# Runs in a process of its own, so that its CPU time can be told and its cores be limited.
MITSUBA_PROGRAM = """
import os
import sys
scene, output, variant, size, spp, seed, threads, defines = sys.argv[1:9]
os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:int(threads)])
import mitsuba as mi
mi.set_variant(variant)
values = dict(pair.split("=", 1) for pair in defines.split(",") if pair)
loaded = mi.load_file(scene, res=size, spp=spp, **values)
picture = mi.render(loaded, spp=int(spp), seed=int(seed))
mi.Bitmap(picture).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False).write(output)
"""


def run_mitsuba(variant):
    def run(name, scene, defines, spp, options, seed):
        image = OUT / f"mitsuba-{variant}-{name}.exr"
        pairs = ",".join(f"{n}={v}" for n, v in defines.items())
        command = [sys.executable, "-c", MITSUBA_PROGRAM, scene, image, variant]
        command += [options.size, spp, seed, options.threads, pairs]
        log = OUT / f"mitsuba-{variant}.log"
        with open(log, "w") as output:
            cpu, wall, done = run_timed(command, stdout=output, stderr=output)
        if done.returncode != 0:
            raise CannotRun(f"mitsuba {variant}: exit code {done.returncode}, see {log}")
        return image, cpu, wall

    return run


def measure(renderer, run, case, scratch, options):
    name, file, defines, spp, method, target = case
    spp = passes_of(renderer) or options.spp or spp
    scene = scratch / file
    reference, reference_error = reference_for(name, scene, defines, method, options.reference_error or target, options)
    runs = []
    for seed in range(1, options.runs + 1):
        image, cpu, wall = run(name, scene, defines, spp, options, seed)
        error, bias = error_against(image, reference, reference_error)
        seconds = cpu / options.threads
        runs.append({"seed": seed, "seconds": seconds, "wall": wall, "relmse": error, "bias": bias, "k": seconds * error})
    median = sorted(runs, key=lambda r: r["k"])[(len(runs) - 1) // 2]
    if reference_error > 0.1 * median["relmse"]:
        print(f"warning: {name}: the reference's own relMSE {reference_error:.2g} is no small part of the {median['relmse']:.2g} that is "
              "measured; it is subtracted, but render more with --reference-error", file=sys.stderr)
    return {"renderer": renderer, "scene": name, "spp": spp, "k": median["k"], "seconds": median["seconds"], "wall": median["wall"],
            "relmse": median["relmse"], "bias": statistics.median(r["bias"] for r in runs), "reference_relmse": reference_error,
            "runs": runs}


def print_table(rows):
    print(f"{'renderer':30} {'scene':12} {'spp':>6} {'seconds':>9} {'relMSE':>10} {'bias':>9} {'k':>9}")
    for r in rows:
        print(f"{r['renderer']:30} {r['scene']:12} {r['spp']:6} {r['seconds']:9.3f} {r['relmse']:10.3e} {100 * r['bias']:8.2f}% "
              f"{r['k']:9.4f}")


PAGE = """# Speed

Written by `scripts/bench.sh --page docs/results/speed.md`, {threads} threads, {size} x {size} pixels, median over {runs} seed(s). k = seconds x relMSE is a constant of an
unbiased renderer on a scene: lower is better, and k / relMSE is the time that it needs. Seconds are (user + system) / threads of the whole process;
relMSE is against a converged picture of another seed, whose own error is subtracted. Only ratios within one table mean anything. `ims` with mode=fast or frame is biased: of these, the error
after so many passes counts, not k.

| renderer | scene | samples a pixel | seconds | relMSE | bias | k |
| --- | --- | --- | --- | --- | --- | --- |
{rows}

The scenes: `smoke`, a plume of 128^3 voxels over a ground, albedo 0.95, under a point light; `smoke-g0.6`, the same with forward scattering; `fog`, a
closed box of thin fog with a lamp, the camera inside. They are not part of the repository.

The least k of other path tracers on these scenes, measured once on two cores of another machine, and what `path` is meant to stay below:

| | smoke | smoke-g0.6 | fog |
| --- | --- | --- | --- |
| pbrt-v4, `volpath` | 0.137 | 0.292 | 10.1 |
| Tungsten | 0.106 | 0.209 | 1.75 |
| Blender Cycles 3.4 | 0.106 | 0.303 | 1.56 |
| aim | 0.05 | 0.10 | 0.40 |
"""


def write_page(path, rows, options):
    lines = [f"| {r['renderer']} | {r['scene']} | {r['spp']} | {r['seconds']:.2f} | {r['relmse']:.2e} | {100 * r['bias']:.2f} % | {r['k']:.4f} |"
             for r in rows]
    text = PAGE.format(threads=options.threads, size=options.size, runs=options.runs, rows="\n".join(lines))
    pathlib.Path(path).write_text(text)


def renderers(options):
    found = [(f"virga {spec}", run_virga(spec)) for spec in options.method]
    if options.mitsuba:
        check = subprocess.run([sys.executable, "-c", "import mitsuba; print(*mitsuba.variants())"], capture_output=True, text=True)
        if check.returncode != 0:
            fail("--mitsuba: python3 finds no mitsuba; pip install mitsuba")
        for variant in options.mitsuba.split(","):
            if variant not in check.stdout.split():
                fail(f"--mitsuba: there is no variant {variant}; available: {check.stdout.strip()}")
            found.append((f"mitsuba {variant}", run_mitsuba(variant)))
    return found


def main():
    options = parse_arguments()
    if not VIRGA.exists():
        fail("build Virga first: scripts/build.sh release virga")
    names = [case[0] for case in CASES]
    for name in options.only or []:
        if name not in names:
            fail(f"there is no scene {name}; available: {', '.join(names)}")
    OUT.mkdir(parents=True, exist_ok=True)
    scratch = unpack_scenes(options.scenes)
    cases = [case for case in CASES if not options.only or case[0] in options.only]
    rows = []
    for case in cases:
        for name, run in renderers(options):
            try:
                rows.append(measure(name, run, case, scratch, options))
            except CannotRun as problem:
                print(f"warning: {problem}", file=sys.stderr)
    print_table(rows)
    machine = {"processor": platform.processor() or platform.machine(), "threads": options.threads, "size": options.size}
    (OUT / "results.json").write_text(json.dumps({"machine": machine, "results": rows}, indent=2) + "\n")
    if options.page:
        write_page(options.page, rows, options)
    print(f"wrote {(OUT / 'results.json').relative_to(ROOT)}")


if __name__ == "__main__":
    main()
