# SPDX-License-Identifier: Apache-2.0
"""How much light from medium to medium flickers in films of smoke by `ims.mode=frame`, with kept walks and without.

A plume of `virga make` over a ground, 128 x 128 pixels, one pass a frame. Change: mean absolute change from frame to frame over the
mean of (pixel + picture). Flicker: root mean square of what the change is off from that of 64 passes, over the picture's mean; that of
two such pictures is the reference's own. Noise likewise, of a frame. Seconds: of CPU, by the program's own clock, of the first frame
and of a later one.
"""

import json

import numpy as np

import exr_pixels
from ims_scenes import checked
from scenes import OUT, VIRGA, fail

FRAMES, RESOLUTION, HEADER = 9, 96, 48
REFERENCE_PASSES, REFERENCE_SEED = 64, 77
RETRACE = ("1", "0.125", "0")

SCENE = """<scene version="3.0.0"><integrator type="volpath"><integer name="max_depth" value="65"/></integrator>
  <sensor type="perspective"><float name="fov" value="34"/>
    <transform name="to_world"><lookat origin="0, 0.5, 5" target="0, -0.05, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="128"/><integer name="height" value="128"/><rfilter type="box"/></film></sensor>
  <emitter type="point"><point name="position" x="-2.5" y="3" z="1.5"/><rgb name="intensity" value="48"/></emitter>
  <shape type="rectangle"><transform name="to_world"><scale value="20"/><rotate x="1" angle="-90"/><translate y="-1"/></transform></shape>
  <shape type="cube"><transform name="to_world"><scale value="0.95"/></transform><bsdf type="null"/>
    <medium name="interior" type="heterogeneous"><volume name="sigma_t" type="gridvolume">
      <string name="filename" value="flicker-NAME.$frame.vol"/>
      <transform name="to_world"><scale value="2"/><translate value="-1, -1, -1"/></transform></volume>
      <rgb name="albedo" value="0.95"/><float name="scale" value="20"/></medium></shape></scene>
"""


def volume(name, frame):
    return OUT / f"flicker-{name}.{frame:04d}.vol"


def write(name, frame, header, values):
    volume(name, frame).write_bytes(header + values.astype(np.float32).tobytes())


def make_volumes():
    """Frames of the fast plume as `virga make` has them; of a slow one, an eighth of the way from one to the next; of a denser one."""
    checked("make", "smoke", "--resolution", RESOLUTION, "--seed", 1, "--frames", FRAMES, "-o", OUT / "flicker-fast.vol")
    bytes_of = [volume("fast", frame).read_bytes() for frame in (1, 2)]
    header, (first, second) = bytes_of[0][:HEADER], [np.frombuffer(b[HEADER:], np.float32) for b in bytes_of]
    for n in range(FRAMES):
        write("denser", n + 1, header, first * 1.004**n)
        write("slow", n + 1, header, first + (second - first) * (n / 8))


def film(name, retrace, passes=1, seed=1):
    """The layer of each frame, one channel, and the seconds of CPU that each took."""
    scene, out = OUT / f"flicker-{name}.xml", OUT / "flicker.exr"
    scene.write_text(SCENE.replace("NAME", name))
    checked("render", scene, "--frames", f"1..{FRAMES}", "-m", "ims", "--set", "ims.mode=frame", "--set", f"ims.retrace={retrace}", "--passes",
            passes, "--seed", seed, "--layers", "--quiet", "-o", out, "--stats", OUT / "flicker.json")
    frames = [f"flicker.{frame:04d}" for frame in range(1, FRAMES + 1)]
    pictures = [exr_pixels.read(OUT / f"{f}.exr", "media_to_media").mean(axis=2) for f in frames]
    return pictures, [json.loads((OUT / f"{f}.json").read_text())["seconds"]["render_cpu"] for f in frames]


def rms(difference):
    return np.sqrt((difference**2).mean())


def row(name, retrace, reference):
    pictures, seconds = film(name, retrace)
    level = [r.mean() for r in reference]
    steps = range(1, FRAMES)
    change = np.mean([np.mean(np.abs(pictures[i] - pictures[i - 1]) / (pictures[i - 1] + level[i])) for i in steps])
    flicker = np.mean([rms(pictures[i] - pictures[i - 1] - reference[i] + reference[i - 1]) / level[i] for i in steps])
    noise = np.mean([rms(pictures[i] - reference[i]) / level[i] for i in range(FRAMES)])
    print(f"| {name} | {retrace} | {100 * change:.2f} % | {100 * flicker:.1f} % | {100 * noise:.0f} % | {seconds[0]:.2f} | "
          f"{np.median(seconds[1:]):.2f} |", flush=True)


def main():
    if not VIRGA.exists():
        fail("build Virga first: scripts/build.sh release virga")
    OUT.mkdir(parents=True, exist_ok=True)
    make_volumes()
    print("| smoke | retrace | change | flicker | noise | first frame [s] | later [s] |\n| --- | --- | --- | --- | --- | --- | --- |")
    for name in ("denser", "slow", "fast"):
        reference = film(name, "1", REFERENCE_PASSES, REFERENCE_SEED)[0]
        for retrace in RETRACE:
            row(name, retrace, reference)


if __name__ == "__main__":
    main()
