#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes a foggy scene of the Crytek Sponza (Frank Meinl, Crytek; CC-BY 3.0), the hall of the instant-scattering paper.

The model is not part of the repository: name the folder that has meshes/crytek_sponza/crytek_sponza.obj, with its
.mtl and textures.

  VIRGA_ASSETS=FOLDER bench/sponza.py out/sponza
  build/release/virga render out/sponza/sponza.xml -m ims --set ims.mode=fast --passes 16 -o out/sponza.png --dots out/dots.png
"""

import argparse
import os
import pathlib
import sys

SCENE = """<!-- Crytek Sponza in fog, with sun. Written by bench/sponza.py; lengths are the model's, about a centimetre. -->
<scene version="3.0.0">
  <default name="width" value="640"/>
  <default name="height" value="480"/>
  <default name="spp" value="64"/>
  <default name="sigma_t" value="0.0004"/>
  <integrator type="volpath"/>
  <sensor type="perspective">
    <float name="fov" value="75"/>
    <transform name="to_world"><lookat origin="-1150, 190, -40" target="200, 330, -30" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="$width"/><integer name="height" value="$height"/></film>
    <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
  </sensor>
  <emitter type="directional"><vector name="direction" x="0.25" y="-1" z="0.18"/><rgb name="irradiance" value="14, 12.6, 10.5"/></emitter>
  <emitter type="constant"><rgb name="radiance" value="0.25, 0.33, 0.45"/></emitter>
{shapes}
  <shape type="cube">
    <transform name="to_world"><scale x="1830" y="770" z="1130"/><translate x="-60" y="650" z="-38"/></transform>
    <bsdf type="null"/>
    <medium name="interior" type="homogeneous"><float name="sigma_t" value="$sigma_t"/><float name="albedo" value="0.95"/></medium>
  </shape>
</scene>
"""


def read_materials(path):
    """{name: (texture's file name or None, Kd as text)}"""
    materials, name = {}, None
    for line in path.read_text().splitlines():
        words = line.split(maxsplit=1)
        if not words:
            continue
        if words[0] == "newmtl":
            name = words[1].strip()
            materials[name] = (None, "0.5, 0.5, 0.5")
        elif words[0] == "Kd":
            materials[name] = (materials[name][0], ", ".join(words[1].split()))
        elif words[0] == "map_Kd":
            materials[name] = (words[1].strip(), materials[name][1])
    return materials


class Part:
    """The faces of one material as an obj file of its own, with just the vertices that they use."""

    KINDS = ("v", "vt", "vn")

    def __init__(self):
        self.lines = []
        self.numbers = {kind: {} for kind in self.KINDS}

    def add_face(self, corners, attributes):
        face = []
        for corner in corners.split():
            indices = []
            for kind, index in zip(self.KINDS, corner.split("/")):
                numbers = self.numbers[kind]
                if index not in numbers:
                    numbers[index] = len(numbers) + 1
                    self.lines.append(f"{kind} {attributes[kind][int(index) - 1]}")
                indices.append(str(numbers[index]))
            face.append("/".join(indices))
        self.lines.append("f " + " ".join(face))


def read_parts(path):
    """{material: Part}. The file has positions, texture coordinates and normals for every corner, counted from 1."""
    attributes = {kind: [] for kind in Part.KINDS}
    parts, part = {}, None
    with path.open() as file:
        for line in file:
            word, _, rest = line.strip().partition(" ")
            if word in attributes:
                attributes[word].append(rest)
            elif word == "usemtl":
                part = parts.setdefault(rest, Part())
            elif word == "f":
                part.add_face(rest, attributes)
    return parts


def shape(name, material, textures):
    texture, color = material
    reflectance = f'<rgb name="reflectance" value="{color}"/>'
    if texture:
        reflectance = f'<texture name="reflectance" type="bitmap"><string name="filename" value="{textures / texture}"/></texture>'
    return f"""  <shape type="obj">
    <string name="filename" value="{name}.obj"/>
    <bsdf type="twosided"><bsdf type="diffuse">{reflectance}</bsdf></bsdf>
  </shape>"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path, help="where to write sponza.xml and its meshes")
    parser.add_argument("--assets", type=pathlib.Path, default=os.environ.get("VIRGA_ASSETS"))
    arguments = parser.parse_args()
    if not arguments.assets:
        sys.exit("Where is the model? Name its folder with --assets or VIRGA_ASSETS.")
    model = arguments.assets.resolve() / "meshes/crytek_sponza/crytek_sponza.obj"
    if not model.is_file():
        sys.exit(f"{model} is not there.")

    materials = read_materials(model.with_suffix(".mtl"))
    arguments.folder.mkdir(parents=True, exist_ok=True)
    shapes = []
    for name, part in read_parts(model).items():
        (arguments.folder / f"{name}.obj").write_text("\n".join(part.lines) + "\n")
        shapes.append(shape(name, materials[name], model.parent))
    (arguments.folder / "sponza.xml").write_text(SCENE.replace("{shapes}", "\n".join(shapes)))


if __name__ == "__main__":
    main()
