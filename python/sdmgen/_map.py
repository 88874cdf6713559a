"""Images and signed distance maps: arrays with a grid."""

from __future__ import annotations

from ctypes import byref, c_bool, c_double
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Optional, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arrays import Float32, Float64, address, float32, instance, number, whole
from ._errors import Error, argument_error, warn
from ._grid import Grid
from ._library import call, make

if TYPE_CHECKING:
    from ._mesh import Surface


@dataclass(frozen=True)
class Segment:
    """A segment of a segmentation: the voxels of `layer` that are equal to `value`."""

    name: str
    id: str
    value: int
    layer: int


class Image:
    """An image: `values`, C-contiguous [z, y, x] (a segmentation of several layers: [layer, z, y, x]),
    on a grid in the coordinates LPS (x to the left, y to the back, z to the head), mm."""

    def __init__(self, values: ArrayLike, grid: Grid, text: str = "") -> None:
        instance(grid, Grid, "grid")
        array = np.ascontiguousarray(values)
        if array.dtype.kind not in "fiu" or array.dtype.itemsize not in (1, 2, 4, 8):
            raise argument_error(f"values: need real numbers, not values of type {array.dtype}")
        if array.shape[-3:] != grid.shape or array.ndim not in (3, 4):
            raise argument_error(f"values: the grid needs an array of shape {list(grid.shape)}, not {list(array.shape)}")
        self.values: NDArray[Any] = array
        self.grid = grid
        #: a description of one line
        self.text = text
        #: the segments, if the file names any
        self.segments: tuple[Segment, ...] = ()
        #: whether the file states a frame; False: the default of its format is assumed
        self.placed = True

    @property
    def origin(self) -> Float64:
        """centre of the first voxel, LPS mm"""
        return self.grid.origin

    @property
    def spacing(self) -> Float64:
        """edges of a voxel along x, y, z, mm"""
        return self.grid.spacing

    @property
    def direction(self) -> Float64:
        """orthonormal matrix whose columns are the axes of the grid"""
        return self.grid.direction

    @property
    def shape(self) -> tuple[int, ...]:
        """the shape of `values`"""
        return self.values.shape

    def __array__(self, dtype: Any = None, copy: Any = None) -> NDArray[Any]:
        return np.array(self.values, dtype) if copy else np.asarray(self.values, dtype)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {list(self.values.shape)} {self.values.dtype}, {self.grid!r}>"

    def to_itk(self) -> Any:
        """the image as a SimpleITK.Image (needs SimpleITK)"""
        import SimpleITK

        image = SimpleITK.GetImageFromArray(self.values)
        image.SetOrigin([float(x) for x in self.origin])
        image.SetSpacing([float(x) for x in self.spacing])
        image.SetDirection([float(x) for x in self.direction.ravel()])
        return image

    def to_nibabel(self) -> Any:
        """the image as a nibabel.Nifti1Image in RAS (needs nibabel)"""
        import nibabel

        affine = np.diag([-1.0, -1.0, 1.0, 1.0]) @ self.grid.affine
        return nibabel.Nifti1Image(self.values.transpose(2, 1, 0), affine)

    def to_vtk(self) -> Any:
        """the image as a vtkImageData with the point data "values" (needs vtk)"""
        from vtkmodules.util.numpy_support import numpy_to_vtk
        from vtkmodules.vtkCommonDataModel import vtkImageData

        image = vtkImageData()
        image.SetDimensions(*self.grid.size)
        image.SetOrigin(*self.origin)
        image.SetSpacing(*self.spacing)
        image.SetDirectionMatrix(*self.direction.ravel())
        array = numpy_to_vtk(self.values.ravel(), deep=True)
        array.SetName("values")
        image.GetPointData().SetScalars(array)
        return image

    def to_openvdb(self) -> Any:
        """the values as a dense openvdb.FloatGrid with the transform of the grid (needs the Python
        module of OpenVDB); write(FILE.vdb) makes a level set"""
        try:
            import pyopenvdb as openvdb
        except ImportError:
            import openvdb

        grid = openvdb.FloatGrid()
        grid.copyFromArray(np.ascontiguousarray(self.values.transpose(2, 1, 0)))
        grid.transform = openvdb.createLinearTransform(self.grid.affine.T.tolist())
        return grid


@dataclass(frozen=True)
class Check:
    """The error of a map, mm: value of the map minus exact distance, at the voxels nearest to 1000
    points of the true surface. `bias` > 0: the map's surface lies inside the true one."""

    mean: float
    rmse: float
    q95: float
    max: float
    bias: float
    used: int
    outside: int


def check_of(c: Any) -> Check:
    return Check(c.mean_mm, c.rmse_mm, c.q95_mm, c.max_mm, c.bias_mm, c.used, c.outside)


@dataclass(frozen=True)
class MapInfo:
    """How a map was computed."""

    #: "network" or "exact"
    source: str = "exact"
    #: a parameter was moved into its range
    clamped: bool = False
    #: expected root mean square error, mm: that of the network on held-out maps; 0 if exact
    error_mm: float = 0.0
    #: why the exact engine computed the map of a model: "range" or "error"; "" else
    reason: str = ""
    #: the check of the network's map; None: it was not checked
    check: Optional[Check] = None
    #: the surface leaves the grid, so the map holds a part of the shape only (maps of a model)
    cut: bool = False


def info_of(result: Any) -> MapInfo:
    return MapInfo(
        ("network", "exact")[result.source],
        result.clamped,
        result.error_mm,
        ("", "range", "error")[result.reason],
        check_of(result.check) if result.checked else None,
        result.cut,
    )


class Doubts:
    """The uses that a model is not for, by sdm_model_check_use(): each warns once. Maps of the
    network share those of their model."""

    def __init__(self, texts: Optional[dict[str, str]] = None) -> None:
        self._texts = texts or {}

    def has(self, use: str) -> bool:
        return use in self._texts

    def warn(self, use: str) -> None:
        text = self._texts.pop(use, None)
        if text:
            warn(text)


class VolumeAdjoint(np.ndarray):  # type: ignore[type-arg]
    """Derivatives of the volume by the values of a map: `Model.vjp` of them warns of derivatives of
    volumes in place of those of maps."""


class Map(Image):
    """A signed distance map: float32 [z, y, x], mm, NEGATIVE INSIDE, on a grid in LPS."""

    values: Float32

    def __init__(self, values: ArrayLike, grid: Grid, info: Optional[MapInfo] = None, text: str = "") -> None:
        super().__init__(float32(values, (None, None, None), "values"), grid, text)
        #: how the map was computed
        self.info = info or MapInfo()
        self._doubts = Doubts()

    def _of(self, doubts: Doubts) -> Map:
        """This map of a model that has these doubts; an exact map has none."""
        if self.info.source == "network":
            self._doubts = doubts
        return self

    def surface(self, level: float = 0.0) -> Surface:
        """The surface on which the map has the value `level` (mm), by marching cubes."""
        return surface(self, level)

    def gradient(self, threads: int = 0) -> Float32:
        """The derivatives of the map along the world axes x, y, z (mm per mm): [3, z, y, x]."""
        result = np.empty((3, *self.grid.shape), np.float32)
        n = whole(threads, "threads", 0)
        call("sdm_map_gradient", self.grid, address(self.values), n, address(result))
        return result

    @property
    def volume(self) -> float:
        """the volume of the shape, mm^3, from the distances near the surface (method: `sdm_map_volume`
        in sdm/map.h). Warns once if the training of the model found volumes off by over 2 %"""
        self._doubts.warn("volume")
        result = c_double()
        call("sdm_map_volume", self.grid, address(self.values), 0, byref(result))
        return result.value

    def volume_adjoint(self) -> Float32:
        """derivatives of `volume` by the values, mm^3 per mm, [z, y, x]. `model.vjp(map.volume_adjoint())`
        gives the derivatives of the volume by the parameters. Warns once if the training of the model
        found these off by over 20 %, and names the parameters that hardly change the volume with an error
        above 20 % of their own derivative"""
        self._doubts.warn("volume_derivative")
        result = np.empty_like(self.values)
        call("sdm_map_volume_adjoint", self.grid, address(self.values), 0, address(result))
        return result.view(VolumeAdjoint)


def surface(map: Image, level: float = 0.0) -> Surface:
    """The surface on which a map has the value `level` (mm), by marching cubes (Lorensen and Cline
    1987): a mesh in world coordinates (LPS, mm) with normals towards larger values. For a map, which
    is negative inside, level 0 is the surface of the shape."""
    from ._mesh import Surface, taken_mesh

    values = float32(instance(map, Image, "map").values, map.grid.shape, "values")
    mesh, cut = make("sdm_mesh"), c_bool()
    call("sdm_isosurface", map.grid, address(values), number(level, "level"), byref(mesh), byref(cut))
    vertices, triangles = taken_mesh(mesh)
    return Surface(vertices, triangles, cut=cut.value)


class Batch:
    """Maps of several parameter vectors: `values`, float32 [n, z, y, x], mm, NEGATIVE INSIDE."""

    def __init__(self, values: Float32, grid: Grid, infos: list[MapInfo], doubts: Optional[Doubts] = None) -> None:
        self._doubts = doubts or Doubts()
        self.values = values
        self.grid = grid
        #: how each map was computed
        self.infos = infos

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, index: int) -> Map:
        return Map(self.values[index], self.grid, self.infos[index])._of(self._doubts)

    def __array__(self, dtype: Any = None, copy: Any = None) -> NDArray[Any]:
        return np.array(self.values, dtype) if copy else np.asarray(self.values, dtype)


class Band:
    """A narrow band of a map in blocks of 8 x 8 x 8 voxels: distances in mm, NEGATIVE INSIDE.

    `first` [n, 3] is the index (i, j, k) of the first voxel of each block, `values` [n, 8, 8, 8] its
    distances [z, y, x]; `tile` [z, y, x] the number of the block of each tile of the grid, or
    Band.OUTSIDE or Band.INSIDE, where all distances are +width or -width."""

    OUTSIDE = 2**32 - 1
    INSIDE = 2**32 - 2

    def __init__(self, grid: Grid, width: float, tile: NDArray[np.uint32], first: NDArray[np.int32], values: Float32):
        self.grid = grid
        self.width = width
        self.tile = tile
        self.first = first
        self.values = values

    def dense(self) -> Map:
        """the band as a map, with +width or -width beyond it"""
        nz, ny, nx = self.tile.shape
        full = np.full((nz, ny, nx, 8, 8, 8), np.float32(self.width))
        full[self.tile == Band.INSIDE] = -np.float32(self.width)
        full[self.tile < Band.INSIDE] = self.values[self.tile[self.tile < Band.INSIDE]]
        whole_map = full.transpose(0, 3, 1, 4, 2, 5).reshape(8 * nz, 8 * ny, 8 * nx)
        a, b, c = self.grid.shape
        return Map(whole_map[:a, :b, :c], self.grid)


def band_of(c: Any) -> Band:
    """The band of a C structure, which is freed."""
    from ._arrays import copied
    from ._library import function

    try:
        nx, ny, nz = c.n
        return Band(
            Grid._of(c.grid),
            c.band_mm,
            copied(c.tile, (nz, ny, nx), np.uint32),
            copied(c.first, (c.n_block, 3), np.int32),
            cast(Float32, copied(c.values, (c.n_block, 8, 8, 8), np.float32)),
        )
    finally:
        function("sdm_blocks_dispose")(byref(c))


__all__ = ["Band", "Batch", "Check", "Error", "Image", "Map", "MapInfo", "Segment", "surface"]
