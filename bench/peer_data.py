# SPDX-License-Identifier: Apache-2.0
"""What the scenes of bench/peers refer to: volumes, a sky, a picture, two meshes. All of it is computed here."""

import math
import struct
import zlib

import numpy as np

SIZE = (36, 28)  # of the scenes' films


def write_volume(path, values):
    """Mitsuba's .vol: an array (z, y, x, channel) in the unit cube."""
    values = np.ascontiguousarray(values, dtype="<f4")
    nz, ny, nx, channels = values.shape
    header = b"VOL" + struct.pack("<B5i6f", 3, 1, nx, ny, nz, channels, 0, 0, 0, 1, 1, 1)
    path.write_bytes(header + values.tobytes())


def write_png(path, rgb):
    """8 bits a channel, an array (row, column, 3)."""
    height, width, _ = rgb.shape
    rows = b"".join(b"\0" + row.astype(np.uint8).tobytes() for row in rgb)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def bitmap():
    import mitsuba as mi
    if mi.variant() is None:
        mi.set_variant("scalar_rgb")
    return mi.Bitmap


def read_picture(path):
    return np.array(bitmap()(str(path)))[..., :3]


def density():
    """Two puffs and a ripple, different along each axis; zero in a corner."""
    z, y, x = np.meshgrid(*[(np.arange(n) + 0.5) / n for n in (14, 12, 16)], indexing="ij")
    puff = np.exp(-20 * ((x - 0.35) ** 2 + (y - 0.4) ** 2 + (z - 0.6) ** 2)) + 0.6 * np.exp(-30 * ((x - 0.7) ** 2 + (y - 0.7) ** 2 + (z - 0.4) ** 2))
    return np.maximum(0, puff * (1 + 0.5 * np.sin(9 * x + 5 * y)) - 0.05)[..., None]


def colours(low, high):
    """A gradient of another colour along each axis."""
    z, y, x = np.meshgrid(*[(np.arange(n) + 0.5) / n for n in (5, 6, 7)], indexing="ij")
    return low + (high - low) * np.stack([x, y, z], axis=-1)


def sky():
    """A gradient from the horizon up, dark ground, and a sun of some pixels."""
    height, width = 32, 64
    rows = np.arange(height)[:, None] / height
    image = np.where(rows < 0.5, 0.2 + 0.6 * (1 - 2 * rows), 0.08)[..., None] * np.array([0.6, 0.8, 1.0]) * np.ones((1, width, 1))
    image[7:10, 40:43] = [60, 50, 40]
    return image.astype(np.float32)


def picture():
    """A gradient with a block that shows which way is up and left."""
    y, x = np.mgrid[0:12, 0:16]
    rgb = np.stack([40 + 12 * x, 60 + 14 * y, 200 - 8 * x], axis=-1)
    rgb[1:4, 1:5] = [250, 240, 30]
    return rgb


def write_star(path):
    """A closed mesh that is not convex: an octahedron whose faces were pulled out. Flat shaded, outward."""
    axes = [np.array(v, float) for v in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))]
    vertices, faces = list(axes), []
    for sx in (0, 1):
        for sy in (2, 3):
            for sz in (4, 5):
                a, b, c = (sx, sy, sz) if (sx + sy + sz) % 2 == 0 else (sx, sz, sy)
                vertices.append(0.75 * (axes[a] + axes[b] + axes[c]) / math.sqrt(3) * 0.7)
                tip = len(vertices) - 1
                faces += [(a, b, tip), (b, c, tip), (c, a, tip)]
    lines = [f"v {v[0]:.6f} {v[1]:.6f} {v[2]:.6f}" for v in vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n")


def write_smooth(path):
    """A coarse ball with normals of its own and texture coordinates, ascii PLY."""
    rings, sectors = 8, 12
    points = [(math.pi * r / rings, 2 * math.pi * s / sectors) for r in range(rings + 1) for s in range(sectors + 1)]
    lines = []
    for theta, phi in points:
        n = (math.sin(theta) * math.cos(phi), math.cos(theta), -math.sin(theta) * math.sin(phi))
        lines.append(" ".join(f"{v:.6f}" for v in (*n, *n, phi / (2 * math.pi), 1 - theta / math.pi)))
    faces = []
    for r in range(rings):
        for s in range(sectors):
            a, b = r * (sectors + 1) + s, (r + 1) * (sectors + 1) + s
            if r + 1 < rings:
                faces.append(f"3 {a} {b} {b + 1}")
            if r > 0:
                faces.append(f"3 {a} {b + 1} {a + 1}")
    properties = "".join(f"property float {n}\n" for n in ("x", "y", "z", "nx", "ny", "nz", "u", "v"))
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex {len(lines)}\n{properties}element face {len(faces)}\n"
                    "property list uchar int vertex_indices\nend_header\n" + "\n".join(lines + faces) + "\n")


def write_all(folder):
    write_volume(folder / "density.vol", density())
    write_volume(folder / "albedo.vol", colours(0.3, 0.95))
    write_volume(folder / "sigma_t_rgb.vol", colours(0.1, 1.0))
    write_png(folder / "picture.png", picture())
    bitmap()(sky()).write(str(folder / "sky.exr"))
    write_star(folder / "star.obj")
    write_smooth(folder / "smooth.ply")
