# SPDX-License-Identifier: Apache-2.0
"""The two scenes of bench/ims_settings.py, and pictures of them."""

import functools
import json
import re
import subprocess

import numpy as np

import exr_pixels
from scenes import OUT, ROOT, VIRGA, fail

FIRST_SEED, PATH_SEED = 100, 7700

# Smoke of `virga make` in a room with a lamp.
ROOM = """<scene version="3.0.0">
  <default name="fov" value="42"/>
  <sensor type="perspective"><float name="fov" value="$fov"/>
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


def virga(*words):
    return subprocess.run([str(VIRGA), *[str(word) for word in words]], capture_output=True, text=True)


def checked(*words):
    done = virga(*words)
    if done.returncode != 0:
        fail(done.stderr.strip())
    return done.stdout


def _room():
    volume, room = OUT / "ims-smoke.vdb", OUT / "ims-room.xml"
    checked("make", "smoke", "--resolution", 96, "--seed", 1, "-o", volume)
    turns = [("", "white"), ('<rotate x="1" angle="90"/>', "white"), ('<rotate x="1" angle="-90"/>', "white"),
             ('<rotate y="1" angle="90"/>', "red"), ('<rotate y="1" angle="-90"/>', "green")]
    text = ROOM.replace("{walls}", "".join(WALL.format(turn=t, bsdf=b) for t, b in turns))
    if not room.exists() or room.read_text() != text:  # its time says when pictures of it are stale
        room.write_text(text)
    return room


class Scene:
    """A scene and its clamping radius, which every picture by `ims` has unless its settings say otherwise."""

    def __init__(self, name, file, radius, size):
        self.name, self.file, self.radius, self.size = name, file, radius, size
        self.image = OUT / f"ims-{name}.exr"

    def render(self, method, settings, passes, seed, outputs, size=None, defines=()):
        """What --stats says."""
        stats, size = OUT / "ims.json", size or f"{self.size}x{self.size}"
        words = ["render", self.file, "-m", method, "--size", size, "--passes", passes, "--seed", seed, "--stats", stats, "-q"]
        for output in outputs:
            words += ["-o", output]
        for define in defines:
            words += ["-D", define]
        if method == "ims" and "radius=" not in settings:
            settings = f"radius={self.radius} {settings}"
        for setting in settings.split():
            words += ["--set", f"{method}.{setting}"]
        checked(*words)
        return json.loads(stats.read_text())

    def pictures(self, settings, passes, seeds):
        """One for each seed, (seed, row, column, channel), and the CPU seconds that all of them took."""
        found, seconds = [], 0
        for seed in range(FIRST_SEED, FIRST_SEED + seeds):
            seconds += self.render("ims", settings, passes, seed, [self.image])["seconds"]["render_cpu"]
            found.append(exr_pixels.read(self.image))
        return np.array(found), seconds

    @functools.cache
    def paths(self, passes, seeds):
        """Likewise by `path`; kept on disk while the program stays what it is."""
        found = []
        for seed in range(PATH_SEED, PATH_SEED + seeds):
            image = OUT / f"ims-path-{self.name}-{self.size}-{passes}-{seed}.exr"
            newest = max(file.stat().st_mtime for file in (VIRGA, self.file))
            if not image.exists() or image.stat().st_mtime < newest:
                self.render("path", "", passes, seed, [image])
            found.append(exr_pixels.read(image))
        return np.array(found)

    def lights_of(self, walks):
        """Virtual lights of a first pass: the number that it refuses to make maps for."""
        done = virga("render", self.file, "-m", "ims", "--passes", 1, "--size", "8x8", "-q", "-o", self.image, "--set", "ims.visibility=shadow_map",
                     "--set", "ims.map_resolution=1024", "--set", f"ims.walks={walks}")
        found = re.search(r"maps of (\d+) virtual lights", done.stderr)
        return int(found.group(1)) if found else 0


def make_scenes(size):
    OUT.mkdir(parents=True, exist_ok=True)
    return [Scene("hall", ROOT / "scenes/hall.xml", 3, size), Scene("smoke", _room(), 0.4, size)]
