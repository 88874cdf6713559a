"""mypy --strict finds nothing in the package and in a script of a user."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy")
PACKAGE = Path(__file__).resolve().parents[2] / "python"

SCRIPT = """\
import numpy as np
import sdmgen

model = sdmgen.Model("model.sdm")
map = model(a=4.2, policy="clamp")
low: float = float(map.values.min())
volume: float = map.surface().audit().volume
slopes: np.ndarray[tuple[int, ...], np.dtype[np.float32]] = model.jacobian({"a": 4.2}).values
points = sdmgen.exact_points(sdmgen.Shape("torus"), [[0.0, 0.0, 0.0]])
distance: float = float(points.distance[0])
result = sdmgen.fit(model, map, label=1, start_axis=(0, 0, 1))
dice: float = result.dice
"""


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


def mypy(cache, *files):
    words = [sys.executable, "-m", "mypy", "--strict", "--config-file", PACKAGE / "pyproject.toml", "--cache-dir", cache]
    return subprocess.run([*words, *files], capture_output=True, text=True, cwd=PACKAGE)


def test_the_package(cache):
    done = mypy(cache, "sdmgen", "declarations.py")
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_script(cache, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    done = mypy(cache, script)
    assert done.returncode == 0, done.stdout + done.stderr
    script.write_text(SCRIPT.replace("result.dice", "result.dices").replace("model(a=4.2", "model(grid=4.2"))
    done = mypy(cache, script)
    assert '"dices"' in done.stdout and "grid" in done.stdout and "Found 2 errors" in done.stdout
