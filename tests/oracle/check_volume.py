"""Writes images with widely used libraries and compares the voxel values and positions that read_volume reads from them.

usage: check_volume.py READ_VOLUME [FOLDER]
Needs numpy; uses those of nibabel (NIfTI-1 and -2) and vtk (MetaImage, NIfTI) that are installed. Exit status 77 (skipped) if neither is.
"""
import itertools
import os
import subprocess
import sys
import tempfile

EXIT_SKIPPED = 77

try:
    import numpy as np
except ImportError:
    print("skipped: no numpy (Debian: python3-numpy)")
    sys.exit(EXIT_SKIPPED)

SHAPE = (7, 5, 9)
LIMIT = 1e-5  # mm: NIfTI-1 headers are float32
RAS_TO_LPS = np.diag([-1.0, -1.0, 1.0])
TYPES = ["uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float32", "float64"]


def phantom(kind):
    """Test values: all voxels differ where the range of the type allows it."""
    i, j, k = np.meshgrid(*[np.arange(n) for n in SHAPE], indexing="ij")
    if kind in ("uint8", "int8"):
        return (i + 3 * j + 11 * k - (40 if kind == "int8" else 0)).astype(kind)
    values = i + 10 * j + 100 * k
    if kind.startswith("float"):
        return (0.37 * values - 50).astype(kind)
    return (30 * values - (0 if kind.startswith("u") else 9000)).astype(kind)


def rotation(a, b, c):
    x, y, z = [np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]]) for t in (a, b, c)]
    rz, ry, rx = np.eye(3), np.eye(3), np.eye(3)
    rz[:2, :2], ry[np.ix_([2, 0], [2, 0])], rx[1:, 1:] = x, y, z
    return rz @ ry @ rx


def frames():
    """Direction matrices: all signed permutations of the axes, and oblique rotations with and without a reflection."""
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            m = np.zeros((3, 3))
            for axis, (row, sign) in enumerate(zip(order, signs)):
                m[row, axis] = sign
            yield m
    for angles in ((0.5, 1.1, -0.3), (-2.0, 0.1, 3.0), (1e-3, -1e-3, 2e-3)):
        yield rotation(*angles)
        yield rotation(*angles) @ np.diag([1, 1, -1])


class Checks:
    """Collects written images and compares them with the output of `program` (read_volume)."""

    def __init__(self, program, folder):
        self.program, self.folder, self.todo = program, folder, []

    def path(self, ending):
        return os.path.join(self.folder, f"v{len(self.todo)}{ending}")

    def add(self, path, values, affine, kind):
        self.todo.append((path, values, affine, kind))

    def run(self):
        corners = np.array([[i, j, k, 1] for i in (0, 6) for j in (0, 4) for k in (0, 8)], float).T
        largest = 0
        for first in range(0, len(self.todo), 50):
            part = self.todo[first : first + 50]
            text = subprocess.run([self.program] + [t[0] for t in part], check=True, capture_output=True, text=True).stdout
            lines = text.splitlines()
            assert len(lines) == 2 * len(part)
            for (path, values, affine, kind), head, numbers in zip(part, lines[::2], lines[1::2]):
                words = head.split()
                assert tuple(int(w) for w in words[:3]) == values.shape, f"{path}: sizes {words[:3]}"
                assert words[15] == kind, f"{path}: type {words[15]}, wanted {kind}"
                found = np.array([float(w) for w in words[3:15]]).reshape(3, 4)
                error = np.abs(found @ corners - affine @ corners).max()
                assert error < LIMIT, f"{path}: a position is off by {error} mm, allowed {LIMIT}"
                got = np.array([float(w) for w in numbers.split()]).astype(np.float32).reshape(values.shape, order="F")
                assert np.array_equal(got, values.astype(np.float32)), f"{path}: values differ"
                largest = max(largest, error)
        print(f"{len(self.todo)} images: values equal, positions within {largest:.1e} mm")
        return len(self.todo)


def add_nibabel(checks):
    import nibabel

    classes = [nibabel.Nifti1Image, nibabel.Nifti2Image]

    def save(image, ending, kind):
        path = checks.path(ending)
        nibabel.save(image, path)
        back = nibabel.load(path)
        affine = (RAS_TO_LPS @ back.affine[:3]).astype(float)
        checks.add(path, back.get_fdata(), affine, kind)

    def make(cls, values, affine, order="<", sform=1, qform=1):
        image = cls(values, None, cls.header_class(endianness=order))
        image.set_data_dtype(values.dtype)
        image.set_qform(affine, qform)
        image.set_sform(affine, sform)
        return image

    spacing = np.diag([0.2, 0.35, 1.25])
    offset = [[-12.25], [31.5], [7.125]]
    affines = [np.vstack([np.hstack([m @ spacing, offset]), [0, 0, 0, 1]]) for m in frames()]
    for cls, kind, order in itertools.product(classes, TYPES, "<>"):
        for ending in (".nii", ".nii.gz"):
            save(make(cls, phantom(kind), affines[-2], order), ending, kind)
    for affine in affines:
        for codes in ((1, 1), (0, 1), (2, 0)):  # both transforms, qform only, sform only
            save(make(classes[0], phantom("int16"), affine, sform=codes[0], qform=codes[1]), ".nii", "int16")
        save(make(classes[1], phantom("int16"), affine, sform=0), ".nii", "int16")
    # sform and qform that differ
    image = make(classes[0], phantom("int16"), affines[-1])
    image.set_sform(affines[-3], 2)
    save(image, ".nii", "int16")
    # real values stored as integers: nibabel chooses slope and intercept
    for kind in ("uint8", "int16", "int32"):
        image = make(classes[0], phantom("float64"), affines[-2])
        image.set_data_dtype(kind)
        save(image, ".nii.gz", kind)
    # extra dimensions of length 1; then a header extension before the voxels
    image = make(classes[0], phantom("int16")[..., None, None], affines[-2])
    path = checks.path(".nii")
    nibabel.save(image, path)
    checks.add(path, phantom("int16"), RAS_TO_LPS @ affines[-2][:3], "int16")
    image = make(classes[0], phantom("int16"), affines[-2])
    image.header.extensions.append(nibabel.nifti1.Nifti1Extension("comment", b"a comment of some length"))
    save(image, ".nii.gz", "int16")


def add_vtk(checks):
    from vtkmodules.util.numpy_support import get_vtk_array_type, numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkIOImage import vtkMetaImageWriter, vtkNIFTIImageWriter

    spacing, origin = np.array([0.2, 0.35, 1.25]), np.array([-12.25, 31.5, 7.125])
    plain = np.column_stack([np.diag(spacing), origin])
    for kind in [t for t in TYPES if not t.endswith("int64")]:  # VTK names 64-bit integers differently from MetaImage
        image = vtkImageData()
        image.SetDimensions(*SHAPE)
        image.SetSpacing(*spacing)
        image.SetOrigin(*origin)
        flat = phantom(kind).ravel(order="F")
        image.GetPointData().SetScalars(numpy_to_vtk(flat, deep=1, array_type=get_vtk_array_type(flat.dtype)))
        for ending, zipped in ((".mha", True), (".mha", False), (".mhd", True), (".mhd", False)):
            path = checks.path(ending)
            writer = vtkMetaImageWriter()
            writer.SetFileName(path)
            writer.SetCompression(zipped)
            writer.SetInputData(image)
            writer.Write()
            checks.add(path, phantom(kind), plain, kind)
        path = checks.path(".nii.gz")
        writer = vtkNIFTIImageWriter()
        writer.SetFileName(path)
        writer.SetInputData(image)
        writer.Write()
        # VTK writes its coordinates as NIfTI's RAS coordinates without conversion
        checks.add(path, phantom(kind), RAS_TO_LPS @ plain, kind)


def main():
    if len(sys.argv) < 2:
        print(__doc__)
        return 2
    with tempfile.TemporaryDirectory() as temporary:
        checks = Checks(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else temporary)
        for module, add in (("nibabel", add_nibabel), ("vtkmodules", add_vtk)):
            try:
                __import__(module)
            except ImportError:
                print(f"skipped: no python module {module}")
                continue
            add(checks)
        return 0 if checks.run() else EXIT_SKIPPED


if __name__ == "__main__":
    sys.exit(main())
