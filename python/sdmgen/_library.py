"""The shared libraries: where they are, and calls of their functions."""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import signal
import threading
from pathlib import Path
from typing import Any, Callable, Optional, Sequence

from . import _abi
from ._errors import UnsupportedError, error_of

#: name of the file with the functions of each header that is not in libsdmgen
_FILES = {
    "sdm_image_": "sdmgen_image",
    "sdm_volume_": "sdmgen_image",
    "sdm_voxel_": "sdmgen_image",
    "sdm_picture_": "sdmgen_picture",
    "sdm_vdb_": "sdmgen_vdb",
    "sdm_training_": "sdmgen_training",
}
_VERSION = ".".join(str(_abi.constants[f"SDM_VERSION_{part}"]) for part in ("MAJOR", "MINOR"))

_libraries: dict[str, ctypes.CDLL] = {}
_functions: dict[str, Any] = {}
_lock = threading.RLock()
_local = threading.local()


def _candidates(name: str) -> list[str]:
    """The paths to try: beside this file, the folder of SDMGEN_LIBRARY, the folder lib with python3/dist-packages of an
    installation, and the system's path."""
    file = f"lib{name}.so.{_VERSION}"
    paths = [str(Path(__file__).resolve().parent / "lib" / file)]
    given = os.environ.get("SDMGEN_LIBRARY")
    if given:
        folder = Path(given) if os.path.isdir(given) else Path(given).parent
        paths.append(given if name == "sdmgen" and not os.path.isdir(given) else str(folder / file))
    above = Path(__file__).resolve().parents
    if len(above) > 4 and above[2].name == "python3":
        paths += [str(above[4] / folder / file) for folder in ("lib", "lib64")]
    return [path for path in paths if os.path.exists(path)] + [file]


def _open(name: str) -> ctypes.CDLL:
    if name != "sdmgen":
        _load("sdmgen")
    path = _candidates(name)[0]
    try:
        return ctypes.CDLL(path)
    except OSError as reason:
        text = f"lib{name}.so.{_VERSION} cannot be loaded: {reason}; set SDMGEN_LIBRARY to the path of libsdmgen.so"
        if name == "sdmgen":
            raise ImportError(text) from None
        raise UnsupportedError("unsupported", text) from None


def _load(name: str) -> ctypes.CDLL:
    with _lock:
        if name not in _libraries:
            _libraries[name] = _open(name)
        return _libraries[name]


def function(name: str) -> Any:
    """The C function of this name, with the types of its declaration."""
    found = _functions.get(name)
    if found is None:
        file = next((file for start, file in _FILES.items() if name.startswith(start)), "sdmgen")
        found = getattr(_load(file), name)
        found.restype, found.argtypes = _abi.functions[name]
        _functions[name] = found
    return found


def make(struct: str, /, **members: Any) -> Any:
    """A new structure, zero but for the given members."""
    return _abi.structs[struct](**members)


def array(struct: str, items: Sequence[Any]) -> Any:
    """An array of structures, from structures or tuples of their members."""
    made: Any = _abi.structs[struct] * len(items)
    return made(*items)


def _error_here() -> Any:
    error = getattr(_local, "error", None)
    if error is None:
        error = _local.error = make("sdm_error")
    return error


def check(code: int, error: Any) -> None:
    """Raises the exception of a status other than SDM_OK."""
    if code:
        text = bytes(error.text).decode("utf-8", "replace") if error.status == code else ""
        raise error_of(code, text or f"status {code}")


def call(name: str, *arguments: Any) -> None:
    """Calls a function that returns a status and takes an error last; raises what it reports."""
    # a callback may call the library in the same thread: the error belongs to one call at a time
    error = _error_here()
    _local.error = None
    try:
        error.status = 0
        check(function(name)(*arguments, ctypes.byref(error)), error)
    finally:
        _local.error = error


class Handle:
    """An object of the C library, freed with its function when it is no longer used; the objects that
    it needs are kept until then."""

    def __init__(self, free: str, *needs: Any) -> None:
        self.pointer = ctypes.c_void_p()
        self._free = function(free)
        self._needs = needs

    def out(self) -> Any:
        """The place where a function stores the new object."""
        return ctypes.byref(self.pointer)

    @property
    def _as_parameter_(self) -> ctypes.c_void_p:
        return self.pointer

    def __del__(self) -> None:
        if self.pointer.value:
            self._free(self.pointer)
            self.pointer.value = None


class _Place:
    """What threading.local() is for one thread, for all of them."""


class Callbacks:
    """C callbacks from Python functions. An exception in one of them stops the call of the library
    and is raised again after it. One call at a time; per_thread: one in each thread, for callbacks
    that the library calls in the thread of the call."""

    def __init__(self, per_thread: bool = False) -> None:
        self._place: Any = threading.local() if per_thread else _Place()
        self._kept: list[Any] = []

    @property
    def raised(self) -> Optional[BaseException]:
        """the exception of a callback"""
        return getattr(self._place, "raised", None)

    @raised.setter
    def raised(self, value: Optional[BaseException]) -> None:
        self._place.raised = value

    def wrap(self, struct: str, member: str, python: Callable[..., Any], on_error: Any) -> Any:
        """The C function pointer for a member of a structure."""
        kind = dict(getattr(_abi.structs[struct], "_fields_"))[member]

        def safe(*arguments: Any) -> Any:
            if self.raised is not None:
                return on_error
            try:
                return python(*arguments)
            except BaseException as raised:  # it passes through C and is raised by call()
                self.raised = raised
                return on_error

        pointer = kind(safe)
        self._kept.append(pointer)
        return pointer

    def stopped(self, _user: Any = None) -> bool:
        """For `cancelled` callbacks: lets Python handle signals such as Ctrl-C."""
        return self.raised is not None

    def _note(self, handler: Callable[..., Any]) -> Callable[..., None]:
        """A handler of signals that keeps the exception of another one for the end of the call: one
        that is raised at the first instruction of a callback would be lost."""

        def note(*arguments: Any) -> None:
            try:
                handler(*arguments)
            except BaseException as raised:
                self.raised = raised

        return note

    def call(self, name: str, *arguments: Any) -> None:
        """Calls a function that these callbacks belong to."""
        main = threading.current_thread() is threading.main_thread()
        handler = signal.getsignal(signal.SIGINT) if main else None
        if callable(handler):
            signal.signal(signal.SIGINT, self._note(handler))
        try:
            call(name, *arguments)
        except Exception:
            if self.raised is None:
                raise
        finally:
            if callable(handler):
                signal.signal(signal.SIGINT, handler)
        raised, self.raised = self.raised, None
        if raised is not None:
            raise raised
