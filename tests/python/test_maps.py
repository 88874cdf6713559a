"""Maps, derivatives and distances: the same bits as those of the program."""

import multiprocessing
import os
import pickle
import re
import signal
import threading
import time
import warnings

import numpy as np
import pytest
from conftest import SOURCE, ball, in_threads

import sdmgen
from sdmgen._errors import with_arguments
from sdmgen._model import _doubts_of

P = {"a": 4.1, "alpha": 0.5}
WORDS = ["-p", "a=4.1", "-p", "alpha=0.5"]


def same(array, file):
    expected = np.load(file)
    assert array.dtype == expected.dtype and array.shape == expected.shape
    assert np.ascontiguousarray(array).tobytes() == expected.tobytes()


def test_a_map_has_the_bits_of_the_program(run, model, model_file, tmp_path):
    out = tmp_path / "map.npy"
    run("generate", model_file, *WORDS, "-o", out)
    map = model(**P)
    same(map.values, out)
    assert map.values.flags.c_contiguous and map.shape == model.grid.shape
    assert map.info == sdmgen.MapInfo("network", error_mm=model.accuracy.rmse_mm)
    same(model(params=P).values, out)
    same(model(model.values(P)).values, out)
    same(np.asarray(map), out)
    # negative inside: the middle of the tube of the exact shape is inside
    assert map.values.min() < 0 < map.values.max()


def test_maps_on_other_grids(run, model, model_file, tmp_path):
    out = tmp_path / "map.npy"
    run("generate", model_file, *WORDS, "--spacing", "0.5", "-o", out)
    same(model(**P, spacing=0.5).values, out)
    run("generate", model_file, *WORDS, "--size", "20,21,22", "--outside", "bound", "-o", out)
    same(model(P, size=(20, 21, 22), outside="bound").values, out)
    turn = "0,-1,0,1,0,0,0,0,1"
    words = ["--size", "9,8,7", "--spacing", "0.3,0.4,0.5", "--origin", "-1,-2,-1", "--direction", turn]
    run("generate", model_file, *WORDS, *words, "-o", out)
    grid = sdmgen.Grid((9, 8, 7), (0.3, 0.4, 0.5), (-1, -2, -1), [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    same(model(P, grid=grid).values, out)
    same(model.field(P).grid(grid).values, out)
    run("generate", model_file, *WORDS, "--size", "40,40,40", "--spacing", "0.5", "--outside", "bound", "-o", out)
    same(model(P, size=(40, 40, 40), spacing=0.5, outside="bound").values, out)
    with pytest.raises(sdmgen.RangeError):
        model(P, size=(40, 40, 40), spacing=0.5)
    # a band has the values of the map
    dense = model(P, spacing=0.25)
    band = model.band(1.0, P, spacing=0.25)
    near = np.abs(dense.values) < 1
    assert near.sum() > 100 and np.array_equal(band.dense().values[near], dense.values[near])
    assert np.array_equal(band.dense().values < 0, dense.values < 0)


def test_derivatives(run, model, model_file, tmp_path):
    out, slopes = tmp_path / "map.npy", tmp_path / "jacobian.npy"
    run("generate", model_file, *WORDS, "-o", out, "--jacobian", slopes, "--gradient", tmp_path / "gradient.npy")
    both = model.jacobian(P)
    same(both.values, slopes)
    same(both.map.values, out)
    same(both.map.gradient(), tmp_path / "gradient.npy")
    counted = (both.map.values < 0).sum() * both.map.spacing.prod()
    assert 0.8 * counted < both.map.volume < 1.2 * counted
    slope = both.map.volume_adjoint()  # the volume of a map that grows by 0.01 mm everywhere
    grown = type(both.map)(both.map.values - np.float32(0.01), both.map.grid)
    assert grown.volume - both.map.volume == pytest.approx(-0.01 * slope.sum(), rel=0.02)
    rng = np.random.default_rng(1)
    v, w = rng.normal(size=4), rng.normal(size=model.grid.shape).astype(np.float32)
    along = np.tensordot(v, both.values.astype(float), 1)
    assert np.abs(model.jvp(v, P).values - along).max() < 1e-2 * np.abs(along).max()
    back = (both.values.astype(float) * w).sum((1, 2, 3))
    assert np.abs(model.vjp(w, P) - back).max() < 1e-2 * np.abs(back).max()


def test_derivatives_and_volumes_that_are_bad_warn_once(model_file, tmp_path):
    """The test network, trained in a second, is bad for all three uses; each warns at the line of the caller."""
    model = sdmgen.Model(model_file)
    for use in ("volume", "derivative", "volume_derivative"):
        with pytest.raises(sdmgen.QualityError) as refused:
            model.check_use(use)
        told = refused.value.text.split("off by ")[1].split(" %")[0]
        if use == "volume":
            assert float(told) == pytest.approx(100 * model.quality.volume_error, rel=0.05)
        else:  # the parameter and the figure that the training printed
            name = refused.value.text.split(" for ")[1].split(",")[0]
            assert any(f"by {name}: off by {told} %" in line for line in model.quality.unfit)
    if model.quality.grade != "poor":
        model.check_use("surface")
    with pytest.raises(sdmgen.ArgumentError, match="use"):
        model.check_use("nonsense")
    ones = np.ones(model.grid.shape, np.float32)
    derivatives = (
        lambda m: m.jacobian(P),
        lambda m: m.jvp([1, 0, 0, 0], P),
        lambda m: m.vjp(ones, P),
        lambda m: m.sample([[0, 0, 0]], P, slopes=True),
        lambda m: m.field(P, derivatives=True),
    )
    volumes = (lambda m: m(P).volume, lambda m: m.batch([m.values(P)])[0].volume, lambda m: m.field(P).grid(m.grid).volume)
    cases = [(work, "derivatives of its maps are off by") for work in derivatives]
    cases += [(work, "volumes of its maps are off by") for work in volumes]
    cases += [(lambda m: m(P).volume_adjoint(), "derivatives of volumes of its maps are off by")]
    cases += [(lambda m: m.vjp(2 * m(P).volume_adjoint(), P), "derivatives of volumes of its maps are off by")]
    for work, text in cases:
        fresh = sdmgen.Model(model_file)
        with pytest.warns(UserWarning, match=f"model.sdm: {text}") as caught:
            work(fresh)
            work(fresh)
        assert len(caught) == 1 and caught[0].filename == __file__
    # no words about maps alone, or about exact maps
    fresh = sdmgen.Model(model_file)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fresh(P).surface()
        fresh.sample([[0, 0, 0]], P)
        assert fresh(P, max_error=0.001).volume > 0
        assert pickle.loads(pickle.dumps(sdmgen.Map(fresh(P).values, fresh.grid))).volume > 0


SMALL = """
shape: {name: linkage, options: {links: 1}, ranges: {q1: [-0.4, 0.4]}}
grid: {size: [56, 32, 32], spacing: 0.3, centre: [1, 0, 0]}
network: {kind: template, depth: 0}
data: {start: 60, online: 0, holdout: 8, memory_gb: 0.5}
train: {steps: 10, batch: 64, refine: 0}
"""


def test_derivatives_of_a_volume_that_hardly_changes_warn_once(run, tmp_path):
    """A joint that turns hardly changes the volume: the check of the whole model passes, the derivative is wrong."""
    (tmp_path / "small.yaml").write_text(SMALL)
    run("train", tmp_path / "small.yaml", "--out", tmp_path / "run")
    file = tmp_path / "run" / "model.sdm"
    model = sdmgen.Model(file)
    model.check_use("volume_derivative")
    k = [p.name for p in model.params].index("q1")
    text = f"{file}: do not use the derivatives of the volume by q1: off by "
    with pytest.warns(UserWarning, match=re.escape(text)) as caught:
        slopes = model.vjp(model(q1=0.2).volume_adjoint(), q1=0.2)
        model.vjp(model().volume_adjoint())
    assert len(caught) == 1 and caught[0].filename == __file__ and "hardly changes the volume" in str(caught[0].message)

    def volume(q1):  # of the mesh
        return next(m.value for m in model.shape.measures(q1=q1) if m.name == "volume")

    by_mesh = (volume(0.25) - volume(0.15)) / 0.1
    assert abs(slopes[k] - by_mesh) > 0.2 * abs(by_mesh)
    # only derivatives of volumes are told
    fresh = sdmgen.Model(file)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fresh.vjp(np.ones(fresh.grid.shape, np.float32))
    # beside a check that fails, too
    bad = sdmgen.Model(file)
    bad.check_use = lambda use: (_ for _ in ()).throw(sdmgen.QualityError("quality", "off by 30 % for length"))
    doubts = _doubts_of(bad)
    with pytest.warns(UserWarning, match="off by 30 % for length; do not use the derivatives of the volume by q1"):
        doubts.warn("volume_derivative")


def test_wrong_distances_far_from_the_surface_warn_once(model_file):
    model = sdmgen.Model(model_file)
    model.check_use("distance")  # the test network has right ones
    assert model.quality.far_error_mm <= model.grid.spacing.min() and model.quality.surface_volume_error > 0.02
    assert model.quality.unfit[0].startswith("volumes of maps: off by ")
    model._doubts = type(model._doubts)({"distance": "distances"})
    values = np.abs(model(P).values)
    index = {far: np.argwhere((values > model.accuracy.near_mm) == far)[0][::-1] for far in (False, True)}
    near, far = ([model.grid.origin + i * model.grid.spacing] for i in index.values())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.sample(near, P)
    with pytest.warns(UserWarning, match="distances") as caught:
        model.sample(far, P)
        model.field(P).sample(far)
    assert len(caught) == 1 and caught[0].filename == __file__


def test_a_shape_that_is_not_known_asks_for_the_argument():
    text = (SOURCE / "runtime/maps/model_shape.c").read_text()
    asked = re.search(r'"(\(sdm_registry_load\(\)\))"', text)
    assert with_arguments(asked[1]) == "(plugin=FILE of sdmgen.Model)"


def test_a_map_that_the_grid_cuts_is_marked(model):
    assert not model(P).info.cut and not model(P, spacing=0.5).info.cut
    low = np.argwhere(model(P).values < 0).min(0)[::-1]
    grid = sdmgen.Grid((6, 6, 6), 0.5, model.grid.origin + (low + 2) * model.grid.spacing)
    inner = model(P, grid=grid)
    border = np.pad(np.zeros((4, 4, 4), bool), 1, constant_values=True)
    assert inner.info.cut and (inner.values[border] < 0).any()
    # a slice cuts every shape
    assert not model(P, size=(90, 90, 1), spacing=0.2, outside="bound").info.cut


def test_batches_and_policies(run, model, model_file, tmp_path):
    rows = np.array([[4.1, 0.5, 0.15, 0.1], [4.4, 0.2, 0.16, 0.0], [3.9, 0.6, 0.15, 0.3]])
    batch = model.batch(rows)
    assert batch.values.shape == (3, *model.grid.shape) and len(batch) == 3
    for map, row in zip(batch, rows):
        assert np.array_equal(map.values, model(row).values)
    assert model.batch(np.empty((0, 4))).values.shape == (0, *model.grid.shape)
    with pytest.raises(sdmgen.RangeError, match="'a'.*; policy=\"clamp\" moves .*, \"exact\" computes"):
        model(a=9)
    with pytest.raises(ValueError):
        model.batch([[9, 0.5, 0.15, 0.1]])
    out = tmp_path / "map.npy"
    run("generate", model_file, "-p", "a=9", "--policy", "clamp", "-o", out)
    clamped = model(a=9, policy="clamp")
    same(clamped.values, out)
    assert clamped.info.clamped and clamped.info.source == "network"
    low = model.params[0].min - 0.5 * (model.params[0].min - 1)
    with pytest.raises(sdmgen.RangeError):
        model(a=low, max_error=0.1)
    # a bound on the error replaces the map of this small network by an exact one
    run("generate", model_file, *WORDS, "--max-error", "0.01", "-o", out)
    exact = model(P, max_error=0.01)
    same(exact.values, out)
    assert exact.info.source == "exact" and exact.info.reason == "error" and exact.info.check.max > 0.01
    with pytest.raises(sdmgen.QualityError) as caught:
        model(P, max_error=0.01, policy="clamp")
    assert np.array_equal(caught.value.result.values, model(P).values)
    assert model.check(P) == model(P, check=True).info.check == model.check_map(model(P), P)


def test_points(run, model, model_file, tmp_path):
    x = np.random.default_rng(2).uniform(-3, 3, (200, 3))
    np.save(tmp_path / "x.npy", x)
    words = ["--points", tmp_path / "x.npy", "--columns", "distance,gradient"]
    run("generate", model_file, *WORDS, *words, "-o", tmp_path / "at.npy", "--jacobian", tmp_path / "slopes.npy")
    samples = model.sample(x, P, gradient=True, slopes=True)
    table = np.load(tmp_path / "at.npy")
    assert np.array_equal(table[:, 0], samples.distance) and np.array_equal(table[:, 1:], samples.gradient)
    same(samples.slopes, tmp_path / "slopes.npy")
    assert model.sample(x, P).gradient is None
    # outside of the box, slopes are those of exact distances, as central differences have them
    beyond = [[9, 1, 0.5], [-2, 8, -6]]
    slopes = model.sample(beyond, P, outside="exact", slopes=True).slopes
    low, high = (sdmgen.exact_points(model.shape.mesh(a=a, alpha=0.5), beyond).distance for a in (4.0999, 4.1001))
    assert np.allclose(slopes[:, 0], (high - low) / 2e-4, atol=1e-3) and np.abs(slopes[:, 0]).max() > 0.1


def test_the_description_of_a_model(model, model_file):
    assert [p.name for p in model.params] == ["a", "alpha", "b", "phi"] and model.params[0].unit == "mm"
    assert all(p.min <= p.default <= p.max for p in model.params)
    assert model.kind == "pod" and model.shape_name == "cochlea" and len(model.checksum) == 16
    assert model.accuracy.samples == 8 and "grid" in model.config and model.options["ear"] == "right"
    assert sdmgen.Model(model_file.read_bytes()).checksum == model.checksum
    assert model.quality.grade in ("good", "usable", "poor") and 0 <= model.quality.cut <= 1 and model.quality.thickness_mm > 0
    again = pickle.loads(pickle.dumps(model))
    assert np.array_equal(again(P).values, model(P).values)


def test_exact_maps(run, tmp_path):
    out = tmp_path / "exact.npy"
    files = {name: tmp_path / f"{name}.npy" for name in ("closest", "normal", "triangle", "jacobian")}
    words = [word for name, file in files.items() for word in (f"--{name}", file)]
    run("exact", "--shape", "torus", "-p", "major=2.5", "--spacing", "0.4", "-o", out, *words)
    shape = sdmgen.Shape("torus")
    map = sdmgen.exact(shape, params={"major": 2.5}, spacing=0.4, layers=list(files))
    same(map.values, out)
    for name, file in files.items():
        same(getattr(map, name), file)
    # the default grid, a mesh, a pair of arrays
    run("exact", "--shape", "torus", "-o", out)
    mesh = shape.mesh()
    for source in (shape, mesh, (mesh.vertices, mesh.triangles)):
        same(sdmgen.exact(source).values, out)
    run("exact", "--shape", "torus", "--size", "20,20,10", "--narrow", "2", "--keep-overlap", "-o", out)
    same(sdmgen.exact(shape, size=(20, 20, 10), narrow=2, keep_overlap=True).values, out)
    run("exact", "--shape", "cochlea", "-O", "edge=0.5", "--size", "20,18,16", "-o", out)
    same(sdmgen.exact(sdmgen.Shape("cochlea", edge=0.5), size=(20, 18, 16)).values, out)
    # a band
    band = sdmgen.exact_band(shape, sdmgen.exact(shape).grid, 0.5).dense()
    full = sdmgen.exact(shape).values
    assert np.array_equal(band.values, np.clip(full, np.float32(-0.5), np.float32(0.5)))


def test_exact_points(run, tmp_path):
    x = np.random.default_rng(3).uniform(-4, 4, (500, 3))
    np.save(tmp_path / "x.npy", x)
    words = ["--points", tmp_path / "x.npy", "--columns", "distance,gradient,closest,triangle"]
    run("exact", "--shape", "torus", *words, "-o", tmp_path / "at.npy")
    table = np.load(tmp_path / "at.npy")
    at = sdmgen.exact_points(sdmgen.Shape("torus"), x)
    assert np.array_equal(table, np.column_stack([at.distance, at.normal, at.closest, at.triangle]))
    mesh = sdmgen.Mesh(*ball(2.0, n=40))
    r = np.linalg.norm(x, axis=1)
    assert np.abs(mesh.distance(x) - (r - 2)).max() < 0.02
    assert np.array_equal(mesh.distance(x), sdmgen.exact_points(mesh, x).distance)
    assert mesh.audit().closed and mesh.report().sign == "crossings" and mesh.audit().volume > 0


def two_balls(shift, flip, radius=1.0):
    """Two balls, the second moved along x; flip: it is inside out."""
    (v, t), (w, u) = ball(), ball(radius)
    return sdmgen.Mesh(np.concatenate([v, w + [shift, 0.01, 0.02]]), np.concatenate([t, u[:, :: -1 if flip else 1] + len(v)]))


def test_warnings_of_meshes():
    vertices, triangles = ball()
    open_ball, turned = sdmgen.Mesh(vertices, triangles[1:]), sdmgen.Mesh(vertices, triangles[:, ::-1])
    for mesh, text in (
        (open_ball, "the mesh is not closed \\(3 boundary edges"),
        (turned, "the mesh is inside out; distances are those of the turned mesh"),
        (two_balls(3, True), "1 part is inside out; distances are those of the turned parts"),
        (two_balls(1, True), "a part of the mesh is inside out.*about 2.8 mm"),
    ):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            mesh.report()
        with pytest.warns(UserWarning, match=text) as told:
            mesh.distance([[0, 0, 0]])
            sdmgen.exact(mesh, spacing=0.5)
            mesh.distance([[0, 0, 0]], threads=1)
        assert len(told) == 1 and told[0].filename == __file__
    apart, report = two_balls(3, True), two_balls(1, True).report()
    assert apart.report().parts_turned == 1 and apart.report().subtracted == 0 and not apart.audit().inverted
    volume = -turned.audit().volume
    assert report.parts_turned == 0 and 0.5 * volume < report.subtracted < volume
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for mesh in (two_balls(1, False), two_balls(0.1, True, 0.5), sdmgen.Shape("linkage").mesh()):
            assert mesh.report().subtracted == 0 and mesh.distance([[99, 0, 0]]) > 0


def test_a_shape_is_examined_once():
    """The first distances of a shape warn of its mesh; reports tell what was not measured."""

    def balls(shift):
        mesh = two_balls(shift, True)
        return mesh.vertices, mesh.triangles

    shape = sdmgen.Shape(balls, [sdmgen.Param("shift", 0.5, 1.5, unit="mm")])
    with pytest.warns(UserWarning, match="a part of the mesh is inside out") as told:
        first = sdmgen.exact(shape, spacing=0.5)
        again = sdmgen.exact(shape, spacing=0.5, params={"shift": 1.2})
    assert len(told) == 1 and told[0].filename == __file__
    assert first.report.subtracted > 1 and np.isnan(again.report.subtracted)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert sdmgen.exact(sdmgen.Shape("torus"), spacing=1.0).report.subtracted == 0


def test_surfaces():
    mesh = sdmgen.Mesh(*ball(2.0, n=30))
    map = sdmgen.exact(mesh, spacing=0.1)
    surface = map.surface()
    assert not surface.cut and abs(surface.audit().volume - mesh.audit().volume) < 0.05
    assert sdmgen.surface(map, 0.5).audit().volume > surface.audit().volume
    assert sdmgen.Map(map.values[:10], sdmgen.Grid((*map.grid.size[:2], 10), map.spacing, map.origin)).surface().cut


def test_eight_threads(model):
    rows = model.defaults + np.random.default_rng(4).uniform(-0.05, 0.05, (64, 4)) * [1, 1, 0.1, 0]
    expected = [model(row).values for row in rows]
    mesh, x = sdmgen.Mesh(*ball()), np.random.default_rng(5).uniform(-2, 2, (50, 3))
    distances, wrong = mesh.distance(x), []

    def work(first):
        for i in range(first, 64, 8):
            try:
                with pytest.raises(sdmgen.RangeError, match=f"{100 + i}"):
                    model(a=100 + i)
                ok = np.array_equal(model(rows[i]).values, expected[i]) and np.array_equal(mesh.distance(x), distances)
            except BaseException as error:
                ok = error
            if ok is not True:
                wrong.append(ok)

    in_threads(8, work)
    assert not wrong


def test_ctrl_c_stops_an_exact_map():
    mesh, finished = sdmgen.Shape("cochlea").mesh(), False
    timer = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        timer.start()
        sdmgen.exact(mesh, size=(480, 480, 480), threads=1)
        finished = True
        time.sleep(60)
    assert not finished
    # the handler of before is back, and the mesh serves as before
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert sdmgen.exact(mesh, size=(5, 5, 5)).shape == (5, 5, 5)


def test_fork_after_use(model):
    """The child of a process that has used all threads computes the same."""
    expected = model(P, threads=4).values
    exact = sdmgen.exact(sdmgen.Shape("torus"), spacing=0.3, threads=4).values

    def child(queue):
        same_map = np.array_equal(model(P, threads=4).values, expected)
        same_exact = np.array_equal(sdmgen.exact(sdmgen.Shape("torus"), spacing=0.3, threads=4).values, exact)
        queue.put(same_map and same_exact)

    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(target=child, args=(queue,))
    process.start()
    assert queue.get(timeout=60) is True
    process.join(60)
    assert process.exitcode == 0
