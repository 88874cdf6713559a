#!/usr/bin/python3 -B
"""VTK: vtkImplicitPolyDataDistance at an array of points."""
import json
import sys

import sdmgen_peer
import numpy as np

try:
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkDoubleArray, vtkVersion
    from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance
except ImportError as e:
    print(json.dumps({"error": f"VTK's Python modules are missing ({e}): install python3-vtk9"}))
    sys.exit(1)


def prepare(job):
    mesh = sdmgen_peer.vtk_mesh(job)
    distance = vtkImplicitPolyDataDistance()
    distance.SetInput(mesh)
    x = numpy_to_vtk(job.points(), deep=True)

    def compute():
        out = vtkDoubleArray()
        distance.FunctionValue(x, out)
        return vtk_to_numpy(out)

    return compute


sdmgen_peer.run(f"VTK {vtkVersion.GetVTKVersion()}",
                "vtkImplicitPolyDataDistance, FunctionValue of an array of points; measures to all "
                "triangles", prepare)
