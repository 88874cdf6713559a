"""Files: what is written can be read, by this package, by the program and by other libraries."""

import sys
import types

import numpy as np
import pytest
from conftest import ball

import sdmgen

TURN = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]


@pytest.fixture
def map():
    grid = sdmgen.Grid((14, 12, 11), 0.3, (-2.0, -1.8, -1.5))
    return sdmgen.exact(ball(), grid)


def test_images(map, tmp_path):
    for ending in (".nii", ".nii.gz", ".nrrd", ".mha"):
        file = tmp_path / f"map{ending}"
        sdmgen.write(file, map, text="a ball")
        image = sdmgen.read(file)
        assert np.array_equal(image.values, map.values) and image.text == "a ball" and image.placed
        assert image.grid.size == map.grid.size and np.allclose(image.origin, map.origin, atol=1e-6)
    sdmgen.write(tmp_path / "map.npy", map)
    assert np.array_equal(np.load(tmp_path / "map.npy"), map.values)
    assert np.array_equal(sdmgen.read(tmp_path / "map.npy"), map.values)
    turned = sdmgen.Grid((14, 12, 11), (0.3, 0.4, 0.5), (1, 2, 3), TURN)
    for dtype in (np.uint8, np.int16, np.uint32, np.int64, np.float64):
        labels = sdmgen.Image((map.values < 0).astype(dtype), turned)
        sdmgen.write(tmp_path / "labels.nrrd", labels)
        again = sdmgen.read(tmp_path / "labels.nrrd")
        assert np.array_equal(again.values, labels.values) and np.allclose(again.direction, TURN)
    with pytest.raises(sdmgen.ArgumentError, match="needs an array of shape"):
        sdmgen.Image(np.zeros((2, 2, 2)), turned)
    with pytest.raises(sdmgen.UnsupportedError, match=r"must end in one of .*\.vdb .*\.stl"):
        sdmgen.write(tmp_path / "map.png", map)


def test_meshes(map, tmp_path):
    mesh = sdmgen.Mesh(*ball())
    for ending in (".ply", ".obj", ".off", ".stl", ".vtk", ".vtp"):
        sdmgen.write(tmp_path / f"ball{ending}", mesh)
        again = sdmgen.read(tmp_path / f"ball{ending}")
        assert len(again.triangles) == len(mesh.triangles)
        assert again.audit().volume == pytest.approx(mesh.audit().volume, rel=1e-5)
    sdmgen.write(tmp_path / "surface.ply", map)
    assert np.array_equal(sdmgen.read(tmp_path / "surface.ply").vertices, map.surface().vertices)


def test_level_sets(run, map, tmp_path):
    try:
        sdmgen.write(tmp_path / "map.vdb", map, metadata={"sdm_shape": "ball"})
    except sdmgen.UnsupportedError:
        pytest.skip("built without OpenVDB")
    assert "ball" in run("info", tmp_path / "map.vdb")
    run("verify", tmp_path / "map.vdb")
    fine = sdmgen.Grid((60, 60, 60), 0.06, (-1.8, -1.8, -1.8))
    sdmgen.write(tmp_path / "band.vdb", sdmgen.exact_band(ball(), fine, 3 * 0.06))
    run("verify", tmp_path / "band.vdb")
    sdmgen.write(tmp_path / "dense.vdb", map, dense=True, half=True)
    with pytest.raises(sdmgen.ArgumentError, match="needs a Map or a Band"):
        sdmgen.write(tmp_path / "mesh.vdb", sdmgen.Mesh(*ball()))


def test_nibabel(map):
    pytest.importorskip("nibabel")
    image = map.to_nibabel()
    i = np.array([3, 4, 5])
    world = image.affine @ [*i, 1]
    assert np.allclose(world[:3], map.grid.points()[5, 4, 3] * [-1, -1, 1])
    assert image.get_fdata()[3, 4, 5] == map.values[5, 4, 3]


def test_simpleitk(map):
    sitk = pytest.importorskip("SimpleITK")
    image = map.to_itk()
    assert np.array_equal(sitk.GetArrayFromImage(image), map.values)
    assert np.allclose(image.TransformIndexToPhysicalPoint((3, 4, 5)), map.grid.points()[5, 4, 3])


class FakeImage:
    """What SimpleITK's documentation says of an image made from an array [z, y, x]: indices are (x, y, z),
    the direction is a matrix row by row, point = origin + direction (spacing * index)."""

    def __init__(self, array):
        self.array = array

    def SetOrigin(self, values):
        self.origin = self.three(values)

    def SetSpacing(self, values):
        self.spacing = self.three(values)

    def SetDirection(self, values):
        assert len(values) == 9 and all(type(v) is float for v in values)
        self.direction = np.reshape(values, (3, 3))

    def GetPixel(self, index):
        x, y, z = index
        return self.array[z, y, x]

    def TransformIndexToPhysicalPoint(self, index):
        return self.origin + self.direction @ (self.spacing * np.array(index))

    @staticmethod
    def three(values):
        assert len(values) == 3 and all(type(v) is float for v in values)
        return np.array(values)


def test_itk_without_it(map, monkeypatch):
    """Debian has no SimpleITK: the calls are checked against what its documentation says."""
    monkeypatch.setitem(sys.modules, "SimpleITK", types.SimpleNamespace(GetImageFromArray=FakeImage))
    turned = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    grid = sdmgen.Grid(map.grid.size, (0.5, 0.75, 1.25), (1, 2, 3), turned)
    image = sdmgen.Map(map.values, grid).to_itk()
    assert image.GetPixel((3, 4, 5)) == map.values[5, 4, 3]
    assert np.allclose(image.TransformIndexToPhysicalPoint((3, 4, 5)), grid.points()[5, 4, 3])


def test_vtk(map):
    pytest.importorskip("vtkmodules")
    image = map.to_vtk()
    number = image.ComputePointId((3, 4, 5))
    assert np.allclose(image.GetPoint(number), map.grid.points()[5, 4, 3])
    assert image.GetPointData().GetScalars().GetTuple1(number) == map.values[5, 4, 3]


def test_openvdb(map):
    try:
        import pyopenvdb  # noqa: F401
    except ImportError:
        pytest.importorskip("openvdb")
    grid = map.to_openvdb()
    assert grid.getConstAccessor().getValue((3, 4, 5)) == map.values[5, 4, 3]
    assert np.allclose(grid.transform.indexToWorld((3, 4, 5)), map.grid.points()[5, 4, 3])
