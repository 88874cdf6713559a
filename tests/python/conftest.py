"""What the tests of the Python package share: the program, and a small trained model.

The environment names the build: SDMGEN_LIBRARY (libsdmgen.so), SDMGEN_PROGRAM (the program sdmgen),
PYTHONPATH (the folder of the package)."""

import os
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest

import sdmgen

SOURCE = Path(__file__).resolve().parents[2]
PROGRAM = os.environ["SDMGEN_PROGRAM"]


def sdmgen_program(*arguments, code=0):
    """Runs the program; returns what it prints."""
    words = [PROGRAM, *map(str, arguments), "--quiet"]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    return done.stdout


@pytest.fixture(scope="session")
def run():
    return sdmgen_program


@pytest.fixture(scope="session")
def model_file(tmp_path_factory):
    """A network that trains in seconds."""
    folder = tmp_path_factory.mktemp("run")
    sdmgen_program("train", SOURCE / "tests/cli/tiny.yaml", "--out", folder)
    return folder / "model.sdm"


@pytest.fixture(scope="session")
def model(model_file):
    return sdmgen.Model(model_file)


def in_threads(n, work):
    """Calls work(0) .. work(n - 1) at the same time; returns when all have returned."""
    threads = [threading.Thread(target=work, args=(i,)) for i in range(n)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def ball(radius=1.0, stretch=1.0, n=12):
    """A closed mesh of a ball that is stretched along z."""
    polar, turn = np.linspace(0, np.pi, n + 1)[1:-1], 2 * np.pi * np.arange(2 * n) / (2 * n)
    ring = np.array([[np.sin(t) * np.cos(f), np.sin(t) * np.sin(f), np.cos(t)] for t in polar for f in turn])
    vertices = radius * np.concatenate([ring, [[0, 0, 1], [0, 0, -1]]]) * [1, 1, stretch]
    m, top, bottom, triangles = 2 * n, len(ring), len(ring) + 1, []
    for j in range(m):
        k = (j + 1) % m
        triangles += [[top, j, k], [bottom, (n - 2) * m + k, (n - 2) * m + j]]
        for i in range(n - 2):
            a, b, c, d = i * m + j, i * m + k, (i + 1) * m + j, (i + 1) * m + k
            triangles += [[a, c, b], [b, c, d]]
    return vertices, np.array(triangles)
