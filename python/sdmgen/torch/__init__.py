"""Maps in PyTorch: a model as a differentiable function, and the networks themselves as modules.

    import torch, sdmgen, sdmgen.torch
    model = sdmgen.Model("model.sdm")
    sdm = sdmgen.torch.Sdm(model)                    # computed by the library, on the processor
    maps = sdm(params)                               # [n, k] -> [n, z, y, x], mm, NEGATIVE INSIDE
    network = sdmgen.torch.load("model.sdm").cuda()  # an nn.Module: any device, second derivatives
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from .._model import Model
from ._load import load
from ._networks import Network, Pod, Point, Sdmnn
from ._template import Template

__all__ = ["Network", "Pod", "Point", "Sdm", "Sdmnn", "Template", "load"]


class _Maps(torch.autograd.Function):
    """Forward: maps; backward: vector-Jacobian products, both by the library."""

    @staticmethod
    def forward(ctx: Any, *arguments: Any) -> Tensor:
        params, model, options = arguments
        rows = params.detach().cpu().double().numpy()
        ctx.save_for_backward(params)
        ctx.model, ctx.options = model, options
        if ctx.needs_input_grad[0]:
            # the map of the derivatives is smooth, that of generate rounds to integers
            still = np.zeros(rows.shape[1])
            maps = np.stack([model.jvp(still, row, **options).map.values for row in rows])
        else:
            maps = model.batch(rows, **options).values
        result: Tensor = torch.from_numpy(maps).to(params)
        return result

    @staticmethod
    def backward(ctx: Any, *adjoints: Any) -> tuple[Tensor, None, None]:
        (adjoint,) = adjoints
        (params,) = ctx.saved_tensors
        rows = params.detach().cpu().double().numpy()
        weights = adjoint.detach().cpu().float().numpy()
        slopes = [ctx.model.vjp(w, row, **ctx.options) for w, row in zip(weights, rows)]
        return torch.from_numpy(np.stack(slopes)).to(params), None, None


class Sdm(nn.Module):
    """A model as a function of PyTorch: parameters [n, k] -> maps [n, z, y, x], mm, NEGATIVE INSIDE, of
    the type and device of the parameters. The library computes maps and first derivatives on the
    processor; load() makes modules with second derivatives. policy: parameters outside of the
    trained range, as for Model."""

    def __init__(self, model: Model, *, policy: str = "refuse", threads: int = 0) -> None:
        super().__init__()
        self.model = model
        self.options = {"policy": policy, "threads": threads}

    def forward(self, params: Tensor) -> Tensor:
        if params.ndim != 2 or params.shape[1] != len(self.model.params) or not len(params):
            raise ValueError(f"parameters: need a tensor [n, {len(self.model.params)}], not {list(params.shape)}")
        maps: Tensor = _Maps.apply(params, self.model, self.options)
        return maps
