"""Compares distances of the exact engine, written by write_exact_points, with those of VTK.

usage: check_vtk.py WRITE_EXACT_POINTS
Only absolute values are compared, because vtkImplicitPolyDataDistance takes its sign from pseudo-normals.
Exit status 77 (skipped) without VTK (Debian: python3-vtk9).
"""
import subprocess
import sys

EXIT_SKIPPED = 77
TOLERANCE = 1e-9  # relative to the largest coordinate; VTK has errors of up to 1e-10 near needles

try:
    import vtk
except ImportError:
    print("skipped: no vtk (Debian: python3-vtk9)")
    sys.exit(EXIT_SKIPPED)


def surface(vertices, triangles):
    points = vtk.vtkPoints()
    points.SetDataTypeToDouble()
    for v in vertices:
        points.InsertNextPoint(v)
    cells = vtk.vtkCellArray()
    for t in triangles:
        cells.InsertNextCell(3)
        for corner in t:
            cells.InsertCellPoint(corner)
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(cells)
    return data


def main():
    lines = iter(subprocess.run([sys.argv[1]], check=True, capture_output=True, text=True).stdout.splitlines())
    compared = wrong = 0
    worst = 0.0
    for header in lines:
        _, n_vert, n_tri, n_point, family = header.split(maxsplit=4)
        vertices = [[float(x) for x in next(lines).split()] for _ in range(int(n_vert))]
        triangles = [[int(i) for i in next(lines).split()] for _ in range(int(n_tri))]
        rows = [[float(x) for x in next(lines).split()] for _ in range(int(n_point))]
        distance = vtk.vtkImplicitPolyDataDistance()
        distance.SetInput(surface(vertices, triangles))
        for *x, ours in rows:
            theirs = distance.EvaluateFunction(x)
            scale = max(abs(c) for c in x + [c for v in vertices for c in v])
            error = abs(abs(ours) - abs(theirs)) / scale
            compared += 1
            worst = max(worst, error)
            if error > TOLERANCE:
                wrong += 1
                print(f"{family} at {x}: {ours!r}, VTK {theirs!r}")
    print(f"{compared} distances, largest difference {worst:.2g} of the largest coordinate")
    assert compared > 1000
    return 1 if wrong else 0


sys.exit(main())
