"""Phantoms: test images of a shape with known truth."""

from __future__ import annotations

from ctypes import byref
from dataclasses import dataclass
from typing import Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Float64, Triple, address, flag, float64, instance, number, triple, whole
from ._grid import Grid, Pose, grid_around
from ._library import Callbacks, function, make
from ._map import Image
from ._mesh import mesh_corners
from ._shape import Shape


@dataclass(frozen=True)
class Phantom:
    """A test image, its labels (uint8, 1 inside, 0 outside), and the truth."""

    image: Image
    label: Image
    params: Float64
    pose: Pose


def random_pose(degrees: float, mm: float, seed: int = 1) -> Pose:
    """A random pose: a rotation about a random axis by up to `degrees`, and a translation in the ball of
    radius `mm`."""
    angle = np.arccos(-1.0) / 180 * number(degrees, "degrees")
    return Pose._of(function("sdm_phantom_random_pose")(angle, number(mm, "mm"), whole(seed, "seed", 0, 2**53)))


def phantom(
    shape: Shape,
    params: Union[None, ArrayLike, Mapping[str, float]] = None,
    *,
    pose: Optional[Pose] = None,
    grid: Optional[Grid] = None,
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Triple] = None,
    origin: Optional[Triple] = None,
    inside: Optional[Sequence[float]] = None,
    outside: Optional[Sequence[float]] = None,
    air: Optional[Sequence[float]] = None,
    air_cells: Optional[Sequence[float]] = None,
    blur: Union[None, float, Triple] = None,
    texture: Optional[float] = None,
    noise: Optional[float] = None,
    white_noise: bool = False,
    supersample: Optional[int] = None,
    seed: int = 1,
    threads: int = 0,
) -> Phantom:
    """A CT-like image (float32, HU) of a shape in a pose, with partial volume, texture, blur and noise,
    for tests of fits. The arguments are the options of `sdmgen phantom`, with its defaults. Without
    grid, size and spacing the grid has 64 voxels along the longest edge of the shape."""
    p = instance(shape, Shape, "shape").values(params)
    at = Pose() if pose is None else instance(pose, Pose, "pose")
    if grid is None:
        vertices = at.apply(mesh_corners(shape.mesh(p)))
        low, high = ([float(x) for x in f(axis=0)] for f in (vertices.min, vertices.max))
        grid = grid_around(low, high, size, spacing, origin)
    instance(grid, Grid, "grid")
    opts = function("sdm_phantom_defaults")()
    for name, given in (("inside", inside), ("outside", outside), ("air", air)):
        if given is not None:
            mean, sd = float64(given, (2,), name)
            setattr(opts, name, make("sdm_tissue", mean=mean, sd=sd))
    if air_cells is not None:
        opts.air_share, opts.air_mm, opts.air_clear_mm = float64(air_cells, (3,), "air_cells")
    if blur is not None:
        opts.blur[:] = triple(blur, "blur")
    if texture is not None:
        opts.texture_mm = number(texture, "texture")
    if noise is not None:
        opts.noise = number(noise, "noise")
    if supersample is not None:
        opts.supersampling = whole(supersample, "supersample", 1, 16)
    opts.noise_is_blurred = not flag(white_noise, "white_noise")
    opts.seed, opts.n_threads = whole(seed, "seed", 0, 2**53), whole(threads, "threads", 0)
    callbacks = Callbacks()
    opts.cancelled = callbacks.wrap("sdm_phantom_opts", "cancelled", callbacks.stopped, True)
    values, label = np.empty(grid.shape, np.float32), np.empty(grid.shape, np.uint8)
    arguments = (shape, address(p), at, byref(opts), grid, address(values), address(label))
    if shape._python is None:
        callbacks.call("sdm_phantom_make", *arguments)
    else:
        shape._python.call_with(callbacks, "sdm_phantom_make", *arguments)
    return Phantom(Image(values, grid), Image(label, grid), p, at)
