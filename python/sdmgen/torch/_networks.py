"""The networks of model files as modules: the same maps up to rounding, on any device, with
derivatives of any order."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np
import torch
from torch import Tensor, nn

from ._blocks import Block, blocks_of, leaves_of
from ._polynomials import exponents_of, polynomials
from ._weights import Array, File, Panels

ACTIVATIONS: tuple[Callable[[Tensor], Tensor], ...] = (
    torch.nn.functional.silu,
    torch.tanh,
    torch.relu,
    lambda x: torch.nn.functional.leaky_relu(x, 0.02),
)


class Network(nn.Module):
    """A network: parameters [n, k] -> maps [n, z, y, x], mm, NEGATIVE INSIDE. The weights are those of
    the file and do not require gradients until requires_grad_() is called."""

    low: Tensor
    unit: Tensor

    def __init__(self, file: File) -> None:
        super().__init__()
        params = file.model.params
        #: the model of the file: its parameters, grid and accuracy
        self.model = file.model
        low = np.array([p.min for p in params])
        self.register_buffer("low", torch.from_numpy(low))
        self.register_buffer("unit", torch.from_numpy(2 / (np.array([p.max for p in params]) - low)))

    def weight(self, values: Array) -> nn.Parameter:
        """A weight of the module."""
        array = np.array(values, np.float32, order="C")
        return nn.Parameter(torch.from_numpy(array), requires_grad=False)

    def index(self, name: str, values: Any) -> None:
        """A constant array of indices."""
        self.register_buffer(name, torch.from_numpy(np.ascontiguousarray(values, np.int64)))

    def scaled(self, params: Tensor) -> Tensor:
        """The parameters in double precision, scaled to [-1, 1]."""
        x: Tensor = (params.to(torch.float64) - self.low.double()) * self.unit.double() - 1
        return x


class Pod(Network):
    """The network of a model of the kind "pod"."""

    exponents: Tensor
    voxel: Tensor

    def __init__(self, path: Any) -> None:
        file = path if isinstance(path, File) else File(path)
        super().__init__(file)
        self._kind = file.int("pod.type")
        self._dtype = ("<f4", "<f2", "i1")[self._kind]
        self.degree, self.input_degree = file.int("pod.degree"), file.int("pod.input_degree")
        self.activation = ACTIVATIONS[file.int("pod.activation")]
        ranks = file.array("pod.ranks", "<u4")
        levels = blocks_of(file.model.grid.size, file.int("pod.block"), file.int("pod.levels"), ranks)
        self._read_polynomials(len(file.model.params))
        self._read_mlp(file, file.int("pod.depth"), file.int("pod.width"))
        self._read_decoder(file, levels, file.int("pod.block"))

    def _read_polynomials(self, n: int) -> None:
        degree = max(self.degree, self.input_degree)
        table = exponents_of(degree, n)
        self.index("exponents", table)
        self.n_terms = sum(sum(row) <= self.degree for row in table)
        self.n_inputs = sum(0 < sum(row) <= self.input_degree for row in table)

    def _read_mlp(self, file: File, depth: int, width: int) -> None:
        panels = Panels(file.sections["pod.mlp"], self._dtype)
        bias = file.array("pod.bias", "<f4").reshape(depth, width)
        scale = file.array("pod.layer_scale", "<f4").reshape(depth, width) if self._kind == 2 else None
        self.layers, self.biases = nn.ParameterList(), nn.ParameterList()
        at = 0
        for layer in range(depth):
            inputs = width if layer else self.n_inputs
            matrix, at = panels.matrix(at, width, inputs, inputs)
            self.layers.append(self.weight(matrix if scale is None else matrix * scale[layer][:, None]))
            self.biases.append(self.weight(bias[layer]))

    def _read_decoder(self, file: File, levels: list[list[Block]], edge: int) -> None:
        integers = self._kind == 2
        blocks = [block for level in levels for block in level]
        wide = file.array("pod.wide", "<u4") if integers else np.zeros(len(blocks) + 1, int)
        factor = file.array("pod.factor", "<f4") if integers else None
        starts = np.cumsum([0, *(block.rank for block in blocks)])
        # the head: its columns are in an order of their own
        n_latent = self.n_terms + (len(self.layers[-1]) if len(self.layers) else 0)
        n_top = sum(block.rank for block in levels[-1])
        head, _ = Panels(file.sections["pod.head"], self._dtype).matrix(0, n_top, n_latent, int(wide[-1]))
        if factor is not None:
            order = file.array("pod.order", "<u4")
            head, columns = np.zeros((n_top, n_latent)), head * factor[starts[-1] :]
            head[:, order] = columns
        self.head = self.weight(head)
        # the bases, in the order of decoding
        panels, at = Panels(file.sections["pod.basis"], self._dtype), 0
        bases: dict[int, Array] = {}
        mean = np.zeros(file.model.grid.shape, np.float32)
        means, mean_at = file.array("pod.mean", "<f4"), 0
        for block, is_leaf in leaves_of(levels, edge):
            b = block.number
            bases[b], at = panels.matrix(at, block.outputs, block.rank, int(wide[b]))
            if factor is not None:
                bases[b] = bases[b] * factor[starts[b] : starts[b] + block.rank]
            if is_leaf:
                nx, ny, nz = block.size
                x, y, z = block.at
                mean[z : z + nz, y : y + ny, x : x + nx] = means[mean_at : mean_at + block.outputs].reshape(nz, ny, nx)
                mean_at += -(-block.outputs // 16) * 16
        self.mean = self.weight(mean)
        # a level is a block-diagonal matrix, padded to blocks of one size
        self.bases = nn.ParameterList()
        for number, level in enumerate(levels):
            rank, outputs = max(b.rank for b in level), max(b.outputs for b in level)
            first = level[0].number
            total = int(sum(b.rank for b in level))
            padded = np.zeros((len(level), rank, outputs), np.float32)
            source = np.full((len(level), rank), total)
            target: list[Array] = []
            for i, block in enumerate(level):
                padded[i, : block.rank, : block.outputs] = bases[block.number].T
                begin = starts[block.number] - starts[first]
                source[i, : block.rank] = np.arange(begin, begin + block.rank)
                target.append(i * outputs + np.arange(block.outputs))
            self.bases.append(self.weight(padded))
            self.index(f"source_{number}", source)
            if number:
                self.index(f"target_{number}", np.concatenate(target))
            else:
                self.index("target_0", _voxel_order(file.model.grid.shape, level, target))

    def forward(self, params: Tensor) -> Tensor:
        """Parameters [n, k] -> maps [n, z, y, x], mm, NEGATIVE INSIDE."""
        degree = max(self.degree, self.input_degree)
        phi = polynomials(self.scaled(params), degree, self.exponents).to(self.head.dtype)
        latent = phi[:, : self.n_terms]
        if len(self.layers):
            h = phi[:, 1 : 1 + self.n_inputs]
            for matrix, bias in zip(self.layers, self.biases):
                h = self.activation(h @ matrix.T + bias)
            latent = torch.cat([latent, h], dim=1)
        c = latent @ self.head.T
        for level in range(len(self.bases) - 1, -1, -1):
            padded = torch.cat([c, c.new_zeros(len(c), 1)], dim=1)
            inputs = padded[:, getattr(self, f"source_{level}")]
            outputs = torch.einsum("nbr,bro->nbo", inputs, self.bases[level]).flatten(1)
            c = outputs[:, getattr(self, f"target_{level}")]
        return c.reshape(-1, *self.mean.shape) + self.mean


def _voxel_order(shape: tuple[int, ...], leaves: list[Block], places: list[Array]) -> Array:
    """For each voxel of the map the index of the output that is its value."""
    order = np.empty(shape, np.int64)
    for block, place in zip(leaves, places):
        (x, y, z), (nx, ny, nz) = block.at, block.size
        order[z : z + nz, y : y + ny, x : x + nx] = place.reshape(nz, ny, nx)
    return order.ravel()


class Point(Network):
    """The network of a model of the kind "deepsdf" or "imnet": a value for each point of space."""

    def __init__(self, path: Any) -> None:
        file = path if isinstance(path, File) else File(path)
        super().__init__(file)
        k, depth = len(file.model.params), file.int("point.depth")
        widths = [int(word) for word in file.text("point.width")]
        takes = [int(word) != 0 for word in file.text("point.input")]
        self.activation = ACTIVATIONS[file.int("point.activation")]
        self.tanh = file.int("point.tanh") != 0
        self.scale, self.radius = file.reals("point.scale")[0], file.reals("point.radius")[0]
        self.centre = file.reals("point.centre")
        panels, at = Panels(file.sections["point.hidden"], "<f2" if file.int("point.half") else "<f4"), 0
        rest, start = file.array("point.input", "<f4"), 0
        self.hidden, self.biases, self.inputs = nn.ParameterList(), nn.ParameterList(), nn.ParameterDict()
        for layer in range(depth):
            width = widths[layer]
            if layer:
                matrix, at = panels.matrix(at, width, widths[layer - 1])
                self.hidden.append(self.weight(matrix))
            self.biases.append(self.weight(rest[start : start + width]))
            start += width
            if takes[layer]:
                columns = rest[start : start + (k + 3) * width].reshape(k + 3, width)
                self.inputs[str(layer)] = self.weight(columns.T)
                start += columns.size
        self.last, self.last_bias = self.weight(rest[start:-1]), self.weight(rest[-1:])

    def at(self, params: Tensor, points: Tensor) -> Tensor:
        """The distances [n, m] at points [m, 3], LPS mm."""
        kind = self.last.dtype
        x = self.scaled(params).to(kind)
        q = ((points.double() - torch.tensor(self.centre, dtype=torch.float64, device=points.device)) / self.radius).to(kind)
        u = torch.cat([x[:, None].expand(-1, len(q), -1), q[None].expand(len(x), -1, -1)], dim=-1)
        h = u
        for layer, bias in enumerate(self.biases):
            total = bias
            if layer:
                total = total + h @ self.hidden[layer - 1].T
            if str(layer) in self.inputs:
                total = total + u @ self.inputs[str(layer)].T
            h = self.activation(total)
        value = h @ self.last + self.last_bias
        result: Tensor = self.scale * (torch.tanh(value) if self.tanh else value)
        return result

    def forward(self, params: Tensor) -> Tensor:
        """Parameters [n, k] -> maps [n, z, y, x], mm, NEGATIVE INSIDE."""
        grid = self.model.grid
        points = torch.from_numpy(grid.points().reshape(-1, 3)).to(params.device)
        return self.at(params, points).reshape(-1, *grid.shape)


class Sdmnn(Network):
    """The network of a model of the kind "sdmnn": dense layers and a U-Net."""

    def __init__(self, path: Any) -> None:
        file = path if isinstance(path, File) else File(path)
        super().__init__(file)
        self.depth, channels = file.int("sdmnn.depth"), file.int("sdmnn.channels")
        width, self.block = file.int("sdmnn.width"), file.int("sdmnn.block")
        self.activation = ACTIVATIONS[file.int("sdmnn.activation")]
        half = "<f2" if file.int("sdmnn.half") else "<f4"
        self.cells = tuple(-(-n // self.block) for n in file.model.grid.shape)
        n_cells, k = int(np.prod(self.cells)), len(file.model.params)
        dense = file.array("sdmnn.dense", "<f4")
        self.dense1 = self.weight(dense[: width * k].reshape(width, k))
        self.bias1 = self.weight(dense[width * k :][:width])
        self.bias2 = self.weight(dense[width * (k + 1) :][:n_cells])
        biases, b = dense[width * (k + 1) + n_cells :], 0
        matrix, _ = Panels(file.sections["sdmnn.volume"], half).matrix(0, n_cells, width)
        self.dense2 = self.weight(matrix)
        weights, w = file.array("sdmnn.conv", half), 0
        self.kernels, self.biases = nn.ParameterList(), nn.ParameterList()
        for inputs, outputs, edge in _convolutions(self.depth, channels):
            size = outputs * inputs * edge**3
            self.kernels.append(self.weight(weights[w : w + size].reshape(outputs, inputs, edge, edge, edge)))
            self.biases.append(self.weight(biases[b : b + outputs]))
            w, b = w + size, b + outputs

    def _conv(self, x: Tensor, number: int) -> Tensor:
        kernel = self.kernels[number]
        return torch.nn.functional.conv3d(x, kernel, self.biases[number], padding=kernel.shape[-1] // 2)

    def forward(self, params: Tensor) -> Tensor:
        """Parameters [n, k] -> maps [n, z, y, x], mm, NEGATIVE INSIDE."""
        shape = self.model.grid.shape
        h = self.activation(self.scaled(params).to(self.dense1.dtype) @ self.dense1.T + self.bias1)
        v = (h @ self.dense2.T + self.bias2).reshape(-1, 1, *self.cells)
        x = _repeat(v, self.block, shape)
        kept, number = [], 0
        for level in range(self.depth + 1):
            for _ in range(2):
                x = self.activation(self._conv(x, number))
                number += 1
            if level < self.depth:
                kept.append(x)
                x = torch.nn.functional.max_pool3d(x, 2, ceil_mode=True)
        for down in reversed(kept):
            x = self.activation(self._conv(x, number))
            x = torch.cat([down, _repeat(x, 2, down.shape[2:])], dim=1)
            for i in (1, 2):
                x = self.activation(self._conv(x, number + i))
            number += 3
        return self._conv(x, number)[:, 0]


def _convolutions(depth: int, channels: int) -> list[tuple[int, int, int]]:
    """inputs, outputs and edge of the kernel of each convolution in order"""
    c = [min(channels << level, 512) for level in range(depth + 1)]
    result = []
    for level in range(depth + 1):
        result += [(c[level - 1] if level else 1, c[level], 3), (c[level], c[level], 3)]
    for level in range(depth - 1, -1, -1):
        result += [(c[level + 1], c[level], 1), (2 * c[level], c[level], 3), (c[level], c[level], 3)]
    return [*result, (c[0], 1, 1)]


def _repeat(x: Tensor, times: int, shape: Any) -> Tensor:
    """Repeats each voxel along all axes and cuts to a shape."""
    for axis in (2, 3, 4):
        x = x.repeat_interleave(times, dim=axis)
    return x[:, :, : shape[0], : shape[1], : shape[2]]
