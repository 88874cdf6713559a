"""Maps of a shape at several parameters, exact, with the derivative by one of them.

    python3 maps.py [maps.png]
"""

import sys

import numpy as np

import sdmgen

shape = sdmgen.Shape("cochlea")
name = shape.params[0].name
values = np.linspace(shape.params[0].min + 1, shape.params[0].max, 3)
grid = sdmgen.exact(shape, params={name: values[-1]}, spacing=0.2).grid
maps = [sdmgen.exact(shape, grid, params={name: v}, layers=["jacobian"]) for v in values]
for v, sdm in zip(values, maps):
    print(f"{name} = {v:.2f} mm: volume {sdm.surface().audit().volume:.1f} mm^3, {sdm.values.min():.2f} mm deepest")

try:
    import matplotlib
except ImportError:
    sys.exit("no picture: matplotlib is not installed")
matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

k = grid.shape[0] // 2
figure, axes = plt.subplots(2, len(maps), figsize=(10, 6), layout="constrained")
for column, (v, sdm) in enumerate(zip(values, maps)):
    for row, (picture, title) in enumerate(((sdm.values, f"{name} = {v:.2f} mm"), (sdm.jacobian[0], f"derivative by {name}"))):
        axis = axes[row, column]
        limit = abs(picture[k]).max()
        shown = axis.imshow(picture[k], origin="lower", cmap="RdBu", vmin=-limit, vmax=limit)
        axis.contour(sdm.values[k], [0], colors="k")
        axis.set_title(title)
        figure.colorbar(shown, ax=axis, shrink=0.7)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "maps.png")
