"""Runs in a bare Debian system (see packages.sh): a shape in Python, its exact map, a network of it, and derivatives."""

from pathlib import Path

import numpy as np
import sdmgen


def box(width: float, height: float):
    corners = [[x, y, z] for z in (0, height) for y in (0, 1) for x in (0, width)]
    triangles = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
                 [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]]
    return np.array(corners), np.array(triangles)


shape = sdmgen.Shape(box, [sdmgen.Param("width", 1, 2, unit="mm"), sdmgen.Param("height", 1, 3, 1.5)])
exact = sdmgen.exact_points(shape.mesh(width=1.5, height=2), [[0.75, 0.5, 1], [-1, 0.5, 1]])
assert np.allclose(exact.distance, [-0.5, 1]), exact.distance
Path("box.yaml").write_text("shape: {name: box}\ngrid: {voxels: 20}\ndata: {static: 2, start: 40, online: 0}\ntrain: {steps: 40}\n")
trained = sdmgen.train("box.yaml", out="box", shape=shape)
map = trained.model(width=1.5, height=2)
map.surface().write("box.stl")
slope = trained.model.jvp([1, 0], width=1.5, height=2)
print(f"{trained.maps} exact maps, error {trained.accuracy.rmse_mm:.3f} mm; smallest distance {map.values.min():.2f} mm")
assert map.values.min() < -0.3 and np.isfinite(slope.values).all() and Path("box.stl").stat().st_size > 1000
