"""Fits and training: the numbers are those of the program."""

import json
import warnings

import numpy as np
import pytest
from conftest import SOURCE, ball

import sdmgen


@pytest.fixture(scope="module")
def ct(run, tmp_path_factory):
    """An image of a torus, its labels and the truth."""
    folder = tmp_path_factory.mktemp("ct")
    files = {name: folder / name for name in ("ct.nii.gz", "label.nii.gz", "truth.json")}
    words = ["-p", "major=2.6", "--spacing", "0.5", "--translation", "0.2,0.1,-0.1", "--seed", "5"]
    outputs = ["-o", files["ct.nii.gz"], "--label", files["label.nii.gz"], "--truth", files["truth.json"]]
    run("phantom", "--shape", "torus", *words, *outputs)
    return files


def compare(result, text):
    told = json.loads(text)
    assert list(told["parameters"].values()) == list(result.params)
    assert list(told["parameters_sd"].values()) == list(result.sd[: len(result.params)])
    assert told["pose"]["rotation_rad"] == list(result.pose.rotation)
    assert told["pose"]["translation_mm"] == list(result.pose.translation)
    assert np.array_equal(told["covariance"], result.cov)
    assert told["unknowns"] == list(result.unknowns)
    assert told["iterations"] == result.iterations and told["used"] == result.used
    assert told["log_likelihood"] == result.log_likelihood
    assert told["not_determined_motions"] == result.open_motions and told.get("outliers", 0) == result.outliers
    if result.open_motions:
        assert told["pose"]["rotation_sd_determined_rad"] == list(result.pose_sd_determined[:3])
        assert told["pose"]["translation_sd_determined_mm"] == list(result.pose_sd_determined[3:])
    assert told["verdict"]["grade"] == result.verdict
    # the program also fits the mirror image
    told_checks = [c for c in told["verdict"]["checks"] if c["name"] != "mirror image"]
    figures = [float("nan") if c["figure"] is None else c["figure"] for c in told_checks]
    checks = [
        (c["name"], c["grade"], pytest.approx(figure, nan_ok=True))
        for c, figure in zip(told_checks, figures)
    ]
    assert [(f.check, f.grade, f.figure) for f in result.findings] == checks
    assert not any("sdm_" in f.text for f in result.findings)
    if "overlap" in told:
        assert told["overlap"]["dice"] == pytest.approx(result.dice, abs=1e-12)


def compare_measures(result, text):
    told = json.loads(text)["measures"]
    found = [{"name": m.name, "value": m.value, "sd": m.sd, "unit": m.unit, "not_determined": m.not_determined} for m in result.measures()]
    assert found == told and [m["name"] for m in told][:2] == ["volume", "area"] and all(m["sd"] > 0 for m in told)


def test_an_open_end(run, ct, tmp_path):
    image = tmp_path / "ear.nii"
    run("phantom", "--shape", "cochlea", "--spacing", "0.6", "-o", image)
    words = ["-O", "ear=right", "--open-end", "--keep", "parameters", "--rotation", "0,0,0", "--spacing", "0.6", "--mirror", "no", "--json"]
    told = run("fit", "--shape", "cochlea", image, *words)
    named = {"keep": "parameters", "rotation": (0, 0, 0), "spacing": 0.6, "open_end": True}
    result = sdmgen.fit(sdmgen.Shape("cochlea"), image, **named)
    compare(result, told)
    assert result.beyond_open_end == json.loads(told)["beyond_open_end"] > 50
    with pytest.raises(sdmgen.ArgumentError, match="states no open end"):
        sdmgen.fit(sdmgen.Shape("torus"), ct["ct.nii.gz"], rotation=(0, 0, 0), open_end=True)


def test_an_image(run, ct):
    words = ["--rotation", "0,0,0", "--spacing", "0.5", "--threads", "1", "--reference", ct["label.nii.gz"], "--measure", "--json"]
    told = run("fit", "--shape", "torus", ct["ct.nii.gz"], *words)
    seen = []
    shape = sdmgen.Shape("torus")
    named = {"rotation": (0, 0, 0), "spacing": 0.5, "threads": 1, "reference": ct["label.nii.gz"]}
    result = sdmgen.fit(shape, sdmgen.read(ct["ct.nii.gz"]), **named, progress=seen.append)
    compare(result, told)
    compare_measures(result, told)
    assert "rotation about the axis" in result.open_motions and result.pose_sd_determined[2] < 0.1 < result.sd[4]
    assert abs(result.values["major"] - 2.6) < 0.1 and result.dice > 0.9 and result.evidence > 0
    phases = [s.phase for s in seen]
    rivals = [s.start for s in seen if s.phase == "judge"]
    assert len(seen) >= result.iterations and seen[0].params.shape == (2,)
    assert phases[-len(rivals) - 1] == "fit" and rivals == list(range(len(rivals))) and 1 < len(rivals) <= seen[-1].starts + 1
    assert abs(result.surface().audit().volume - shape.mesh(result.values).audit().volume) < 3
    map = result.map(sdmgen.read(ct["ct.nii.gz"]).grid)
    assert map.grid == sdmgen.read(ct["ct.nii.gz"]).grid and map.values.min() < 0

    def stop(_state):
        raise StopIteration("enough")

    with pytest.raises(StopIteration, match="enough"):
        sdmgen.fit(shape, ct["ct.nii.gz"], **named, progress=stop)


def test_labels_and_points(run, ct, tmp_path):
    words = ["--label", "1", "--start-axis", "0,0,1", "--turns", "1", "--spacing", "0.6", "--threads", "1", "--json"]
    shape = sdmgen.Shape("torus")
    result = sdmgen.fit(shape, ct["label.nii.gz"], label=1, start_axis=(0, 0, 1), turns=1, spacing=0.6, threads=1)
    compare(result, run("fit", "--shape", "torus", ct["label.nii.gz"], *words))
    assert result.dice > 0.9
    finer = result.advised_voxel_mm
    assert 0.2 < finer < 0.6
    result = sdmgen.fit(shape, ct["label.nii.gz"], label=1, rotation=(0, 0, 0), spacing=finer, threads=1)
    assert np.isnan(result.advised_voxel_mm) and result.verdict == "passed"
    mesh = sdmgen.Shape("torus", edge=0.5).mesh(major=2.4)
    mesh.write(tmp_path / "torus.ply")
    np.save(tmp_path / "points.npy", mesh.vertices)
    lines = [f"{i},{z!r}, {x!r},{y!r}" for i, (x, y, z) in enumerate(mesh.vertices.tolist())]
    (tmp_path / "points.csv").write_text("\n".join(["\ufeff# points", "name,Z,x,y", "", *lines, ""]), encoding="utf-8")
    words = ["--rotation", "0.1,0,0", "--spacing", "0.8", "--threads", "1", "--keep", "appearance", "--json"]
    told = run("fit", "--shape", "torus", tmp_path / "torus.ply", *words)
    for target in (mesh, tmp_path / "torus.ply"):
        compare(sdmgen.fit(shape, target, rotation=(0.1, 0, 0), spacing=0.8, threads=1, keep="appearance"), told)
    told = run("fit", "--shape", "torus", tmp_path / "points.npy", *words)
    for target in (mesh.vertices, tmp_path / "points.npy", tmp_path / "points.csv"):
        compare(sdmgen.fit(shape, target, rotation=(0.1, 0, 0), spacing=0.8, threads=1, keep="appearance"), told)
    kept = sdmgen.fit(shape, mesh, params={"major": 2.4}, rotation=(0.1, 0, 0), keep=["major"], threads=1)
    assert kept.params[0] == 2.4 and kept.sd[0] == 0 < kept.sd[1]


def test_labels_without_label(ct):
    shape, label = sdmgen.Shape("torus"), sdmgen.read(ct["label.nii.gz"])
    named = {"rotation": (0, 0, 0), "spacing": 0.8, "max_iterations": 1}
    for values in (label.values, label.values.astype(np.uint8)):
        image = sdmgen.Image(values, label.grid)
        with pytest.raises(ValueError, match="holds only the values 0, 1, as labels do: give label= .*, e.g. label=1, or several"):
            sdmgen.fit(shape, image, **named)
        with pytest.warns(UserWarning, match="only 2 different values, 0 to 1: if it is a label map, give label="):
            with pytest.raises(sdmgen.QualityError):
                sdmgen.fit(shape, image, **named, inside=(0, 0.3), outside=(1, 0.3))
    for target, more in ((ct["ct.nii.gz"], {}), (label, {"label": 1})):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises(sdmgen.QualityError):
                sdmgen.fit(shape, target, **named, **more)


def test_mistakes_of_tables(tmp_path):
    file, shape = tmp_path / "points.csv", sdmgen.Shape("torus")
    for text, told in (
        ("a,b,c\n1,2,3\n", "points.csv:1: the header (a,b,c) must name one column each x, y and z, in mm"),
        ("x,y,z,x\n1,2,3,4\n", "points.csv:1: the header (x,y,z,...) must name"),
        ("x;y;z\n1;2;3\n", "a decimal number has a point: 0.5,1,2"),
        ("x,y,z\n1,2,3\n1,2\n", "points.csv:3: 2 values, a line needs three: x,y,z (mm)"),
        ("x,y,z,w\n1,2,3\n", "points.csv:2: 3 values, the header names 4 columns"),
        ("1,2,3\n\n1,nan,2\n", "points.csv:3: 'nan' is not a finite number; a line is x,y,z"),
        ("x,y,z\n", "points.csv: no points"),
    ):
        file.write_text(text)
        with pytest.raises(sdmgen.FormatError) as caught:
            sdmgen.fit(shape, file)
        assert told in str(caught.value), caught.value
    with pytest.raises(sdmgen.FileError, match="no such|No such"):
        sdmgen.fit(shape, tmp_path / "none.csv")
    with pytest.raises(sdmgen.ArgumentError, match="must end in .* .csv"):
        sdmgen.fit(shape, tmp_path / "points.txt")


def test_a_network(run, model, model_file, tmp_path):
    mesh = sdmgen.Shape("cochlea", edge=1.0).mesh(a=4.2)
    mesh.write(tmp_path / "cochlea.ply")
    words = ["--rotation", "0,0,0", "--max-iterations", "30", "--prior-sd", "1", "--threads", "1", "--json"]
    told = run("fit", model_file, tmp_path / "cochlea.ply", *words)
    compare(sdmgen.fit(model, mesh, rotation=(0, 0, 0), max_iterations=30, prior_sd=1, threads=1), told)


def test_a_fit_that_is_not_to_be_trusted(ct):
    image = sdmgen.read(ct["ct.nii.gz"])
    flat = sdmgen.Image(np.full_like(image.values, 3.0), image.grid)
    with pytest.raises(sdmgen.QualityError):
        sdmgen.fit(sdmgen.Shape("torus"), flat, rotation=(0, 0, 0), spacing=0.8)
    with pytest.raises(sdmgen.QualityError, match="not converged") as caught:
        sdmgen.fit(sdmgen.Shape("torus"), image, rotation=(0, 0, 0), spacing=0.8, max_iterations=1)
    assert caught.value.result.iterations >= 1 and caught.value.result.params.shape == (2,)


def test_mistakes(model, ct):
    shape = sdmgen.Shape("torus")
    for text, arguments, named in (
        ("need a Model or a Shape", (3, ct["ct.nii.gz"]), {}),
        ("a model has its own grid", (model, ct["ct.nii.gz"]), {"spacing": 0.3}),
        ("exact from the start", (shape, ct["ct.nii.gz"]), {"polish": True}),
        ("one of rotation", (shape, ct["ct.nii.gz"]), {"rotation": (0, 0, 0), "start_axis": (0, 0, 1)}),
        ("a rotation vector in rad", (shape, ct["ct.nii.gz"]), {"rotation": (0, 0, 180)}),
        ("one of turns", (shape, ct["ct.nii.gz"]), {"turns": 3, "turns_sphere": 4}),
        ("leave nothing to fit", (shape, ct["ct.nii.gz"]), {"keep": ["pose", "parameters"]}),
        ("keep: need one of", (shape, ct["ct.nii.gz"]), {"keep": "poses"}),
        ("a standard deviation above 0", (shape, ct["ct.nii.gz"]), {"inside": (40, 0)}),
        ("label: it applies to images", (shape, ball()[0]), {"label": 1}),
        ("label 'bone'", (shape, ct["label.nii.gz"]), {"label": "bone"}),
        ("no voxel has the label 7", (shape, ct["label.nii.gz"]), {"label": 7}),
        ("points: need an array of shape", (shape, [1, 2, 3]), {}),
        ("3 or more", (shape, np.zeros((2, 3))), {}),
        ("unknown parameter 'x'", (shape, ball()[0]), {"params": {"x": 1}}),
        ("'major' = 9", (shape, ball()[0]), {"params": {"major": 9}}),
    ):
        with pytest.raises(sdmgen.Error) as caught:
            sdmgen.fit(*arguments, **named)
        assert text in str(caught.value), caught.value


def test_phantoms(run, ct):
    truth = json.loads(ct["truth.json"].read_text())
    pose = sdmgen.Pose(translation=(0.2, 0.1, -0.1))
    made = sdmgen.phantom(sdmgen.Shape("torus"), {"major": 2.6}, pose=pose, spacing=0.5, seed=5)
    image, label = sdmgen.read(ct["ct.nii.gz"]), sdmgen.read(ct["label.nii.gz"])
    assert made.image.grid.size == image.grid.size and np.allclose(made.image.origin, image.origin, atol=1e-4)
    assert np.array_equal(np.clip(np.round(made.image.values), -32768, 32767), image.values) or (
        np.abs(made.image.values - image.values).max() <= 0.5
    )
    assert np.array_equal(made.label.values, label.values) and truth["parameters"]["major"] == 2.6


def test_a_training_is_that_of_the_program(model_file, tmp_path):
    result = sdmgen.train(SOURCE / "tests/cli/tiny.yaml", out=tmp_path / "run")
    assert (tmp_path / "run/model.sdm").read_bytes()[:-8] == model_file.read_bytes()[:-8] or (
        # the seconds of the training differ
        np.array_equal(result.model().values, sdmgen.Model(model_file)().values)
    )
    assert result.steps == 60 and result.path == str(tmp_path / "run/model.sdm")
    with pytest.raises(sdmgen.ConfigError, match="did you mean 'network.depth'"):
        sdmgen.train(SOURCE / "tests/cli/tiny.yaml", ["network.dpth=3"], out=tmp_path / "other")
