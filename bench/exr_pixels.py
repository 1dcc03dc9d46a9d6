# SPDX-License-Identifier: Apache-2.0
"""Pictures as Virga writes them to EXR, without any library for that: single part, scan lines, ZIP, channels of 32-bit floats."""

import struct
import zlib

import numpy as np

MAGIC, ZIP, FLOAT, LINES = 20000630, 3, 2, 16


def _text(data, at):
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 1


def _header(data):
    """Attributes by name, and where the header ends."""
    magic, version = struct.unpack_from("<II", data)
    if magic != MAGIC or version & 0x1a00:
        raise ValueError("not an EXR of one part with scan lines")
    found, at = {}, 8
    while data[at]:
        name, at = _text(data, at)
        _, at = _text(data, at)
        size, = struct.unpack_from("<i", data, at)
        found[name] = data[at + 4:at + 4 + size]
        at += 4 + size
    return found, at + 1


def _channels(body):
    """Names in the file's order."""
    names, at = [], 0
    while body[at]:
        name, at = _text(body, at)
        if struct.unpack_from("<i", body, at)[0] != FLOAT:
            raise ValueError(f"channel {name} does not hold floats")
        names.append(name)
        at += 16
    return names


def _unpacked(block, size):
    """A block of lines: its bytes are differences, and the halves of the block lie one in the other."""
    if len(block) == size:
        return np.frombuffer(block, np.uint8)
    raw = np.frombuffer(zlib.decompress(block), np.uint8).astype(np.int64)
    raw[1:] -= 128
    raw = np.cumsum(raw).astype(np.uint8)
    lines, half = np.empty(size, np.uint8), (size + 1) // 2
    lines[0::2], lines[1::2] = raw[:half], raw[half:]
    return lines


def read(path, layer=""):
    """A picture, or one of its layers: an array (row, column, 3), linear."""
    data = path.read_bytes()
    header, at = _header(data)
    if header["compression"][0] != ZIP:
        raise ValueError(f"{path}: not compressed by ZIP")
    names = _channels(header["channels"])
    x0, y0, x1, y1 = struct.unpack("<4i", header["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    pixels = np.empty((height, len(names), width), np.float32)
    at += 8 * (-(-height // LINES))  # the table of the blocks
    for _ in range(-(-height // LINES)):
        y, size = struct.unpack_from("<ii", data, at)
        first, count = y - y0, min(LINES, y1 - y + 1)
        lines = _unpacked(data[at + 8:at + 8 + size], 4 * count * len(names) * width)
        pixels[first:first + count] = lines.view("<f4").reshape(count, len(names), width)
        at += 8 + size
    prefix = f"{layer}." if layer else ""
    return np.stack([pixels[:, names.index(prefix + c)] for c in "RGB"], axis=-1).astype(np.float64)
