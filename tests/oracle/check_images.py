"""Reads the test images of write_phantom with widely used libraries and compares voxel values and positions.

usage: check_images.py WRITE_PHANTOM [FOLDER]
Needs numpy; uses those of nibabel, vtk and SimpleITK that are installed. Exit status 77 (skipped) if none of the three is.
"""
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


# The readers return a list of (name, values[x][y][z], 3 x 4 affine map from index to LPS mm or (spacing, origin)).
def read_nibabel(path):
    import nibabel

    image = nibabel.load(path)
    ras_to_lps = np.diag([-1.0, -1.0, 1.0, 1.0])
    header = image.header
    found = []
    for name, affine in (("sform", header.get_sform()), ("qform", header.get_qform()), ("affine", image.affine)):
        found.append((name, np.asarray(image.dataobj), (ras_to_lps @ affine)[:3]))
    assert header.get_xyzt_units()[0] == "mm", header.get_xyzt_units()
    return found


def vtk_values(reader):
    from vtk.util.numpy_support import vtk_to_numpy

    data = reader.GetOutput()
    nx, ny, nz = data.GetDimensions()
    return vtk_to_numpy(data.GetPointData().GetScalars()).reshape(nz, ny, nx).transpose(2, 1, 0), data


def read_vtk_mha(path):
    import vtk

    reader = vtk.vtkMetaImageReader()
    reader.SetFileName(path)
    reader.Update()
    values, data = vtk_values(reader)
    # this reader ignores the direction matrix: compare spacing and origin only
    return [("vtk", values, (np.array(data.GetSpacing()), np.array(data.GetOrigin())))]


def read_vtk_nifti(path):
    import vtk

    reader = vtk.vtkNIFTIImageReader()
    reader.SetFileName(path)
    reader.Update()
    values, data = vtk_values(reader)
    # for qfac = -1 this reader reverses the order of the slices: undo it
    turn = np.eye(4)
    if reader.GetQFac() < 0:
        turn[2, 2], turn[2, 3] = -1, values.shape[2] - 1
        values = values[:, :, ::-1]
    # the matrices apply to index * spacing
    step = np.diag(list(data.GetSpacing()) + [1.0])
    found = []
    for name, matrix in (("vtk sform", reader.GetSFormMatrix()), ("vtk qform", reader.GetQFormMatrix())):
        m = np.array([[matrix.GetElement(r, c) for c in range(4)] for r in range(4)])
        found.append((name, values, (np.diag([-1.0, -1.0, 1.0, 1.0]) @ m @ step @ turn)[:3]))
    return found


def read_sitk(path):
    import SimpleITK

    image = SimpleITK.ReadImage(path)
    n = len(image.GetSize())
    direction = np.array(image.GetDirection()).reshape(n, n)
    affine = np.column_stack([direction @ np.diag(image.GetSpacing()), image.GetOrigin()])
    return [("SimpleITK", SimpleITK.GetArrayFromImage(image).transpose(2, 1, 0), affine)]


def have(module):
    try:
        __import__(module)
        return True
    except ImportError:
        print(f"skipped: no python module {module}")
        return False


def compare(path, name, values, affine, wanted, wanted_affine):
    assert values.shape == wanted.shape, f"{path} {name}: shape {values.shape}, wanted {wanted.shape}"
    assert np.array_equal(values, wanted), f"{path} {name}: values differ"
    if isinstance(affine, tuple):
        spacing = np.linalg.norm(wanted_affine[:, :3], axis=0)
        error = max(np.abs(affine[0] - spacing).max(), np.abs(affine[1] - wanted_affine[:, 3]).max())
    else:
        corners = np.array([[i, j, k, 1] for i in (0, 6) for j in (0, 4) for k in (0, 8)], float).T
        error = np.abs(affine @ corners - wanted_affine @ corners).max()
    limit = 2e-5 if ".nii" in path else 1e-9
    print(f"{os.path.basename(path):18} {name:10} values equal, positions within {error:.1e} mm")
    assert error < limit, f"{path} {name}: a position is off by {error} mm, allowed {limit}"


def main():
    if len(sys.argv) < 2:
        print(__doc__)
        return 2
    readers = []
    if have("nibabel"):
        readers += [(".nii", read_nibabel), (".nii.gz", read_nibabel)]
    if have("vtk"):
        readers += [(".mha", read_vtk_mha), (".nii", read_vtk_nifti), (".nii.gz", read_vtk_nifti)]
    if have("SimpleITK"):
        readers += [(ext, read_sitk) for ext in (".nii", ".nii.gz", ".nrrd", ".mha")]
    with tempfile.TemporaryDirectory() as temporary:
        folder = sys.argv[2] if len(sys.argv) > 2 else temporary
        lines = subprocess.run([sys.argv[1], folder], check=True, capture_output=True, text=True).stdout.splitlines()
        for line in lines:
            words = line.split()
            shape = [int(w) for w in words[1:4]]
            affine = np.array([float(w) for w in words[4:]]).reshape(3, 4)
            i, j, k = np.meshgrid(*[np.arange(n) for n in shape], indexing="ij")
            values = (0.1 * i - 3.0 * j + 100.0 * k).astype(np.float32)
            path = os.path.join(folder, f"phantom{words[0]}")
            assert np.array_equal(np.load(path + ".npy"), values.transpose(2, 1, 0)), "numpy reads other values"
            print(f"{os.path.basename(path)}.npy       numpy      values equal")
            for ext, reader in readers:
                for name, found, found_affine in reader(path + ext):
                    compare(path + ext, name, found, found_affine, values, affine)
    return 0 if readers else EXIT_SKIPPED


if __name__ == "__main__":
    sys.exit(main())
