# SPDX-License-Identifier: Apache-2.0
"""PERF.DATA BINARY: what a render spends its time on.

The binary needs debug information (-g); record with `perf record -e cpu-clock -F 2500 -o PERF.DATA BINARY render ...`. A sample counts for
the innermost inlined function that a row of TASKS names.
"""

import collections
import os
import re
import subprocess
import sys

TASKS = [
    ("logarithms", r"exponential|logf"),
    ("random numbers", r"Pcg32|core/(random|sampler)\.h"),
    ("lamp tables", r"LampTable|lamp_tables\.h"),
    ("checks of tables", r"optical_depth\.h"),
    ("grid lookups", r"BoxView|lookupInside|SparseGridView"),
    ("majorant cells", r"CellAxis|walkMajorants|forEachMajorant|CoarseGridView|clipToBox"),
    ("tentative collisions", r"transport/tracking\.h"),
    ("crossings and media", r"[cC]rossing|media_walk\.h|MediaState"),
    ("ray queries", r"ray_scene|embree|RayScene"),
    ("equiangular connections", r"equiangular\.h|atanf?\b|atan2f"),
    ("guides toward lamps", r"lamp_guide\.h"),
    ("sharing between pixels", r"shared_paths\.h|pixel_groups\.h|path_pixels\.h"),
    ("film", r"Film|PassFrame|/image/"),
    ("phase functions and bsdfs", r"/scattering/|warp\.h|sincosf|powf|expf"),
    ("camera, lights, surface points", r"camera\.h|emitter\.h|shape\.h|spherical_rectangle"),
    ("vertices and connections", r"methods/path/|transport/(vertex|visibility)\.h"),
]


def task_of(frames):
    for frame in frames:
        for task, pattern in TASKS:
            if re.search(pattern, frame):
                return task
    return "other"


def samples(data, binary):
    """Addresses in the binary, as it lies in its file, and names elsewhere, with how often each was met."""
    script = ["perf", "script", "-i", data, "--show-mmap-events", "-F", "ip,sym,dso"]
    maps, inside, outside = [], collections.Counter(), collections.Counter()
    for line in subprocess.run(script, capture_output=True, text=True, check=True).stdout.splitlines():
        mapped = re.search(r"MMAP2? .*\[0x([0-9a-f]+)\(0x([0-9a-f]+)\) @ (?:0x)?([0-9a-f]+) .* (\S+)$", line)
        if mapped:
            if os.path.basename(mapped[4]) == os.path.basename(binary):
                maps.append([int(mapped[i], 16) for i in (1, 2, 3)])
            continue
        sample = re.match(r"\s*([0-9a-f]+)\s+(.*)\s+\((\S+)\)$", line)
        if sample and os.path.basename(sample[3]) == os.path.basename(binary):
            ip = int(sample[1], 16)
            inside[next(ip - start + offset for start, size, offset in maps if start <= ip < start + size)] += 1
        elif sample:
            outside[f"{sample[2]} {sample[3]}"] += 1
    return inside, outside


def loaded_address(binary):
    """File offsets to the addresses that the debug information knows."""
    headers = subprocess.run(["readelf", "-lW", binary], capture_output=True, text=True, check=True).stdout
    segments = [[int(x, 16) for x in m] for m in re.findall(r"LOAD\s+(\S+)\s+(\S+)\s+\S+\s+(\S+)", headers)]
    return lambda at: next(at - start + address for start, address, size in segments if start <= at < start + size)


def inlined_frames(binary, addresses):
    symbolizer = ["llvm-symbolizer", f"--obj={binary}", "--inlining"]
    text = subprocess.run(symbolizer, input="\n".join(map(hex, addresses)), capture_output=True, text=True, check=True).stdout
    for block in text.strip().split("\n\n"):
        lines = block.split("\n")
        # Template arguments and parameters name other functions: the function's own name and its file count.
        yield [re.sub(r"[<(].*", "", name) + " " + place for name, place in zip(lines[::2], lines[1::2])]


def main():
    data, binary = sys.argv[1:]
    inside, outside = samples(data, binary)
    address = loaded_address(binary)
    shares = collections.Counter()
    for count, frames in zip(inside.values(), inlined_frames(binary, [address(at) for at in inside])):
        shares[task_of(frames)] += count
    for name, count in outside.items():
        shares[task_of([name])] += count
    for task, count in shares.most_common():
        print(f"{task:32} {100 * count / shares.total():5.1f} %")


if __name__ == "__main__":
    main()
