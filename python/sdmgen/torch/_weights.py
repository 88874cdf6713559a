"""Reads the weights of a model file (docs/formats.md) as NumPy arrays."""

from __future__ import annotations

import os
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._model import Model

Array = NDArray[Any]
_PANEL = 16


class File:
    """The sections of a model file, or of its bytes, and the values of its description."""

    def __init__(self, path: Any) -> None:
        # the library checks the file: all checksums, sizes and values
        if isinstance(path, (bytes, memoryview)):
            self._bytes = bytes(path)
        else:
            with open(os.fspath(path), "rb") as file:
                self._bytes = file.read()
        self.model = Model(self._bytes)
        self.sections: dict[str, memoryview] = {}
        for i in range(struct.unpack_from("<I", self._bytes, 12)[0]):
            name, at, size = struct.unpack_from("<24sQQ", self._bytes, 24 + 48 * i)
            self.sections[name.rstrip(b"\0").decode()] = memoryview(self._bytes)[at : at + size]
        self._lines: dict[str, list[str]] = {}
        for line in bytes(self.sections["meta"]).decode().splitlines():
            key, _, value = line.partition("=")
            self._lines.setdefault(key, []).append(value)

    def text(self, key: str) -> list[str]:
        """all values of a key"""
        return self._lines[key]

    def int(self, key: str) -> int:
        """the whole number of a key"""
        return int(self._lines[key][0])

    def reals(self, key: str) -> list[float]:
        """the numbers of a key"""
        return [float(word) for word in self._lines[key][0].replace(",", " ").split()]

    def array(self, section: str, dtype: str) -> Array:
        """a section as an array"""
        return np.frombuffer(self.sections[section], dtype)


class Panels:
    """Matrices in panels of 16 outputs, one after another in a section."""

    def __init__(self, section: memoryview, dtype: str) -> None:
        self._bytes, self._dtype = section, dtype

    def matrix(self, at: int, outputs: int, inputs: int, wide: int = 0) -> tuple[Array, int]:
        """The matrix [outputs, inputs] at an offset in bytes, and the offset of its end. Of integers
        the first `wide` columns have two bytes."""
        panels = -(-outputs // _PANEL)
        if self._dtype != "i1":
            item = np.dtype(self._dtype).itemsize
            flat = np.frombuffer(self._bytes, self._dtype, panels * inputs * _PANEL, at)
            matrix = flat.reshape(panels, inputs, _PANEL).transpose(0, 2, 1).reshape(-1, inputs)
            return matrix[:outputs], at + flat.size * item
        wide, even = wide + wide % 2, inputs + inputs % 2
        rows = np.frombuffer(self._bytes, "i1", panels * _PANEL * (even + wide), at).reshape(panels, -1)
        first = rows[:, : 2 * wide * _PANEL].copy().view("<i2").reshape(panels, wide // 2, _PANEL, 2)
        last = rows[:, 2 * wide * _PANEL :].reshape(panels, (even - wide) // 2, _PANEL, 2)
        both = np.concatenate([first, last.astype(np.int16)], axis=1)
        matrix = both.transpose(0, 2, 1, 3).reshape(panels * _PANEL, even)
        return matrix[:outputs, :inputs], at + rows.size
