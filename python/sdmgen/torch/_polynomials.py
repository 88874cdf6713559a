"""Products of normalised Legendre polynomials, in the order of model files (docs/formats.md)."""

from __future__ import annotations

import torch
from torch import Tensor


def exponents_of(degree: int, n: int) -> list[list[int]]:
    """The degrees of n variables in each product, by total degree up to `degree`."""

    def products(left: int, variables: int) -> list[list[int]]:
        if variables == 1:
            return [[left]]
        return [[e, *rest] for e in range(left, -1, -1) for rest in products(left - e, variables - 1)]

    return [row for d in range(degree + 1) for row in products(d, n)]


def polynomials(x: Tensor, degree: int, exponents: Tensor) -> Tensor:
    """The products [n, products] at variables x [n, k] in [-1, 1]; exponents [products, k] <= degree."""
    values = [torch.ones_like(x), x]
    for k in range(1, degree):
        values.append(((2 * k + 1) * x * values[k] - k * values[k - 1]) / (k + 1))
    table = torch.stack([(2 * k + 1) ** 0.5 * value for k, value in enumerate(values)], dim=-1)
    chosen = table[:, torch.arange(x.shape[1], device=x.device), exponents]
    product: Tensor = chosen.prod(dim=-1)
    return product
