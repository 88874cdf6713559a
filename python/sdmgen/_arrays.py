"""Checks of array arguments, and their addresses."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any, Mapping, Optional, Sequence, TypeVar, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import argument_error

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Shape = Sequence[Optional[int]]
T = TypeVar("T")
#: one number for each of the axes x, y, z
Triple = Union[Sequence[float], NDArray[Any]]


def _text(shape: Shape) -> str:
    return "[" + ", ".join("n" if n is None else str(n) for n in shape) + "]"


def _array(value: ArrayLike, name: str, kinds: str, what: str) -> NDArray[Any]:
    try:
        array = np.asarray(value)
    except Exception as reason:
        raise argument_error(f"{name}: not an array: {reason}") from None
    empty_list = array.size == 0 and array.dtype == np.float64
    if array.dtype.kind not in kinds and not empty_list:
        raise argument_error(f"{name}: need {what}, not values of type {array.dtype}")
    return array


def _shaped(array: NDArray[Any], shape: Shape, name: str) -> None:
    if array.ndim != len(shape) or any(want not in (None, n) for n, want in zip(array.shape, shape)):
        raise argument_error(f"{name}: need an array of shape {_text(shape)}, not {_text(array.shape)}")


def float64(value: ArrayLike, shape: Shape, name: str) -> Float64:
    """A C-contiguous array of doubles of this shape (None: any length)."""
    array = np.ascontiguousarray(_array(value, name, "fiub", "real numbers"), np.float64)
    if not shape:
        array = array.reshape(()) if array.size == 1 and array.ndim <= 1 else array
    _shaped(array, shape, name)
    return array


def float32(value: ArrayLike, shape: Shape, name: str) -> Float32:
    """A C-contiguous array of floats of this shape (None: any length)."""
    with np.errstate(over="ignore"):
        array = np.ascontiguousarray(_array(value, name, "fiub", "real numbers"), np.float32)
    _shaped(array, shape, name)
    return array


def indices(value: ArrayLike, shape: Shape, name: str) -> NDArray[np.uint32]:
    """A C-contiguous array of indices of this shape."""
    array = _array(value, name, "iu", "integers")
    _shaped(array, shape, name)
    if array.size and (array.min() < 0 or array.max() >= 2**32):
        raise argument_error(f"{name}: need integers from 0 to {2**32 - 1}")
    return np.ascontiguousarray(array, np.uint32)


def finite(array: NDArray[Any], name: str) -> NDArray[Any]:
    """The array, all of whose values are finite."""
    if not np.isfinite(array).all():
        raise argument_error(f"{name}: a value is NaN or infinite")
    return array


def number(value: Any, name: str) -> float:
    """A finite number."""
    return float(finite(float64(value, (), name), name))


def whole(value: Any, name: str, least: int, most: int = 2**31 - 1) -> int:
    """An integer within bounds."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or not least <= value <= most:
        raise argument_error(f"{name}: need an integer from {least} to {most}, not {value!r}")
    return int(value)


def triple(value: Union[float, Triple], name: str) -> list[float]:
    """Three finite numbers from three, or from one for all axes."""
    array = np.asarray(value)
    if array.ndim == 0:
        return 3 * [number(array, name)]
    return [float(x) for x in finite(float64(array, (3,), name), name)]


def choice(value: str, names: Sequence[str], name: str) -> int:
    """The place of a word in a list of allowed ones."""
    if not isinstance(value, str) or value not in names:
        raise argument_error(f"{name}: need one of {', '.join(map(repr, names))}, not {value!r}")
    return names.index(value)


def address(array: Optional[NDArray[Any]]) -> Optional[int]:
    """The address of the data of an array; it must stay in use during the call."""
    return None if array is None else int(array.ctypes.data)


def copied(pointer: Optional[int], shape: Sequence[int], dtype: Any) -> NDArray[Any]:
    """A copy of an array of the library."""
    import ctypes

    result = np.empty(shape, dtype)
    if pointer and result.size:
        ctypes.memmove(result.ctypes.data, pointer, result.nbytes)
    return result


#: keywords of the calls that take parameters as keywords, too
KEYWORDS = ("grid", "size", "spacing", "origin", "direction", "policy", "outside", "check", "max_error", "error_of", "threads")


def _nearest(name: str, names: Sequence[str]) -> str:
    """A question about a misspelt parameter or keyword, or nothing."""
    near = [word for word in get_close_matches(name, [*names, *KEYWORDS], 1) if word != name]
    return f"did you mean '{near[0]}'? " if near else ""


def named_values(
    names: Sequence[str],
    defaults: Float64,
    values: Union[None, ArrayLike, Mapping[str, float]],
    more: Mapping[str, float],
) -> Float64:
    """Parameters from an array, a mapping or keywords; those not given have their defaults."""
    result = defaults.copy()
    if isinstance(values, Mapping):
        more = {**values, **more}
    elif values is not None:
        result = float64(values, (len(names),), "parameters").copy()
    for name, value in more.items():
        if name not in names:
            raise argument_error(f"unknown parameter '{name}'; {_nearest(name, names)}the parameters are {', '.join(names)}")
        result[names.index(name)] = float64(value, (), f"parameter {name}")
    return result


def words(value: Any, names: Sequence[str], name: str) -> list[str]:
    """A list of allowed words."""
    if isinstance(value, (str, np.ndarray)) or not isinstance(value, (list, tuple, set, frozenset)):
        raise argument_error(f"{name}: need a list of words out of {', '.join(map(repr, names))}, not {value!r}")
    for word in value:
        choice(word, names, name)
    return list(value)


def flag(value: Any, name: str) -> bool:
    """True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise argument_error(f"{name}: need True or False, not {value!r}")
    return bool(value)


def text_bytes(value: Any, name: str) -> bytes:
    """A text for the library."""
    try:
        result = str(value).encode()
    except UnicodeEncodeError:
        raise argument_error(f"{name}: {value!r} is not a valid text") from None
    if b"\0" in result:
        raise argument_error(f"{name}: a text must not contain a zero")
    return result


def instance(value: Any, kind: type[T], name: str) -> T:
    """The value, which must be an object of this class."""
    if not isinstance(value, kind):
        raise argument_error(f"{name}: need an sdmgen.{kind.__name__}, not {type(value).__name__}")
    return value


def path_bytes(path: Any, name: str = "path") -> bytes:
    """A file name for the library."""
    import os

    try:
        result = os.fsencode(path)
    except (TypeError, UnicodeError):
        result = b"\0"
    if b"\0" in result:
        raise argument_error(f"{name}: need the name of a file, not {path!r}")
    return result
