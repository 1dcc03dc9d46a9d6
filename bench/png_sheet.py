# SPDX-License-Identifier: Apache-2.0
"""Pictures side by side, without any library: PNGs of 8 bits a channel, RGB, not interlaced, as Virga writes them."""

import struct
import zlib

GAP = 4  # pixels


def _unfilter(kind, line, above, channels):
    for i in range(len(line)):
        left = line[i - channels] if i >= channels else 0
        corner = above[i - channels] if i >= channels else 0
        if kind == 1:
            guess = left
        elif kind == 2:
            guess = above[i]
        elif kind == 3:
            guess = (left + above[i]) // 2
        elif kind == 4:
            near = [abs(left + above[i] - corner - c) for c in (left, above[i], corner)]
            guess = (left, above[i], corner)[near.index(min(near))]
        else:
            return
        line[i] = (line[i] + guess) & 255


def read(path):
    """Rows of RGB bytes."""
    data = path.read_bytes()
    at, packed = 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            width, height, depth, color, _, _, interlaced = struct.unpack(">IIBBBBB", body)
            if (depth, color, interlaced) != (8, 2, 0):
                raise ValueError(f"{path}: not a plain RGB picture")
        packed += body if kind == b"IDAT" else b""
        at += size + 12
    raw, stride, rows = zlib.decompress(packed), 3 * width, []
    above = bytearray(stride)
    for y in range(height):
        start = y * (stride + 1)
        line = bytearray(raw[start + 1:start + 1 + stride])
        _unfilter(raw[start], line, above, 3)
        rows.append(line)
        above = line
    return rows


def write(path, rows):
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", len(rows[0]) // 3, len(rows), 8, 2, 0, 0, 0)
    raw = b"".join(b"\0" + bytes(row) for row in rows)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b""))


def sheet(paths, columns, output):
    """Pictures of one size, row by row, on white."""
    pictures = [read(path) for path in paths]
    width = (len(pictures[0][0]) + 3 * GAP) * columns - 3 * GAP
    rows = []
    for first in range(0, len(pictures), columns):
        if rows:
            rows += [b"\xff" * width] * GAP
        group = pictures[first:first + columns]
        rows += [(b"\xff" * 3 * GAP).join(bytes(p[y]) for p in group) for y in range(len(group[0]))]
    write(output, rows)
