# check_ssm.py SDMGEN: shape models that h5py writes (versions 0.8, 0.9, 1.0, a catalog, the JSON form) and folders of meshes give the
# shapes that numpy computes; models that are broken are refused in one line.
# Tests: cmd_import.c report_ssm.c ssm_child.c ssm_statismo.c ssm_meshes.c tree_hdf5.c tree_json.c ssm_file.c json_read.c align.c components.c statistical.c
import json
import os
import shutil
import sys

try:
    import h5py
    import numpy as np
except ImportError as missing:
    print("skipped:", missing)
    sys.exit(77)

from sdm_program import done, refused, sdmgen

chance = np.random.default_rng(1)


def sphere(n=12):
    """Vertices and triangles of a closed surface."""
    u, v = np.meshgrid(np.arange(1, n) / n * np.pi, np.arange(2 * n) / n * np.pi, indexing="ij")
    vert = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], axis=-1).reshape(-1, 3) * 10
    vert = np.concatenate([vert, [[0, 0, 10], [0, 0, -10]]])
    tri, m = [], 2 * n
    for k in range(m):
        next_k = (k + 1) % m
        tri.append([(n - 1) * m, k, next_k])
        tri.append([(n - 1) * m + 1, (n - 2) * m + next_k, (n - 2) * m + k])
        for i in range(n - 2):
            a, b, c, d = i * m + k, i * m + next_k, (i + 1) * m + k, (i + 1) * m + next_k
            tri += [[a, c, b], [b, c, d]]
    return vert, np.array(tri)


vert, tri = sphere()
mean = (vert + [1.5, -2.25, 30]).astype(np.float32)
n, r = len(vert), 5
basis = np.linalg.qr(chance.normal(size=(3 * n, r)))[0].astype(np.float32)
variance = np.array([40.0, 22.5, 9.0, 2.0, 0.5], dtype=np.float32)


def write(name, version=(0, 9), root="", scaled=False, change=None, cells=True, compress=None, mode="w"):
    with h5py.File(name, mode) as f:
        data = {
            "/model/mean": mean.reshape(-1),
            "/model/pcaBasis": basis * np.sqrt(variance) if scaled else basis,
            "/model/pcaVariance": variance,
            "/model/noiseVariance": np.array([0.25], dtype=np.float32),
            "/representer/points": mean.T,
            "/representer/cells": tri.T.astype(np.int32),
        }
        if not cells:
            del data["/representer/cells"]
        data.update(change or {})
        for key, value in data.items():
            if value is not None:
                f.create_dataset(root + key, data=value, compression=compress if np.ndim(value) else None)
        f.require_group(root + "/representer").attrs["name"] = "itkStandardMeshRepresenter"
        f[root + "/representer"].attrs["datasetType"] = "POLYGON_MESH" if cells else "POINT_SET"
        if version and "version" not in f:
            f["/version/majorVersion"] = version[0]
            f["/version/minorVersion"] = version[1]


def vertices(name):
    """The vertices of an OBJ file, whose numbers have all digits."""
    with open(name) as f:
        return np.array([[float(x) for x in line.split()[1:]] for line in f if line.startswith("v ")])


def sample(model, expected, weights):
    named = [a for i, w in enumerate(weights) for a in ("-p", f"m{i + 1}={float(w)!r}")]
    done("mesh", "--shape", "statistical", "-O", f"model={model}", *named, "-o", "sample.obj")
    error = np.abs(vertices("sample.obj") - expected).max()
    assert error < 1e-6, (model, error)


def expected(weights, flip=1.0, unit=1.0):
    m = len(weights)
    offset = basis[:, :m].astype(float) @ (np.sqrt(variance[:m].astype(float)) * weights)
    return (mean.astype(float) + offset.reshape(-1, 3)) * unit * [flip, flip, 1]


weights = np.clip(chance.normal(size=r), -2.9, 2.9)

# the versions
write("v09.h5")
write("v10.h5", version=(1, 0), compress="gzip")
write("v08.h5", version=(0, 8), scaled=True)
for name, tolerance in (("v09.h5", 0), ("v10.h5", 0), ("v08.h5", 1e-5)):
    text = done("import", "ssm", name, "-o", "m.ssm")
    assert "5 modes" in text and "54.05 %" in text, text
    if tolerance == 0:
        sample("m.ssm", expected(weights), weights)
# of version 0.8, the basis itself is rounded to float32
scaled = (basis * np.sqrt(variance)).astype(np.float32).astype(float)
sample("m.ssm", mean.astype(float) + (scaled @ weights).reshape(-1, 3), weights)

# frame, unit, fewer modes
done("import", "ssm", "v09.h5", "-o", "ras.ssm", "--frame", "ras", "--unit", "cm")
sample("ras.ssm", expected(weights, -1, 10), weights)
report = json.loads(done("import", "ssm", "v09.h5", "-o", "few.ssm", "--variance", "0.9", "--json"))
assert report["modes"] == 3 and abs(report["total_variance_mm2"] - 74) < 1e-6, report
sample("few.ssm", expected(weights[:3]), weights[:3])
done("import", "ssm", "v09.h5", "-o", "few.ssm", "--modes", "2", "--quiet")
sample("few.ssm", expected(weights[:2]), weights[:2])

# a catalog
write("catalog.h5", root="/first")
write("catalog.h5", root="/second", mode="a", change={"/model/mean": mean.reshape(-1) + 1})
with h5py.File("catalog.h5", "a") as f:
    for name in ("first", "second"):
        f[f"/catalog/{name}/modelPath"] = "/" + name
        f[f"/catalog/{name}/modelType"] = "POLYGON_MESH_MODEL"
refused(2, "'first', 'second'", "import", "ssm", "catalog.h5", "-o", "never.ssm")
refused(2, "no model 'third'", "import", "ssm", "catalog.h5", "-o", "never.ssm", "--model", "third")
done("import", "ssm", "catalog.h5", "-o", "m.ssm", "--model", "second")
sample("m.ssm", expected(weights) + ((mean + 1).astype(float) - mean.astype(float)), weights)

# points without triangles
write("points.h5", cells=False)
refused(3, "--surface", "import", "ssm", "points.h5", "-o", "never.ssm")
with open("surface.off", "w") as f:
    f.write(f"OFF\n{n} {len(tri)} 0\n" + "".join("%r %r %r\n" % tuple(map(float, x)) for x in vert) + "".join("3 %d %d %d\n" % tuple(t) for t in tri))
done("import", "ssm", "points.h5", "-o", "m.ssm", "--surface", "surface.off")
sample("m.ssm", expected(weights), weights)

# the JSON form
def to_json(source, target):
    ids, out = {}, {"apiVersion": "1.1.1", "groups": {}, "datasets": {}}

    def visit(obj, path):
        key = f"id-{len(ids)}"
        ids[path] = key
        attributes = [{"name": a, "value": str(v)} for a, v in obj.attrs.items()]
        if isinstance(obj, h5py.Dataset):
            value = obj[()]
            out["datasets"][key] = {"alias": [path], "value": value.tolist() if hasattr(value, "tolist") else value, "attributes": attributes}
            return "datasets", key
        links = []
        for name, child in obj.items():
            collection, id = visit(child, path + "/" + name)
            links.append({"class": "H5L_TYPE_HARD", "collection": collection, "id": id, "title": name})
        out["groups"][key] = {"links": links, "attributes": attributes}
        return "groups", key

    with h5py.File(source) as f:
        out["root"] = visit(f, "")[1]
    with open(target, "w") as f:
        json.dump(out, f)


to_json("v09.h5", "v09.h5.json")
done("import", "ssm", "v09.h5.json", "-o", "m.ssm")
sample("m.ssm", expected(weights), weights)
with open("v09.h5.json") as f:
    text = f.read()
for i, cut in enumerate((0, 1, 100, len(text) // 2, len(text) - 1)):
    with open("cut.h5.json", "w") as f:
        f.write(text[:cut])
    refused(3, "cut.h5.json", "import", "ssm", "cut.h5.json", "-o", "never.ssm")
for wrong in (text.replace("40.0", "NaN"), text.replace("40.0", '"a"'), text.replace("40.0", "-1.0"), "[" * 100000, '{"root": 3}'):
    with open("cut.h5.json", "w") as f:
        f.write(wrong)
    refused(3, "cut.h5.json", "import", "ssm", "cut.h5.json", "-o", "never.ssm")

# broken models
nan = basis.copy()
nan[17, 2] = np.nan
for what, change in (
    ("not finite", {"/model/pcaBasis": nan}),
    ("need >= 0", {"/model/pcaVariance": np.array([40, np.inf, 9, 2, 0.5])}),
    ("need >= 0", {"/model/pcaVariance": -variance}),
    ("dimensions", {"/model/pcaBasis": basis.reshape(3 * n, r, 1)}),
    ("rows in 1 dimensions", {"/model/pcaBasis": basis[:, 0]}),
    ("rows in 2 dimensions", {"/model/pcaBasis": basis.T}),
    ("variances of", {"/model/pcaVariance": variance[:3]}),
    ("need x, y, z", {"/model/mean": mean.reshape(-1)[:-1]}),
    ("has 4 rows", {"/representer/cells": np.zeros((4, 7), dtype=np.int32)}),
    ("has point", {"/representer/cells": tri.T + 5}),
    ("has point", {"/representer/cells": -tri.T}),
    ("no array /model/mean", {"/model/mean": None}),
    ("no array /model/pcaVariance", {"/model/pcaVariance": None}),
    ("no array of numbers", {"/model/mean": "text"}),
    ("no mode has a variance", {"/model/pcaVariance": 0 * variance}),
):
    write("bad.h5", change=change)
    refused(3, what, "import", "ssm", "bad.h5", "-o", "never.ssm")
write("bad.h5", version=(2, 0))
refused(3, "version 2.0", "import", "ssm", "bad.h5", "-o", "never.ssm")
write("bad.h5", version=None)
refused(3, "majorVersion", "import", "ssm", "bad.h5", "-o", "never.ssm")
write("bad.h5", change={"/representer/cells": None})
with h5py.File("bad.h5", "a") as f:  # 10^9 cells that are not there
    f.create_dataset("/representer/cells", shape=(3, 10**9), dtype="i4", chunks=(3, 1000))
refused(3, "only 0 bytes", "import", "ssm", "bad.h5", "-o", "never.ssm")
whole = open("v09.h5", "rb").read()
for cut in (0, 7, 100, 2000, len(whole) // 2, len(whole) - 1):
    with open("bad.h5", "wb") as f:
        f.write(whole[:cut])
    refused(3, "bad.h5", "import", "ssm", "bad.h5", "-o", "never.ssm")
# damaged anywhere: a model, or one line in bounded time, though libhdf5 crashes and hangs
damage = np.random.default_rng(2)
for _ in range(12):
    bad = np.frombuffer(whole, np.uint8).copy()
    bad[damage.integers(0, len(whole) // 4, size=20)] = damage.integers(0, 256, size=20)
    bad.tofile("bad.h5")
    ended = sdmgen("import", "ssm", "bad.h5", "-o", "may_be.ssm", "--quiet")
    assert ended.returncode in (0, 3) and ended.stderr.count("\n") == (ended.returncode == 3), ended

refused(2, "need a model", "import", "ssm", "surface.off", "-o", "never.ssm")
refused(1, "missing.h5", "import", "ssm", "missing.h5", "-o", "never.ssm")
refused(2, "exclude", "import", "ssm", "v09.h5", "-o", "never.ssm", "--modes", "2", "--variance", "0.5")
refused(2, "--modes 9", "import", "ssm", "v09.h5", "-o", "never.ssm", "--modes", "9")

# damaged .ssm files
whole = bytearray(open("m.ssm", "rb").read())
for at in (9, 100, 300, len(whole) // 2, len(whole) - 3):
    changed = bytearray(whole)
    changed[at] ^= 64
    with open("bad.ssm", "wb") as f:
        f.write(changed)
    refused(3, "bad.ssm", "mesh", "--shape", "statistical", "-O", "model=bad.ssm", "-o", "never.ssm.ply")
refused(3, "excludes", "mesh", "--shape", "statistical", "-O", "model=m.ssm", "-O", "mean=surface.off", "-o", "x.ply")
assert "ssm" in done("info", "m.ssm")

# a folder of meshes: the model of shapes that were moved and turned is the model of the shapes
def write_obj(name, points):
    with open(name, "w") as f:
        f.write("".join("v %r %r %r\n" % tuple(map(float, x)) for x in points) + "".join("f %d %d %d\n" % tuple(t + 1) for t in tri))


os.mkdir("meshes")
count = 12
factors = chance.normal(size=(count, 2))
bumps = np.stack([vert * [1, 0, 0] * 0.1, vert * np.sin(vert[:, 2:3] / 4) * [0, 0.1, 0]])
shapes = vert + np.einsum("ij,jkl->ikl", factors, bumps)
for i, shape in enumerate(shapes):
    q = chance.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
    write_obj(f"meshes/{i:02d}.obj", shape @ turn.T + chance.normal(size=3) * 50)
report = json.loads(done("import", "ssm", "meshes", "-o", "learnt.ssm", "--json"))


def procrustes(shapes):
    """The same by singular value decompositions."""
    shapes = [s - s.mean(axis=0) for s in shapes]
    middle = shapes[0]
    for _ in range(200):
        turned = []
        for s in shapes:
            u, _, v = np.linalg.svd(s.T @ middle)
            turned.append(s @ (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v))
        middle = np.mean(turned, axis=0)
    return np.array(turned).reshape(len(shapes), -1)


aligned = procrustes(shapes)
values = np.linalg.svd(aligned - aligned.mean(axis=0), compute_uv=False) ** 2 / (count - 1)
got = np.array(report["variances_mm2"])
assert np.abs(got - values[: len(got)]).max() < 1e-6 * values[0] and values[len(got)] < 1e-9 * values[0], (got, values)
done("import", "ssm", "meshes", "-o", "scaled.ssm", "--scale", "--modes", "1")
write_obj("meshes/99.obj", shapes[0][::-1])
with open("meshes/99.obj", "a") as f:
    f.write("f 1 2 3\n")
refused(3, "99.obj", "import", "ssm", "meshes", "-o", "never.ssm")
shutil.rmtree("meshes")
os.mkdir("meshes")
refused(2, "0 mesh files", "import", "ssm", "meshes", "-o", "never.ssm")
print("shape models agree with numpy")
