"""Trained networks: maps, their derivatives, values at points."""

from __future__ import annotations

import threading
from ctypes import byref
from dataclasses import dataclass
from typing import Any, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from . import _abi
from ._arrays import Float32, Float64, Triple, address, choice, finite, flag, float32, float64, instance, named_values, number, path_bytes, whole
from ._errors import QualityError, UnsupportedError, argument_error, warn
from ._grid import Grid, grid_within
from ._library import Handle, call, function, make
from ._map import Band, Batch, Check, Doubts, Map, MapInfo, VolumeAdjoint, band_of, check_of, info_of
from ._shape import InstanceShape, Param, Registry, Shape, param_of

Params = Union[None, ArrayLike, Mapping[str, float]]
POLICIES = ("refuse", "clamp", "exact")
STATISTICS = ("max", "q95", "rmse", "mean")
USES = ("surface", "volume", "derivative", "volume_derivative", "distance", "surface_volume")


@dataclass(frozen=True)
class Accuracy:
    """Errors of a network on random shapes that its training did not use, measured against exact
    distances at the end of the training; mm. `near`: at voxels within `near_mm` of the surface."""

    samples: int
    mse_mm2: float
    rmse_mm: float
    mae_mm: float
    max_abs_mm: float
    rmse_near_mm: float
    q50_mm: float
    q90_mm: float
    q99_mm: float
    near_mm: float


def accuracy_of(c: Any) -> Accuracy:
    return Accuracy(**{name: getattr(c, name) for name in Accuracy.__dataclass_fields__})


@dataclass(frozen=True)
class Quality:
    """Quality of a model, as its training measured it on held-out shapes; NaN: not known. The errors of
    volumes and derivatives are relative: root mean square of the error over that of the exact values
    (0.1: 10 %)."""

    #: "good", "usable" or "poor"; "": trained by an earlier version
    grade: str
    #: share of the shapes that the grid cuts
    cut: float
    #: how far exact maps, interpolated between the voxels, miss the surface, mm
    between_mm: float
    #: thickness of the thinnest part, mm
    thickness_mm: float
    #: of the volume of maps
    volume_error: float
    #: of the derivatives of maps near the surface, by the worst parameter
    derivative_error: float
    #: of the derivatives of the volume, by the worst parameter
    volume_derivative_error: float
    #: of the volume inside surfaces of maps
    surface_volume_error: float
    #: largest error of distances farther than `Accuracy.near_mm` from the surface, mm
    far_error_mm: float
    #: the uses for which the model is not good enough, with their figures, in words
    unfit: tuple[str, ...]


#: largest share of shapes that the grid of a good model cuts (docs/network.md)
CUT_MAX = 0.05


def _quality_of(c: Any, name: str) -> Quality:
    """The quality of a model; warns, as the program does, of one that is poor or cuts its shapes."""
    numbers = {key: getattr(c, key) for key in Quality.__dataclass_fields__ if key not in ("grade", "unfit")}
    result = Quality(grade=c.grade.decode(), unfit=tuple(c.unfit.decode().splitlines()), **numbers)
    if result.grade == "poor":
        warn(f"{name}: the training graded this model poor (sdmgen info)")
    if result.cut > CUT_MAX:
        text = f"{name}: its grid cuts {100 * result.cut:.0f} % of the shapes, whose maps end open (train with grid: auto)"
        warn(text)
    return result


def _doubts_of(model: Model) -> Doubts:
    """The uses that the training found the model not good enough for, with the texts of their warnings."""
    texts = {}
    for use in ("volume", "derivative", "volume_derivative", "distance"):
        try:
            model.check_use(use)
        except QualityError as error:
            texts[use] = error.text
        except UnsupportedError:  # not measured
            pass
    # the check passes parameters that hardly change the volume, whatever their error
    for line in model.quality.unfit:
        if line.startswith("derivatives of the volume by ") and " % of their own size" in line:
            before = [texts["volume_derivative"]] if "volume_derivative" in texts else []
            texts["volume_derivative"] = "; ".join([*before, f"do not use the {line}"])
    name = "model" if model.path is None else model.path
    return Doubts({use: f"{name}: {text}" for use, text in texts.items()})


@dataclass(frozen=True)
class Jacobian:
    """A map (mm, NEGATIVE INSIDE) and `values` [parameters, z, y, x], its derivative by each
    parameter, mm per unit of the parameter."""

    map: Map
    values: Float32


@dataclass(frozen=True)
class Tangent:
    """A map (mm, NEGATIVE INSIDE) and `values` [z, y, x], its derivative along a direction, mm."""

    map: Map
    values: Float32


@dataclass(frozen=True)
class Samples:
    """Signed distances at points: `distance` [n], mm, NEGATIVE INSIDE; `gradient` [n, 3] by the world
    coordinates; `slopes` [n, parameters] by the parameters, mm per unit (None: not asked for)."""

    distance: Float32
    gradient: Optional[Float32]
    slopes: Optional[Float32]
    info: MapInfo




class Model:
    """A trained network, from a model file (its path, or its content as bytes). Any number of threads
    may use it.

    model(a=4.2) computes the map with a = 4.2 and the other parameters at their defaults. `policy` is
    for parameters outside of the trained range: "refuse" raises RangeError, "clamp" moves them to the
    nearest allowed value, "exact" computes the map with the exact engine. The exact engine needs the
    shape: a built-in one, that of `plugin` (the path of its .so file), or `shape` (for example one
    written in Python)."""

    def __init__(self, path: Any, *, shape: Optional[Shape] = None, plugin: Any = None) -> None:
        self._handle = Handle("sdm_model_free")
        if isinstance(path, (bytes, bytearray, memoryview)):
            data = bytes(path)
            call("sdm_model_open_memory", b"model", data_address(data), len(data), self._handle.out())
            self.path = None
        else:
            call("sdm_model_open", path_bytes(path), self._handle.out())
            self.path = path
        self._plugin = plugin
        self._shape = None if shape is None else instance(shape, Shape, "shape")
        self._lock = threading.Lock()
        info = _abi.structs["sdm_model_info"].from_address(function("sdm_model_get_info")(self))
        params = (_abi.structs["sdm_model_param"] * info.n_params).from_address(info.params)
        self._params = [param_of(p, p.distribution) for p in params]
        #: the grid of the maps
        self.grid = Grid._of(info.grid)
        #: errors on shapes that the training did not use
        self.accuracy = accuracy_of(info.accuracy)
        #: the grade of the training, and the uses for which the model is not good enough
        self.quality = _quality_of(info.quality, "model" if self.path is None else str(self.path))
        self._doubts = _doubts_of(self)
        #: name of the shape
        self.shape_name: str = info.shape.decode()
        #: kind of the network: "pod", "template", "deepsdf", "imnet" or "sdmnn"
        self.kind: str = info.kind.decode()
        #: version of the program that trained it
        self.version: str = info.version.decode()
        #: checksum of the file, 16 hexadecimal digits
        self.checksum = f"{info.checksum:016x}"
        #: the options of the shape
        self.options = dict(zip(_texts(info.option_names, info.n_options), _texts(info.option_values, info.n_options)))
        #: the configuration of the training, YAML
        self.config: str = (info.config or b"").decode()
        #: seed and seconds of the training, and number of its exact maps
        self.seed: int = info.seed
        self.train_seconds: float = info.train_seconds
        self.train_samples: int = info.train_samples
        #: number of multiply-adds for one map
        self.macs: float = info.macs

    @property
    def _as_parameter_(self) -> Any:
        return self._handle.pointer

    @property
    def params(self) -> list[Param]:
        """The parameters in their order: name, unit, range of the training, default, distribution. Their
        `help` is empty, since a model file holds none: `Model.shape.params` has it."""
        return self._params

    @property
    def defaults(self) -> Float64:
        """the default values of the parameters"""
        return np.array([p.default for p in self.params], np.float64)

    @property
    def shape(self) -> Shape:
        """The shape that the network was trained on, with the same options, for exact maps."""
        with self._lock:
            if self._shape is None:
                registry = Registry(self._plugin)
                instance = Handle("sdm_instance_free", registry)
                call("sdm_runtime_instance", self, registry, instance.out())
                self._shape = InstanceShape(registry, instance, self.shape_name)
            return self._shape

    def check_use(self, use: str) -> None:
        """Raises QualityError, with the measured figure, if the training found the model not good
        enough for a use: "surface", "volume" (of maps), "derivative" (of maps by the parameters),
        "volume_derivative" (passes parameters that hardly change the volume, whatever their error:
        `quality.unfit` names them), "distance" (far from the surface) or "surface_volume" (inside surfaces of
        maps). Raises UnsupportedError if the training did not measure it. Else returns None."""
        call("sdm_model_check_use", self, choice(use, USES, "use"))

    def values(self, params: Params = None, **named: float) -> Float64:
        """A parameter vector, from an array, a mapping or names; the others have their defaults."""
        return named_values([p.name for p in self.params], self.defaults, params, named)

    def _call(self, exact: bool, name: str, *arguments: Any) -> None:
        """Calls the library; with the shape of the model, whose mesh function may fail in Python."""
        if exact:
            self.shape.call(name, *arguments)
        else:
            call(name, *arguments)

    def _opts(
        self,
        policy: str,
        threads: int,
        check: bool = False,
        max_error: Optional[float] = None,
        error_of: str = "max",
        outside: str = "refuse",
    ) -> Any:
        result = make(
            "sdm_generate_opts",
            policy=choice(policy, POLICIES, "policy"),
            n_threads=whole(threads, "threads", 0),
            check=flag(check, "check"),
            max_error_of=choice(error_of, STATISTICS, "error_of"),
            outside=choice(outside, ("refuse", "bound", "exact"), "outside"),
        )
        if max_error is not None:
            result.max_error_mm = number(max_error, "max_error")
            if not result.max_error_mm > 0:
                raise argument_error(f"max_error: need a positive number of mm, not {max_error!r}")
        if check or max_error is not None or policy == "exact" or outside == "exact":
            result.exact_shape = self.shape._as_parameter_
        return result

    def _bounded(self, opts: Any, rows: Float64) -> None:
        """A bound on the error replaces maps by exact ones; parameters out of range stay refused."""
        if not opts.max_error_mm > 0 or opts.policy != POLICIES.index("refuse"):
            return
        low, high = (np.array([getattr(p, end) for p in self.params]) for end in ("min", "max"))
        for row in rows:
            if not ((row >= low) & (row <= high)).all():
                none = np.empty(self.grid.shape, np.float32)
                call("sdm_generate", self, address(row), None, address(none), None)  # raises
        opts.policy = POLICIES.index("exact")

    def __call__(
        self,
        params: Params = None,
        *,
        grid: Optional[Grid] = None,
        size: Optional[Sequence[int]] = None,
        spacing: Union[None, float, Triple] = None,
        origin: Optional[Triple] = None,
        direction: Optional[ArrayLike] = None,
        policy: str = "refuse",
        outside: str = "refuse",
        check: bool = False,
        max_error: Optional[float] = None,
        error_of: str = "max",
        threads: int = 0,
        **named: float,
    ) -> Map:
        """The signed distance map, mm, NEGATIVE INSIDE, at parameters.

        grid, or size, spacing, origin and direction: another grid than the model's, as for `sdmgen
        generate`. outside: for voxels outside of the box of the model's voxel centres: "refuse"
        (RangeError), "bound" (a lower bound of the distance) or "exact". check: compares the network's
        map with exact distances (map.info.check). max_error: bound, mm, on the error of the map near
        the surface (error_of: its statistic, "max", "q95", "rmse" or "mean"). A map beyond the bound
        is replaced by an exact one; with policy="clamp" QualityError is raised."""
        p = self.values(params, **named)
        opts = self._opts(policy, threads, check, max_error, error_of, outside)
        self._bounded(opts, p[None])
        exact = bool(opts.exact_shape)
        on = self._grid(grid, size, spacing, origin, direction)
        values, result = np.empty(on.shape, np.float32), make("sdm_result")
        try:
            if on is self.grid:
                self._call(exact, "sdm_generate", self, address(p), byref(opts), address(values), byref(result))
            else:
                self._call(
                    exact, "sdm_generate_grid", self, address(p), byref(opts), on, address(values), None, byref(result)
                )
        except QualityError as error:
            error.result = Map(values, on, info_of(result))._of(self._doubts)
            raise
        return Map(values, on, info_of(result))._of(self._doubts)

    def _grid(self, grid: Optional[Grid], size: Any, spacing: Any, origin: Any, direction: Any) -> Grid:
        if grid is None:
            return grid_within(self.grid, size, spacing, origin, direction)
        if size is not None or spacing is not None or origin is not None or direction is not None:
            raise argument_error("grid: give a grid, or size, spacing, origin and direction, not both")
        instance(grid, Grid, "grid")
        return self.grid if grid == self.grid else grid

    def batch(
        self,
        params: ArrayLike,
        *,
        policy: str = "refuse",
        check: bool = False,
        max_error: Optional[float] = None,
        error_of: str = "max",
        threads: int = 0,
    ) -> Batch:
        """The maps at parameters [n, k]: float32 [n, z, y, x], mm, NEGATIVE INSIDE."""
        p = float64(params, (None, len(self.params)), "parameters")
        opts = self._opts(policy, threads, check, max_error, error_of)
        self._bounded(opts, p)
        values = np.empty((len(p), *self.grid.shape), np.float32)
        results = (_abi.structs["sdm_result"] * len(p))()
        if len(p):
            exact = bool(opts.exact_shape)
            try:
                self._call(
                    exact, "sdm_generate_batch", self, address(p), len(p), byref(opts), address(values), byref(results)
                )
            except QualityError as error:
                error.result = Batch(values, self.grid, [info_of(r) for r in results], self._doubts)
                raise
        return Batch(values, self.grid, [info_of(r) for r in results], self._doubts)

    def _warn_derivatives(self, info: MapInfo, of_volume: bool = False) -> None:
        """Warns once of derivatives by the network that its training found to be off by over 20 %."""
        if info.source == "network":
            self._doubts.warn("volume_derivative" if of_volume else "derivative")

    def _warn_distances(self, info: MapInfo, distance: Float32) -> None:
        """Warns once of distances by the network far from the surface that its training found to be wrong."""
        if info.source == "network" and self._doubts.has("distance"):
            if (np.abs(distance) > self.accuracy.near_mm).any():
                self._doubts.warn("distance")

    def _differentiated(self, values: Float32, result: Any) -> Map:
        """The map of derivatives that have been computed."""
        info = info_of(result)
        self._warn_derivatives(info)
        return Map(values, self.grid, info)._of(self._doubts)

    def jacobian(self, params: Params = None, *, policy: str = "refuse", threads: int = 0, **named: float) -> Jacobian:
        """The map and its derivatives by all parameters, mm per unit of the parameter. Like jvp(), vjp() and
        slopes it warns once if the training found derivatives off by over 20 %."""
        p = self.values(params, **named)
        opts, result = self._opts(policy, threads), make("sdm_result")
        values = np.empty(self.grid.shape, np.float32)
        slopes = np.empty((len(p), *self.grid.shape), np.float32)
        exact = bool(opts.exact_shape)
        self._call(
            exact,
            "sdm_generate_jacobian",
            self,
            address(p),
            byref(opts),
            address(values),
            address(slopes),
            byref(result),
        )
        return Jacobian(self._differentiated(values, result), slopes)

    def jvp(
        self, direction: ArrayLike, params: Params = None, *, policy: str = "refuse", threads: int = 0, **named: float
    ) -> Tangent:
        """The map and its derivative along `direction` [k]: the Jacobian times the direction, mm."""
        p = self.values(params, **named)
        v = float64(direction, (len(p),), "direction")
        opts, result = self._opts(policy, threads), make("sdm_result")
        values, tangent = (np.empty(self.grid.shape, np.float32) for _ in range(2))
        exact = bool(opts.exact_shape)
        self._call(
            exact,
            "sdm_generate_jvp",
            self,
            address(p),
            address(v),
            byref(opts),
            address(values),
            address(tangent),
            byref(result),
        )
        return Tangent(self._differentiated(values, result), tangent)

    def vjp(
        self, adjoint: ArrayLike, params: Params = None, *, policy: str = "refuse", threads: int = 0, **named: float
    ) -> Float64:
        """The transposed Jacobian times `adjoint` [z, y, x]. If the adjoint is the derivative of a
        function of the map by the voxels, the result [k] is the derivative of this function by the
        parameters. Warns once if the training found derivatives off by over 20 %: those of the volume
        for an adjoint of `Map.volume_adjoint`, also by a parameter that hardly changes it, else those of
        maps."""
        p = self.values(params, **named)
        w = float32(adjoint, self.grid.shape, "adjoint")
        opts, slopes, result = self._opts(policy, threads), np.empty(len(p)), make("sdm_result")
        exact = bool(opts.exact_shape)
        self._call(exact, "sdm_generate_vjp", self, address(p), address(w), byref(opts), address(slopes), byref(result))
        self._warn_derivatives(info_of(result), isinstance(adjoint, VolumeAdjoint))
        return slopes

    def check(self, params: Params = None, *, threads: int = 0, **named: float) -> Check:
        """The error of the network's map near the surface, mm, against exact distances. Needs the shape."""
        info = self(self.values(params, **named), check=True, threads=threads).info
        assert info.check is not None
        return info.check

    def check_map(self, map: Map, params: Params = None, **named: float) -> Check:
        """The error of any map of this shape near the surface, mm, against exact distances."""
        p, result = self.values(params, **named), make("sdm_check")
        values = float32(instance(map, Map, "map").values, map.grid.shape, "map")
        shape = self.shape
        shape.call("sdm_check_shape", shape, address(p), map.grid, address(values), byref(result))
        return check_of(result)

    def field(
        self,
        params: Params = None,
        *,
        derivatives: bool = False,
        policy: str = "refuse",
        outside: str = "refuse",
        threads: int = 0,
        **named: float,
    ) -> Field:
        """The map at parameters as a function of space, for many calls of sample(), grid() and band()."""
        return Field(self, self.values(params, **named), self._opts(policy, threads, outside=outside), derivatives)

    def sample(
        self,
        points: ArrayLike,
        params: Params = None,
        *,
        gradient: bool = False,
        slopes: bool = False,
        policy: str = "refuse",
        outside: str = "refuse",
        threads: int = 0,
        **named: float,
    ) -> Samples:
        """Signed distances (mm, NEGATIVE INSIDE) at points [n, 3], LPS mm, and their derivatives. Computes the
        whole map at each call; field() computes it once. Warns once of points far from the surface if the
        training found distances there wrong by over a voxel."""
        field = self.field(
            self.values(params, **named), derivatives=slopes, policy=policy, outside=outside, threads=threads
        )
        return field.sample(points, gradient=gradient, slopes=slopes)

    def band(
        self,
        width: float,
        params: Params = None,
        *,
        grid: Optional[Grid] = None,
        size: Optional[Sequence[int]] = None,
        spacing: Union[None, float, Triple] = None,
        origin: Optional[Triple] = None,
        direction: Optional[ArrayLike] = None,
        policy: str = "refuse",
        outside: str = "refuse",
        threads: int = 0,
        **named: float,
    ) -> Band:
        """The narrow band of half width `width` (mm) in blocks of 8 x 8 x 8 voxels; distances NEGATIVE
        INSIDE."""
        on = self._grid(grid, size, spacing, origin, direction)
        return self.field(self.values(params, **named), policy=policy, outside=outside, threads=threads).band(width, on)

    def __repr__(self) -> str:
        names = ", ".join(p.name for p in self.params)
        return f"<Model of {self.shape_name}({names}), {self.kind}, {list(self.grid.shape)}, {self.checksum}>"

    def __reduce__(self) -> Any:
        if self.path is None or self._shape is not None and self._shape._python is not None:
            raise TypeError("only models from files, of shapes that are not written in Python, can be pickled")
        return (_reopened, (self.path, self._plugin))


def _reopened(path: Any, plugin: Any) -> Model:
    return Model(path, plugin=plugin)


def data_address(data: bytes) -> int:
    """The address of the content of a bytes object, which must stay in use during the call."""
    import ctypes

    return ctypes.cast(ctypes.c_char_p(data), ctypes.c_void_p).value or 0


def _texts(at: int, n: int) -> list[str]:
    import ctypes

    if not n:
        return []
    return [(text or b"").decode() for text in (ctypes.c_char_p * n).from_address(at)]


class Field:
    """The map of a model at fixed parameters as a function of space: distances in mm, NEGATIVE
    INSIDE. Between the voxel centres it is a cubic spline (sdm/field.h). Any number of threads may
    use it."""

    def __init__(self, model: Model, params: Float64, opts: Any, derivatives: bool) -> None:
        self._model, self._opts, self._derivatives = model, opts, flag(derivatives, "derivatives")
        self.params = params
        self._exact = bool(opts.exact_shape)
        self._handle = Handle("sdm_field_free", model._handle, opts, model._shape and model._shape._instance)
        result = make("sdm_result")
        call("sdm_field_create", model, byref(opts), self._derivatives, self._handle.out())
        model._call(self._exact, "sdm_field_set_params", self, address(params), byref(result))
        #: how the map was computed
        self.info = info_of(result)
        if self._derivatives:
            model._warn_derivatives(self.info)

    @property
    def _as_parameter_(self) -> Any:
        return self._handle.pointer

    def sample(self, points: ArrayLike, *, gradient: bool = False, slopes: bool = False) -> Samples:
        """Signed distances (mm, NEGATIVE INSIDE) at points [n, 3], LPS mm, and their derivatives; the
        slopes need derivatives=True in Model.field()."""
        x = finite(float64(points, (None, 3), "points"), "points")
        gradient, slopes = flag(gradient, "gradient"), flag(slopes, "slopes")
        n = len(x)
        result = Samples(
            np.empty(n, np.float32),
            np.empty((n, 3), np.float32) if gradient else None,
            np.empty((n, len(self.params)), np.float32) if slopes else None,
            self.info,
        )
        self._model._call(
            self._exact,
            "sdm_field_points",
            self,
            address(x),
            n,
            address(result.distance),
            address(result.gradient),
            address(result.slopes),
        )
        self._model._warn_distances(self.info, result.distance)
        return result

    def grid(self, grid: Grid) -> Map:
        """The map on a grid."""
        values = np.empty(instance(grid, Grid, "grid").shape, np.float32)
        self._model._call(self._exact, "sdm_field_grid", self, grid, address(values), None)
        return Map(values, grid, self.info)._of(self._model._doubts)

    def band(self, width: float, grid: Optional[Grid] = None) -> Band:
        """The narrow band of half width `width` (mm) on a grid, by default the model's."""
        blocks, w = make("sdm_blocks"), number(width, "width")
        on = self._model.grid if grid is None else instance(grid, Grid, "grid")
        self._model._call(self._exact, "sdm_field_band", self, on, w, byref(blocks))
        return band_of(blocks)
