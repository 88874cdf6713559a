"""The exceptions of the package: one for each status of the C library."""

from __future__ import annotations

import re
import sys
import warnings
from pathlib import Path
from typing import Any

from . import _abi


class Error(Exception):
    """An error of sdmgen. `status` names its kind, as the subclasses do: "argument", "memory", "io",
    "format", "config", "mesh", "plugin", "range", "unsupported", "cancelled", "quality" or "internal".
    `text` is the message."""

    def __init__(self, status: str, text: str) -> None:
        super().__init__(text)
        self.status = status
        self.text = text

    def __str__(self) -> str:
        return self.text

    def __reduce__(self) -> Any:
        return (type(self), (self.status, self.text))


class ArgumentError(Error, ValueError):
    """An argument is not valid."""


class OutOfMemoryError(Error, MemoryError):
    """Not enough memory."""


class FileError(Error, OSError):
    """A file cannot be opened, read or written."""

    def __new__(cls, status: str, text: str) -> FileError:
        return OSError.__new__(cls, text)  # type: ignore[call-arg]


class FormatError(Error, ValueError):
    """The content of a file is damaged or of another type."""


class ConfigError(Error, ValueError):
    """A configuration has mistakes: `text` has one line for each."""


class MeshError(Error, ValueError):
    """A mesh cannot be used."""


class ShapeError(Error, RuntimeError):
    """A shape returned invalid data, is not known or cannot be loaded."""


class RangeError(Error, ValueError):
    """Parameters or points outside of the allowed range."""


class UnsupportedError(Error, NotImplementedError):
    """Valid input that this build or shape does not support."""


class CancelledError(Error, RuntimeError):
    """Stopped on request."""


class QualityError(Error, ArithmeticError):
    """Completed, but the result is below the required quality. `result` holds the result, or None: a
    Map or Batch with a larger error than `max_error`, the FitResult of a fit that failed."""

    result: Any = None


class InternalError(Error, RuntimeError):
    """A bug in sdmgen."""


_CLASSES: dict[int, tuple[str, type[Error]]] = {
    _abi.constants[name]: (status, kind)
    for name, status, kind in (
        ("SDM_E_ARG", "argument", ArgumentError),
        ("SDM_E_NOMEM", "memory", OutOfMemoryError),
        ("SDM_E_IO", "io", FileError),
        ("SDM_E_FORMAT", "format", FormatError),
        ("SDM_E_CONFIG", "config", ConfigError),
        ("SDM_E_MESH", "mesh", MeshError),
        ("SDM_E_PLUGIN", "plugin", ShapeError),
        ("SDM_E_RANGE", "range", RangeError),
        ("SDM_E_UNSUPPORTED", "unsupported", UnsupportedError),
        ("SDM_E_CANCELLED", "cancelled", CancelledError),
        ("SDM_E_QUALITY", "quality", QualityError),
        ("SDM_E_INTERNAL", "internal", InternalError),
    )
}


def warn(text: str) -> None:
    """Issues a UserWarning at the line that called the package, also through PyTorch."""
    inner = [str(Path(__file__).parent / "_")[:-1]]
    if "torch" in sys.modules:
        inner.append(str(Path(str(sys.modules["torch"].__file__)).parent / "_")[:-1])
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(tuple(inner)):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, stacklevel=level)


def with_arguments(text: str) -> str:
    """A text of the C library, which names options of C, with the names of arguments in their place."""
    text = text.replace("sdm_fit_source.grid", "exact=True, spacing=...")
    text = text.replace("sdm_fit_opts.max_polish_iterations", "polish=True")
    text = text.replace("sdm_fit_opts.kept", "keep")
    text = text.replace("(sdm_registry_load())", "(plugin=FILE of sdmgen.Model)")
    text = re.sub(r"( = )?\bSDM_RANGE_(\w+)", lambda m: f'{"=" if m[1] else ""}"{m[2].lower()}"', text)
    return re.sub(r"\bsdm_\w+_opts\.(\w+)", r"\1", text)


def error_of(code: int, text: str) -> Error:
    """The exception of a status of the C library."""
    status, kind = _CLASSES.get(code, ("internal", InternalError))
    return kind(status, with_arguments(text))


def argument_error(text: str) -> ArgumentError:
    return ArgumentError("argument", text)
