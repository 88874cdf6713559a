#!/usr/bin/python3 -B
"""SciPy: Euclidean distance transforms of the voxels inside and of those outside; VTK's stencil
makes the mask of the voxels inside."""
import json
import sys

import sdmgen_peer
import numpy as np

try:
    import scipy
    from scipy.ndimage import distance_transform_edt
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkVersion
    from vtkmodules.vtkImagingStencil import vtkImageStencilToImage, vtkPolyDataToImageStencil
except ImportError as e:
    print(json.dumps({"error": f"SciPy or VTK's Python modules are missing ({e}): "
                               "install python3-scipy python3-vtk9"}))
    sys.exit(1)


def prepare(job):
    mesh = sdmgen_peer.vtk_mesh(job)
    stencil = vtkPolyDataToImageStencil()
    stencil.SetInputData(mesh)
    stencil.SetOutputOrigin(job.origin)
    stencil.SetOutputSpacing(job.spacing)
    stencil.SetOutputWholeExtent(0, job.n[0] - 1, 0, job.n[1] - 1, 0, job.n[2] - 1)
    image = vtkImageStencilToImage()
    image.SetInputConnection(stencil.GetOutputPort())
    image.SetOutputScalarTypeToUnsignedChar()
    image.SetInsideValue(1)
    image.SetOutsideValue(0)
    image.Update()
    values = vtk_to_numpy(image.GetOutput().GetPointData().GetScalars())
    mask = values.reshape(job.n[::-1]).astype(bool)

    def compute():
        spacing = job.spacing[::-1]
        # the surface lies between voxels inside and outside, about half an edge from both
        half = 0.5 * job.spacing.min()
        outside = distance_transform_edt(~mask, sampling=spacing)
        inside = distance_transform_edt(mask, sampling=spacing)
        return np.where(mask, half - inside, outside - half)

    return compute


sdmgen_peer.run(f"SciPy {scipy.__version__}, VTK {vtkVersion.GetVTKVersion()}",
                "vtkPolyDataToImageStencil makes the mask (prepare), distance_transform_edt the "
                "map: approximate", prepare, whole=True)
