"""The example scripts run as they are and draw pictures where matplotlib is installed."""

import importlib.util
import subprocess
import sys

import pytest
from conftest import SOURCE

FOLDER = SOURCE / "examples/python"


@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.py")))
def test_example(name, model_file, tmp_path):
    words = [sys.executable, FOLDER / f"{name}.py"]
    if name in ("torch_fit", "first_network"):
        pytest.importorskip("torch")
        words.append(model_file if name == "torch_fit" else "0.02")
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    pictures = list(tmp_path.glob("*.png"))
    if importlib.util.find_spec("matplotlib"):
        assert done.returncode == 0, done.stderr
        assert [p.name for p in pictures] == [f"{name}.png"] and pictures[0].stat().st_size > 10000
    else:
        assert "no picture" in done.stderr and not pictures
    assert len(done.stdout.splitlines()) >= 2
