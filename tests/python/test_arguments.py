"""Wrong arguments: one clear exception each; other layouts of good arrays are copied."""

import pickle

import numpy as np
import pytest
from conftest import ball

import sdmgen


def refuses(text, function, *arguments, kind=sdmgen.ArgumentError, **named):
    with pytest.raises(kind) as caught:
        function(*arguments, **named)
    assert text in str(caught.value), caught.value
    assert isinstance(caught.value, sdmgen.Error) and "\n" not in caught.value.text
    return caught.value


def test_dtypes_and_shapes(model):
    refuses("parameters: need real numbers, not values of type complex128", model, np.zeros(4, complex))
    refuses("parameters: need real numbers, not values of type <U1", model, ["a", "b", "c", "d"])
    refuses("parameters: need real numbers, not values of type object", model, [None, 1, 2, 3])
    refuses("parameters: need an array of shape [4], not [3]", model, [1, 2, 3])
    refuses("parameters: need an array of shape [n, 4], not [4]", model.batch, [1, 2, 3, 4])
    refuses("parameters: not an array", model, [[1, 2], 3, 4, 5])
    refuses("unknown parameter 'z'; the parameters are a, alpha, b, phi", model, z=3)
    refuses("unknown parameter 'alfa'; did you mean 'alpha'? the parameters", model, alfa=3)
    refuses("unknown parameter 'spacin'; did you mean 'spacing'? the parameters", model, spacin=1)
    refuses("parameter a: need an array of shape []", model, a=[1, 2])
    refuses("adjoint: need an array of shape [12, 14, 16]", model.vjp, np.zeros((3, 3, 3)))
    refuses("direction: need an array of shape [4]", model.jvp, [1])
    refuses("points: need an array of shape [n, 3], not [2, 2]", model.sample, np.zeros((2, 2)))
    refuses("vertices: need an array of shape [n, 3]", sdmgen.Mesh, np.zeros(3), [[0, 0, 0]])
    refuses("triangles: need integers, not values of type float64", sdmgen.Mesh, np.zeros((3, 3)), np.zeros((1, 3)))
    refuses("triangles: need integers from 0 to 4294967295", sdmgen.Mesh, np.zeros((3, 3)), [[0, 1, -1]])
    refuses("need a Shape, a Mesh or a pair", sdmgen.exact, 7)


def test_nan_and_infinity(model):
    nan, inf = float("nan"), float("inf")
    for policy in ("refuse", "clamp"):
        refuses("parameter 'a'", model, a=nan, policy=policy, kind=sdmgen.RangeError)
        refuses("parameter 'a'", model, a=inf, policy=policy, kind=sdmgen.RangeError)
    refuses("points: a value is NaN or infinite", model.sample, [[0, nan, 0]])
    refuses("points: a value is NaN or infinite", sdmgen.exact_points, ball(), [[0, 0, inf]])
    refuses("", sdmgen.exact, (np.full((3, 3), nan), [[0, 1, 2]]), kind=sdmgen.MeshError)
    refuses("triangle 0 names vertex 9 of 3", sdmgen.exact, (np.eye(3), [[0, 1, 9]]), kind=sdmgen.MeshError)
    refuses("origin: a value is NaN", sdmgen.Grid, (3, 3, 3), 1.0, (0, 0, nan))
    refuses("spacing", sdmgen.Grid, (3, 3, 3), -1.0)
    refuses("size: need an integer from 1", sdmgen.Grid, (3, 3, 0), 1.0)
    refuses("orthonormal", sdmgen.Grid, (3, 3, 3), 1.0, (0, 0, 0), np.ones((3, 3)))


def test_words_and_numbers(model):
    refuses("policy: need one of 'refuse', 'clamp', 'exact', not 'refus'", model, policy="refus")
    refuses("outside: need one of", model, outside="no")
    refuses("error_of: need one of", model, max_error=1.0, error_of="mid")
    refuses("threads: need an integer from 0", model, threads=-1)
    refuses("threads: need an integer from 0", model, threads=1.5)
    refuses("max_error: need a positive number", model, max_error=0)
    refuses("layers: need one of", sdmgen.exact, ball(), layers=["near"])
    refuses("'jacobian' needs a shape", sdmgen.exact, ball(), layers=["jacobian"])
    refuses("sign: need one of", sdmgen.exact, ball(), sign="up")
    refuses("grid: give a grid, or size", sdmgen.exact, ball(), sdmgen.Grid((3, 3, 3), 1.0), size=(3, 3, 3))
    refuses("makes over 2^20 voxels", sdmgen.exact, ball(), spacing=1e-9)
    refuses("narrow: need a number of voxels", sdmgen.exact, ball(), narrow=0.1)


def test_files(tmp_path):
    refuses("no-such.sdm", sdmgen.Model, tmp_path / "no-such.sdm", kind=OSError)
    (tmp_path / "bad.sdm").write_bytes(b"not a model")
    refuses("bad.sdm", sdmgen.Model, tmp_path / "bad.sdm", kind=sdmgen.FormatError)
    refuses("need the name of a file", sdmgen.Model, 3.5)
    refuses("the name must end in", sdmgen.read, tmp_path / "x.what", kind=sdmgen.UnsupportedError)
    refuses("", sdmgen.write, tmp_path / "no" / "x.ply", sdmgen.Mesh(*ball()), kind=sdmgen.FileError)
    refuses("write: need an Image", sdmgen.write, tmp_path / "x.ply", 3)
    refuses("unknown shape 'tors'; did you mean 'torus'?", sdmgen.Shape, "tors", kind=sdmgen.ShapeError)
    refuses("edg", sdmgen.Shape, "torus", edg=0.1, kind=sdmgen.ConfigError)


def test_errors_are_ordinary_exceptions():
    error = sdmgen.RangeError("range", "too large")
    again = pickle.loads(pickle.dumps(error))
    assert (again.status, again.text, str(again)) == ("range", "too large", "too large")
    assert issubclass(sdmgen.RangeError, ValueError) and issubclass(sdmgen.FileError, OSError)
    assert issubclass(sdmgen.OutOfMemoryError, MemoryError) and issubclass(sdmgen.FormatError, ValueError)
    assert str(pickle.loads(pickle.dumps(sdmgen.FileError("io", "no file")))) == "no file"


def test_other_layouts_are_copied(model):
    p = np.stack([model.defaults, model.defaults])
    expected = model(model.defaults).values
    for array in (p.T.copy().T[0], p[::-1][1], p.astype(">f8")[0], list(p[0]), tuple(p[0])):
        assert np.array_equal(model(array).values, expected)
    assert np.array_equal(model.batch(np.asfortranarray(p)).values[1], expected)
    w = np.random.default_rng(1).normal(size=model.grid.shape).astype(np.float32)
    for array in (np.asfortranarray(w), w.astype(float), np.repeat(w, 2, axis=2)[:, :, ::2]):
        assert np.array_equal(model.vjp(array), model.vjp(w))
    vertices, triangles = ball()
    x = np.random.default_rng(2).normal(size=(20, 3))
    plain = sdmgen.exact_points((vertices, triangles), x).distance
    for t in (triangles.astype(np.int32), triangles.astype(np.uint64)[::-1][::-1], np.asfortranarray(triangles)):
        assert np.array_equal(sdmgen.exact_points((vertices, t), np.asfortranarray(x)).distance, plain)
    # a mesh has its own copies
    mesh = sdmgen.Mesh(vertices, triangles)
    vertices[:] = 0
    assert np.array_equal(mesh.distance(x), plain)
    with pytest.raises(ValueError):
        mesh.vertices[0, 0] = 1
    # float32 vertices are converted, not reinterpreted
    assert np.array_equal(sdmgen.Mesh(np.eye(3, dtype=np.float32), [[0, 1, 2]]).vertices, np.eye(3))
