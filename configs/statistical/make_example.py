#!/usr/bin/env python3
"""Writes mean.ply and modes.npy beside itself: a synthetic point-distribution model of an egg with three modes.

The mean is an ellipsoid of half axes 4, 3 and 2.5 mm on a subdivided icosahedron of 642 vertices.
Modes, in mm per standard deviation: length along x, bend towards z, taper along x.
"""
import math
import pathlib
import struct

FOLDER = pathlib.Path(__file__).parent
AXES = (4.0, 3.0, 2.5)


def unit(v):
    length = math.sqrt(sum(c * c for c in v))
    return tuple(c / length for c in v)


def icosphere(levels):
    g = (1 + math.sqrt(5)) / 2
    vert = [unit(v) for v in [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g),
                              (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]]
    tri = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6),
           (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10),
           (8, 6, 7), (9, 8, 1)]
    for _ in range(levels):
        middle = {}

        def between(a, b):
            key = (min(a, b), max(a, b))
            if key not in middle:
                middle[key] = len(vert)
                vert.append(unit(tuple(p + q for p, q in zip(vert[a], vert[b]))))
            return middle[key]

        finer = []
        for a, b, c in tri:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        tri = finer
    return vert, tri


def main():
    sphere, tri = icosphere(3)
    mean = [tuple(r * c for r, c in zip(AXES, v)) for v in sphere]
    length = [(0.1 * x, 0.0, 0.0) for x, y, z in mean]
    bend = [(0.0, 0.0, 0.5 * ((x / AXES[0]) ** 2 - 1 / 3)) for x, y, z in mean]
    taper = [(0.0, 0.12 * y * x / AXES[0], 0.12 * z * x / AXES[0]) for x, y, z in mean]

    with open(FOLDER / "mean.ply", "w", encoding="ascii") as out:
        out.write(f"ply\nformat ascii 1.0\nelement vertex {len(mean)}\nproperty float x\nproperty float y\n"
                  f"property float z\nelement face {len(tri)}\nproperty list uchar int vertex_indices\nend_header\n")
        out.writelines("%.5f %.5f %.5f\n" % v for v in mean)
        out.writelines("3 %d %d %d\n" % t for t in tri)

    values = [c for mode in (length, bend, taper) for v in mode for c in v]
    head = "{'descr': '<f4', 'fortran_order': False, 'shape': (3, %d, 3), }" % len(mean)
    head += " " * (-(10 + len(head) + 1) % 64) + "\n"
    with open(FOLDER / "modes.npy", "wb") as out:
        out.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode("ascii"))
        out.write(struct.pack("<%df" % len(values), *values))


main()
