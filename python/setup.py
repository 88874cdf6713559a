"""Builds the wheel with the shared libraries in it; pyproject.toml has the rest.

SDMGEN_LIBRARY names libsdmgen.so of the build that goes into the wheel, with its neighbours."""

import os
import re
import shutil
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py
from wheel.bdist_wheel import bdist_wheel

LIBRARIES = ("sdmgen", "sdmgen_image", "sdmgen_training", "sdmgen_vdb")


def version():
    text = (Path(__file__).parent / "sdmgen" / "_declarations.py").read_text()
    return ".".join(re.search(rf"SDM_VERSION_{part} = (\d+)", text)[1] for part in ("MAJOR", "MINOR"))


class BuildWithLibraries(build_py):
    def run(self):
        super().run()
        given = os.environ.get("SDMGEN_LIBRARY")
        if not given:
            raise SystemExit("setup.py: set SDMGEN_LIBRARY to the path of libsdmgen.so")
        folder = Path(given) if os.path.isdir(given) else Path(given).parent
        target = Path(self.build_lib) / "sdmgen" / "lib"
        target.mkdir(parents=True, exist_ok=True)
        for name in LIBRARIES:
            file = folder / f"lib{name}.so.{version()}"
            if file.exists():
                shutil.copy(file, target / file.name)
            elif name == "sdmgen":
                raise SystemExit(f"setup.py: {file} does not exist")


class WheelOfPlatform(bdist_wheel):
    """No extension module: one wheel serves all versions of Python 3."""

    def get_tag(self):
        return "py3", "none", super().get_tag()[2]


class BinaryDistribution(Distribution):
    def has_ext_modules(self):
        return True


setup(distclass=BinaryDistribution, cmdclass={"build_py": BuildWithLibraries, "bdist_wheel": WheelOfPlatform})
