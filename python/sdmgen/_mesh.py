"""Triangle meshes and exact distances."""

from __future__ import annotations

import threading
from ctypes import byref
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arrays import Float32, Float64, Triple, address, choice, copied, finite, flag, float64, indices, instance, number, path_bytes, whole, words
from ._errors import argument_error, warn
from ._grid import Grid, grid_around
from ._library import Callbacks, Handle, call, function, make
from ._map import Band, Map, MapInfo, band_of

if TYPE_CHECKING:
    from ._shape import Shape

SIGNS = ("auto", "crossings", "pseudonormal", "winding")


@dataclass(frozen=True)
class Audit:
    """Findings on a mesh; vertices with equal coordinates count as one. `volume` is signed, mm^3;
    `low` and `high` are the corners of the bounding box, mm. `closed`: on every edge as many triangles
    run in one direction as in the other. `manifold`: closed, and every edge has two triangles.
    `inverted`: closed, and the whole mesh is inside out. sdm/mesh.h describes the numbers."""

    vertices: int
    triangles: int
    degenerate: int
    duplicate: int
    boundary_edges: int
    nonmanifold_edges: int
    misoriented_edges: int
    components: int
    self_intersections: int
    volume: float
    area: float
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    closed: bool
    manifold: bool
    inverted: bool


def _corner(c: Any) -> tuple[float, float, float]:
    x, y, z = c
    return (x, y, z)


def _audit_of(c: Any) -> Audit:
    return Audit(
        vertices=c.n_vert,
        triangles=c.n_tri,
        degenerate=c.degenerate,
        duplicate=c.duplicate,
        boundary_edges=c.boundary_edges,
        nonmanifold_edges=c.nonmanifold_edges,
        misoriented_edges=c.misoriented_edges,
        components=c.components,
        self_intersections=c.self_intersections,
        volume=c.volume,
        area=c.area,
        low=_corner(getattr(c, "min")),
        high=_corner(getattr(c, "max")),
        closed=c.closed,
        manifold=c.manifold,
        inverted=c.inverted,
    )


@dataclass(frozen=True)
class Report:
    """How the exact engine understood a mesh (sdm/exact.h)."""

    audit: Audit
    #: sign method: "crossings", "pseudonormal" or "winding"
    sign: str
    #: the whole mesh was inside out and was turned
    turned: bool
    #: number of parts that were inside out and were turned, apart from `turned`
    parts_turned: int
    #: volume, mm^3, of parts that are inside out and meet others: they are subtracted from these.
    #: Counted by voxels, 64 along the longest edge, so a small part may be missed. NaN in the report
    #: of a map: not measured, because the mesh or its shape was examined before
    subtracted: float
    #: surface inside the union was removed
    unioned: bool
    #: number of triangles of the surface to which distances are measured
    triangles_used: int
    #: bound on the error of distances that the removal of inner surface causes, mm
    union_error_mm: float


@dataclass(frozen=True)
class Points:
    """Exact distances at points: `distance` [n], mm, NEGATIVE INSIDE; `closest` [n, 3], the nearest
    point of the surface, mm; `normal` [n, 3], the unit vector along the gradient of the signed
    distance; `triangle` [n], the nearest triangle of the given mesh, counted from 0."""

    distance: Float64
    closest: Float64
    normal: Float64
    triangle: NDArray[np.uint32]


class ExactMap(Map):
    """An exact map, mm, NEGATIVE INSIDE, with the layers that were asked for (None: not asked for)."""

    #: [z, y, x, 3] nearest point of the surface, mm
    closest: Optional[Float32] = None
    #: [z, y, x, 3] unit vector along the gradient of the signed distance
    normal: Optional[Float32] = None
    #: [z, y, x] nearest triangle of the given mesh; 2^32 - 1 outside of a narrow band
    triangle: Optional[NDArray[np.uint32]] = None
    #: [parameters, z, y, x] derivative of the distance by each parameter of the shape, mm per unit
    jacobian: Optional[Float32] = None
    report: Report


class _Engine(Handle):
    """A mesh that is prepared for exact distances."""

    def __init__(self, mesh: Mesh, sign: int, keep_overlap: bool, threads: int) -> None:
        super().__init__("sdm_exact_free")
        # the engine keeps the options: their callback must live as long as it does
        self._callbacks = Callbacks(per_thread=True)
        cancelled = self._callbacks.wrap("sdm_exact_opts", "cancelled", self._callbacks.stopped, True)
        self._opts = make("sdm_exact_opts", sign=sign, keep_overlap=keep_overlap, n_threads=threads, cancelled=cancelled)
        self.call("sdm_exact_create", byref(mesh._c), byref(self._opts), self.out())
        report = _pointed("sdm_exact_report", function("sdm_exact_get_report")(self))
        n = _pointed("sdm_mesh", function("sdm_exact_surface")(self)).n_tri
        self.source: NDArray[np.uint32] = copied(function("sdm_exact_source")(self), (n,), np.uint32)
        self.report = Report(
            _audit_of(report.audit),
            SIGNS[report.sign],
            report.turned,
            report.parts_turned,
            np.nan,
            report.unioned,
            report.n_tri_used,
            report.union_error_mm,
        )

    def call(self, name: str, *arguments: Any) -> None:
        self._callbacks.call(name, *arguments)

    def examined(self) -> Report:
        """The report, with Report.subtracted measured once."""
        if np.isnan(self.report.subtracted):
            self.report = replace(self.report, subtracted=self._subtracted())
        return self.report

    def _subtracted(self) -> float:
        """The engine turns parts that meet no others; open meshes have no such parts."""
        audit = self.report.audit
        several = audit.components > 1 or audit.nonmanifold_edges > 0
        meeting = audit.self_intersections > 0 or audit.nonmanifold_edges > 0
        if not (audit.closed and several and meeting):
            return 0.0
        grid = grid_around(audit.low, audit.high, None, None)
        far = np.full(grid.shape, np.inf, np.float32)  # nearer voxels may count as on the surface
        signs = make("sdm_sign_certificate")
        self.call("sdm_exact_certify", self, grid, address(far), byref(signs))
        return float(signs.below_zero * grid.spacing.prod())

    def original(self, triangle: NDArray[np.uint32]) -> NDArray[np.uint32]:
        """Numbers of triangles of the given mesh; 2^32 - 1 stays."""
        result = triangle.copy()
        known = triangle < len(self.source)
        result[known] = self.source[triangle[known]]
        return result


def _doubts(report: Report) -> list[str]:
    """Why signs of distances may surprise; nothing for a mesh as it should be."""
    audit, texts = report.audit, []
    if not audit.closed:
        texts.append(
            f"the mesh is not closed ({audit.boundary_edges} boundary edges, {audit.misoriented_edges} edges whose "
            "two triangles run along them in the same direction): inside is where the winding number exceeds 1/2"
        )
    if report.turned:
        texts.append("the mesh is inside out; distances are those of the turned mesh")
    if report.parts_turned:
        n = report.parts_turned
        texts.append(f"{n} {'part is' if n == 1 else 'parts are'} inside out; distances are those of the turned parts")
    if report.subtracted > 0:
        texts.append(
            "a part of the mesh is inside out, or passes through itself, and meets another one: it is subtracted from "
            f"what it overlaps and is not solid itself (about {report.subtracted:.2g} mm^3); reverse the vertices of "
            "its triangles (mesh.write(FILE.ply) and sdmgen mesh --mesh FILE.ply --audit name the part)"
        )
    return texts


def _pointed(name: str, at: int) -> Any:
    from ._abi import structs

    return structs[name].from_address(at)


class Examined:
    """Whether a mesh, or one mesh of a shape, was examined at its first distance."""

    def __init__(self) -> None:
        self._done = False
        self._lock = threading.Lock()

    def first(self) -> bool:
        """True at the first call."""
        with self._lock:
            first, self._done = not self._done, True
        return first


class Mesh:
    """A triangle mesh: `vertices` float64 [n, 3], LPS mm, and `triangles` uint32 [m, 3], counter-
    clockwise seen from outside. Both are copies. The first distance prepares a search tree, which
    the mesh keeps; any number of threads may use it."""

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike) -> None:
        self.vertices: Float64 = np.array(float64(vertices, (None, 3), "vertices"))
        self.triangles: NDArray[np.uint32] = np.array(indices(triangles, (None, 3), "triangles"))
        self.vertices.flags.writeable = self.triangles.flags.writeable = False
        self._c = make(
            "sdm_mesh",
            vert=address(self.vertices),
            tri=address(self.triangles),
            n_vert=len(self.vertices),
            n_tri=len(self.triangles),
        )
        self._engines: dict[tuple[int, bool, int], _Engine] = {}
        self._lock = threading.Lock()
        self._examined = Examined()

    @classmethod
    def read(cls, path: Any) -> Mesh:
        """The mesh of a .ply, .stl, .obj, .off, .vtk or .vtp file."""
        mesh = make("sdm_mesh")
        call("sdm_mesh_read", path_bytes(path), byref(mesh))
        return cls(*taken_mesh(mesh))

    def write(self, path: Any) -> None:
        """Writes a .ply, .stl, .obj, .off, .vtk or .vtp file."""
        call("sdm_mesh_write", path_bytes(path), byref(self._c))

    def audit(self) -> Audit:
        """Findings on the mesh as a whole: closed, overlapping, inside out. report() has those on its parts."""
        result = make("sdm_audit")
        call("sdm_mesh_audit", byref(self._c), byref(result))
        return _audit_of(result)

    def distance(self, points: ArrayLike, sign: str = "auto", keep_overlap: bool = False, threads: int = 0) -> Float64:
        """Exact signed distances at points [n, 3], LPS mm: [n], mm, NEGATIVE INSIDE."""
        return exact_points(self, points, sign=sign, keep_overlap=keep_overlap, threads=threads).distance

    def report(self, sign: str = "auto", keep_overlap: bool = False, threads: int = 0) -> Report:
        """How the exact engine understands the mesh."""
        return self._engine(sign, keep_overlap, threads).examined()

    def _engine(self, sign: str, keep_overlap: bool, threads: int) -> _Engine:
        key = (choice(sign, SIGNS, "sign"), flag(keep_overlap, "keep_overlap"), whole(threads, "threads", 0))
        with self._lock:
            if key not in self._engines:
                self._engines[key] = _Engine(self, *key)
            return self._engines[key]

    def _prepared(self, sign: str, keep_overlap: bool, threads: int) -> _Engine:
        """The engine for distances; the first one warns of a mesh that is open or inside out."""
        engine = self._engine(sign, keep_overlap, threads)
        for text in _doubts(engine.examined()) if self._examined.first() else ():
            warn(text)
        return engine

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {len(self.vertices)} vertices, {len(self.triangles)} triangles>"

    def __reduce__(self) -> Any:
        return (Mesh, (self.vertices, self.triangles))


class Surface(Mesh):
    """The surface of a map. `cut`: it leaves the grid of the map and is open there."""

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike, cut: bool = False) -> None:
        super().__init__(vertices, triangles)
        self.cut = cut


def mesh_corners(mesh: Mesh) -> Float64:
    """The vertices of the triangles, without those that belong to none: they count for no box."""
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.triangles.ravel()] = True
    corners: Float64 = mesh.vertices[used]
    return corners


def taken_mesh(mesh: Any) -> Sequence[NDArray[Any]]:
    """Vertices and triangles of a C mesh, which is freed."""
    try:
        return (
            copied(mesh.vert, (mesh.n_vert, 3), np.float64),
            copied(mesh.tri, (mesh.n_tri, 3), np.uint32),
        )
    finally:
        function("sdm_mesh_dispose")(byref(mesh))


Source = Union["Shape", Mesh, Sequence[ArrayLike]]
_LAYERS = ("closest", "normal", "triangle", "jacobian")


def mesh_of(source: Source, params: Union[None, ArrayLike, Mapping[str, float]] = None) -> Mesh:
    """The mesh of a shape at parameters, a mesh, or the mesh of a pair (vertices, triangles)."""
    from ._shape import Shape

    if isinstance(source, Shape):
        return source.mesh(params)
    if params is not None:
        raise argument_error("params: a mesh has no parameters")
    if isinstance(source, Mesh):
        return source
    if isinstance(source, (tuple, list)) and len(source) == 2:
        return Mesh(source[0], source[1])
    raise argument_error("need a Shape, a Mesh or a pair (vertices, triangles)")


def exact(
    source: Source,
    grid: Optional[Grid] = None,
    *,
    params: Union[None, ArrayLike, Mapping[str, float]] = None,
    layers: Sequence[str] = (),
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Triple] = None,
    origin: Optional[Triple] = None,
    sign: str = "auto",
    keep_overlap: bool = False,
    narrow: Optional[float] = None,
    threads: int = 0,
) -> ExactMap:
    """The exact signed distance map, mm, NEGATIVE INSIDE, of a Shape at `params` (default: its
    defaults), of a Mesh, or of a pair (vertices, triangles). A mesh that overlaps itself counts as
    the union of the solids that it encloses.

    grid, or size, spacing and origin: as for `sdmgen exact`; by default 64 voxels along the longest
    edge of the bounding box with a margin of a tenth of it on every side. layers: any of "closest",
    "normal", "triangle" and, for shapes, "jacobian": the members of ExactMap. narrow: clamps
    distances to this many voxels. keep_overlap: measures distances to all triangles, also to those
    inside the union. sign: the sign method (sdm/exact.h)."""
    layers = words(layers, _LAYERS, "layers")
    shape = source if not isinstance(source, (Mesh, tuple, list)) else None
    if "jacobian" in layers and shape is None:
        raise argument_error("layers: 'jacobian' needs a shape: a mesh has no parameters")
    mesh = mesh_of(source, params)
    engine = mesh._prepared(sign, keep_overlap, threads)
    if grid is None:
        grid = grid_around(engine.report.audit.low, engine.report.audit.high, size, spacing, origin)
    elif size is not None or spacing is not None or origin is not None:
        raise argument_error("grid: give a grid, or size, spacing and origin, not both")
    instance(grid, Grid, "grid")
    result = ExactMap(np.empty(grid.shape, np.float32), grid, MapInfo(error_mm=engine.report.union_error_mm))
    result.report = engine.report
    if "closest" in layers:
        result.closest = np.empty((*grid.shape, 3), np.float32)
    if "normal" in layers:
        result.normal = np.empty((*grid.shape, 3), np.float32)
    if "triangle" in layers:
        result.triangle = np.empty(grid.shape, np.uint32)
    arrays = make(
        "sdm_exact_layers",
        values=address(result.values),
        closest=address(result.closest),
        normal=address(result.normal),
        triangle=address(result.triangle),
        band_mm=0.0 if narrow is None else _narrow(narrow) * float(grid.spacing.min()),
    )
    if "jacobian" in layers:
        assert shape is not None and not isinstance(shape, (Mesh, tuple, list))
        velocity = shape.velocity(params)  # type: ignore[union-attr]
        result.jacobian = np.empty((len(velocity), *grid.shape), np.float32)
        engine.call(
            "sdm_exact_map_derivative",
            engine,
            grid,
            address(velocity),
            len(velocity),
            byref(arrays),
            address(result.jacobian),
        )
    else:
        engine.call("sdm_exact_map_layers", engine, grid, byref(arrays))
    if result.triangle is not None:
        result.triangle = engine.original(result.triangle)
    return result


def _narrow(value: float) -> float:
    width = number(value, "narrow")
    if not 0.5 <= width <= 1e6:
        raise argument_error(f"narrow: need a number of voxels from 0.5 to 1e6, not {width:g}")
    return width


def exact_band(
    source: Source,
    grid: Grid,
    width: float,
    *,
    params: Union[None, ArrayLike, Mapping[str, float]] = None,
    keep_overlap: bool = False,
    threads: int = 0,
) -> Band:
    """The narrow band of half width `width` (mm) of an exact map in blocks of 8 x 8 x 8 voxels, for
    closed meshes; distances NEGATIVE INSIDE."""
    instance(grid, Grid, "grid")
    engine = mesh_of(source, params)._prepared("auto", keep_overlap, threads)
    blocks = make("sdm_blocks")
    engine.call("sdm_exact_map_blocks", engine, grid, number(width, "width"), byref(blocks))
    return band_of(blocks)


def exact_points(
    source: Source,
    points: ArrayLike,
    *,
    params: Union[None, ArrayLike, Mapping[str, float]] = None,
    sign: str = "auto",
    keep_overlap: bool = False,
    threads: int = 0,
) -> Points:
    """Exact distances (mm, NEGATIVE INSIDE), nearest points, gradients and nearest triangles at
    points [n, 3], LPS mm, in any order."""
    x = finite(float64(points, (None, 3), "points"), "points")
    engine = mesh_of(source, params)._prepared(sign, keep_overlap, threads)
    n = len(x)
    result = Points(np.empty(n), np.empty((n, 3)), np.empty((n, 3)), np.empty(n, np.uint32))
    at = make(
        "sdm_exact_at",
        distance=address(result.distance),
        gradient=address(result.normal),
        closest=address(result.closest),
        triangle=address(result.triangle),
    )
    engine.call("sdm_exact_points", engine, address(x), n, byref(at))
    return Points(result.distance, result.closest, result.normal, engine.original(result.triangle))
