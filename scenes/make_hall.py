#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes hall.xml beside itself: a colonnaded court in fog, open to the sun, 8 wide, 6 high and 20 long.

Two rows of columns carry galleries along the sides; the sun falls in through the open middle.
"""

import pathlib

HALF_WIDTH, HEIGHT, HALF_LENGTH = 4, 6, 10
ROW, GALLERY = 2.2, 3.8  # where the columns stand, and the height of the floor above them
COLUMNS = [-9, -6, -3, 0, 3, 6, 9]


def box(center, half, bsdf):
    return f"""  <shape type="cube"><transform name="to_world"><scale x="{half[0]:g}" y="{half[1]:g}" z="{half[2]:g}"/>\
<translate x="{center[0]:g}" y="{center[1]:g}" z="{center[2]:g}"/></transform><ref id="{bsdf}"/></shape>"""


def column(x, z, foot, head, radius):
    return [
        f"""  <shape type="cylinder"><point name="p0" x="{x:g}" y="{foot:g}" z="{z:g}"/><point name="p1" x="{x:g}" y="{head:g}" z="{z:g}"/>\
<float name="radius" value="{radius:g}"/><ref id="stone"/></shape>""",
        box((x, foot + 0.1, z), (1.4 * radius, 0.1, 1.4 * radius), "stone"),
        box((x, head - 0.12, z), (1.5 * radius, 0.12, 1.5 * radius), "stone"),
    ]


def shapes():
    yield box((0, -0.1, 0), (HALF_WIDTH, 0.1, HALF_LENGTH), "floor")
    for side in (-1, 1):
        yield box((side * (HALF_WIDTH + 0.1), HEIGHT / 2, 0), (0.1, HEIGHT / 2, HALF_LENGTH), "plaster")
        yield box((0, HEIGHT / 2, side * (HALF_LENGTH + 0.1)), (HALF_WIDTH, HEIGHT / 2, 0.1), "plaster")
        middle, half = side * (ROW + HALF_WIDTH) / 2, (HALF_WIDTH - ROW) / 2 + 0.15
        yield box((middle - side * 0.15, GALLERY, 0), (half, 0.15, HALF_LENGTH), "stone")
        yield box((middle - side * 0.15, HEIGHT - 0.1, 0), (half, 0.1, HALF_LENGTH), "stone")
        for z in COLUMNS:
            yield from column(side * ROW, z, 0, GALLERY - 0.15, 0.28)
            yield from column(side * ROW, z, GALLERY + 0.15, HEIGHT - 0.2, 0.16)
        for z in COLUMNS[1::2]:  # banners between the columns
            yield box((side * ROW, 2.6, z + 1.5), (0.02, 0.7, 0.5), "red" if side < 0 else "green")


SCENE = """<!-- A colonnaded court in fog, open to the sun. Written by make_hall.py. -->
<scene version="3.0.0">
  <default name="width" value="640"/>
  <default name="height" value="480"/>
  <default name="spp" value="64"/>
  <default name="sigma_t" value="0.06"/>
  <integrator type="volpath"/>
  <sensor type="perspective">
    <float name="fov" value="70"/>
    <transform name="to_world"><lookat origin="-0.6, 1.7, 9.2" target="0.5, 2.5, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="$width"/><integer name="height" value="$height"/></film>
    <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
  </sensor>
  <emitter type="directional"><vector name="direction" x="0.42" y="-1" z="0.35"/><rgb name="irradiance" value="6, 5.4, 4.3"/></emitter>
  <emitter type="constant"><rgb name="radiance" value="0.12, 0.17, 0.25"/></emitter>
  <bsdf type="diffuse" id="stone"><rgb name="reflectance" value="0.62, 0.56, 0.47"/></bsdf>
  <bsdf type="diffuse" id="plaster"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf>
  <bsdf type="diffuse" id="floor"><rgb name="reflectance" value="0.45, 0.4, 0.35"/></bsdf>
  <bsdf type="diffuse" id="red"><rgb name="reflectance" value="0.6, 0.08, 0.05"/></bsdf>
  <bsdf type="diffuse" id="green"><rgb name="reflectance" value="0.1, 0.4, 0.12"/></bsdf>
{shapes}
  <shape type="cube">
    <transform name="to_world"><scale x="3.99" y="3.2" z="9.99"/><translate y="3.21"/></transform>
    <bsdf type="null"/>
    <medium name="interior" type="homogeneous"><float name="sigma_t" value="$sigma_t"/><float name="albedo" value="0.95"/></medium>
  </shape>
</scene>
"""

if __name__ == "__main__":
    text = SCENE.replace("{shapes}", "\n".join(shapes()))
    pathlib.Path(__file__).with_name("hall.xml").write_text(text)
