# SPDX-License-Identifier: Apache-2.0
"""Wrong twins of the scenes of bench/peers. The comparison has to tell each from its scene, or its agreement says nothing."""

import xml.etree.ElementTree as ElementTree


def scale_numbers(element, factor):
    numbers = element.get("value").replace(",", " ").split()
    element.set("value", ", ".join(f"{factor * float(number):g}" for number in numbers))


def densify(root, factor):
    """All media, by their `scale`."""
    media = list(root.iter("medium"))
    for medium in media:
        scale = medium.find("float[@name='scale']")
        if scale is None:
            scale = ElementTree.SubElement(medium, "float", name="scale", value="1")
        scale_numbers(scale, factor)
    return len(media)


def scale_parameter(root, path, factor):
    """All values that the path finds."""
    found = root.findall(path)
    for element in found:
        scale_numbers(element, factor)
    return len(found)


def denser(percent):
    return f"media {percent} % denser", lambda root: densify(root, 1 + percent / 100)


def scaled(what, path, factor):
    return what, lambda root: scale_parameter(root, path, factor)


# Where media a tenth denser are not to be seen, or are not what the scene is for.
OWN = {
    "conductor": scaled("mirror 10 % darker", ".//bsdf[@type='conductor']/rgb[@name='specular_reflectance']", 0.9),
    "dielectric": scaled("index 1.75 instead of 1.4", ".//bsdf[@type='dielectric']/float[@name='int_ior']", 1.25),
    "grid-lamps": denser(60),
    "mesh-medium": denser(25),
    "roughconductor": scaled("a quarter smoother", ".//bsdf/float[@name='alpha']", 0.75),
    "roughdielectric": scaled("index 1.54 instead of 1.4", ".//bsdf/float[@name='int_ior']", 1.1),
    "textures": scaled("checkerboards 5 % darker", ".//texture[@type='checkerboard']/rgb", 0.95),
}


def write_wrong_twin(scene):
    """A copy of the scene with one thing wrong: its path, and what is wrong."""
    what, spoil = OWN.get(scene.stem, denser(10))
    tree = ElementTree.parse(scene)
    if spoil(tree.getroot()) == 0:
        raise ValueError(f"{scene}: there is nothing to spoil for the control \"{what}\"")
    target = scene.with_name(f"{scene.stem}-control.xml")
    tree.write(target)
    return target, what
