"""Random calls of the package, many of them wrong: each returns or raises an sdmgen.Error, and nothing
crashes.

    python3 fuzz_calls.py CALLS SEED
"""

import os
import random
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from conftest import SOURCE, ball

import sdmgen

NAN, INF = float("nan"), float("inf")


def array(rng):
    """An array of any type, shape and layout."""
    shape = rng.choice([(), (0,), (3,), (4,), (0, 3), (2, 3), (5, 3), (2, 4), (1, 4), (3, 3), (4, 5, 6), (12, 14, 16)])
    kind = rng.choice(["f8", "f4", "i4", "u4", "u1", "i8", "?", "c16", "O", ">f8", "U1"])
    values = np.array([rng.choice([0, 1, -1, 0.5, 3, 1e30, NAN, INF, 1e-300]) for _ in range(int(np.prod(shape)))])
    with np.errstate(all="ignore"):
        made = values.reshape(shape).astype("f8" if kind in "OU1" else kind)
    made = made.astype(kind)
    return rng.choice([made, made, np.asfortranarray(made), made[::-1] if made.ndim else made, made.tolist()])


def value(rng):
    """Any argument."""
    return rng.choice([
        lambda: array(rng), lambda: array(rng), lambda: None, lambda: rng.choice([0, 1, -1, 2**40, 0.3, NAN, INF, -0.0]),
        lambda: rng.choice(["", "refuse", "exact", "torus", "a", "no such", "x\0y", "\udcff"]),
        lambda: {"a": rng.choice([4.1, NAN, "x", None])}, lambda: object(), lambda: [], lambda: (1, 2, 3),
        lambda: rng.choice(KEPT), lambda: sdmgen.Grid((3, 4, 5), 0.5), lambda: True, lambda: b"bytes",
    ])()  # fmt: skip


def good(rng, model):
    """A valid parameter vector, sometimes just outside of the range."""
    return [p.min + rng.uniform(-0.02, 1.02) * (p.max - p.min) for p in model.params]


def calls(model, shape, python_shape, folder):
    """Functions of a random number generator that call the package."""
    mesh, grid = sdmgen.Mesh(*ball(n=5)), sdmgen.Grid((6, 5, 4), 0.5, (-1, -1, -1))
    image = sdmgen.exact(mesh, grid)

    def one_of(good_value, rng):
        return good_value if rng.random() < 0.6 else value(rng)

    return [
        lambda r: model(one_of(good(r, model), r), policy=one_of("clamp", r)),
        lambda r: model(one_of(good(r, model), r), grid=one_of(grid, r), outside=one_of("bound", r)),
        lambda r: model(size=one_of((4, 4, 4), r), spacing=one_of(0.5, r), origin=one_of((-1, -1, -1), r)),
        lambda r: model.batch(one_of([good(r, model)], r), threads=one_of(1, r)),
        lambda r: model.jacobian(one_of(good(r, model), r)),
        lambda r: model.jvp(one_of([1, 0, 0, 0], r), one_of(good(r, model), r)),
        lambda r: model.vjp(one_of(np.ones(model.grid.shape), r), one_of(good(r, model), r)),
        lambda r: model.sample(one_of([[0, 0, 0]], r), gradient=one_of(True, r), slopes=one_of(False, r)),
        lambda r: model.band(one_of(1.5, r), grid=one_of(None, r)),
        lambda r: model.field(one_of(good(r, model), r), derivatives=one_of(True, r)).sample(value(r), slopes=True),
        lambda r: sdmgen.exact(one_of(mesh, r), one_of(grid, r), layers=one_of(["normal"], r), narrow=one_of(None, r)),
        lambda r: sdmgen.exact(one_of(python_shape, r), one_of(grid, r), params=one_of([1.0], r), sign=one_of("auto", r)),
        lambda r: sdmgen.exact_points(one_of(mesh, r), one_of([[0, 0, 0]], r)),
        lambda r: sdmgen.exact_band(one_of(mesh, r), one_of(grid, r), one_of(1.0, r)),
        lambda r: sdmgen.Mesh(one_of(mesh.vertices, r), one_of(mesh.triangles, r)).audit(),
        lambda r: sdmgen.Grid(one_of((3, 3, 3), r), one_of(1.0, r), one_of((0, 0, 0), r), one_of(None, r)),
        lambda r: sdmgen.Map(one_of(image.values, r), one_of(grid, r)).surface(one_of(0.0, r)),
        lambda r: sdmgen.Image(one_of(image.values, r), one_of(grid, r)),
        lambda r: sdmgen.surface(one_of(image, r), one_of(0.1, r)),
        lambda r: sdmgen.Shape(one_of("torus", r), **r.choice([{}, {"edge": value(r)}, {"no": 1}])),
        lambda r: shape.mesh(one_of({"major": 2.5}, r)),
        lambda r: sdmgen.Param(value(r), value(r), value(r)) and sdmgen.Shape(
            lambda a: value(r), [sdmgen.Param("a", one_of(1, r), one_of(2, r))], name=one_of("f", r)).mesh(),
        lambda r: sdmgen.write(one_of(folder / "x.ply", r), one_of(mesh, r)),
        lambda r: sdmgen.read(r.choice([folder / "x.ply", folder / "none.nii", value(r)])),
        lambda r: sdmgen.Pose(one_of((0, 0, 0.1), r), one_of((1, 2, 3), r)).apply(one_of([[1, 2, 3]], r)),
        lambda r: sdmgen.Model(value(r)),
        lambda r: sdmgen.close_labels(one_of(image, r), one_of(0.5, r)),
        lambda r: sdmgen.fit(one_of(shape, r), value(r), **{r.choice(["label", "keep", "rotation", "eps"]): value(r)}),
    ]  # fmt: skip


KEPT = [None]


def main(n, seed):
    rng = random.Random(seed)
    folder = Path(tempfile.mkdtemp())
    os.chdir(folder)  # nothing may be written elsewhere
    trained = sdmgen.train(SOURCE / "tests/cli/tiny.yaml", ["train.steps=5", "data.start=20"], out=folder / "run")
    shape = sdmgen.Shape("torus")
    python_shape = sdmgen.Shape(lambda radius: ball(radius, n=5), [sdmgen.Param("radius", 0.5, 1.5)], name="ball")
    functions = calls(trained.model, shape, python_shape, folder)
    KEPT.extend([trained.model, shape, python_shape])
    seen = Counter()
    for i in range(n):
        try:
            rng.choice(functions)(rng)
            seen["returned"] += 1
        except sdmgen.Error as error:
            assert error.text and error.status != "internal", repr(error)
            seen[type(error).__name__] += 1
    print(dict(seen))
    assert seen["returned"] > n / 20 and len(seen) > 5
    return 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2])))
