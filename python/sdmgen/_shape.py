"""Shapes: built in, from plug-ins, or written in Python."""

from __future__ import annotations

import ctypes
import os
import re
import threading
from ctypes import byref, c_size_t, c_void_p
from dataclasses import dataclass
from typing import Any, Callable, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from . import _abi
from ._arrays import Float64, address, float64, indices, named_values, number, path_bytes, text_bytes, whole
from ._errors import Error, ShapeError, argument_error
from ._library import Callbacks, Handle, array, call, function, make
from ._mesh import Examined, Mesh, taken_mesh

Params = Union[None, ArrayLike, Mapping[str, float]]
MeshFunction = Callable[..., Any]


@dataclass(frozen=True)
class Param:
    """A parameter: its range, its default (None: the middle of the range), its unit ("mm", "rad", "sd"
    or "") and a text of help, empty for parameters of a Model. With `mean` and `deviation` it is
    normally distributed within the range, else uniformly."""

    name: str
    min: float
    max: float
    default: Optional[float] = None
    unit: str = ""
    help: str = ""
    mean: Optional[float] = None
    deviation: Optional[float] = None


@dataclass(frozen=True)
class Measure:
    """A measure of a shape, such as a length. `depth`: where it was taken, mm; None: it belongs to no
    depth. `value` is NaN where a depth lies beyond the end of the shape. FitResult.measures() also sets
    `sd`, the standard deviation (NaN: unknown), and `not_determined`: the target says no more about the
    measure than the priors. Else both are None."""

    name: str
    value: float
    unit: str
    help: str
    depth: Optional[float] = None
    sd: Optional[float] = None
    not_determined: Optional[bool] = None


def measures_by(call: Callable[..., Any], name: str, arguments: Sequence[Any], depths: ArrayLike, of_fit: bool) -> list[Measure]:
    """The measures that a function of the library finds at these depths."""
    at, result = float64(depths, (None,), "depths"), make("sdm_measures")
    call(name, *arguments, address(at), len(at), byref(result))
    return [
        Measure(
            *(c.name.decode(), c.value, c.unit.decode(), c.help.decode()),
            depth=None if np.isnan(c.depth) else c.depth,
            sd=c.sd if of_fit else None,
            not_determined=c.not_determined if of_fit else None,
        )
        for c in result.at[: result.n]
    ]


def _distribution(c: Any) -> dict[str, Optional[float]]:
    normal = c.kind == _abi.constants["SDM_DISTRIBUTION_NORMAL"]
    return {"mean": c.mean if normal else None, "deviation": c.deviation if normal else None}


def param_of(c: Any, distribution: Any) -> Param:
    """The parameter of a C structure."""
    text = {name: (getattr(c, name, None) or b"").decode() for name in ("name", "unit", "help")}
    low, high, default = getattr(c, "min"), getattr(c, "max"), getattr(c, "def")
    return Param(text["name"], low, high, default, text["unit"], text["help"], **_distribution(distribution))


class Registry(Handle):
    """The built-in shapes, a plug-in, and the shapes in the folders of SDMGEN_PLUGIN_PATH."""

    def __init__(self, plugin: Any = None) -> None:
        super().__init__("sdm_registry_free")
        call("sdm_registry_create", self.out())
        call("sdm_builtin_shapes_add", self)
        if plugin is not None:
            call("sdm_registry_load", self, path_bytes(plugin, "plugin"))
        call("sdm_registry_load_path", self, os.environb.get(b"SDMGEN_PLUGIN_PATH"))

    def find(self, name: str) -> int:
        near = ctypes.c_char_p()
        found = function("sdm_registry_find")(self, text_bytes(name, "shape"), byref(near))
        if found:
            return int(found)
        known = ", ".join(self.names())
        hint = f"did you mean '{near.value.decode()}'?" if near.value else f"the shapes are {known}"
        raise ShapeError("plugin", f"unknown shape '{name}'; {hint}")

    def names(self) -> list[str]:
        count, at = function("sdm_registry_count")(self), function("sdm_registry_at")
        shape = _abi.structs["sdm_shape"]
        return [shape.from_address(at(self, i)).name.decode() for i in range(count)]


def shapes(plugin: Any = None) -> list[str]:
    """The names of the built-in shapes, those of a plug-in (the path of its .so file) and those in
    the folders of SDMGEN_PLUGIN_PATH."""
    return Registry(plugin).names()


class Shape:
    """A shape: a function from a few parameters to a triangle mesh.

    Shape("cochlea", edge=0.3) is a built-in shape with its options; plugin="gear.so" loads others.

    Shape(function, params) is a shape written in Python: function(a, b, ...) takes a number for each
    Param and returns (vertices [n, 3] in mm, triangles [m, 3]). The mesh must be closed, its triangles
    counter-clockwise seen from outside, and depend on the parameters alone. The numbers n and m should
    not depend on them. velocity(a, b, ...) may return the derivatives of the vertices by each
    parameter, [len(params), n, 3]; without it they are computed by differences. The library calls the
    functions from one thread at a time. name: default the name of the function."""

    def __init__(
        self,
        shape: Union[str, MeshFunction],
        params: Optional[Sequence[Param]] = None,
        *,
        name: Optional[str] = None,
        summary: str = "",
        velocity: Optional[Callable[..., Any]] = None,
        plugin: Any = None,
        base_dir: Any = None,
        **options: Any,
    ) -> None:
        self._registry = Registry(plugin)
        self._examined = Examined()
        self._python: Optional[_PythonShape] = None
        self.name: str
        if isinstance(shape, str):
            if params is not None or velocity is not None or name is not None:
                raise argument_error("params, name and velocity belong to shapes written in Python")
            self.name = shape
        elif callable(shape):
            if options or plugin is not None:
                raise argument_error("options and plug-ins belong to shapes by name")
            self._python = _PythonShape(shape, params or (), name, summary, velocity)
            call("sdm_registry_add", self._registry, byref(self._python.table), b"Python")
            self.name = self._python.name
        else:
            raise argument_error("shape: need the name of a shape, or a function that returns vertices and triangles")
        words = [(text_bytes(key, "option"), text_bytes(value, f"option {key}")) for key, value in options.items()]
        named = array("sdm_named_text", words)
        self._instance = Handle("sdm_instance_free", self._registry, self._python)
        folder = None if base_dir is None else path_bytes(base_dir, "base_dir")
        call("sdm_instance_create", self._registry.find(self.name), named, len(words), folder, self._instance.out())
        self._params = _params(self._instance)

    @property
    def _as_parameter_(self) -> c_void_p:
        return self._instance.pointer

    @property
    def params(self) -> list[Param]:
        """The parameters in their order: name, unit, range, default, distribution."""
        return self._params

    @property
    def defaults(self) -> Float64:
        """the default values of the parameters"""
        return np.array([p.default for p in self.params], np.float64)

    def values(self, params: Params = None, **named: float) -> Float64:
        """A parameter vector, from an array, a mapping or names; the others have their defaults."""
        return named_values([p.name for p in self.params], self.defaults, params, named)

    def call(self, name: str, *arguments: Any) -> None:
        """Calls the library, and raises the exception of a mesh function written in Python."""
        if self._python is None:
            call(name, *arguments)
        else:
            self._python.call(name, *arguments)

    def mesh(self, params: Params = None, **named: float) -> Mesh:
        """The mesh at parameters."""
        p = self.values(params, **named)
        mesh = make("sdm_mesh")
        self.call("sdm_instance_mesh", self, address(p), byref(mesh))
        result = Mesh(*taken_mesh(mesh))
        result._examined = self._examined  # the first mesh with distances stands for the shape
        return result

    def velocity(self, params: Params = None, **named: float) -> Float64:
        """The derivatives of the vertices by the parameters, [parameters, vertices, 3], mm per unit."""
        p = self.values(params, **named)
        result = np.empty((len(p), len(self.mesh(p).vertices), 3))
        self.call("sdm_instance_velocity", self, address(p), result.shape[1], address(result))
        return result

    def distance(self, point: ArrayLike, params: Params = None, **named: float) -> float:
        """The closed-form signed distance of the ideal shape at a point (LPS, mm), NEGATIVE INSIDE;
        UnsupportedError if the shape has none."""
        x, p, result = float64(point, (3,), "point"), self.values(params, **named), ctypes.c_double()
        self.call("sdm_instance_distance", self, address(p), address(x), byref(result))
        return result.value

    def measures(self, params: Params = None, depths: ArrayLike = (), **named: float) -> list[Measure]:
        """The measures of the shape at parameters: its own, then volume, area and extents. Measures that
        depend on a depth, such as the frequency along the cochlea, are taken at each of `depths`, mm."""
        return measures_by(self.call, "sdm_shape_measure", (self, address(self.values(params, **named))), depths, False)

    def random(self, seed: int) -> Float64:
        """Random parameters, each from its distribution."""
        result = np.empty(len(self.params))
        function("sdm_phantom_random_params")(self, whole(seed, "seed", 0, 2**63), address(result))
        return result

    def __repr__(self) -> str:
        return f"<Shape {self.name}({', '.join(p.name for p in self.params)})>"


def _params(instance: Handle) -> list[Param]:
    n = c_size_t()
    first = function("sdm_instance_params")(instance, byref(n))
    laws = function("sdm_instance_distributions")(instance)
    params = (_abi.structs["sdm_param"] * n.value).from_address(first)
    distributions = (_abi.structs["sdm_distribution"] * n.value).from_address(laws)
    return [param_of(p, d) for p, d in zip(params, distributions)]


class InstanceShape(Shape):
    """The shape that a model was trained on, from the registry of the library."""

    def __init__(self, registry: Registry, instance: Handle, name: str) -> None:
        self._registry = registry
        self._examined = Examined()
        self._python = None
        self._instance = instance
        self.name = name
        self._params = _params(instance)


class _PythonShape:
    """The C table of a shape whose mesh is computed in Python."""

    def __init__(
        self,
        mesh: MeshFunction,
        params: Sequence[Param],
        name: Optional[str],
        summary: str,
        velocity: Optional[Callable[..., Any]],
    ) -> None:
        self.name = str(getattr(mesh, "__name__", "") if name is None else name)
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.name):
            raise argument_error(f"name: '{self.name}' must consist of small letters, digits and _, and begin with a letter")
        self._mesh, self._velocity = mesh, velocity
        self._params = [_c_param(p) for p in params]
        self._laws = [_c_distribution(p) for p in params]
        # one call at a time: functions in Python may use variables that are not safe with threads
        self._lock = threading.RLock()
        self._callbacks = Callbacks()
        self._failed: dict[str, Exception] = {}
        self._table_params = array("sdm_param", self._params)
        self.table = make(
            "sdm_shape",
            abi=_abi.constants["SDM_SHAPE_ABI"],
            size=ctypes.sizeof(_abi.structs["sdm_shape"]),
            name=self.name.encode(),
            summary=(summary or (mesh.__doc__ or "written in Python").strip().splitlines()[0]).encode(),
            params=ctypes.addressof(self._table_params),
            n_params=len(self._params),
            mesh=self._callback("mesh", self._make_mesh),
            distributions=self._callbacks.wrap("sdm_shape", "distributions", self._distributions, None),
        )
        if velocity is not None:
            self.table.velocity = self._callback("velocity", self._make_velocity)

    def _callback(self, member: str, python: Callable[..., int]) -> Any:
        """A callback whose exceptions become the message of the call that it belongs to."""

        def told(me: Any, host_at: int, options: Any, *arguments: Any) -> int:
            try:
                with self._lock:
                    return python(host_at, *arguments)
            except Exception as raised:
                text = f"{type(raised).__name__}: {raised}"
                self._failed = {text: raised}
                host = _abi.structs["sdm_host"].from_address(host_at)
                return int(host.fail(host_at, text.encode("utf-8", "replace")))

        return self._callbacks.wrap("sdm_shape", member, told, 1)

    def _values(self, at: int) -> list[float]:
        return [float(x) for x in (ctypes.c_double * len(self._params)).from_address(at)]

    def _make_mesh(self, host_at: int, p: int, out_at: int) -> int:
        result = self._mesh(*self._values(p))
        if isinstance(result, Mesh):
            result = (result.vertices, result.triangles)
        if not isinstance(result, (tuple, list)) or len(result) != 2:
            raise TypeError("the function must return (vertices, triangles)")
        vertices = float64(result[0], (None, 3), "vertices")
        triangles = indices(result[1], (None, 3), "triangles")
        host = _abi.structs["sdm_host"].from_address(host_at)
        out = _abi.structs["sdm_mesh_out"].from_address(out_at)
        failed = int(host.reserve(host_at, out_at, len(vertices), len(triangles)))
        if not failed:
            ctypes.memmove(out.vert, vertices.ctypes.data, vertices.nbytes)
            ctypes.memmove(out.tri, triangles.ctypes.data, triangles.nbytes)
        return failed

    def _make_velocity(self, _host_at: int, p: int, n: int, out: int) -> int:
        assert self._velocity is not None
        result = self._velocity(*self._values(p))
        slopes = float64(result, (len(self._params), n, 3), "velocity")
        ctypes.memmove(out, slopes.ctypes.data, slopes.nbytes)
        return 0

    def _distributions(self, _self: Any, out: int) -> None:
        laws = (_abi.structs["sdm_distribution"] * len(self._laws)).from_address(out)
        laws[:] = self._laws

    def call(self, name: str, *arguments: Any) -> None:
        self.call_with(self._callbacks, name, *arguments)

    def call_with(self, callbacks: Callbacks, name: str, *arguments: Any) -> None:
        """The same with callbacks of the caller."""
        try:
            callbacks.call(name, *arguments)
        except Error as error:
            interrupted, self._callbacks.raised = self._callbacks.raised, None
            if interrupted is not None:
                raise interrupted
            cause = next((raised for text, raised in self._failed.items() if text in error.text), None)
            if cause is None:
                raise
            raise error from cause


def _c_param(p: Param) -> Any:
    if not isinstance(p, Param):
        raise argument_error("params: need a list of sdmgen.Param")
    result = make("sdm_param", name=text_bytes(p.name, "name"), unit=text_bytes(p.unit, "unit"), help=text_bytes(p.help or p.name, "help"))
    low, high = number(p.min, f"{p.name}: min"), number(p.max, f"{p.name}: max")
    default = 0.5 * (low + high) if p.default is None else number(p.default, f"{p.name}: default")
    for member, value in (("min", low), ("max", high), ("def", default)):
        setattr(result, member, value)
    return result


def _c_distribution(p: Param) -> Any:
    if p.mean is None and p.deviation is None:
        return make("sdm_distribution")
    return make(
        "sdm_distribution",
        kind=_abi.constants["SDM_DISTRIBUTION_NORMAL"],
        mean=number(p.mean, f"{p.name}: mean"),
        deviation=number(p.deviation, f"{p.name}: deviation"),
    )
