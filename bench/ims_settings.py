#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What each approximation of `ims` costs in truth, how the error falls with the number of virtual lights, and what each way of
sub-sampling costs in time. Writes docs/results/ims.md, docs/images/ims-lights.png and docs/images/ims-clamping.png; takes about
ten minutes. --only TABLE measures one table again and leaves the rest of the page as it is. Needs numpy.

Errors depend on the seeds and on nothing else; seconds, and k in the table of strategies, want an idle machine.
"""

import argparse

import numpy as np

import systematic_error as statistics
from ims_scenes import checked, make_scenes
from png_sheet import sheet
from scenes import OUT, ROOT, VIRGA, fail

PAGE = ROOT / "docs/results/ims.md"
SIZE = 128
PATH_PASSES, SEEDS = {"hall": 96, "smoke": 64}, 8

INTRO = f"""# What the approximations of ims cost

Written by `bench/ims_settings.py`: {SIZE} x {SIZE} pixels. *hall*: `scenes/hall.xml`, a court in homogeneous fog, clamping radius 3.
*smoke*: smoke of `virga make` in a closed room with a lamp, radius 0.4. Every row is a mean over pictures of several seeds, with one standard
error; passes are fixed, so all errors come out the same on any machine. Seconds are those of an idle machine with two cores.

Systematic relMSE is what no number of passes mends: the mean over pixels of the product of two seeds' differences, over all pairs of seeds. Noise is
not in it, as that of two seeds is independent, and does not have to be known; so it may come out a little below zero. Bias: mean signed relative difference.
Where a row is held against `ims` with another setting, both have the same seeds, so that most of their noise cancels.
"""

# Title, settings, what it is held against (settings, or "path"), passes, seeds.
SAMPLED = "compensation=sampled"
COMPENSATIONS = [
    ("none: the eye path compensates", "", "path", 16, 8),
    ("none: sampled compensation", SAMPLED, "path", 16, 8),
    ("none: one level, then unclamped lights", SAMPLED + " levels=1 ending=unclamped", SAMPLED, 16, 16),
    ("one level, then reduced clamping", SAMPLED + " levels=1 ending=reduced", SAMPLED, 16, 8),
    ("one level, then nothing", SAMPLED + " levels=1 ending=nothing", SAMPLED, 16, 8),
    ("two levels, then nothing", SAMPLED + " levels=2 ending=nothing", SAMPLED, 16, 8),
    ("no compensation", "compensation=none", SAMPLED, 16, 8),
]
RADII = {"hall": [3], "smoke": [0.4, 0.1]}
TRANSMITTANCES = [
    ("one level, then nothing", " levels=1 ending=nothing"),
    ("two levels, then nothing", " levels=2 ending=nothing"),
    ("as many levels as there are", ""),
]
FAST = [
    ("every 4th pixel", "spacing=4"),
    ("every 8th pixel (default)", ""),
    ("every 16th pixel", "spacing=16"),
    ("16 steps of an eye ray", "eye_steps=16"),
]
# Title, settings, passes.
FRAMES = [
    ("(default)", "", 1),
    ("(default), eight passes averaged", "", 8),
    ("compensation=sampled", "compensation=sampled", 1),
    ("compensation=none", "compensation=none", 1),
    ("lights=325", "lights=325", 1),
    ("lights=5200", "lights=5200", 1),
    ("walks=65536", "walks=65536", 1),
    ("samples=16", "samples=16", 1),
    ("map_resolution=16", "map_resolution=16", 1),
    ("map_resolution=128", "map_resolution=128", 1),
    ("visibility=exact", "visibility=exact", 1),
    ("visibility=none", "visibility=none", 1),
    ("spacing=16", "spacing=16", 1),
]
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
LIGHTS = [64, 125, 250, 500, 1000, 2000, 4000]
PICTURED = [64, 250, 1000, 4000]
# The lights are spread over so many passes, lest the noise of direct light hide their error.
LIGHT_PASSES = 32
SAMPLE = 4096  # walks that are counted to know how many lights a walk leaves
# Of the smoke, radius 0.4: each vertex is lit by all lights of its pass, the same ones in all pixels.
CLAMPING = "walks=2 paths=2 "
CLAMPED = [
    ("unclamped", CLAMPING + "compensation=none radius=0.001"),
    ("clamped", CLAMPING + "compensation=none"),
    ("lost", CLAMPING + "show=lost"),
    ("found", CLAMPING + "show=compensation " + SAMPLED),
    ("compensated", CLAMPING + SAMPLED),
]


def shown(cells):
    line = f"| {' | '.join(cells)} |"
    print(line, flush=True)
    return line


def table(head, rows):
    return "\n".join([f"| {' | '.join(head)} |", "|" + " --- |" * len(head), *rows])


def path_of(scene):
    return scene.paths(PATH_PASSES[scene.name], SEEDS)


class Held:
    """Pictures against others, (seed, row, column, channel). What they are relative to must not have the noise of either in it: it would
    be in the numerator and in the denominator."""

    def __init__(self, pictures, others, reference, references=None):
        differences = pictures - others
        self.relmse = statistics.relmse(differences, reference)
        self.bias = statistics.bias(differences, reference if references is None else references)

    def cells(self):
        return [self.relmse.text(), f"{self.bias.text(100)} %"]


def truth_of(scene):
    return path_of(scene).mean(axis=0)


def against_path(pictures, scene):
    paths = path_of(scene)
    folded = pictures.reshape(len(paths), -1, *pictures.shape[1:]).mean(axis=1)  # as many as there are by path
    others = (paths.sum(axis=0) - paths) / (len(paths) - 1)
    return Held(folded, paths, truth_of(scene), others)


def compensations(scenes):
    rows = []
    for scene in scenes:
        full, _ = scene.pictures(SAMPLED, 16, 16)
        for title, settings, against, passes, seeds in COMPENSATIONS:
            pictures = full[:seeds] if settings == SAMPLED else scene.pictures(settings, passes, seeds)[0]
            if against == "path":
                held, other = against_path(pictures, scene), "`path`"
            else:
                held, other = Held(pictures, full[:seeds], truth_of(scene)), "sampled"
            rows.append(shown([title, scene.name, other, *held.cells()]))
    return table(["approximation", "scene", "held against", "systematic relMSE", "bias"], rows) + """

Held against the sampled compensation of the same seeds, but for the first two. Unclamped lights have no finite variance: a light at a distance d adds 1 / d^2, and of the lights
a share of d^3 is nearer than that, so that the error of a mean over n samples falls as n^-1/3 only. What is measured of them is whether their bias is below a percent; their systematic relMSE is not known any better
than its error says. They are no approximation: what compensates is put in place of lights only to be rid of that variance."""


def transmittances(scenes):
    rows = []
    for scene in scenes:
        for title, levels in TRANSMITTANCES:
            for radius in RADII[scene.name]:
                settings = f"radius={radius} {SAMPLED}{levels}"
                exact, seconds = scene.pictures(settings, 8, 8)
                for way in "mean", "gradient":
                    found, taken = scene.pictures(f"{settings} transmittance={way}", 8, 8)
                    held = Held(found, exact, truth_of(scene))
                    rows.append(shown([way, title, f"{radius}", scene.name, *held.cells(), f"{taken / seconds:.2f}"]))
    return table(["transmittance", "levels", "radius", "scene", "systematic relMSE", "bias", "seconds"], rows) + """

Against exact transmittance with the same seeds; seconds of CPU over those with it. In the hall the mean is wrong only at walls and floor, which stand a finger's breadth outside
the fog, where it is 0. In smoke, ways lead from thin places to dense ones, whose light
is then as if nothing were between: one level adds a little light, each further level multiplies that, and without a limit some
paths grow without bound. `transmittance=mean` is for few levels. `gradient` takes the mean only where extinction hardly changes between the two
ends of a way."""


def marched_walks(scenes):
    scene = scenes[1]  # in homogeneous media marching is exact
    tracked, seconds = scene.pictures("", 16, 8)
    marched, taken = scene.pictures("walk_flights=marching", 16, 8)
    rows = [shown([scene.name, *Held(marched, tracked, truth_of(scene)).cells(), f"{taken / seconds:.2f}"])]
    return table(["scene", "systematic relMSE", "bias", "seconds"], rows) + """

Against walks by delta tracking, seconds of CPU of the whole picture over those with it. In homogeneous media free flights are exact either way."""


def fast(scenes):
    rows = []
    for scene in scenes:
        for title, settings in FAST:
            if scene.name == "hall" and "steps" in settings:
                continue  # nothing is marched where fog is homogeneous
            pictures, _ = scene.pictures("mode=fast " + settings, 16, SEEDS)
            rows.append(shown([title, scene.name, *against_path(pictures, scene).cells()]))
    return table(["`mode=fast`", "scene", "systematic relMSE", "bias"], rows) + """

Against `path`: what remains however many passes are averaged, that is the blur of the filter and the steps of the marching."""


def frames(scenes):
    rows = []
    for scene in scenes:
        paths = path_of(scene)
        reference = truth_of(scene)
        noise = statistics.squared(paths - reference, reference).value / (len(paths) - 1)
        for title, settings, passes in FRAMES:
            pictures, seconds = scene.pictures("mode=frame " + settings, passes, SEEDS)
            one = statistics.squared(pictures - reference, reference)
            error = statistics.Estimate(one.value - noise, one.error)
            rows.append(shown([title, scene.name, error.text(), *against_path(pictures, scene).cells(), f"{seconds / SEEDS:.2f}"]))
    return table(["`mode=frame`", "scene", "relMSE of a frame", "systematic relMSE", "bias", "seconds"], rows) + f"""

Against `path`, first frames of {SEEDS} seeds: the error of one of them, the noise of `path` subtracted; what of it is the same for all seeds, and so the error that comes of the four points
of each lamp, which later passes place elsewhere; seconds of CPU for a frame, everything traced and drawn anew. The default: 1300 lights
spread over balls, 16384 walks, shadow maps of 32 x 32 texels with a ray for each, 4 points of an eye ray, every 8th pixel."""


def visibilities(scenes):
    rows = []
    for scene in scenes:
        exact, seconds = scene.pictures("walks=512", 1, SEEDS)
        for title, settings in VISIBILITIES:
            pictures, taken = scene.pictures("walks=512 " + settings, 1, SEEDS)
            held = Held(pictures, exact, truth_of(scene))
            rows.append(shown([title, scene.name, *held.cells(), f"{taken / seconds:.2f}"]))
    return table(["visibility of virtual lights", "scene", "systematic relMSE", "bias", "seconds"], rows) + """

Against exact visibility with the same seeds: `exact`, 512 walks a pass. Seconds of CPU, maps included, over those with exact visibility."""


def lights(scenes):
    rows, pictures = [], []
    for scene in scenes:
        reference, shown_path = truth_of(scene), OUT / f"ims-path-{scene.name}"
        noise = statistics.squared(path_of(scene) - reference, reference).value / (SEEDS - 1)
        scene.render("path", "", 512, 1, [f"{shown_path}.exr", f"{shown_path}.png"])
        pictures.append(shown_path.with_suffix(".png"))
        each = scene.lights_of(SAMPLE) / SAMPLE
        for count in LIGHTS:
            walks = max(1, round(count / each / LIGHT_PASSES))
            found, _ = scene.pictures(f"mode=fast spacing=4 samples=4 lights=16 walks={walks}", LIGHT_PASSES, 3)
            error = statistics.squared(found - reference, reference)
            rows.append(shown([f"{count}", scene.name, f"{walks * LIGHT_PASSES}", statistics.Estimate(error.value - noise, error.error).text()]))
            if count in PICTURED:
                pictures.append(OUT / f"ims-{scene.name}-{count}.png")
                checked("compare", scene.image, f"{shown_path}.exr", "--diff", pictures[-1])
    sheet(pictures, 1 + len(PICTURED), ROOT / "docs/images/ims-lights.png")
    return table(["virtual lights", "scene", "walks", "relMSE"], rows) + f"""

`fast`, every fourth pixel, the lights spread over {LIGHT_PASSES} passes: relMSE against `path`, whose noise is subtracted; mean over three sets of lights.

![Signed differences of pictures with 64, 250, 1000 and 4000 virtual lights](../images/ims-lights.png)

Left: the picture by `path`. To its right the signed difference, times 2, of a picture with 64, 250, 1000 and 4000 virtual lights; green is
too dark, red too bright."""


def strategies(scenes):
    rows = []
    for scene in scenes:
        first = None
        for title, settings in STRATEGIES:
            given = f"{SAMPLED} levels=2 ending=reduced show=compensation paths=1 walks=1024 {settings}"
            runs = [scene.render("ims", given, 16, 1 + seed, [scene.image], "32x32") for seed in range(8)]
            errors = np.array([stats["estimated_relmse"] for stats in runs])
            error, seconds = np.median(errors), np.median([stats["seconds"]["render_cpu"] for stats in runs])
            first = first or (error, seconds)
            errors, seconds = errors / first[0], seconds / first[1]
            rows.append(shown([title, scene.name, f"{np.median(errors):.2f}", f"{errors.min():.2f} to {errors.max():.2f}",
                               f"{seconds:.1f}", f"{np.median(errors) * seconds:.2f}"]))
    return table(["new vertices / walks for each", "scene", "relMSE", "of eight seeds", "seconds", "k"], rows) + """

V_1 (P_1 + V_2 P_2) = 320 walks at two levels, then reduced clamping; V_1 / P_1, V_2 / P_2. relMSE of the noise of what is compensated, without the rest of the picture: median, and range of the seeds; seconds of CPU; k their product; all relative to the first row of a scene.
For the same number of walks many new vertices are better than many walks for each, as the paper found (figure 4). There the walks cost the time; here a new vertex does, with its rays: at equal time 4 to 16 of them are best."""


def clamping(scenes):
    scene, pictures = scenes[1], []
    for name, settings in CLAMPED:
        pictures.append(OUT / f"ims-clamping-{name}.png")
        scene.render("ims", settings, 128, 1, [pictures[-1]], "120x180", ["fov=26"])
    sheet(pictures, len(pictures), ROOT / "docs/images/ims-clamping.png")
    return """![Smoke lit by virtual lights: unclamped, clamped, what was lost, what compensation finds, compensated](../images/ims-clamping.png)

Light of virtual lights alone, of the same 256 walks, tone mapped alike: unclamped; clamped; what clamping takes; what compensation finds, in expectation the same; clamped and compensated."""


TABLES = {
    "compensation": ("Compensation and how it ends", compensations),
    "transmittance": ("Transmittance from the local mean", transmittances),
    "walks": ("Walks by marching", marched_walks),
    "visibility": ("Visibility", visibilities),
    "fast": ("Pictures in less than a second", fast),
    "frame": ("Frames", frames),
    "lights": ("Number of virtual lights", lights),
    "strategies": ("Ways to compensate at equal cost", strategies),
    "pictures": ("What clamping takes, and what is found again", clamping),
}


def sections_of(page):
    """What lies between the headings, by heading."""
    parts = page.split("\n## ")[1:]
    return {title: body.strip("\n") for title, body in (part.split("\n", 1) for part in parts)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", choices=TABLES, metavar="TABLE", help=f"{', '.join(TABLES)}; repeatable")
    options = parser.parse_args()
    if not VIRGA.exists():
        fail("build Virga first: scripts/build.sh")
    scenes = make_scenes(SIZE)
    sections = sections_of(PAGE.read_text()) if PAGE.exists() else {}
    for name in options.only or TABLES:
        title, measure = TABLES[name]
        sections[title] = measure(scenes)
        texts = [f"## {title}\n\n{sections[title]}\n" for title, _ in TABLES.values() if title in sections]
        PAGE.write_text("\n".join([INTRO, *texts]))


if __name__ == "__main__":
    main()
