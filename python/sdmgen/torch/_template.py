"""The network of a model of the kind "template" as a module (framework/include/sdm/internal/template.h):
exact maps of the parts, carried along as the parts move and bend."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Iterator

import numpy as np
import torch
from torch import Tensor, nn

from ._networks import Network, Pod
from ._polynomials import exponents_of, polynomials
from ._weights import Array, File

STEP = 4  # voxels between two stations, the points at which a warp is inverted
ITERATIONS = 12  # of Newton's method
AFFINE = 2  # type of a frame that stretches
FAR = 3.0  # voxels from the surface where interpolation between the corners of blocks begins


@dataclass
class Lattice:
    """Points origin + spacing * (i, j, k), (i, j, k) < n."""

    n: Array
    origin: Array
    spacing: float

    @property
    def count(self) -> int:
        """number of points"""
        return int(self.n.prod())


@dataclass
class Part:
    """A part as the description of the file states it."""

    parent: int
    frame: int
    pivot: Array
    numbers: int
    modes: int
    amplitudes: int
    near: Lattice
    far: Lattice
    warp: Lattice | None = field(default=None)


def _parts(file: File) -> list[Part]:
    """The parts of a file. Only those with modes have a line for the lattice of the warp."""

    def lattice(line: str) -> Lattice:
        v = [float(word) for word in line.replace(",", " ").split()]
        return Lattice(np.array(v[:3], np.int64), np.array(v[3:6]), v[6])

    whole = [[int(v) for v in file.text(f"part.{key}")] for key in ("parent", "frame", "numbers", "modes", "amplitudes")]
    warps: Iterator[str] = iter(file.text("part.warp")) if any(whole[3]) else iter(())
    result = []
    for i in range(file.int("template.parts")):
        parent, frame, numbers, modes, amplitudes = (values[i] for values in whole)
        pivot = np.array([float(v) for v in file.text("part.pivot")[i].replace(",", " ").split()])
        near, far = lattice(file.text("part.near")[i]), lattice(file.text("part.far")[i])
        warp = lattice(next(warps)) if modes else None
        result.append(Part(parent, frame, pivot, numbers, modes, amplitudes, near, far, warp))
    return result


def _rotation(w: Tensor) -> Tensor:
    """The matrices [n, 3, 3] of rotation vectors [n, 3] (Rodrigues)."""
    squared = (w * w).sum(-1)[:, None, None] + 1e-24
    angle = squared.sqrt()
    half = torch.sin(angle / 2) / (angle / 2)
    zero = torch.zeros_like(w[:, 0])
    x, y, z = w.unbind(-1)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(-1, 3, 3)
    unit = torch.eye(3, dtype=w.dtype, device=w.device)
    return unit + torch.sin(angle) / angle * cross + half * half / 2 * (cross @ cross)


def _expansion(voxels: int) -> dict[str, Array]:
    """Matrices [voxels, stations] of a whole number of blocks: `cubic`, the B-splines through values at
    the stations, and `linear`. Station i lies at the voxel STEP (i - 1). Matrices [voxels, corners]:
    cubic interpolation of values v with slopes s at the corners of the blocks is (line + bend) v +
    tangent s."""
    blocks = voxels // STEP
    stations = blocks + 3
    through = np.zeros((stations, stations))  # values of B-splines with given coefficients
    through[0, 0] = through[-1, -1] = 1
    for i in range(1, stations - 1):
        through[i, i - 1 : i + 2] = (1 / 6, 4 / 6, 1 / 6)
    cubic, linear = np.zeros((voxels, stations)), np.zeros((voxels, stations))
    line, bend, tangent = (np.zeros((voxels, blocks + 1)) for _ in range(3))
    for v in range(voxels):
        block, t = v // STEP, v % STEP / STEP
        s = 1 - t
        cubic[v, block : block + 4] = (s**3 / 6, (3 * t**3 - 6 * t**2 + 4) / 6, (3 * s**3 - 6 * s**2 + 4) / 6, t**3 / 6)
        linear[v, block + 1 : block + 3] = line[v, block : block + 2] = (s, t)
        first, second = t * s * s, t * t * s
        tangent[v, block : block + 2] = (first, -second)
        bend[v, block : block + 2] = (first - second, second - first)
    return {"cubic": cubic @ np.linalg.inv(through), "linear": linear, "line": line, "bend": bend, "tangent": tangent}


def _corners(at: Tensor, n: Tensor) -> Tensor:
    """The indices [..., 8] of the nodes around cells `at` [..., 3] of lattices of n [..., 3] nodes."""
    first = (at[..., 2] * n[..., 1] + at[..., 1]) * n[..., 0] + at[..., 0]
    line, plane = n[..., 0], n[..., 0] * n[..., 1]
    return torch.stack([first + (i & 1) + (i >> 1 & 1) * line + (i >> 2) * plane for i in range(8)], -1)


def _cell(x: Tensor, n: Tensor) -> tuple[Tensor, Tensor]:
    """The cells [..., 3] of indices x [..., 3] in lattices of n nodes, and the place in them, 0 .. 1.
    Indices beyond the lattice are clamped."""
    last = (n - 1).to(x.dtype)
    clamped = torch.minimum(x.clamp(min=0), last)
    at = torch.minimum(clamped.detach().floor(), last - 1)
    return at.long(), clamped - at


def _linear(corner: Tensor, t: Tensor) -> Tensor:
    """Interpolates corners [..., 8, c] at places t [..., 3]: [..., c]."""
    for axis in (2, 1, 0):
        half = corner.shape[-2] // 2
        corner = corner[..., :half, :] + t[..., axis, None, None] * (corner[..., half:, :] - corner[..., :half, :])
    return corner[..., 0, :]


class _Template(nn.Module):
    """The template of a part: its distance and gradient on the lattices `near` and, after it, `far`."""

    size: Tensor
    shift: Tensor
    factor: Tensor

    def __init__(self, part: Part, nodes: Array) -> None:
        super().__init__()
        self.nodes = nn.Parameter(torch.from_numpy(nodes.reshape(-1, 4).copy()), requires_grad=False)
        near, far = part.near, part.far
        self.origin, self.spacing, self.count = near.origin, near.spacing, near.count
        self.ratio, self.far_spacing = near.spacing / far.spacing, far.spacing
        self.register_buffer("size", torch.from_numpy(np.stack([near.n, far.n])))
        self.register_buffer("shift", torch.from_numpy((near.origin - far.origin) / far.spacing))

    def inside(self, u: Tensor, level: int) -> Tensor:
        """Whether indices u [..., 3] in the lattice `near` lie in it (level 0) or in `far` (1)."""
        x = u * self.ratio + self.shift.to(u) if level else u
        return ((x >= 0) & (x <= self.size[level] - 1)).all(-1)

    def forward(self, u: Tensor) -> tuple[Tensor, Tensor]:
        """Distance [...] and gradient [..., 3] at indices u [..., 3] in the lattice `near`: quadratic
        interpolation, which is exact for quadratic functions."""
        near = self.inside(u, 0)
        n = torch.where(near[..., None], self.size[0], self.size[1])
        at, t = _cell(torch.where(near[..., None], u, u * self.ratio + self.shift.to(u)), n)
        first = torch.where(near, 0, self.count)
        corner = self.nodes[_corners(at, n) + first[..., None]]
        value = _linear(corner, t)
        bend = torch.zeros_like(value[..., 0])
        for axis in range(3):
            # the change of the derivative along each axis, interpolated along the others
            low = [i for i in range(8) if not i >> axis & 1]
            change = corner[..., [i + (1 << axis) for i in low], axis + 1] - corner[..., low, axis + 1]
            others = [a for a in (0, 1, 2) if a != axis]
            for a in reversed(others):
                half = change.shape[-1] // 2
                change = change[..., :half] + t[..., a, None] * (change[..., half:] - change[..., :half])
            bend = bend + t[..., axis] * (1 - t[..., axis]) * change[..., 0]
        spacing = torch.where(near, self.spacing, self.far_spacing).to(u)
        return value[..., 0] - spacing / 2 * bend, value[..., 1:]


class _Warp(nn.Module):
    """The warp y + U(y) of a part, cubic B-splines on a lattice, and its inverse."""

    def __init__(self, part: Part, modes: Array) -> None:
        super().__init__()
        assert part.warp is not None
        self.lattice = part.warp
        values = torch.from_numpy(modes.reshape(part.modes, -1).copy())
        self.modes = nn.Parameter(values, requires_grad=False)

    def displacement(self, control: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
        """U [n, s, 3] at y [n, s, 3] and its derivative [n, s, 3, 3], for control points [n, nodes, 3].
        Beyond the lattice U is that of its nearest point."""
        lattice, n = self.lattice, torch.from_numpy(self.lattice.n).to(y.device)
        u = (y - torch.from_numpy(lattice.origin).to(y)) / lattice.spacing
        last = (n - 2).to(y)
        inside = (u >= 1) & (u <= last)
        u = torch.minimum(u.clamp(min=1), last)
        at = torch.minimum(u.detach().floor(), last - 1)
        t = u - at
        s = 1 - t
        w = torch.stack([s**3, 3 * t**3 - 6 * t**2 + 4, 3 * s**3 - 6 * s**2 + 4, t**3], -1) / 6
        d = torch.stack([-s * s / 2, 1.5 * t * t - 2 * t, 2 * s - 1.5 * s * s, t * t / 2], -1)
        d = d * (inside / lattice.spacing)[..., None]
        taps = torch.arange(-1, 3, device=y.device)
        x, yy, z = ((at[..., a].long()[..., None] + taps) for a in range(3))
        index = (z[..., :, None, None] * n[1] + yy[..., None, :, None]) * n[0] + x[..., None, None, :]
        batch = torch.arange(len(y), device=y.device)[:, None, None]
        near = control[batch, index.flatten(2)].unflatten(2, (4, 4, 4))
        sums = []
        for axis in (None, 0, 1, 2):
            f = [d[..., a, :] if a == axis else w[..., a, :] for a in range(3)]
            sums.append(torch.einsum("nszyxc,nsx,nsy,nsz->nsc", near, f[0], f[1], f[2]))
        return sums[0], torch.stack(sums[1:], -1)

    def _step(self, control: Tensor, q: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
        """The step of Newton's method for y + U(y) = q, and (I + U')^-1. A warp that folds is treated as
        the identity."""
        u, slope = self.displacement(control, y)
        unit = torch.eye(3, dtype=y.dtype, device=y.device)
        matrix = unit + slope
        folds = (torch.linalg.det(matrix) <= 1e-2)[..., None, None]
        inverse = torch.linalg.inv(torch.where(folds, unit, matrix))
        return (inverse @ (q - y - u)[..., None])[..., 0], inverse

    def inverse(self, amplitudes: Tensor, q: Tensor) -> tuple[Tensor, Tensor]:
        """y [n, s, 3] with y + U(y) = q, and (I + U')^-1 there."""
        control = (amplitudes.to(self.modes.dtype) @ self.modes).to(q).unflatten(1, (-1, 3))
        with torch.no_grad():
            y = q.clone()
            for _ in range(ITERATIONS):
                step, _ = self._step(control, q, y)
                length = step.norm(dim=-1, keepdim=True).clamp(min=1e-30)
                y = y + step * (0.5 * self.lattice.spacing / length).clamp(max=1)
        # at the solution each further step is 0, and gives another derivative
        for _ in range(2):
            y = y + self._step(control, q, y)[0]
        return y, self._step(control, q, y)[1]


class Template(Network):
    """The network of a model of the kind "template"."""

    exponents: Tensor
    voxels: Tensor
    stations: Tensor
    corners: Tensor
    middles: Tensor
    steps: Tensor

    def __init__(self, path: Any) -> None:
        file = path if isinstance(path, File) else File(path)
        super().__init__(file)
        self.degree = file.int("template.degree")
        self.index("exponents", exponents_of(self.degree, len(file.model.params)))
        functions = file.array("template.functions", "<f8").reshape(file.int("template.numbers"), -1)
        self.functions = nn.Parameter(torch.from_numpy(functions.copy()), requires_grad=False)
        self.parts = _parts(file)
        self.templates, self.warps = nn.ModuleList(), nn.ModuleDict()
        nodes, modes, node, mode = file.array("template.nodes", "<f4"), file.array("template.modes", "<f4"), 0, 0
        for number, part in enumerate(self.parts):
            size = 4 * (part.near.count + part.far.count)
            self.templates.append(_Template(part, nodes[node : node + size]))
            node += size
            if part.warp is not None:
                size = 3 * part.modes * part.warp.count
                self.warps[str(number)] = _Warp(part, modes[mode : mode + size])
                mode += size
        self.correction = Pod(File(file.sections["template.correction"])) if "template.correction" in file.sections else None
        self._read_grid()

    def _read_grid(self) -> None:
        grid = self.model.grid
        self.blocks = [-(-n // STEP) for n in grid.size]
        steps = grid.direction * grid.spacing

        def places(name: str, *index: Array) -> None:
            z, y, x = np.meshgrid(index[2], index[1], index[0], indexing="ij")
            points = np.stack([x, y, z], -1).reshape(-1, 3) @ steps.T + grid.origin
            self.register_buffer(name, torch.from_numpy(points))

        places("voxels", *(np.arange(STEP * n) for n in self.blocks))
        places("stations", *(STEP * (np.arange(n + 3) - 1) for n in self.blocks))
        places("corners", *(STEP * np.arange(n + 1) for n in self.blocks))
        places("middles", *(STEP * np.arange(n) + (STEP - 1) / 2 for n in self.blocks))
        self.register_buffer("steps", torch.from_numpy(steps))
        for axis, n in enumerate(self.blocks):
            for name, matrix in _expansion(STEP * n).items():
                self.register_buffer(f"{name}_{axis}", torch.from_numpy(matrix))

    def numbers(self, params: Tensor) -> Tensor:
        """The numbers [n, numbers] of all frames and warps."""
        phi = polynomials(self.scaled(params), self.degree, self.exponents)
        return phi @ self.functions.double().T

    def frames(self, g: Tensor) -> list[tuple[Tensor, Tensor]]:
        """For each part A [n, 3, 3] and b [n, 3]: A x + b is the point of the template, without its warp,
        at the point x of the world."""
        result: list[tuple[Tensor, Tensor]] = []
        unit = torch.eye(3, dtype=g.dtype, device=g.device)
        for part in self.parts:
            a, b = result[part.parent] if part.parent >= 0 else (unit.expand(len(g), 3, 3), g.new_zeros(len(g), 3))
            if part.frame:
                n = g[:, part.numbers :]
                pivot = torch.from_numpy(part.pivot).to(g)
                inverse = _rotation(n[:, :3]).transpose(1, 2)
                if part.frame == AFFINE:
                    stretch = n[:, [6, 11, 10, 11, 7, 9, 10, 9, 8]].reshape(-1, 3, 3)
                    inverse = torch.linalg.inv(unit + stretch) @ inverse
                a = inverse @ a
                b = (inverse @ (b - pivot - n[:, 3:6])[..., None])[..., 0] + pivot
            result.append((a, b))
        return result

    def _expand(self, values: Tensor, *names: str) -> Tensor:
        """Values [n, z, y, x, ...] at stations or corners in all voxels, with one matrix for all axes or
        those for x, y, z."""
        for axis in range(3):
            matrix = getattr(self, f"{names[axis % len(names)]}_{axis}").to(values)
            values = torch.tensordot(values, matrix, dims=([3 - axis], [1])).movedim(-1, 3 - axis)
        return values

    def _interpolated(self, value: Tensor, slope: Tensor) -> Tensor:
        """Cubic interpolation in the blocks from values [n, z, y, x] and slopes [n, z, y, x, 3] at their
        corners: linear, and the correction of the edges along each axis interpolated between them."""
        result = self._expand(value, "line")
        for axis in range(3):
            for name, of in (("bend", value), ("tangent", slope[..., axis])):
                result = result + self._expand(of, *(name if a == axis else "line" for a in range(3)))
        return result

    def _rigid(self, number: int) -> bool:
        part = self.parts[number]
        if part.frame == AFFINE or part.modes:
            return False
        return part.parent < 0 or self._rigid(part.parent)

    def _shape(self, more: int) -> list[int]:
        return [n + more for n in reversed(self.blocks)]

    def _still(self, number: int, a: Tensor, b: Tensor, correction: Tensor | None, kind: torch.dtype) -> Tensor:
        """The distance to a part without a warp in all voxels. A rigid part is interpolated in the blocks
        that do not lie within its lattice `near`."""
        near, template = self.parts[number].near, self.templates[number]

        def index(points: Tensor) -> Tensor:
            y = points.to(a) @ a.transpose(1, 2) + b[:, None]
            return (y - torch.from_numpy(near.origin).to(y)) / near.spacing

        u = index(self.voxels).to(kind)
        f, gradient = template(u)
        shape = [STEP * n for n in self._shape(0)]
        if not self._rigid(number):
            f = f * _stretch(gradient, (a @ a.transpose(1, 2))[:, None].to(kind))
            return (f if correction is None else f + self._corrected(correction, u)).unflatten(1, shape)
        u = index(self.corners).to(kind)
        value, gradient = template(u)
        slope = STEP * (gradient @ (a @ self.steps.to(a)).to(kind))
        far = self._interpolated(value.unflatten(1, self._shape(1)), slope.unflatten(1, self._shape(1)))
        extent = (a @ self.steps.to(a)).abs().sum(-1)[:, None] * ((STEP - 1) / 2 / near.spacing)
        middle, rounding = index(self.middles), 1e-4
        low, high = middle - extent - rounding, middle + extent + rounding
        within = ((low >= 0) & (high <= template.size[0] - 1)).all(-1).unflatten(1, self._shape(0))
        share = (self._known(template, u) & ~within).to(kind)
        return _blend(share, far, f.unflatten(1, shape))

    def _known(self, template: _Template, u: Tensor) -> Tensor:
        """Whether all corners of a block, at the indices u, lie in the lattice `far`: [n, z, y, x]."""
        known = template.inside(u.detach(), 1).unflatten(1, self._shape(1))
        for axis in (1, 2, 3):
            n = known.shape[axis] - 1
            known = known.narrow(axis, 0, n) & known.narrow(axis, 1, n)
        return known

    def _warped(self, number: int, g: Tensor, a: Tensor, b: Tensor, correction: Tensor | None, kind: torch.dtype) -> Tensor:
        """The distance to a part with a warp in all voxels. It is interpolated in the blocks that lie four
        voxels from the surface; between three and four voxels both are blended."""
        part, template = self.parts[number], self.templates[number]
        near = part.near
        q = self.stations.to(g) @ a.transpose(1, 2) + b[:, None]
        amplitudes = g[:, part.amplitudes : part.amplitudes + part.modes]
        y, inverse = self.warps[str(number)].inverse(amplitudes, q)
        back = inverse @ a[:, None]
        u = ((y - torch.from_numpy(near.origin).to(y)) / near.spacing).to(kind).unflatten(1, self._shape(3))
        metric = (back @ back.transpose(-1, -2)).to(kind).unflatten(1, self._shape(3))
        far, known = self._around(u, metric, template, correction)
        u, metric = self._expand(u, "cubic"), self._expand(metric, "linear")
        f, gradient = template(u)
        exact = f * _stretch(gradient, metric)
        if correction is not None:
            exact = exact + self._corrected(correction, u)
        voxels = far.abs() / float(max(self.model.grid.spacing))
        least = voxels.unfold(1, STEP, STEP).unfold(2, STEP, STEP).unfold(3, STEP, STEP).amin((4, 5, 6))
        return _blend((least - FAR).clamp(0, 1) * known, far, exact)

    def _around(self, u: Tensor, metric: Tensor, template: _Template, correction: Tensor | None) -> tuple[Tensor, Tensor]:
        """The distance to a part with a warp, interpolated in all blocks, and the blocks where it is known.
        Slopes are central differences between stations, those of the template its own."""
        f, gradient = template(u)
        factor = _stretch(gradient, metric)
        r = torch.zeros_like(f) if correction is None else self._corrected(correction, u)
        inner = (slice(None), *(slice(1, -1),) * 3)

        def change(v: Tensor, axis: int) -> Tensor:
            low, high = list(inner), list(inner)
            low[3 - axis], high[3 - axis] = slice(0, -2), slice(2, None)
            return (v[tuple(high)] - v[tuple(low)]) / 2

        slopes = []
        for axis in range(3):
            moved = template.spacing * (gradient[inner] * change(u, axis)).sum(-1)
            slopes.append(factor[inner] * moved + f[inner] * change(factor, axis) + change(r, axis))
        far = self._interpolated((f * factor + r)[inner], torch.stack(slopes, -1))
        return far, self._known(template, u[inner].flatten(1, 3))

    def _corrected(self, maps: Tensor, u: Tensor) -> Tensor:
        """The correction at the indices u [n, ..., 3] of the template, from its maps [n, z, y, x]."""
        assert self.correction is not None
        near, grid = self.parts[0].near, self.correction.model.grid
        shift = torch.from_numpy((near.origin - grid.origin) / grid.spacing).to(u)
        n = torch.tensor(grid.size, device=u.device)
        at, t = _cell(u * (near.spacing / grid.spacing[0]) + shift, n)
        index = _corners(at, n)
        corner = torch.gather(maps.flatten(1), 1, index.flatten(1)).reshape(index.shape)
        return _linear(corner[..., None], t)[..., 0]

    def forward(self, params: Tensor) -> Tensor:
        """Parameters [n, k] -> maps [n, z, y, x], mm, NEGATIVE INSIDE."""
        g = self.numbers(params)
        kind = self.templates[0].nodes.dtype
        correction = None if self.correction is None else self.correction(params).to(kind)
        parts = []
        for number, (a, b) in enumerate(self.frames(g)):
            r = None if number else correction
            parts.append(self._warped(number, g, a, b, r, kind) if self.parts[number].modes else self._still(number, a, b, r, kind))
        nx, ny, nz = self.model.grid.size
        result: Tensor = torch.stack(parts).amin(0)[:, :nz, :ny, :nx]
        return result


def _stretch(gradient: Tensor, metric: Tensor) -> Tensor:
    """What makes the value of the carried template a distance to first order; finite where the gradient
    [..., 3] is 0."""
    least = 1e-3
    mean = metric.diagonal(dim1=-2, dim2=-1).sum(-1) / 3
    q = (gradient[..., None, :] @ metric @ gradient[..., None])[..., 0, 0]
    return (((gradient * gradient).sum(-1) + least) / (q + least * mean)).sqrt()


def _blend(share: Tensor, far: Tensor, exact: Tensor) -> Tensor:
    """The distances [n, z, y, x] with the share [n, z, y, x] of `far` in each block."""
    for axis in (1, 2, 3):
        share = share.repeat_interleave(STEP, dim=axis)
    return exact + share * (far - exact)
