"""The wheel: built without a network, it works without the build folder, the sources and their
environment."""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from conftest import SOURCE

pytest.importorskip("setuptools")
pytest.importorskip("wheel")

SCRIPT = """
import sys, numpy as np, sdmgen
model = sdmgen.Model(sys.argv[1])
sdmgen.write("map.nii.gz", model())
assert np.array_equal(sdmgen.read("map.nii.gz").values, model().values)
sdmgen.exact(sdmgen.Shape("torus"), spacing=0.5)
try:
    sdmgen.train("no-such.yaml")
except sdmgen.FileError:
    pass
used = [line.split()[-1] for line in open("/proc/self/maps") if "libsdmgen" in line]
print(model().values.tobytes().hex()[:64], sdmgen.__file__, *sorted(set(used)))
"""


def built(folder, code, **environment):
    """Calls the builder of setuptools in a copy of the sources."""
    copy = folder / "source"
    shutil.copytree(SOURCE / "python", copy, ignore=shutil.ignore_patterns("__pycache__", "build", "*.egg-info"))
    words = [sys.executable, "-c", f"from setuptools import build_meta as b; {code}"]
    plain = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "SDMGEN_LIBRARY")}
    return subprocess.run(words, cwd=copy, env={**plain, **environment}, capture_output=True, text=True)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    done = built(folder, "b.build_wheel('..')", SDMGEN_LIBRARY=os.environ["SDMGEN_LIBRARY"])
    assert done.returncode == 0, done.stdout + done.stderr
    (file,) = folder.glob("*.whl")
    return file


def test_its_content(wheel):
    assert wheel.name.startswith("sdmgen-0.1.0-py3-none-linux_") and wheel.stat().st_size < 20e6
    names = zipfile.ZipFile(wheel).namelist()
    for name in ("sdmgen/py.typed", "sdmgen/lib/libsdmgen.so.0.1", "sdmgen/lib/libsdmgen_image.so.0.1",
                 "sdmgen/lib/libsdmgen_training.so.0.1", "sdmgen/torch/__init__.py"):  # fmt: skip
        assert name in names
    assert not [n for n in names if n.startswith("declarations") or "__pycache__" in n]


def test_it_works_alone(wheel, model_file, tmp_path):
    venv = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--system-site-packages", "--without-pip", venv], check=True)
    python = venv / "bin/python"
    place = "import sysconfig; print(sysconfig.get_path('purelib'))"
    site = Path(subprocess.run([python, "-c", place], check=True, capture_output=True, text=True).stdout.strip())
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--no-index", "--no-deps", "-q", wheel]
    if subprocess.run([sys.executable, "-m", "pip", "--version"], capture_output=True).returncode == 0:
        subprocess.run(pip, check=True)
    else:
        zipfile.ZipFile(wheel).extractall(site)
    shutil.copy(model_file, tmp_path / "model.sdm")
    plain = {"PATH": "/usr/bin:/bin", "LANG": "C.UTF-8"}
    done = subprocess.run(
        [python, "-c", SCRIPT, "model.sdm"], cwd=tmp_path, env=plain, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    values, package, *libraries = done.stdout.split()
    import sdmgen

    assert values == sdmgen.Model(model_file)().values.tobytes().hex()[:64]
    assert package.startswith(str(site)) and len(libraries) == 3
    assert all(file.startswith(str(site / "sdmgen/lib")) for file in libraries), libraries


def test_the_source_archive(tmp_path):
    done = built(tmp_path, "b.build_sdist('..')")
    assert done.returncode == 0, done.stderr
    (file,) = tmp_path.glob("*.tar.gz")
    names = tarfile.open(file).getnames()
    for name in ("setup.py", "pyproject.toml", "sdmgen/_declarations.py", "sdmgen/torch/_networks.py", "sdmgen/py.typed"):
        assert f"sdmgen-0.1.0/{name}" in names
    assert not [name for name in names if name.endswith(".so")]


def test_without_a_library(tmp_path):
    done = built(tmp_path, "b.build_wheel('..')")
    assert done.returncode != 0 and "set SDMGEN_LIBRARY to the path of libsdmgen.so" in done.stderr + done.stdout
    plain = {"PATH": "/usr/bin:/bin", "PYTHONPATH": str(SOURCE / "python"), "PYTHONDONTWRITEBYTECODE": "1"}
    words = [sys.executable, "-c", "import sdmgen; sdmgen.Shape('torus')"]
    done = subprocess.run(words, env=plain, cwd=tmp_path, capture_output=True, text=True)
    if done.returncode:  # no library is installed on this system
        assert "ImportError: libsdmgen.so.0.1 cannot be loaded" in done.stderr and "set SDMGEN_LIBRARY" in done.stderr
