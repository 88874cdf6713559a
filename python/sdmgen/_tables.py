"""Text tables of points (.csv), read as the program reads them."""

from __future__ import annotations

import math
import os
from typing import Any, Sequence

import numpy as np

from ._arrays import Float64, path_bytes
from ._errors import FileError, FormatError

#: the end of messages about lines with other separators: 0,5;1;2 for 0.5,1,2
_SEPARATORS = "; commas separate the values, and a decimal number has a point: 0.5,1,2"


def _number(cell: str) -> float:
    """The finite number of a cell; NaN: it is none."""
    try:
        value = float(cell) if "_" not in cell else math.nan
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def _places(where: str, names: Sequence[str]) -> list[int]:
    """The columns x, y and z among the names of a header, which may hold others."""
    low = [name.lower() for name in names]
    if any(low.count(axis) != 1 for axis in "xyz"):
        told = ",".join(name[:30] for name in names[:3]) + (",..." if len(names) > 3 else "")
        raise FormatError(
            "format",
            f"{where}: the header ({told}) must name one column each x, y and z, in mm; "
            f"without a header a line is x,y,z{_SEPARATORS if ';' in names[0] else ''}",
        )
    return [low.index(axis) for axis in "xyz"]


def _point(where: str, cells: Sequence[str], places: Sequence[int], n: int) -> list[float]:
    """The coordinates of a line of a table of n columns."""
    point = [_number(cells[place]) if place < len(cells) else 0.0 for place in places]
    for value, place in zip(point, places):
        if math.isnan(value):
            line = "x,y,z" if n == 3 else "as the header says"
            end = _SEPARATORS if ";" in cells[place] else ""
            raise FormatError("format", f"{where}: {cells[place][:100]!r} is not a finite number; a line is {line}{end}")
    if len(cells) != n:
        need = "a line needs three: x,y,z (mm)" if n == 3 else f"the header names {n} columns"
        end = _SEPARATORS if n == 3 and len(cells) == 6 else ""
        raise FormatError("format", f"{where}: {len(cells)} values, {need}{end}")
    return point


def read_points_table(path: Any) -> Float64:
    """Points [n, 3], mm, of a .csv file of lines x,y,z. A header may name the columns and hold others;
    lines that begin with # do not count."""
    name = os.fsdecode(path_bytes(path))
    try:
        with open(name, encoding="utf-8-sig", errors="replace") as file:
            lines = file.read().split("\n")
    except OSError as reason:
        raise FileError("io", f"{name}: cannot open: {reason.strerror}") from None
    points: list[list[float]] = []
    places, n, first = [0, 1, 2], 3, True
    for number, line in enumerate(lines, 1):
        cells = [cell.strip(" \t\r") for cell in line.split(",")]
        if cells == [""] or cells[0].startswith("#"):
            continue
        where = f"{name}:{number}"
        if first and all(math.isnan(_number(cell)) for cell in cells):
            places, n = _places(where, cells), len(cells)
        else:
            points.append(_point(where, cells, places, n))
        first = False
    if not points:
        raise FormatError("format", f"{name}: no points")
    return np.array(points)
