"""Signed distance maps of parametric shapes: exact, and by networks; fits to images.

Distances are in mm and NEGATIVE INSIDE. Coordinates are LPS (x to the left, y to the back, z to the
head), mm. Arrays are C-contiguous with the axes [z, y, x]. Results have the same bits as those of the
program sdmgen, for any number of threads. docs/python.md is the guide.

    import sdmgen
    model = sdmgen.Model("runs/cochlea/model.sdm")
    sdm = model(a=4.2)                      # sdm.values: float32 [z, y, x]
    sdmgen.write("cochlea.nii.gz", sdm)
"""

from __future__ import annotations

try:
    import numpy as _numpy  # noqa: F401
except ModuleNotFoundError:
    raise ModuleNotFoundError(
        "sdmgen needs NumPy: install python3-numpy (Debian), or numpy with pip", name="numpy"
    ) from None

from ._errors import (
    ArgumentError,
    CancelledError,
    ConfigError,
    Error,
    FileError,
    FormatError,
    InternalError,
    MeshError,
    OutOfMemoryError,
    QualityError,
    RangeError,
    ShapeError,
    UnsupportedError,
)
from ._files import read, write
from ._fit import Finding, FitProgress, FitResult, Tissue, close_labels, fit
from ._grid import Grid, Pose
from ._map import Band, Batch, Check, Image, Map, MapInfo, Segment, surface
from ._mesh import Audit, ExactMap, Mesh, Points, Report, Surface, exact, exact_band, exact_points
from ._model import Accuracy, Field, Jacobian, Model, Quality, Samples, Tangent
from ._phantom import Phantom, phantom, random_pose
from ._shape import Measure, Param, Shape, shapes
from ._train import Progress, TrainResult, train

__version__ = "0.1.0"

__all__ = [
    "Accuracy",
    "ArgumentError",
    "Audit",
    "Band",
    "Batch",
    "CancelledError",
    "Check",
    "ConfigError",
    "Error",
    "ExactMap",
    "Field",
    "FileError",
    "Finding",
    "FitProgress",
    "FitResult",
    "FormatError",
    "Grid",
    "Image",
    "InternalError",
    "Jacobian",
    "Map",
    "MapInfo",
    "Measure",
    "Mesh",
    "MeshError",
    "Model",
    "OutOfMemoryError",
    "Param",
    "Phantom",
    "Points",
    "Pose",
    "Progress",
    "Quality",
    "QualityError",
    "RangeError",
    "Report",
    "Samples",
    "Segment",
    "Shape",
    "ShapeError",
    "Surface",
    "Tangent",
    "Tissue",
    "TrainResult",
    "UnsupportedError",
    "close_labels",
    "exact",
    "exact_band",
    "exact_points",
    "fit",
    "phantom",
    "random_pose",
    "read",
    "shapes",
    "surface",
    "train",
    "write",
]
