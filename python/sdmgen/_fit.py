"""Fits of shapes to images, labels, meshes and points."""

from __future__ import annotations

import ctypes
import os
from ctypes import byref
from dataclasses import dataclass
from typing import Any, Callable, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from . import _abi
from ._arrays import Float32, Float64, Triple, address, choice, copied, finite, flag, float32, float64, instance, number, triple, whole, words
from ._errors import Error, FormatError, QualityError, argument_error, warn, with_arguments
from ._files import IMAGES, MESHES, _ends, read_array, read_image
from ._grid import Grid, Pose, grid_around
from ._library import Callbacks, call, function, make
from ._map import Image, Map, MapInfo
from ._mesh import Mesh, Surface, mesh_corners
from ._model import POLICIES, Model
from ._shape import Measure, Shape, measures_by
from ._tables import read_points_table

Label = Union[int, str]
Target = Union[Image, Mesh, ArrayLike, Any]
_KEEP = ("parameters", "pose", "blur", "appearance")
_GRADES = ("passed", "doubtful", "failed")
_POSE = ("rotation_x", "rotation_y", "rotation_z", "translation_x", "translation_y", "translation_z")
_TURNS_ABOUT_AXIS, _TURNS_ALL, _SURFACE_POINTS = 12, 60, 20000
#: an image with as few different values looks like labels; voxels that are looked at together
_FEW_VALUES, _CHUNK = 16, 1 << 16
#: largest number of a rotation vector, rad: more are degrees
_TURN = 2 * np.pi


@dataclass(frozen=True)
class FitProgress:
    """State after an iteration. `phase`: "search", "fit", "polish" or, after the last step,
    "judge" (before the checks, and before each rival of the fit). In a search with several starts:
    start number `start` of `starts`, in `round` 1 (all of them) or 2 (the best ones). "judge": rival
    number `start` of at most `starts`. Else these three are 0."""

    phase: str
    iteration: int
    objective: float
    step: float
    params: Float64
    pose: Pose
    round: int
    start: int
    starts: int


@dataclass(frozen=True)
class Tissue:
    """Values of a tissue: relative frequency on its side of the surface, mean, standard deviation."""

    weight: float
    mean: float
    sd: float


@dataclass(frozen=True)
class Finding:
    """One check of a fit; docs/fitting-reference.md#the-checks describes all of them."""

    #: name of the check, such as "residuals"
    check: str
    #: "passed", "doubtful" or "failed"
    grade: str
    #: the figure, and the limit that separates passed from the rest; NaN: none
    figure: float
    limit: float
    #: why the check did not pass or has no figure; else empty
    text: str


@dataclass(frozen=True)
class FitResult:
    """Result of a fit. The unknowns are the parameters, then the rotation (rad: a small turn about the
    axes of the world, after the pose), then the translation (mm). `sd`, `cov` and `correlation` are in
    this order."""

    #: names of the unknowns
    unknowns: tuple[str, ...]
    #: the estimated parameters, in their order; `values` has them by name
    params: Float64
    #: the estimated pose: world = R x + translation
    pose: Pose
    #: standard deviations of the unknowns; large for a pose with `open_motions`
    sd: Float64
    #: standard deviations of the pose [6] without `open_motions`; the command line prints these
    pose_sd_determined: Float64
    #: rigid motions that the target does not determine, such as a turn about the axis of a cup, in
    #: words; "": none
    open_motions: str
    #: covariance of the unknowns
    cov: Float64
    #: correlation of the unknowns
    correlation: Float64
    #: names of the parameters at an end of their range: their sd is not reliable
    at_bound: tuple[str, ...]
    #: names of the parameters that the target does not determine
    not_determined: tuple[str, ...]
    #: standard deviations of the parameters before the fit: of their priors or, without priors, of
    #: uniform distributions over their ranges
    prior_sd: Float64
    #: overlap with the labels or the reference (Dice coefficient); NaN: none were given
    dice: float
    #: the worst grade of the findings: "passed", "doubtful" or "failed"
    verdict: str
    #: all checks, in a fixed order
    findings: tuple[Finding, ...]
    converged: bool
    #: why the fit stopped
    reason: str
    iterations: int
    #: how often a refused fit went on from another pose or value of a parameter
    restarts: int
    #: True: the fit began with a network and ended with exact maps (polish=True, or points that did not converge with the network)
    polished: bool
    #: edge of the voxels of exact maps (mm) that would be fine enough, where the check `map voxels` has
    #: not passed, or `network bias` and a polish may end too coarse: fit with `spacing=` of it; else NaN
    advised_voxel_mm: float
    #: log-posterior density after each iteration, up to a constant
    objective: Float64
    log_likelihood: float
    #: evidence of the shape in an image; at most 0: the image shows no such shape; other targets: NaN
    evidence: float
    #: share of the volume of the shape that lies in the image
    inside_share: float
    #: number of voxels or points used
    used: int
    #: number of voxels near the shape that were skipped: NaN, or left out by `cavity=`
    nan: int
    #: number of voxels of the whole image that `cavity=` left out
    cavity: int
    #: number of voxels near the shape beyond its open end, which `open_end=True` left out; not in `used`
    beyond_open_end: int
    #: sum of the correlations of a residual with all residuals (1: independent)
    noise_factor: float
    #: error of the maps near the surface, mm; the covariance includes it
    model_error_mm: float
    #: images and labels: standard deviation of the point spread, mm; else 0
    blur: float
    #: points: standard deviation of their distances from the surface, mm; else 0
    point_sd: float
    #: points: estimated share of strays; else 0
    outliers: float
    inside: tuple[Tissue, ...]
    outside: tuple[Tissue, ...]
    #: number of the rotation that was chosen
    turn: int
    start_clamped: bool
    #: maps that the network and the exact engine made
    maps_network: int
    maps_exact: int
    seconds: float
    _source: _Source

    @property
    def values(self) -> dict[str, float]:
        """the estimated parameters by name"""
        return dict(zip(self.unknowns, (float(p) for p in self.params)))

    def measures(self, depths: ArrayLike = ()) -> list[Measure]:
        """The measures of the fitted shape (Shape.measures()) with standard deviations, by the
        covariance of the fit. After a fit with a model, the shape of the model must be known: built
        in, or given by plugin= or shape= of Model."""
        source = self._source
        shape = source.shape if source.shape is not None else instance(source.model, Model, "model").shape
        c = make("sdm_fit_result", n_params=len(self.params))
        c.params, c.prior_sd, c.covariance = address(self.params), address(self.prior_sd), address(self.cov)
        return measures_by(shape.call, "sdm_fit_measure", (shape, byref(c)), depths, True)

    def map(self, grid: Optional[Grid] = None, threads: int = 0) -> Map:
        """The signed distance map of the fitted shape in the world, mm, NEGATIVE INSIDE; by default on
        the grid of the source's maps, moved with the shape."""
        return self._source.map(self.params, self.pose, grid, threads)

    def surface(self) -> Surface:
        """The surface of the fitted shape in the world."""
        return self.map().surface()


class _Source:
    """Where the maps of a fit come from."""

    def __init__(self, model: Optional[Model], shape: Optional[Shape], grid: Optional[Grid], policy: int) -> None:
        self.model, self.shape, self.grid = model, shape, grid
        self.c = make("sdm_fit_source", policy=policy)
        if model is not None:
            self.c.model = model._as_parameter_
        if shape is not None:
            self.c.shape = shape._as_parameter_
        if grid is not None:
            self.c.grid = grid._c

    def map_grid(self) -> Grid:
        if self.model is not None:
            return self.model.grid
        assert self.grid is not None
        return self.grid

    def call(self, callbacks: Optional[Callbacks], name: str, *arguments: Any) -> None:
        python = None if self.shape is None else self.shape._python
        if python is not None:
            python.call_with(callbacks or Callbacks(), name, *arguments)
        elif callbacks is not None:
            callbacks.call(name, *arguments)
        else:
            call(name, *arguments)

    def map(self, params: Float64, pose: Pose, grid: Optional[Grid], threads: int) -> Map:
        on = None if grid is None else instance(grid, Grid, "grid")
        if on is None:
            own = self.map_grid()
            start = pose.apply(own.origin[None])[0]
            on = Grid(own.size, own.spacing, start, pose.matrix[:3, :3] @ own.direction)
        values = np.empty(on.shape, np.float32)
        n = whole(threads, "threads", 0)
        self.call(None, "sdm_fit_map", byref(self.c), address(params), pose, on, n, address(values))
        error = self.model.accuracy.rmse_mm if self.model is not None else 0.0
        return Map(values, on, MapInfo("exact" if self.model is None else "network", error_mm=error))


def close_labels(labels: Image, radius: float, threads: int = 0) -> Image:
    """The morphological closing of a label map by a ball of this radius, mm: walls between labelled
    compartments that are thinner than about twice the radius become inside. 1 inside, 0 outside."""
    values = float32(instance(labels, Image, "labels").values, labels.grid.shape, "labels").copy()
    n = whole(threads, "threads", 0)
    call("sdm_fit_close_labels", labels.grid, number(radius, "radius"), n, address(values))
    return Image(values, labels.grid)


def _mask(image: Image, labels: Sequence[Label], close: Optional[float], threads: int) -> Float32:
    """1 where a voxel has one of the labels (none given: where it is not 0), else 0."""
    layers = image.values.reshape(-1, *image.grid.shape)
    mask = np.zeros(image.grid.shape, bool)
    if not labels:
        mask = ((layers > 0) | (layers < 0)).any(axis=0)
    for label in labels:
        segment = next((s for s in image.segments if label in (s.name, s.id)), None)
        if segment is None and (isinstance(label, str) or label == 0):
            known = ", ".join(repr(s.name) for s in image.segments)
            raise argument_error(f"label {label!r}: need " + (f"one of {known}" if known else "a whole number other than 0"))
        found = layers[segment.layer] == segment.value if segment else (layers == np.float32(label)).any(axis=0)
        if not found.any():
            raise FormatError("format", f"no voxel has the label {label!r}")
        mask |= found
    if not mask.any():
        raise FormatError("format", "every voxel is 0: no label")
    values = mask.astype(np.float32)
    return values if close is None else close_labels(Image(values, image.grid), close, threads).values


def _labels(value: Union[None, Label, Sequence[Label]]) -> list[Label]:
    if value is None:
        return []
    if isinstance(value, (int, str, np.integer)):
        return [value]
    if not isinstance(value, (list, tuple)) or not all(isinstance(v, (int, str, np.integer)) for v in value):
        raise argument_error(f"label: need a whole number, the name of a segment, or a list of them, not {value!r}")
    return list(value)


def _check_few_values(image: Image, tissues: bool) -> None:
    """Refuses an image that looks like labels: few different values, all of them whole numbers from 0 on.
    Where values of tissues say that it is meant as an image, a warning."""
    values, found = image.values.ravel(), np.empty(0)
    for start in range(0, values.size, _CHUNK):
        part = values[start : start + _CHUNK].astype(np.float64)
        found = np.union1d(found, part[~np.isnan(part)])
        if found.size > _FEW_VALUES or (found < 0).any() or (found != np.rint(found)).any():
            return
    if found.size > 1 and not tissues:
        raise argument_error(
            f"fit: the image holds only the values {', '.join(f'{v:g}' for v in found)}, as labels do: give label= with that "
            f"of the shape, e.g. label={found[-1]:g}, or several; inside= and outside= fit to them as to an image"
        )
    if found.size > 1:
        warn(
            f"the image holds only {found.size} different values, {found[0]:g} to {found[-1]:g}: if it is a label map, "
            f"give label= with the value of the shape, e.g. label={found[-1]:g}"
        )


def _surface_points(mesh: Mesh, threads: int) -> Float64:
    """Points that lie evenly on the surface of a mesh."""
    points = np.empty((_SURFACE_POINTS, 3))
    n = whole(threads, "threads", 0)
    call("sdm_fit_surface_points", byref(mesh._c), len(points), n, address(points))
    return points


def _read_points(path: Any) -> Union[Mesh, Float64]:
    if _ends(path, MESHES):
        return Mesh.read(path)
    if _ends(path, (".csv",)):
        return read_points_table(path)
    if _ends(path, (".npy",)):
        return read_array(path)
    known = " ".join((*IMAGES, *MESHES))
    raise argument_error(f"fit {os.fspath(path)!r}: the name must end in {known} .csv (points x,y,z) or .npy (points [n, 3])")


def _open_target(target: Target, threads: int) -> Union[Image, Float64]:
    """An image, or points [n, 3]."""
    if isinstance(target, Image):
        return target
    if isinstance(target, (str, bytes)) or hasattr(target, "__fspath__"):
        if _ends(target, IMAGES):
            return read_image(target)
        target = _read_points(target)
    if isinstance(target, Mesh):
        target = _surface_points(target, threads) if len(target.triangles) else target.vertices
    points = finite(float64(target, (None, 3), "points"), "points")
    if len(points) < 3:
        raise FormatError("format", f"{len(points)} points, need 3 or more")
    return points


def _open_source(
    source: Union[Model, Shape], params: Any, exact: bool, polish: bool, policy: str, spacing: Any
) -> tuple[_Source, Float64, bool]:
    """The source, the start parameters, and whether these were moved into their range."""
    exact, polish = flag(exact, "exact"), flag(polish, "polish")
    rule = choice(policy, POLICIES, "policy")
    if not isinstance(source, (Model, Shape)):
        raise argument_error("fit: need a Model or a Shape, and what to fit it to")
    start = source.values(params)
    network = isinstance(source, Model) and not exact
    if network and spacing is not None:
        raise argument_error("spacing: it applies to exact maps (exact=True, or a shape); a model has its own grid")
    if not network and polish:
        raise argument_error("polish: it follows the fit of a network; this fit is exact from the start")
    finite(start, "parameters")
    low, high = (np.array([getattr(p, end) for p in source.params]) for end in ("min", "max"))
    clamped = policy == "clamp" and not ((start >= low) & (start <= high)).all()
    if policy == "clamp":
        start = np.clip(start, low, high)
    if isinstance(source, Model):
        shape = source.shape if exact or polish or policy == "exact" else _known_shape(source)
        if not exact:
            return _Source(source, shape, None, rule), start, clamped
        assert shape is not None
        grid = source.grid if spacing is None else _exact_grid(shape, start, spacing)
        return _Source(None, shape, grid, rule), start, clamped
    return _Source(None, source, _exact_grid(source, start, spacing), rule), start, clamped


def _known_shape(model: Model) -> Optional[Shape]:
    """The shape of a model for the checks of a fit through its network; None: not known, or another one."""
    try:
        return model.shape
    except Error:
        return None


def _exact_grid(shape: Shape, start: Float64, spacing: Any) -> Grid:
    """A grid that holds the shape at the start, and with any parameter at an end of its range."""
    at = [start]
    for i, p in enumerate(shape.params):
        for end in (p.min, p.max):
            at.append(start.copy())
            at[-1][i] = end
    boxes = [(v.min(axis=0), v.max(axis=0)) for v in (mesh_corners(shape.mesh(p)) for p in at)]
    low = np.min([box[0] for box in boxes], axis=0)
    high = np.max([box[1] for box in boxes], axis=0)
    return grid_around([float(x) for x in low], [float(x) for x in high], None, spacing)


def _law(given: Sequence[float], name: str, weight: float) -> Any:
    mean, sd = (float(x) for x in finite(float64(given, (2,), name), name))
    if not sd > 0:
        raise argument_error(f"{name}: need a mean and a standard deviation above 0, not {sd:g}")
    return make("sdm_fit_law", weight=weight, mean=mean, sd=sd)


def _set_tissues(tissues: Any, inside: Any, outside: Any, air: Any) -> None:
    """The default second tissue outside, air, is dropped where other tissues are given but no air."""
    if inside is not None:
        tissues.inside[0] = _law(inside, "inside", 1.0)
    if outside is not None:
        tissues.outside[0] = _law(outside, "outside", tissues.outside[0].weight)
    if air is not None:
        tissues.outside[1] = _law(air, "air", tissues.outside[1].weight)
    elif inside is not None or outside is not None:
        tissues.n_outside = 1


@dataclass
class _Start:
    """Where the optimisation starts: what the caller gives."""

    rotation: Optional[Triple]
    translation: Optional[Triple]
    centre: Optional[Triple]
    axis: Optional[Triple]
    points: Optional[tuple[ArrayLike, ArrayLike]]
    turns: Optional[int]
    turns_sphere: Optional[int]

    def check(self) -> None:
        def given(*values: Any) -> int:
            return sum(value is not None for value in values)

        if given(self.rotation, self.axis, self.points) > 1:
            raise argument_error("fit: give one of rotation, start_axis and start_points")
        if given(self.translation, self.centre, self.points) > 1:
            raise argument_error("fit: give one of translation, start_centre and start_points")
        if self.axis is not None and self.translation is not None:
            raise argument_error("fit: start_axis goes with start_centre, rotation with translation")
        if self.turns is not None and self.turns_sphere is not None:
            raise argument_error("fit: give one of turns and turns_sphere")
        rotation = [] if self.rotation is None else triple(self.rotation, "rotation")
        if any(abs(x) > _TURN for x in rotation):
            told = ", ".join(f"{x:g}" for x in rotation)
            raise argument_error(
                f"rotation ({told}): it is a rotation vector in rad, each number at most a turn of 6.2832 "
                "(90 degrees are 1.5708)"
            )

    def set_turns(self, opts: Any) -> None:
        """Without a start rotation many are tried, about all axes or about the given one."""
        placed = self.rotation is not None or self.translation is not None or self.points is not None
        if self.turns is not None or (self.axis is not None and self.turns_sphere is None):
            opts.turns = _abi.constants["SDM_FIT_TURNS_AXIS"]
            opts.n_turns = _TURNS_ABOUT_AXIS if self.turns is None else whole(self.turns, "turns", 1, 4096)
        elif self.turns_sphere is not None or not placed:
            opts.turns = _abi.constants["SDM_FIT_TURNS_SPHERE"]
            n = self.turns_sphere
            opts.n_turns = _TURNS_ALL if n is None else whole(n, "turns_sphere", 1, 4096)
        if opts.keep_pose:
            opts.turns = _abi.constants["SDM_FIT_TURNS_NONE"]

    def pose(self, pivot: Float64, centre: Triple) -> Any:
        """The C structure of the start pose; `centre` is where the pivot goes unless it is given."""
        result = make("sdm_pose")
        if self.points is not None:
            shape = float64(self.points[0], (None, 3), "start_points")
            world = float64(self.points[1], (len(shape), 3), "start_points")
            call("sdm_fit_pose_from_points", address(shape), address(world), len(shape), byref(result))
            return result
        if self.axis is not None:
            at, axis = (np.array(triple(x, "start_axis")) for x in (centre, self.axis))
            call("sdm_fit_pose_from_axis", address(pivot), address(at), address(axis), byref(result))
            return result
        if self.rotation is not None:
            result.rotation[:] = triple(self.rotation, "rotation")
        if self.translation is not None:
            result.translation[:] = triple(self.translation, "translation")
            return result
        moved = np.empty(3)
        function("sdm_pose_apply")(byref(result), address(pivot), address(moved))
        result.translation[:] = [float(c) - float(m) for c, m in zip(triple(centre, "start_centre"), moved)]
        return result


def _middle(target: Union[Image, Float64], mask: Optional[Float32], opts: Any) -> Triple:
    """The middle of the points, labels, region or image, in the world."""
    if not isinstance(target, Image):
        total = [0.0, 0.0, 0.0]
        for point in target:
            total = [t + float(x) / len(target) for t, x in zip(total, point)]
        return total
    index = np.array([0.5 * float(n - 1) for n in target.grid.size])
    if mask is not None:
        places = np.argwhere(mask > 0)
        index = np.array([float(places[:, axis].sum()) / len(places) for axis in (2, 1, 0)])
    elif opts.use_box:
        return [0.5 * (a + b) for a, b in zip(opts.box_min, opts.box_max)]
    world = np.empty(3)
    function("sdm_grid_world")(target.grid, address(index), address(world))
    return [float(x) for x in world]


def fit(
    source: Union[Model, Shape],
    target: Target,
    *,
    params: Union[None, ArrayLike, Mapping[str, float]] = None,
    exact: bool = False,
    polish: bool = False,
    policy: str = "refuse",
    spacing: Union[None, float, Triple] = None,
    label: Union[None, Label, Sequence[Label]] = None,
    label_close: Optional[float] = None,
    reference: Optional[Any] = None,
    reference_label: Union[None, Label, Sequence[Label]] = None,
    rotation: Optional[Triple] = None,
    translation: Optional[Triple] = None,
    start_centre: Optional[Triple] = None,
    start_axis: Optional[Triple] = None,
    start_points: Optional[tuple[ArrayLike, ArrayLike]] = None,
    turns: Optional[int] = None,
    turns_sphere: Optional[int] = None,
    region: Optional[tuple[Triple, Triple]] = None,
    margin: Optional[float] = None,
    cavity: Optional[float] = None,
    open_end: bool = False,
    image_model: str = "partial",
    inside: Optional[Sequence[float]] = None,
    outside: Optional[Sequence[float]] = None,
    air: Optional[Sequence[float]] = None,
    tissue_places: Optional[float] = None,
    blur: Optional[float] = None,
    l_ref: Optional[float] = None,
    point_sd: Optional[float] = None,
    keep: Union[str, Sequence[str]] = (),
    prior_sd: Optional[float] = None,
    prior_rotation: Optional[float] = None,
    prior_translation: Optional[float] = None,
    eps: Optional[float] = None,
    max_iterations: Optional[int] = None,
    least_inside: Optional[float] = None,
    tolerance: Optional[float] = None,
    beside: Optional[float] = None,
    threads: int = 0,
    progress: Optional[Callable[[FitProgress], Any]] = None,
) -> FitResult:
    """Fits a shape to a target: estimates parameters and pose, with their uncertainty.

    source: a Model, whose network makes the maps (exact=True: the exact engine), or a Shape, with the
    exact engine.
    target: an Image or its path; with `label` (a value, the name of a segment, or a list of them) a
    label map; points [n, 3], LPS mm, or a .csv or .npy file of them; a Mesh or its path.
    params: start values of the parameters (default: those of the shape).
    rotation, start_axis or start_points: the start rotation; without one, 60 rotations are tried.
    start_points: pairs of points, in the frame of the shape [n, 3] and in the image [n, 3].
    inside, outside, air: (mean, standard deviation) of the values of the tissues of an image; the
    defaults are fluid, bone and air in CT.
    region: two corners of a box. reference: labels to compare with (FitResult.dice).
    tolerance: share of the volume of the shape that the target may contradict (default 0: residuals
    must be noise; labels and points 0.05). beside: volume of the inside's material beside the shape
    that an image may hold, over the volume of the shape (default 0.3).
    spacing: voxel edge of exact maps, mm (default: 64 voxels along the longest edge).
    Every other argument is the option of `sdmgen fit` with its name (l_ref: --l-ref) and its default.
    Places and directions are LPS, mm; rotations are rotation vectors, rad.

    A fit is judged (FitResult.verdict, FitResult.findings). If it failed, QualityError is raised; its
    `result` is the FitResult, or None. An exception in `progress`, or Ctrl-C, stops the fit."""
    from_where, start_params, clamped = _open_source(source, params, exact, polish, policy, spacing)
    start = _Start(rotation, translation, start_centre, start_axis, start_points, turns, turns_sphere)
    start.check()
    opened = _open_target(target, threads)
    chosen_labels = _labels(label)
    if chosen_labels and not isinstance(opened, Image):
        raise argument_error("label: it applies to images")
    if label_close is not None and not chosen_labels and reference is None:
        raise argument_error("label_close: it needs labels: give label or reference")
    mask = _mask(opened, chosen_labels, label_close, threads) if chosen_labels and isinstance(opened, Image) else None

    # the target
    c_target = make("sdm_fit_target")
    voxel = float(from_where.map_grid().spacing.max())
    if isinstance(opened, Image):
        if opened.values.ndim != 3 or (opened.segments and mask is None):
            raise argument_error("fit: the image is a segmentation: select segments by label=")
        if mask is None:
            _check_few_values(opened, inside is not None or outside is not None)
        values = float32(opened.values, opened.grid.shape, "image") if mask is None else mask
        c_target.kind = _abi.constants["SDM_FIT_IMAGE" if mask is None else "SDM_FIT_LABEL"]
        c_target.grid, c_target.values = opened.grid._c, address(values)
        voxel = max(voxel, float(opened.grid.spacing.max()))
    else:
        c_target.kind = _abi.constants["SDM_FIT_POINTS"]
        c_target.points, c_target.n_points = address(opened), len(opened)

    # options
    opts = function("sdm_fit_defaults")()
    lengths = function("sdm_fit_defaults_for")(voxel)
    for name, given in (("blur", blur), ("l_ref", l_ref), ("margin", margin), ("point_sd", point_sd)):
        setattr(opts, name, getattr(lengths, name) if given is None else number(given, name))
    opts.tissue_mm = lengths.tissue_mm if tissue_places is None else number(tissue_places, "tissue_places")
    opts.image_model = choice(image_model, ("partial", "labels"), "image_model")
    for name, given, member in (
        ("cavity", cavity, "cavity"),
        ("least_inside", least_inside, "least_inside"),
        ("tolerance", tolerance, "tolerance"),
        ("beside", beside, "beside"),
        ("prior_sd", prior_sd, "prior_sd"),
        ("prior_rotation", prior_rotation, "prior_rotation_sd"),
        ("prior_translation", prior_translation, "prior_translation_sd"),
        ("eps", eps, "eps"),
        ("eps", eps, "polish_eps"),
    ):
        if given is not None:
            setattr(opts, member, number(given, name))
    opts.open_end = flag(open_end, "open_end")
    if eps is not None:
        opts.eps_sd = 0
    if max_iterations is not None:
        opts.max_iterations = whole(max_iterations, "max_iterations", 1)
    if polish:
        opts.max_polish_iterations = opts.max_iterations
    opts.n_threads = whole(threads, "threads", 0)
    opts.start_params = address(start_params)
    if region is not None:
        corners = float64(np.stack([triple(corner, "region") for corner in region]), (2, 3), "region")
        opts.use_box = True
        opts.box_min[:] = [float(x) for x in corners.min(axis=0)]
        opts.box_max[:] = [float(x) for x in corners.max(axis=0)]
    _set_tissues(opts.appearance, inside, outside, air)
    own = [p.name for p in source.params]
    kept = np.zeros(len(own), np.bool_)
    for word in words([keep] if isinstance(keep, str) else keep, (*_KEEP, *own), "keep"):
        if word in _KEEP:
            setattr(opts, "keep_params" if word == "parameters" else f"keep_{word}", True)
        else:
            kept[own.index(word)] = True
    opts.kept = address(kept)
    opts.keep_params = opts.keep_params or bool(kept.all())
    if opts.keep_params and opts.keep_pose:
        raise argument_error("keep: parameters and pose together leave nothing to fit")

    # the start
    pivot = np.empty(3)
    from_where.call(None, "sdm_fit_centre", byref(from_where.c), address(start_params), address(pivot))
    opts.pivot[:] = [float(x) for x in pivot]
    start.set_turns(opts)
    centre = start_centre if start_centre is not None else _middle(opened, mask, opts)
    opts.start_pose = start.pose(pivot, centre)
    reference_mask = None
    if reference is not None:
        against = reference if isinstance(reference, Image) else read_image(reference)
        chosen = _mask(against, _labels(reference_label), label_close, threads)
        reference_mask = Image(chosen, against.grid)
    elif mask is not None and isinstance(opened, Image):
        reference_mask = Image(mask, opened.grid)

    return _run(from_where, c_target, opts, progress, clamped, source, opened, reference_mask)


def _run(
    source: _Source,
    target: Any,
    opts: Any,
    progress: Optional[Callable[[FitProgress], Any]],
    clamped: bool,
    given: Union[Model, Shape],
    opened: Union[Image, Float64],
    reference: Optional[Image],
) -> FitResult:
    names = [p.name for p in given.params]
    callbacks = Callbacks()

    def show(_user: Any, at: int) -> None:
        c = _abi.structs["sdm_fit_progress"].from_address(at)
        if progress is not None:
            params = np.array((ctypes.c_double * len(names)).from_address(c.params))
            phase = ("search", "fit", "polish", "judge")[c.phase]
            pose = Pose._of(c.pose)
            progress(FitProgress(phase, c.iteration, c.objective, c.step, params, pose, c.round, c.start, c.n_starts))

    opts.progress = callbacks.wrap("sdm_fit_opts", "progress", show, None)
    opts.cancelled = callbacks.wrap("sdm_fit_opts", "cancelled", callbacks.stopped, True)
    result = make("sdm_fit_result")
    try:
        try:
            source.call(callbacks, "sdm_fit", byref(source.c), byref(target), byref(opts), byref(result))
        except QualityError as error:
            if result.params and result.objective:
                error.result = _result_of(result, names, source, given, clamped, opened, reference)
            raise
        return _result_of(result, names, source, given, clamped, opened, reference)
    finally:
        function("sdm_fit_dispose")(byref(result))


def _finding(c: Any) -> Finding:
    check = function("sdm_fit_check_name")(c.kind).decode()
    return Finding(check, _GRADES[c.grade], c.figure, c.limit, with_arguments(c.text.decode()))


def _result_of(
    c: Any,
    names: list[str],
    source: _Source,
    given: Union[Model, Shape],
    clamped: bool,
    opened: Union[Image, Float64],
    reference: Optional[Image],
) -> FitResult:
    n = len(names)
    total = n + len(_POSE)
    # exact maps inside the trained range come from the polish, the last phase
    if source.model is not None and c.n_exact > c.n_exact_outside:
        source = _Source(None, source.shape, source.model.grid, source.c.policy)
    params, pose = copied(c.params, (n,), np.float64), Pose._of(c.pose)
    at_bound, by_prior = (copied(flags, (n,), np.bool_) for flags in (c.at_bound, c.by_prior))
    look = c.appearance
    return FitResult(
        unknowns=(*names, *_POSE),
        params=params,
        pose=pose,
        sd=copied(c.sd, (total,), np.float64),
        pose_sd_determined=np.array(c.pose_sd_determined[: len(_POSE)], np.float64),
        open_motions=c.open_motions.decode(),
        cov=copied(c.covariance, (total, total), np.float64),
        correlation=copied(c.correlation, (total, total), np.float64),
        at_bound=tuple(name for name, flag in zip(names, at_bound) if flag),
        not_determined=tuple(name for name, flag in zip(names, by_prior) if flag),
        prior_sd=copied(c.prior_sd, (n,), np.float64),
        dice=_dice(source, params, pose, opened, reference),
        verdict=_GRADES[c.verdict.grade],
        findings=tuple(_finding(f) for f in c.verdict.findings[: c.verdict.n_findings]),
        converged=c.converged,
        reason=c.reason.decode(),
        iterations=c.n_iterations,
        restarts=c.n_restarts,
        polished=c.polished,
        advised_voxel_mm=c.advised_voxel_mm,
        objective=copied(c.objective, (c.n_iterations,), np.float64),
        log_likelihood=c.log_likelihood,
        evidence=c.evidence,
        inside_share=c.inside_share,
        used=c.n_used,
        nan=c.n_nan,
        cavity=c.n_cavity,
        beyond_open_end=c.n_beyond,
        noise_factor=c.noise_factor,
        model_error_mm=c.model_error_mm,
        blur=c.blur,
        point_sd=c.point_sd,
        outliers=c.outliers,
        inside=tuple(Tissue(law.weight, law.mean, law.sd) for law in look.inside[: look.n_inside]),
        outside=tuple(Tissue(law.weight, law.mean, law.sd) for law in look.outside[: look.n_outside]),
        turn=c.turn,
        start_clamped=clamped or c.start_clamped,
        maps_network=c.n_network,
        maps_exact=c.n_exact,
        seconds=c.seconds,
        _source=source,
    )


def _dice(
    source: _Source, params: Float64, pose: Pose, opened: Union[Image, Float64], reference: Optional[Image]
) -> float:
    """The overlap with the reference within the field of view of the image."""
    if reference is None:
        return float("nan")
    fitted = source.map(params, pose, reference.grid, 0).values < 0
    labelled = reference.values > 0
    if isinstance(opened, Image) and opened.grid != reference.grid:
        offsets = reference.grid.points() - opened.grid.origin
        index = offsets @ opened.grid.direction / opened.grid.spacing
        seen = ((index >= -0.5) & (index <= np.array(opened.grid.size) - 0.5)).all(axis=-1)
        fitted, labelled = fitted & seen, labelled & seen
    both = int(fitted.sum()) + int(labelled.sum())
    return 2 * int((fitted & labelled).sum()) / both if both else float("nan")
