#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What each approximation of `ims` costs in truth, how the error falls with the number of virtual lights, and what each way of
sub-sampling costs in time. Writes docs/results/ims.md and docs/images/ims-lights.png; takes about ten minutes.

The systematic error is relMSE against an unbiased picture of long, less the noise of both as their replicates estimate it. That noise is not
known exactly, least of all where lights are not clamped: below a third of it nothing is said.
"""

import argparse
import json
import re
import subprocess

from png_sheet import sheet
from scenes import OUT, ROOT, VIRGA, fail

APPROXIMATIONS = [
    ("none: the eye path compensates", ""),
    ("none: sampled compensation", "compensation=sampled"),
    ("none: one level, then unclamped lights", "compensation=sampled levels=1 ending=unclamped"),
    ("one level, then reduced clamping", "compensation=sampled levels=1 ending=reduced"),
    ("one level, then nothing", "compensation=sampled levels=1 ending=nothing"),
    ("two levels, then nothing", "compensation=sampled levels=2 ending=nothing"),
    ("no compensation", "compensation=none"),
    ("transmittance from the local mean", "compensation=sampled transmittance=mean"),
    ("walks by marching", "walk_flights=marching"),
    ("fast, every 4th pixel", "mode=fast spacing=4"),
    ("fast, every 8th pixel", "mode=fast spacing=8"),
    ("fast, every 16th pixel", "mode=fast spacing=16"),
]
# Held against the same samples with exact visibility.
VISIBILITIES = [
    ("minimum depth", "visibility=minimum_depth"),
    ("shadow map, 128 x 128, 8192 points", "visibility=shadow_map"),
    ("shadow map, 64 x 64, 2000 points", "visibility=shadow_map map_resolution=64 map_points=2000"),
    ("shadow map, 32 x 32, 500 points", "visibility=shadow_map map_resolution=32 map_points=500"),
    ("none", "visibility=none"),
]
# V_1 (P_1 + V_2 P_2) = 320 walks for each pixel.
STRATEGIES = [("1 / 64, 4 / 64", "v1=1 p1=64 v2=4 p2=64"), ("4 / 16, 4 / 16", "v1=4 p1=16 v2=4 p2=16"),
              ("16 / 4, 4 / 4", "v1=16 p1=4 v2=4 p2=4"), ("64 / 1, 4 / 1", "v1=64 p1=1 v2=4 p2=1")]
WALKS, WALK_PASSES = 512, 8
LIGHTS = [64, 125, 250, 500, 1000, 2000, 4000]
PICTURED = [64, 250, 1000, 4000]
# The lights are spread over so many passes, lest the noise of direct light hide their error.
PASSES = 32
FEW_LIGHTS = "mode=fast spacing=4 samples=4 lights=16"

# Smoke of `virga make` in a room with a lamp.
ROOM = """<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="42"/>
    <transform name="to_world"><lookat origin="0.4, 0.2, 3.2" target="0, -0.12, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><rfilter type="box"/></film></sensor>
  <bsdf type="twosided" id="white"><bsdf type="diffuse"><rgb name="reflectance" value="0.7"/></bsdf></bsdf>
  <bsdf type="twosided" id="red"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.1, 0.08"/></bsdf></bsdf>
  <bsdf type="twosided" id="green"><bsdf type="diffuse"><rgb name="reflectance" value="0.1, 0.45, 0.12"/></bsdf></bsdf>
  {walls}
  <shape type="rectangle"><transform name="to_world"><scale x="0.4" y="0.4"/><rotate x="1" angle="90"/><translate y="1.19"/></transform>
    <emitter type="area"><rgb name="radiance" value="14, 13, 11"/></emitter></shape>
  <shape type="cube"><transform name="to_world"><scale x="0.13" y="0.45" z="0.13"/><translate x="0.75" y="-0.55" z="0.5"/></transform>
    <ref id="white"/></shape>
  <shape type="cube"><transform name="to_world"><scale x="0.49" y="0.84" z="0.53"/><translate x="-0.02" y="-0.115" z="-0.01"/></transform>
    <bsdf type="null"/><medium type="heterogeneous" name="interior"><volume type="vdb" name="sigma_t">
    <string name="filename" value="ims-smoke.vdb"/></volume><float name="scale" value="15"/><rgb name="albedo" value="0.95"/></medium></shape>
</scene>
"""
WALL = """<shape type="rectangle"><transform name="to_world"><scale value="1.2"/><translate z="-1.2"/>{turn}</transform><ref id="{bsdf}"/></shape>
  """

PAGE = """# What the approximations of ims cost

Written by `bench/ims_settings.py`: {size} x {size} pixels, {seconds} s for each picture. *hall*: `scenes/hall.xml`, a court in homogeneous fog, clamping
radius {hall}. *smoke*: smoke of `virga make` in a closed room with a lamp, radius {smoke}. Systematic error: relMSE against
`path`, less the noise of both, where it is more than a third of the picture's own noise; bias: mean signed relative difference.

| approximation | scene | systematic relMSE | noise | bias |
| --- | --- | --- | --- | --- |
{approximations}

## Visibility

Against the same samples with exact visibility, {passes} passes of `exact` with {walks} walks each, so that hardly any noise is in these numbers.
Seconds of CPU, maps included, over those with exact visibility.

| visibility of virtual lights | scene | relMSE | bias | seconds |
| --- | --- | --- | --- | --- |
{visibilities}

## Number of virtual lights

`fast`, every fourth pixel, the lights spread over {few} passes: relMSE against `path`, its noise subtracted; mean over two sets.

| virtual lights | scene | walks | relMSE |
| --- | --- | --- | --- |
{lights}

![Signed differences of pictures with 64, 250, 1000 and 4000 virtual lights](../images/ims-lights.png)

Left: the picture by `path`. To its right the signed difference, times 2, of a picture with 64, 250, 1000 and 4000 virtual lights; green is
too dark, red too bright.

## Ways to compensate at equal cost

V_1 (P_1 + V_2 P_2) = 320 walks at two levels, then unclamped lights; V_1 / P_1, V_2 / P_2. k = seconds x relMSE of the noise, relative to the first.

| new vertices / walks for each | scene | k |
| --- | --- | --- |
{strategies}
"""


def virga(*words):
    return subprocess.run([str(VIRGA), *[str(word) for word in words]], capture_output=True, text=True)


def checked(*words):
    done = virga(*words)
    if done.returncode != 0:
        fail(done.stderr.strip())
    return done.stdout


def render(scene, method, settings, outputs, size, stop):
    stats = OUT / "ims.json"
    words = ["render", scene, "-m", method, "--size", f"{size}x{size}", "--stats", stats, "-q", *stop]
    for output in outputs:
        words += ["-o", output]
    for setting in settings.split():
        words += ["--set", f"{method}.{setting}"]
    checked(*words)
    return json.loads(stats.read_text())


def compared(image, reference, *options):
    return json.loads(checked("compare", image, reference, "--json", *options))


def lights_of(scene, walks):
    """Lights of the first pass: what it refuses to make maps for."""
    done = virga("render", scene, "-m", "ims", "--passes", 1, "--size", "8x8", "-q", "-o", OUT / "ims.exr", "--set", "ims.visibility=shadow_map",
                 "--set", "ims.map_resolution=1024", "--set", f"ims.walks={walks}")
    found = re.search(r"maps of (\d+) virtual lights", done.stderr)
    return int(found.group(1)) if found else 0


def make_scenes():
    OUT.mkdir(parents=True, exist_ok=True)
    checked("make", "smoke", "--resolution", 96, "--seed", 1, "-o", OUT / "ims-smoke.vdb")
    turns = [("", "white"), ('<rotate x="1" angle="90"/>', "white"), ('<rotate x="1" angle="-90"/>', "white"),
             ('<rotate y="1" angle="90"/>', "red"), ('<rotate y="1" angle="-90"/>', "green")]
    room = OUT / "ims-room.xml"
    room.write_text(ROOM.replace("{walls}", "".join(WALL.format(turn=t, bsdf=b) for t, b in turns)))
    return {"hall": (ROOT / "scenes/hall.xml", 3), "smoke": (room, 0.4)}


class Scene:
    """A scene, with a picture of it by `path` that is not biased, and what noise is left in that."""

    def __init__(self, name, file, radius, options):
        self.name, self.file, self.radius, self.options = name, file, radius, options
        self.reference, self.picture = OUT / f"ims-path-{name}.exr", OUT / f"ims-path-{name}.png"
        self.image = OUT / f"ims-{name}.exr"
        stop = ["--seed", 77, "--time", options.reference_seconds]
        self.noise = render(file, "path", "", [self.reference, self.picture], options.size, stop)["estimated_relmse"]

    def approximation(self, title, settings):
        stats = render(self.file, "ims", f"radius={self.radius} {settings}", [self.image], self.options.size,
                       ["--time", self.options.seconds])
        noise, result = stats["estimated_relmse"], compared(self.image, self.reference)
        systematic = result["relmse"] - noise - self.noise
        told = f"{systematic:.4f}" if systematic > noise / 3 else f"< {noise / 3:.4f}"
        return f"| {title} | {self.name} | {told} | {noise:.4f} | {100 * result['bias']:.1f} % |"

    def visibilities(self):
        def picture(settings, output):
            stats = render(self.file, "ims", f"radius={self.radius} walks={WALKS} {settings}", [output], self.options.size,
                           ["--passes", WALK_PASSES])
            return stats["seconds"]["render_cpu"]

        exact = OUT / "ims-exact.exr"
        seconds = picture("", exact)
        for title, settings in VISIBILITIES:
            taken = picture(settings, self.image) / seconds
            result = compared(self.image, exact)
            yield f"| {title} | {self.name} | {result['relmse']:.5f} | {100 * result['bias']:.1f} % | {taken:.2f} |"

    def lights(self, count, difference=None):
        sample = 4096
        walks = max(1, round(count * sample / max(1, lights_of(self.file, sample))))
        errors = []
        for seed in (1, 2):
            render(self.file, "ims", f"radius={self.radius} {FEW_LIGHTS} walks={max(1, round(walks / PASSES))}", [self.image],
                   self.options.size, ["--passes", PASSES, "--seed", seed])
            errors.append(compared(self.image, self.reference)["relmse"] - self.noise)
        if difference:
            compared(self.image, self.reference, "--diff", difference)
        return f"| {count} | {self.name} | {max(1, round(walks / PASSES)) * PASSES} | {sum(errors) / len(errors):.4f} |"

    def strategy(self, settings):
        common = f"radius={self.radius} compensation=sampled levels=2 paths=1 walks=1024 "
        stats = render(self.file, "ims", common + settings, [self.image], self.options.size // 4, ["--passes", 16])
        return stats["estimated_relmse"] * stats["seconds"]["render_cpu"]


def shown(line):
    print(line, flush=True)
    return line


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--seconds", type=float, default=12, help="that each picture may take")
    parser.add_argument("--reference-seconds", type=float, default=60)
    options = parser.parse_args()
    if not VIRGA.exists():
        fail("build Virga first: scripts/build.sh")
    files = make_scenes()
    scenes = [Scene(name, file, radius, options) for name, (file, radius) in files.items()]
    approximations = [shown(s.approximation(*row)) for s in scenes for row in APPROXIMATIONS]
    visibilities = [shown(row) for s in scenes for row in s.visibilities()]
    lights, pictures = [], []
    for s in scenes:
        pictures.append(s.picture)
        for count in LIGHTS:
            difference = OUT / f"ims-{s.name}-{count}.png" if count in PICTURED else None
            pictures += [difference] if difference else []
            lights.append(shown(s.lights(count, difference)))
    sheet(pictures, 1 + len(PICTURED), ROOT / "docs/images/ims-lights.png")
    strategies = []
    for s in scenes:
        k = [s.strategy(settings) for _, settings in STRATEGIES]
        strategies += [shown(f"| {title} | {s.name} | {here / k[0]:.2f} |") for (title, _), here in zip(STRATEGIES, k)]
    page = PAGE.format(size=options.size, seconds=f"{options.seconds:g}", hall=files["hall"][1], smoke=files["smoke"][1],
                       passes=WALK_PASSES, walks=WALKS, few=PASSES, visibilities="\n".join(visibilities),
                       approximations="\n".join(approximations), lights="\n".join(lights), strategies="\n".join(strategies))
    (ROOT / "docs/results/ims.md").write_text(page)


if __name__ == "__main__":
    main()
