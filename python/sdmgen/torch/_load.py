"""Opens the networks of model files as modules."""

from __future__ import annotations

from typing import Any, Callable

from .._errors import UnsupportedError
from ._networks import Network, Pod, Point, Sdmnn
from ._template import Template
from ._weights import File

KINDS: dict[str, Callable[[Any], Network]] = {
    "pod": Pod,
    "template": Template,
    "deepsdf": Point,
    "imnet": Point,
    "sdmnn": Sdmnn,
}


def load(path: Any) -> Network:
    """The network of a model file as a module: Pod, Template, Point or Sdmnn.

    The range of the parameters is not checked. Derivatives of a Template are those of its interpolation;
    the library interpolates the gradients at the nodes, and the two differ where the template has edges.
    Derivatives of the warp of a Template are exact up to the third order."""
    file = File(path)
    if file.model.kind not in KINDS:
        raise UnsupportedError("unsupported", f"networks of the kind '{file.model.kind}' are not modules; use Sdm(model)")
    return KINDS[file.model.kind](file)
