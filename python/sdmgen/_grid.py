"""Grids of voxels, and poses."""

from __future__ import annotations

import math
from ctypes import byref
from typing import Any, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Float64, Triple, finite, float64, triple, whole
from ._errors import argument_error
from ._library import call, function, make


class Grid:
    """A regular grid of voxels: world = origin + direction @ (spacing * (i, j, k)), mm, LPS.

    `size` is the number of voxels along x, y, z; `origin` the centre of the first voxel;
    `direction` an orthonormal matrix whose columns are the axes."""

    def __init__(
        self,
        size: Sequence[int],
        spacing: Union[float, Triple],
        origin: Triple = (0.0, 0.0, 0.0),
        direction: Optional[ArrayLike] = None,
    ) -> None:
        if np.ndim(size) != 1 or len(size) != 3:
            raise argument_error("size: need the numbers of voxels along x, y, z")
        axes = np.eye(3) if direction is None else finite(float64(direction, (3, 3), "direction"), "direction")
        self._c = make("sdm_grid")
        self._c.n[:] = [whole(n, "size", 1, 2**20) for n in size]
        self._c.origin[:] = triple(origin, "origin")
        self._c.spacing[:] = triple(spacing, "spacing")
        self._c.dir[:] = [float(x) for x in axes.ravel()]
        call("sdm_grid_check", byref(self._c))

    @classmethod
    def _of(cls, c: Any) -> Grid:
        """The grid of a C structure, which is copied."""
        grid = cls.__new__(cls)
        grid._c = type(c).from_buffer_copy(c)
        return grid

    @property
    def _as_parameter_(self) -> Any:
        return byref(self._c)

    @property
    def size(self) -> tuple[int, int, int]:
        """numbers of voxels along x, y, z"""
        nx, ny, nz = self._c.n
        return (nx, ny, nz)

    @property
    def shape(self) -> tuple[int, int, int]:
        """the shape of an array on the grid: numbers of voxels along z, y, x"""
        nx, ny, nz = self._c.n
        return (nz, ny, nx)

    @property
    def spacing(self) -> Float64:
        """edges of a voxel along x, y, z, mm"""
        return np.array(self._c.spacing)

    @property
    def origin(self) -> Float64:
        """centre of the first voxel, LPS mm"""
        return np.array(self._c.origin)

    @property
    def direction(self) -> Float64:
        """orthonormal matrix whose columns are the axes of the grid"""
        return np.array(self._c.dir).reshape(3, 3)

    @property
    def affine(self) -> Float64:
        """the matrix [4, 4] from indices (i, j, k, 1) to places (x, y, z, 1), LPS mm"""
        result = np.eye(4)
        result[:3, :3] = self.direction * self.spacing
        result[:3, 3] = self.origin
        return result

    def points(self) -> Float64:
        """the centres of all voxels, LPS mm: [nz, ny, nx, 3]"""
        k, j, i = np.meshgrid(*(np.arange(n, dtype=np.float64) for n in self.shape), indexing="ij")
        offsets = np.stack([i, j, k], axis=-1) * self.spacing
        return np.ascontiguousarray(offsets @ self.direction.T + self.origin)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Grid) and bytes(self._c) == bytes(other._c)

    def __hash__(self) -> int:
        return hash(bytes(self._c))

    def __repr__(self) -> str:
        turned = "" if np.array_equal(self.direction, np.eye(3)) else f", direction={self.direction.tolist()}"
        return f"Grid({self.size}, spacing={self.spacing.tolist()}, origin={self.origin.tolist()}{turned})"

    def __reduce__(self) -> Any:
        return (Grid, (self.size, self.spacing, self.origin, self.direction))


def _spacing_for(size: Optional[Sequence[int]], spacing: Any, edges: Sequence[float], default: Sequence[float]) -> list[float]:
    """The given spacing, or the smallest uniform one with which a grid of this size covers the box."""
    if spacing is not None:
        return triple(spacing, "spacing")
    if size is None:
        return list(default)
    need = max(edge / (n - 1 if n > 1 else 1) for edge, n in zip(edges, size))
    return 3 * [need] if need > 0 else list(default)


def _checked_size(size: Optional[Sequence[int]]) -> Optional[list[int]]:
    if size is None:
        return None
    if np.ndim(size) != 1 or len(size) != 3:
        raise argument_error("size: need the numbers of voxels along x, y, z")
    return [whole(n, "size", 1, 2**20) for n in size]


def _cells(edges: Sequence[float], steps: Sequence[float]) -> list[float]:
    """The number of voxels' edges along each axis."""
    if not all(step > 0 for step in steps):
        raise argument_error(f"spacing: need positive numbers, not {list(steps)}")
    cells = [edge / step for edge, step in zip(edges, steps)]
    if not all(c < 2**20 for c in cells):
        raise argument_error(f"spacing {min(steps):g} mm makes over 2^20 voxels along an edge: need a larger one")
    return cells


def grid_around(
    low: Sequence[float],
    high: Sequence[float],
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Triple] = None,
    origin: Optional[Triple] = None,
) -> Grid:
    """The grid that `sdmgen exact` makes around a box (LPS mm): with a margin of a tenth of the
    longest edge on every side, and 64 voxels along that edge unless size or spacing are given."""
    given = _checked_size(size)
    extent = [b - a for a, b in zip(low, high)]
    longest = max(extent)
    margin = 0.1 * longest
    edges = [e + 2 * margin for e in extent]
    steps = _spacing_for(given, spacing, edges, 3 * [(longest + 2 * margin) / 63])
    n = given or [math.ceil(c - 1e-9) + 1 for c in _cells(edges, steps)]
    centre = [0.5 * (a + b) for a, b in zip(low, high)]
    start = [c - 0.5 * h * float(m - 1) for c, h, m in zip(centre, steps, n)] if origin is None else origin
    return Grid(n, steps, start)


def grid_within(
    model: Grid,
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Triple] = None,
    origin: Optional[Triple] = None,
    direction: Optional[ArrayLike] = None,
) -> Grid:
    """The grid that `sdmgen generate` makes in the box of the voxel centres of a model's grid, with
    the same centre."""
    if size is None and spacing is None and origin is None and direction is None:
        return model
    given = _checked_size(size)
    edges = [float(n - 1) * h for n, h in zip(model.size, model.spacing)]
    steps = _spacing_for(given, spacing, edges, [float(h) for h in model.spacing])
    n = given or [math.floor(c + 1e-9) + 1 for c in _cells(edges, steps)]
    made = Grid(n, steps, direction=model.direction if direction is None else direction)
    if origin is None:
        centre = _world(model, [0.5 * float(m - 1) for m in model.size])
        middle = _world(made, [0.5 * float(m - 1) for m in made.size])
        origin = [c - m for c, m in zip(centre, middle)]
    return Grid(n, steps, origin, made.direction)


def _world(grid: Grid, index: Sequence[float]) -> list[float]:
    at, result = np.array(index, np.float64), np.empty(3)
    function("sdm_grid_world")(byref(grid._c), at.ctypes.data, result.ctypes.data)
    return [float(x) for x in result]


class Pose:
    """A rigid pose: world = R x + translation (mm, LPS), with R the rotation by |rotation| rad about
    the axis `rotation` through the origin of the shape's frame."""

    def __init__(self, rotation: Triple = (0.0, 0.0, 0.0), translation: Triple = (0.0, 0.0, 0.0)) -> None:
        self._c = make("sdm_pose")
        self._c.rotation[:] = triple(rotation, "rotation")
        self._c.translation[:] = triple(translation, "translation")
        call("sdm_pose_check", byref(self._c))

    @classmethod
    def _of(cls, c: Any) -> Pose:
        return cls(list(c.rotation), list(c.translation))

    @property
    def _as_parameter_(self) -> Any:
        return byref(self._c)

    @property
    def rotation(self) -> Float64:
        """rotation vector, rad"""
        return np.array(self._c.rotation)

    @property
    def translation(self) -> Float64:
        """translation, mm"""
        return np.array(self._c.translation)

    @property
    def matrix(self) -> Float64:
        """the matrix [4, 4] from the shape's frame to the world, LPS mm"""
        turn = np.empty(9)
        function("sdm_pose_matrix")(byref(self._c), turn.ctypes.data)
        result = np.eye(4)
        result[:3, :3] = turn.reshape(3, 3)
        result[:3, 3] = self.translation
        return result

    def apply(self, points: ArrayLike) -> Float64:
        """points [n, 3] of the shape's frame, in the world"""
        matrix = self.matrix
        x = finite(float64(points, (None, 3), "points"), "points")
        result: Float64 = x @ matrix[:3, :3].T + matrix[:3, 3]
        return result

    def inverse(self) -> Pose:
        """the inverse pose"""
        return Pose._of(function("sdm_pose_inverse")(byref(self._c)))

    def __repr__(self) -> str:
        return f"Pose(rotation={self.rotation.tolist()}, translation={self.translation.tolist()})"
