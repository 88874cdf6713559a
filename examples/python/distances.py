"""Exact distances of points to a mesh file, or to a built-in shape, and their nearest points.

    python3 distances.py [MESH.ply] [distances.png]
"""

import sys

import numpy as np

import sdmgen

words = sys.argv[1:]
mesh = sdmgen.Mesh.read(words.pop(0)) if words and not words[0].endswith(".png") else sdmgen.Shape("cochlea").mesh()
report, audit = mesh.report(), mesh.audit()
print(f"{audit.triangles} triangles, closed: {audit.closed}, overlaps removed: {report.unioned}, signs by {report.sign}")
low, high = np.array(audit.low), np.array(audit.high)
x = np.random.default_rng(1).uniform(low - 1, high + 1, (2000, 3))
at = sdmgen.exact_points(mesh, x)
print(f"{(at.distance < 0).sum()} of {len(x)} points are inside; the largest distance is {at.distance.max():.2f} mm")

try:
    import matplotlib
except ImportError:
    sys.exit("no picture: matplotlib is not installed")
matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

most = abs(at.distance).max()
near = abs(x[:, 2] - x[:, 2].mean()) < 0.3
style = {"cmap": "RdBu", "clim": (-most, most), "angles": "xy", "scale_units": "xy", "scale": 1}
plt.quiver(*x[near, :2].T, *(at.closest - x)[near, :2].T, at.distance[near], **style)
plt.colorbar(label="signed distance, mm (negative inside)")
plt.axis("equal")
plt.title("from points to the nearest points of the surface")
plt.savefig(words[0] if words else "distances.png")
