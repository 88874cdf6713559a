"""Shapes written in Python: exact maps, derivatives, training and fits through the table of the
library; their mistakes."""

import gc

import numpy as np
import pytest
from conftest import ball, in_threads

import sdmgen

CONFIG = """\
shape: {name: egg}
grid: {size: [16, 16, 20], spacing: 0.25}
network: {kind: pod, depth: 1, width: 16, rank: 8, modes: 16, degree: 2, input_degree: 2}
data: {static: 2, online: 0, start: 60, holdout: 8}
train: {steps: 60, batch: 16, refine: 0}
"""


def egg(radius, stretch):
    """a ball that is stretched along z"""
    return ball(radius, stretch)


def egg_velocity(radius, stretch):
    unit = ball(1.0, 1.0)[0]
    return np.stack([unit * [1, 1, stretch], unit * [0, 0, radius]])


PARAMS = [sdmgen.Param("radius", 0.8, 1.2, unit="mm"), sdmgen.Param("stretch", 1.0, 1.6, 1.2)]


def test_a_shape_in_python_is_a_shape():
    shape = sdmgen.Shape(egg, PARAMS)
    assert shape.name == "egg" and [p.default for p in shape.params] == [1.0, 1.2]
    mesh = shape.mesh(radius=1.1)
    vertices, triangles = egg(1.1, 1.2)
    assert np.array_equal(mesh.vertices, vertices) and np.array_equal(mesh.triangles, triangles)
    map = sdmgen.exact(shape, params={"radius": 1.1}, spacing=0.2, layers=["jacobian"])
    assert np.array_equal(map.values, sdmgen.exact((vertices, triangles), spacing=0.2).values)
    # the derivative along the radius: the change of the map; given velocities agree with differences
    with_velocity = sdmgen.Shape(egg, PARAMS, velocity=egg_velocity)
    assert np.abs(shape.velocity() - with_velocity.velocity()).max() < 1e-6
    moved = sdmgen.exact(with_velocity, map.grid, params={"radius": 1.101}).values
    outside = map.values > 0.2
    assert np.abs((moved - map.values)[outside] / 0.001 - map.jacobian[0][outside]).max() < 0.02
    with pytest.raises(sdmgen.UnsupportedError):
        shape.distance([0, 0, 0])
    with pytest.raises(sdmgen.RangeError, match="'radius' = 3"):
        shape.mesh(radius=3)


def test_measures():
    cochlea = sdmgen.Shape("cochlea", edge=1.0)
    found = {(m.name, m.depth): m for m in cochlea.measures(a=4.0, depths=[0, 90])}
    assert found["frequency", 0.0].value == pytest.approx(20677, abs=1) and found["frequency", 0.0].unit == "Hz"
    assert np.isnan(found["frequency", 90.0].value) and found["diameter_a", None].sd is None
    assert found["volume", None].value == pytest.approx(cochlea.mesh(a=4.0).audit().volume, rel=0.2)
    assert {name for name, _ in found} >= {"area", "extent_x", "extent_y", "extent_z", "length_wall", "turns"}
    egg_measures = sdmgen.Shape(egg, PARAMS).measures(radius=1.1)
    assert [m.name for m in egg_measures] == ["volume", "area", "extent_x", "extent_y", "extent_z"]
    assert egg_measures[4].value == pytest.approx(2.2 * 1.2)
    with pytest.raises(sdmgen.ArgumentError, match="no measure of a depth"):
        sdmgen.Shape("torus").measures(depths=[1])


def test_vertices_of_no_triangle_are_in_no_box():
    def spare(radius, stretch):
        vertices, triangles = egg(radius, stretch)
        return np.concatenate([vertices, [[500.0, 1, 2]]]), triangles

    shapes = [sdmgen.Shape(f, PARAMS) for f in (egg, spare)]
    phantoms = [sdmgen.phantom(shape, spacing=0.5) for shape in shapes]
    assert phantoms[0].image.grid.size == phantoms[1].image.grid.size
    points = shapes[0].mesh().vertices
    maps = [sdmgen.fit(shape, points, keep="pose").map() for shape in shapes]
    assert maps[0].grid.size == maps[1].grid.size


def test_names_options_and_distributions():
    assert "torus" in sdmgen.shapes() and "egg" not in sdmgen.shapes()
    box = sdmgen.Shape(lambda radius, stretch: egg(radius, stretch), PARAMS, name="egg_2", summary="an egg")
    assert repr(box) == "<Shape egg_2(radius, stretch)>"
    for name in ("<lambda>", "Egg", "2egg", ""):
        with pytest.raises(sdmgen.ArgumentError if name else sdmgen.ArgumentError):
            sdmgen.Shape(lambda radius: egg(radius, 1), PARAMS[:1], name=name or None)
    normal = sdmgen.Param("radius", 0.5, 1.5, mean=1.0, deviation=0.1)
    shape = sdmgen.Shape(egg, [normal, PARAMS[1]])
    assert shape.params[0].mean == 1.0 and shape.params[1].mean is None
    drawn = np.array([shape.random(seed)[0] for seed in range(300)])
    assert abs(drawn.mean() - 1) < 0.03 and abs(drawn.std() - 0.1) < 0.02
    torus = sdmgen.Shape("torus")
    inside = torus.distance([torus.defaults[0], 0, 0])
    assert inside == pytest.approx(-torus.defaults[1])


def test_objects_outlive_what_they_need(model, model_file):
    """Meshes, fields and shapes are used after the objects that they came from are gone."""
    for _ in range(20):
        fields = [sdmgen.Model(model_file).field(outside="exact") for _ in range(2)]
        shapes = [sdmgen.Shape(egg, PARAMS) for _ in range(2)] + [sdmgen.Model(model_file).shape]
        bands = [sdmgen.Shape("torus").mesh().report() for _ in range(2)]
        gc.collect()
        assert fields[0].sample([[9, 9, 9]]).distance > 3 and fields[1].grid(model.grid).shape == model.grid.shape
        assert len(shapes[0].mesh().vertices) > 100 and shapes[2].mesh().audit().closed and bands[0].sign


def fails(function, kind, text, cause=None):
    shape = sdmgen.Shape(function, [sdmgen.Param("a", 1, 2)], name="bad")
    with pytest.raises(kind) as caught:
        sdmgen.exact(shape)
    assert text in str(caught.value), caught.value
    if cause is not None:
        assert isinstance(caught.value.__cause__, cause)


def test_mistakes_of_mesh_functions():
    fails(lambda a: 1 / 0, sdmgen.ShapeError, "shape 'bad' at a=1.5: ZeroDivisionError", ZeroDivisionError)
    fails(lambda a, b: None, sdmgen.ShapeError, "TypeError", TypeError)
    fails(lambda a: None, sdmgen.ShapeError, "must return (vertices, triangles)")
    fails(lambda a: (np.zeros((3, 2)), [[0, 1, 2]]), sdmgen.ShapeError, "vertices: need an array of shape [n, 3]")
    fails(lambda a: (np.eye(3), [[0, 1, 2.5]]), sdmgen.ShapeError, "triangles: need integers")
    fails(lambda a: (np.eye(3), [[0, 1, 3]]), sdmgen.ShapeError, "3")
    fails(lambda a: (np.eye(3) * np.nan, [[0, 1, 2]]), sdmgen.ShapeError, "at a=1.5")

    def interrupted(a):
        raise KeyboardInterrupt

    shape = sdmgen.Shape(interrupted, [sdmgen.Param("a", 1, 2)])
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            shape.mesh()


def test_a_failure_belongs_to_its_call():
    """Eight threads, some of whose parameters fail."""

    def sometimes(a):
        if a > 1.5:
            raise LookupError(f"no mesh at {a}")
        return ball(a, n=6)

    shape, wrong = sdmgen.Shape(sometimes, [sdmgen.Param("a", 1, 2)]), []

    def work(k):
        for i in range(25):
            a = 1 + ((7 * i + k) % 20) / 20
            try:
                size = abs(shape.mesh(a=a).vertices).max()
                if a > 1.5 or not np.isclose(size, a):
                    wrong.append(a)
            except sdmgen.ShapeError as error:
                if a <= 1.5 or f"no mesh at {a}" not in error.text:
                    wrong.append(error)

    in_threads(8, work)
    assert not wrong


def test_training_and_fit(tmp_path):
    config = tmp_path / "egg.yaml"
    config.write_text(CONFIG)
    shape, seen = sdmgen.Shape(egg, PARAMS), []
    result = sdmgen.train(config, {"seed": 3}, out=tmp_path / "run", shape=shape, progress=seen.append)
    assert seen and seen[-1].phase == "evaluate" and result.maps >= 60 and result.grade in ("good", "usable", "poor")
    model = result.model
    assert model.shape is shape and model.accuracy == result.accuracy and model.accuracy.rmse_mm < 0.05
    # a model whose grid cuts its shapes is loaded with a warning
    small = {"grid": {"size": [8, 8, 8], "spacing": 0.2}, "train.steps": 5}
    with pytest.warns(UserWarning, match=r"its grid cuts [0-9]+ % of the shapes") as caught:
        cut = sdmgen.train(config, small, out=tmp_path / "cut", shape=shape).model
    assert cut.quality.cut > 0.05 and caught[0].filename == __file__
    assert cut({"radius": 1, "stretch": 1.2}).info.cut
    p = {"radius": 0.9, "stretch": 1.4}
    assert np.abs(model(p).values - sdmgen.exact(shape, model.grid, params=p).values).max() < 0.2
    # policy exact and checks call the function
    assert model(p, policy="exact", check=True).info.check.max < 0.2
    points = shape.mesh(p).vertices + [0.1, -0.1, 0.05]
    fitted = sdmgen.fit(model, points, rotation=(0, 0, 0))
    assert abs(fitted.values["radius"] - 0.9) < 0.05 and abs(fitted.values["stretch"] - 1.4) < 0.08
    assert np.abs(fitted.pose.translation - [0.1, -0.1, 0.05]).max() < 0.03
    with pytest.raises(sdmgen.ArgumentError, match="holds a trained model"):
        sdmgen.train(config, out=tmp_path / "run", shape=shape)

    def stop(_state):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sdmgen.train(config, out=tmp_path / "other", shape=shape, progress=stop)
    assert not (tmp_path / "other" / "model.sdm").exists()
    with pytest.raises(sdmgen.ConfigError, match="unknown shape 'egg'"):
        sdmgen.train(config, out=tmp_path / "third")

    def broken(radius, stretch):
        raise LookupError("no such egg")

    with pytest.raises(sdmgen.Error, match="no such egg"):
        sdmgen.train(config, out=tmp_path / "fourth", shape=sdmgen.Shape(broken, PARAMS, name="egg"))


def test_help_texts():
    for kind in (sdmgen.Model, sdmgen.Shape):
        assert "parameters in their order" in kind.params.__doc__
