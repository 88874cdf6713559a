# check_particles.py SDMGEN: the shape model that the program makes of particles (x y z a line) and one mesh is the one that numpy computes
# with a thin-plate spline, solved as one system of equations, and singular value decompositions; folders that are broken are refused.
# Tests: cmd_import.c ssm_particles.c ssm_folder.c warp.c align.c components.c
import json
import math
import os
import shutil
import sys

try:
    import numpy as np
except ImportError as missing:
    print("skipped:", missing)
    sys.exit(77)

from sdm_program import done, refused

chance = np.random.default_rng(5)


def import_refused(code, what, *arguments):
    refused(code, what, "import", "ssm", *arguments, "-o", "never.ssm")


def ball(n):
    """Vertices on the unit sphere, and triangles, counter-clockwise from outside."""
    u, v = np.meshgrid(np.arange(1, n) / n * np.pi, np.arange(2 * n) / n * np.pi, indexing="ij")
    vert = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], axis=-1).reshape(-1, 3)
    vert = np.concatenate([vert, [[0, 0, 1], [0, 0, -1]]])
    tri, m = [], 2 * n
    for k in range(m):
        e = (k + 1) % m
        tri += [[(n - 1) * m, k, e], [(n - 1) * m + 1, (n - 2) * m + e, (n - 2) * m + k]]
        for i in range(n - 2):
            a, b, c, d = i * m + k, i * m + e, (i + 1) * m + k, (i + 1) * m + e
            tri += [[a, c, b], [b, c, d]]
    return vert, np.array(tri)


def turn():
    w, x, y, z = (lambda q: q / np.linalg.norm(q))(chance.normal(size=4))
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def shape(points, f):
    """A shape of three factors: its points in space."""
    x, y, z = (points * [20, 12, 9]).T
    return np.stack([x * (1 + 0.1 * f[0]), y + 0.01 * f[1] * x * x, z + 2 * f[2] * np.sin(x / 6)], axis=-1)


def save(name, points):
    with open(name, "w") as file:
        file.write("".join("%r %r %r\n" % tuple(map(float, x)) for x in points))


def save_mesh(name, points):
    with open(name, "w") as file:
        file.write("".join("v %r %r %r\n" % tuple(map(float, x)) for x in points) + "".join("f %d %d %d\n" % tuple(t + 1) for t in tri))


def vertices(name):
    with open(name) as file:
        return np.array([[float(x) for x in line.split()[1:]] for line in file if line.startswith("v ")])


def spline(start, ends, at):
    """The points `at`, moved as `start` moves onto each of `ends`: all equations at once."""
    n = len(start)
    distance = lambda a, b: np.linalg.norm(a[:, None] - b[None], axis=-1)
    linear = lambda a: np.concatenate([np.ones((len(a), 1)), a], axis=1)
    left = np.block([[distance(start, start), linear(start)], [linear(start).T, np.zeros((4, 4))]])
    right = np.concatenate([np.concatenate(list(ends), axis=1), np.zeros((4, 3 * len(ends)))])
    weights = np.linalg.solve(left, right)
    moved = distance(at, start) @ weights[:n] + linear(at) @ weights[n:]
    return moved.reshape(len(at), len(ends), 3).transpose(1, 0, 2)


def model(shapes):
    """Mean, on the first shape, and covariance of shapes[n][points][3] after generalised Procrustes analysis."""
    keep = shapes[0].mean(axis=0)
    shapes = [s - s.mean(axis=0) for s in shapes]

    def onto(s, target):
        u, _, v = np.linalg.svd(s.T @ target)
        return s @ (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v)

    middle = shapes[0]
    for _ in range(100):
        middle = onto(np.mean([onto(s, middle) for s in shapes], axis=0), middle)
    turned = np.array([onto(s, middle) for s in shapes]).reshape(len(shapes), -1)
    return turned.mean(axis=0).reshape(-1, 3) + keep, np.cov(turned.T)


def compare(name, shapes):
    """The mean and the covariance of the model in a file, from the shapes that the program makes of it."""
    mean, covariance = model(shapes)
    report = json.loads(done("info", name, "--json"))
    modes = []
    for i in range(report["modes"] + 1):
        done("mesh", "--shape", "statistical", "-O", f"model={name}", *([] if i == 0 else ["-p", f"m{i}=1"]), "-o", "sample.obj", "--quiet")
        modes.append(vertices("sample.obj"))
    got = np.array(modes[1:]).reshape(report["modes"], -1) - modes[0].reshape(-1)
    assert np.abs(modes[0] - mean).max() < 1e-6, np.abs(modes[0] - mean).max()
    assert np.abs(got.T @ got - covariance).max() < 1e-6 * np.abs(covariance).max()
    assert abs(report["total_variance_mm2"] - np.trace(covariance)) < 1e-6 * np.trace(covariance)


# the particles are on the surface, but for a few they are no vertices of the mesh
unit, tri = ball(8)
spread = chance.normal(size=(60, 3))
spread /= np.linalg.norm(spread, axis=1)[:, None]
count = 7
factors = chance.normal(size=(count, 3))
os.mkdir("particles")
local, world = [], []
for i, f in enumerate(factors):
    q, t = turn(), chance.normal(size=3) * 40
    world.append(shape(spread, f))
    local.append(world[-1] @ q.T + t)
    save(f"particles/bone{i}_local.particles", local[-1])
    save(f"particles/bone{i}_world.particles", world[-1])
    save_mesh(f"bone{i}.obj", shape(unit, f) @ q.T + t)

# found by the name of the mesh; the mesh is in the frame of its image, the shapes are the aligned ones
done("import", "ssm", "particles", "--surface", "bone2.obj", "-o", "m.ssm", "--quiet")
compare("m.ssm", spline(local[2], world, vertices("bone2.obj")))
# named; without aligned particles the others are aligned here
os.mkdir("others")
for i in range(count):
    shutil.copy(f"particles/bone{i}_local.particles", "others")
shutil.copy("bone4.obj", "renamed.obj")
done("import", "ssm", "others", "--surface", "renamed.obj", "--particles", "others/bone4_local.particles", "-o", "m.ssm", "--quiet")
compare("m.ssm", spline(local[4], local, vertices("bone4.obj")))
# the vertices are the particles, without and with their names
os.mkdir("vertices")
for i, f in enumerate(factors):
    save(f"vertices/v{i}.particles", shape(unit, f) + 3.0 * i)
dense = np.array([shape(unit, f) for f in factors])
save_mesh("any.obj", unit)
done("import", "ssm", "vertices", "--surface", "any.obj", "-o", "m.ssm", "--quiet")
compare("m.ssm", dense)
save_mesh("v3.obj", dense[3] + 9)
done("import", "ssm", "vertices", "--surface", "v3.obj", "-o", "m.ssm", "--quiet")
compare("m.ssm", dense)

# mistakes
import_refused(2, "--surface", "particles")
import_refused(2, "--particles FILE", "particles", "--surface", "any.obj")
import_refused(2, "does nothing", "particles", "--surface", "bone2.obj", "--model", "x")
import_refused(3, "in its frame", "particles", "--surface", "bone2.obj", "--particles", "particles/bone3_local.particles")
import_refused(1, "missing.particles", "particles", "--surface", "bone2.obj", "--particles", "missing.particles")
import_refused(3, "114 particles", "particles", "--surface", "v3.obj", "--particles", "vertices/v3.particles")
good = open("others/bone1_local.particles").read()
lines = good.splitlines(keepends=True)
for what, text in (
    ("bone1_local.particles:3:", "".join(lines[:2]) + "1 2\n" + "".join(lines[3:])),
    ("bone1_local.particles:3:", "".join(lines[:2]) + "1 2 3 4\n" + "".join(lines[3:])),
    ("bone1_local.particles:3:", "".join(lines[:2]) + "1 nan 3\n" + "".join(lines[3:])),
    ("bone1_local.particles:3:", "".join(lines[:2]) + "1 1e999 3\n" + "".join(lines[3:])),
    ("bone1_local.particles:3:", "".join(lines[:2]) + "1 2 " + "9" * 100000 + "x\n" + "".join(lines[3:])),
    ("59 particles", "".join(lines[1:])),
    ("bone1_local.particles:61:", good + "1"),
    ("no particles", "\n \n"),
    ("zero byte", good + "\0"),
):
    with open("others/bone1_local.particles", "w") as file:
        file.write(text)
    import_refused(3, what, "others", "--surface", "bone2.obj")
shutil.copy("particles/bone1_local.particles", "others")
flat = [(math.cos(i), math.cos(2.5 * i), 0.0) for i in range(60)]
for what, points in (("one plane", flat), ("same place", [*local[1].tolist()[:59], local[1][0].tolist()]), ("all 60 points", [(1, 2, 3)] * 60)):
    save("own.particles", points)
    with open("own.obj", "w") as file:  # a small triangle at each particle
        for x, y, z in points:
            file.write(f"v {x!r} {y!r} {z!r}\nv {x + 0.01!r} {y!r} {z!r}\nv {x!r} {y + 0.01!r} {z!r}\nf -3 -2 -1\n")
    import_refused(3, what, "others", "--surface", "own.obj", "--particles", "own.particles")
os.mkdir("one")
shutil.copy("particles/bone0_local.particles", "one")
import_refused(2, "at least 2", "one", "--surface", "bone0.obj")
print("models of particles agree with numpy")
