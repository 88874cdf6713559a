# check_polydata.py SDMGEN: meshes that VTK writes in every kind of .vtk and .vtp file are read as VTK reads them, VTK reads what sdmgen
# writes, and files that are cut off or changed are refused in one line, or read.
# Tests: vtk.c vtk_types.c vtp.c vtp_data.c vtp_tags.c polydata.c inflate.c
import os
import random
import sys

try:
    import numpy as np
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy
except ImportError as missing:
    print("skipped:", missing)
    sys.exit(77)

from sdm_program import sdmgen



def surface(strips, kind):
    """A sphere with quadrilaterals or strips, and with things that have to be ignored."""
    sphere = vtk.vtkSphereSource()
    sphere.SetThetaResolution(40)
    sphere.SetPhiResolution(30)
    sphere.SetRadius(11.3)
    sphere.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION if kind == "double" else vtk.vtkAlgorithm.SINGLE_PRECISION)
    sphere.SetLatLongTessellation(not strips)
    last = sphere
    if strips:
        last = vtk.vtkStripper()
        last.SetInputConnection(sphere.GetOutputPort())
    last.Update()
    data = vtk.vtkPolyData()
    data.DeepCopy(last.GetOutput())
    lines = vtk.vtkCellArray()
    lines.InsertNextCell(2, [0, 1])
    data.SetLines(lines)
    colour = numpy_to_vtk(np.arange(data.GetNumberOfPoints()) / 7.0, deep=True)
    colour.SetName("a name & more")
    data.GetPointData().AddArray(colour)
    note = numpy_to_vtk(np.arange(5, dtype=np.int16), deep=True)
    note.SetName("note")
    data.GetFieldData().AddArray(note)
    return data


def write_legacy(data, name, binary, version):
    writer = vtk.vtkPolyDataWriter()
    writer.SetFileVersion(version)
    (writer.SetFileTypeToBinary if binary else writer.SetFileTypeToASCII)()
    writer.SetInputData(data)
    writer.SetFileName(name)
    assert writer.Write() == 1


def write_xml(data, name, mode, compress, encode, header, ids, big):
    writer = vtk.vtkXMLPolyDataWriter()
    {"ascii": writer.SetDataModeToAscii, "inline": writer.SetDataModeToBinary, "appended": writer.SetDataModeToAppended}[mode]()
    (writer.SetCompressorTypeToZLib if compress else writer.SetCompressorTypeToNone)()
    writer.SetBlockSize(4096)
    writer.SetEncodeAppendedData(encode)
    writer.SetHeaderType(header)
    writer.SetIdType(ids)
    (writer.SetByteOrderToBigEndian if big else writer.SetByteOrderToLittleEndian)()
    writer.SetInputData(data)
    writer.SetFileName(name)
    assert writer.Write() == 1


def triangles(data):
    """Every triangle as nine numbers, in an order that does not depend on its first corner; lines and vertices are left out."""
    only = vtk.vtkPolyData()
    only.SetPoints(data.GetPoints())
    only.SetPolys(data.GetPolys())
    only.SetStrips(data.GetStrips())
    points = vtk_to_numpy(data.GetPoints().GetData()).astype(float)
    out = []
    ids = vtk.vtkIdList()
    for c in range(only.GetNumberOfCells()):
        only.GetCellPoints(c, ids)
        corner = [ids.GetId(k) for k in range(ids.GetNumberOfIds())]
        if only.GetCellType(c) == vtk.VTK_TRIANGLE_STRIP:
            out += [[corner[k], corner[k + 1 + k % 2], corner[k + 2 - k % 2]] for k in range(len(corner) - 2)]
        else:
            out += [[corner[0], corner[k], corner[k + 1]] for k in range(1, len(corner) - 1)]
    return points, np.array(out)


def read(name):
    reader = vtk.vtkXMLPolyDataReader() if name.endswith(".vtp") else vtk.vtkPolyDataReader()
    reader.SetFileName(name)
    reader.Update()
    return reader.GetOutput()


def compare(name, data, target, exact=True):
    points, tri = triangles(data)
    done = sdmgen("mesh", "--mesh", name, "-o", target)
    assert done.returncode == 0, (name, done.stderr)
    got_points, got_tri = triangles(read(target))
    assert (got_tri == tri).all(), name
    error = np.abs(got_points - points).max()
    assert error == 0 if exact else error < 1e-4, (name, error)


written = []
for strips, kind in ((False, "double"), (True, "float")):
    data = surface(strips, kind)
    for binary in (False, True):
        for version in (42, 51):
            name = f"l{strips:d}{binary:d}{version}.vtk"
            write_legacy(data, name, binary, version)
            compare(name, data, "back.vtp" if version == 42 else "back.vtk", exact=binary)
            written.append(name)
    for mode, compress, encode in (
        ("ascii", False, False), ("inline", False, False), ("inline", True, False),
        ("appended", False, False), ("appended", False, True), ("appended", True, False), ("appended", True, True),
    ):
        for header, ids, big in ((32, 32, False), (64, 64, False), (32, 64, True)):
            name = f"x{strips:d}{len(written)}.vtp"
            write_xml(data, name, mode, compress, encode, header, ids, big)
            compare(name, data, "back.vtk" if big else "back.vtp", exact=mode != "ascii")
            written.append(name)

# other commands take them, too
assert "triangles" in sdmgen("info", written[0]).stdout
assert sdmgen("exact", "--mesh", written[0], "--size", "8,8,8", "-o", "map.npy", "--quiet").returncode == 0
assert sdmgen("exact", "--mesh", written[0], "--size", "8,8,8", "-o", "zero.vtp", "--quiet").returncode == 0
assert read("zero.vtp").GetNumberOfPolys() > 10

# a polydata without polygons, a grid, and another compressor: refused
grid = vtk.vtkRTAnalyticSource()
writer = vtk.vtkStructuredPointsWriter()
writer.SetInputConnection(grid.GetOutputPort())
writer.SetFileName("grid.vtk")
writer.Write()
done = sdmgen("info", "grid.vtk")
assert done.returncode == 3 and "POLYDATA" in done.stderr, done
lz4 = vtk.vtkXMLPolyDataWriter()
lz4.SetCompressorTypeToLZ4()
lz4.SetInputData(data)
lz4.SetFileName("lz4.vtp")
lz4.Write()
done = sdmgen("info", "lz4.vtp")
assert done.returncode == 3 and "compressor is not" in done.stderr, done

# cut off, or with changed bytes: an end in one line
chance = random.Random(1)
small = vtk.vtkSphereSource()
small.SetThetaResolution(5)
small.SetPhiResolution(4)
small.Update()
refused = 0
names = []
for binary in (False, True):
    for version in (42, 51):
        names.append(f"s{binary:d}{version}.vtk")
        write_legacy(small.GetOutput(), names[-1], binary, version)
for mode, compress, encode in (("ascii", 0, 0), ("inline", 0, 0), ("inline", 1, 0), ("appended", 1, 0), ("appended", 1, 1), ("appended", 0, 0)):
    names.append(f"s{mode}{compress}{encode}.vtp")
    write_xml(small.GetOutput(), names[-1], mode, compress, encode, 32, 32, False)
for name in names:
    with open(name, "rb") as file:
        whole = file.read()
    for trial in range(6):
        broken = bytearray(whole)
        if trial < 3:
            # data of points follow the mesh in .vtk files
            broken = broken[: chance.randrange(len(broken) * (1 if name.endswith("k") else 3) // 4)]
        else:
            for _ in range(trial - 2):
                broken[chance.randrange(len(broken))] = chance.randrange(256)
        with open("broken" + name[-4:], "wb") as file:
            file.write(broken)
        done = sdmgen("mesh", "--mesh", "broken" + name[-4:], "-o", "never.ply")
        assert done.returncode in (0, 3), (name, trial, done)
        if trial < 3:
            assert done.returncode == 3, (name, trial)
        if done.returncode:
            refused += 1
            assert done.stderr.count("\n") == 1 and "broken" in done.stderr, done.stderr
            assert not os.path.exists("never.ply")
        else:
            os.remove("never.ply")
assert refused > 30
print(len(written), "files of VTK read,", refused, "damaged ones refused")
