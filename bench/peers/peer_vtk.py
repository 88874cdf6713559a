#!/usr/bin/python3 -B
"""VTK: vtkImplicitPolyDataDistance on an array of points."""
import json
import sys

import sdmgen_peer
import numpy as np

try:
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkDoubleArray, vtkPoints, vtkVersion
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance
except ImportError as e:
    print(json.dumps({"error": f"VTK's Python modules are missing ({e}): install python3-vtk9"}))
    sys.exit(1)


def prepare(job):
    points = vtkPoints()
    points.SetData(numpy_to_vtk(job.vert, deep=True))  # double, as they are
    cells = vtkCellArray()
    cells.SetData(3, numpy_to_vtkIdTypeArray(job.tri.reshape(-1), deep=True))
    mesh = vtkPolyData()
    mesh.SetPoints(points)
    mesh.SetPolys(cells)
    distance = vtkImplicitPolyDataDistance()
    distance.SetInput(mesh)
    x = numpy_to_vtk(job.points(), deep=True)

    def compute():
        out = vtkDoubleArray()
        distance.FunctionValue(x, out)
        return vtk_to_numpy(out)

    return compute


sdmgen_peer.run(f"VTK {vtkVersion.GetVTKVersion()}",
                "vtkImplicitPolyDataDistance, FunctionValue of an array of points; all surface counted", prepare)
