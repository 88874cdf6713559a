"""Runs a peer program in Python: reads its arguments and the mesh, measures time and memory, writes
the results. For the protocol see peer.h."""
import json
import re
import sys
import time

try:
    import numpy as np
except ImportError:
    print(json.dumps({"error": "NumPy is missing: install python3-numpy"}))
    sys.exit(1)

TIME_LIMIT_S = 3  # no run starts after this


def vtk_mesh(job):
    """The mesh as vtkPolyData, with coordinates in double."""
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    points = vtkPoints()
    points.SetData(numpy_to_vtk(job.vert, deep=True))
    cells = vtkCellArray()
    cells.SetData(3, numpy_to_vtkIdTypeArray(job.tri.reshape(-1), deep=True))
    mesh = vtkPolyData()
    mesh.SetPoints(points)
    mesh.SetPolys(cells)
    return mesh


def read_ply(path):
    """vert[n][3] in double and tri[n][3] of a .ply file of sdmgen (binary, little endian)."""
    with open(path, "rb") as f:
        data = f.read()
    start = data.index(b"end_header\n") + 11
    header = data[:start].decode("ascii")
    n_vert, n_tri = (int(re.search(rf"element {name} (\d+)", header).group(1))
                     for name in ("vertex", "face"))
    vert = np.frombuffer(data, "<f8", 3 * n_vert, start).reshape(-1, 3)
    face = np.dtype([("n", "u1"), ("v", "<i4", 3)])
    return vert, np.frombuffer(data, face, n_tri, start + 24 * n_vert)["v"].astype(np.int64)


class Job:
    def __init__(self, arguments):
        if len(arguments) not in (4, 14):
            raise ValueError("need the arguments MESH NX NY NZ OX OY OZ SX SY SZ SHARE BAND REPEAT "
                             "VALUES.npy, or MESH POINTS.npy REPEAT VALUES.npy")
        self.vert, self.tri = read_ply(arguments[0])
        self.given = None  # [n][3] points; None: the voxels of the grid
        if len(arguments) == 4:
            self.given = np.load(arguments[1])
            self.repeat, self.out = int(arguments[2]), arguments[3]
            return
        self.n = [int(a) for a in arguments[1:4]]
        self.origin = np.array([float(a) for a in arguments[4:7]])
        self.spacing = np.array([float(a) for a in arguments[7:10]])
        self.share, self.band = float(arguments[10]), float(arguments[11])
        self.repeat, self.out = int(arguments[12]), arguments[13]
        multiple = np.arange(self.n[1] * self.n[2]) * 0.6180339887498949
        self.rows = np.flatnonzero(multiple - np.floor(multiple) < self.share)

    def points(self):
        """The given points [n][3], or the voxel centres of the rows to compute, [rows * nx][3]."""
        if self.given is not None:
            return self.given
        x = np.empty((len(self.rows), self.n[0], 3))
        x[..., 0] = self.origin[0] + self.spacing[0] * np.arange(self.n[0])
        x[..., 1] = (self.origin[1] + self.spacing[1] * (self.rows % self.n[1]))[:, None]
        x[..., 2] = (self.origin[2] + self.spacing[2] * (self.rows // self.n[1]))[:, None]
        return x.reshape(-1, 3)


def status_kb(name):
    """The number in the line "NAME:  123 kB" of /proc/self/status."""
    with open("/proc/self/status", encoding="ascii") as f:
        return int(re.search(rf"{name}:\s*(\d+)", f.read()).group(1))


def start_peak():
    """Resets the peak of the resident memory (Linux); returns the current one, kB; -1: unknown."""
    try:
        with open("/proc/self/clear_refs", "w", encoding="ascii") as f:
            f.write("5")
        return status_kb("VmRSS")
    except (OSError, AttributeError):
        return -1


def save(job, values, whole):
    """Writes the values; returns the share of the voxels that were computed."""
    if job.given is not None:
        np.save(job.out, np.asarray(values, np.float32).reshape(-1))
        return 1
    out = np.full((job.n[1] * job.n[2], job.n[0]), np.nan, np.float32)
    rows = slice(None) if whole else job.rows
    out[rows] = np.asarray(values).reshape(-1, job.n[0])
    np.save(job.out, out.reshape(job.n[2], job.n[1], job.n[0]))
    return 1 if whole else len(job.rows) / (job.n[1] * job.n[2])


def run(version, note, prepare, whole=False, band=False):
    """Measures prepare(job) and the function that it returns, and prints the result. That function
    returns the values at job.points() or, with `whole`, of all voxels [nz][ny][nx]. band: the peer
    does less work for a narrow band."""
    try:
        job = Job(sys.argv[1:])
        if whole and job.given is not None:
            raise ValueError("no distances at single points")
        best, before, peak, begin = None, start_peak(), -1, time.monotonic()
        for i in range(max(1, job.repeat)):
            start = time.process_time()
            compute = prepare(job)
            ready = time.process_time()
            values = compute()
            times = (ready - start, time.process_time() - ready)
            best = times if best is None else min(best, times, key=sum)
            if i == 0 and before >= 0:
                peak = max(0, status_kb("VmHWM") - before)
            if time.monotonic() - begin > TIME_LIMIT_S:
                break
        share = save(job, values, whole)
        print(json.dumps({"prepare_ms": 1e3 * best[0], "map_ms": 1e3 * best[1], "share": share,
                          "peak_kb": peak, "band": band, "version": version, "note": note}))
    except Exception as e:  # an exception of a library is a result: its message
        print(json.dumps({"error": f"{type(e).__name__}: {e}"}))
        sys.exit(1)
