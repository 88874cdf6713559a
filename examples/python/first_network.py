"""A shape written in Python, a network of it, a map, its gradient by PyTorch, a surface, a picture.

    python3 first_network.py [MINUTES of training, default 1]
"""

import sys
from pathlib import Path

import numpy as np
import torch

import sdmgen
import sdmgen.torch

CORNERS = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
FACES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
TRIANGLES = np.array([[a, b, c] for a, b, c, _ in FACES] + [[a, c, d] for a, _, c, d in FACES])


def box(width: float, height: float):
    """vertices [8][3] and triangles [12][3], counter-clockwise seen from outside"""
    return CORNERS * [width, 1, height], TRIANGLES


shape = sdmgen.Shape(box, [sdmgen.Param("width", 1, 2, unit="mm"), sdmgen.Param("height", 1, 3, unit="mm")])
Path("box.yaml").write_text("shape: {name: box}\ngrid: {voxels: 32}\n")
minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 1
trained = sdmgen.train("box.yaml", {"train.minutes": minutes}, out="box", shape=shape, force=True)
print(f"{trained.maps} exact maps, root mean square error {trained.accuracy.rmse_mm:.2g} mm ({trained.grade})")

params = torch.tensor([[1.5, 2.0]], dtype=torch.float64, requires_grad=True)
sdmgen.torch.Sdm(trained.model)(params)[0].mean().backward()
print("derivative of the mean distance by width and height:", params.grad[0].numpy())

sdm = trained.model(width=1.5, height=2)
sdm.surface().write("box.stl")

try:
    import matplotlib
except ImportError:
    sys.exit("no picture: matplotlib is not installed")
matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

plt.imshow(sdm.values[:, sdm.shape[1] // 2], origin="lower", cmap="RdBu")
plt.colorbar(label="signed distance, mm")
plt.contour(sdm.values[:, sdm.shape[1] // 2], [0], colors="k")
plt.savefig("first_network.png")
