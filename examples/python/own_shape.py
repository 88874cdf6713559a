"""A shape written in Python: a box with rounded edges; exact maps, and a network of it.

    python3 own_shape.py [own_shape.png]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import sdmgen


def pillow(length: float, roundness: float):
    """a superellipsoid, between a ball and a box"""
    n = 24
    polar, turn = np.meshgrid(np.linspace(-np.pi / 2, np.pi / 2, n + 1)[1:-1], 2 * np.pi * np.arange(2 * n) / (2 * n), indexing="ij")

    def power(x):
        return np.sign(x) * abs(x) ** roundness

    ring = np.stack([power(np.cos(polar)) * power(np.cos(turn)), power(np.cos(polar)) * power(np.sin(turn)), power(np.sin(polar))], -1)
    vertices = np.concatenate([ring.reshape(-1, 3), [[0, 0, -1], [0, 0, 1]]]) * [length, 1, 1]
    m, south, triangles = 2 * n, (n - 1) * 2 * n, []
    for j in range(m):
        k = (j + 1) % m
        triangles += [[south, k, j], [south + 1, (n - 2) * m + j, (n - 2) * m + k]]
        for i in range(n - 2):
            a, b, c, d = i * m + j, i * m + k, (i + 1) * m + j, (i + 1) * m + k
            triangles += [[a, b, c], [b, d, c]]
    return vertices, np.array(triangles)


shape = sdmgen.Shape(
    pillow, [sdmgen.Param("length", 1.0, 2.0, unit="mm"), sdmgen.Param("roundness", 0.4, 1.0, 0.7)]
)
folder = Path(tempfile.mkdtemp())
CONFIG = "shape: {name: pillow}\ngrid: {voxels: 32}\ndata: {start: 120, online: 0}\ntrain: {steps: 200}\n"
(folder / "pillow.yaml").write_text(CONFIG)
trained = sdmgen.train(folder / "pillow.yaml", out=folder / "run", shape=shape)
print(f"{trained.maps} exact maps, {trained.seconds:.1f} s, error {trained.accuracy.rmse_mm:.4f} mm ({trained.grade})")
p = {"length": 1.7, "roundness": 0.5}
network, exact = trained.model(p), sdmgen.exact(shape, trained.model.grid, params=p)
print(f"largest difference from the exact map {abs(network.values - exact.values).max():.4f} mm")

try:
    import matplotlib
except ImportError:
    sys.exit("no picture: matplotlib is not installed")
matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

k = exact.shape[0] // 2
figure, axes = plt.subplots(1, 3, figsize=(11, 3.5), layout="constrained")
for axis, picture, title in zip(axes, (exact, network, network.values - exact.values), ("exact", "network", "difference")):
    shown = axis.imshow(np.asarray(picture)[k], origin="lower", cmap="RdBu")
    axis.contour(exact.values[k], [0], colors="k")
    axis.set_title(title)
    figure.colorbar(shown, ax=axis, shrink=0.8)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "own_shape.png")
