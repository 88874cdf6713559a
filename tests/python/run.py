"""Runs a file of tests by pytest, or a script with its arguments; exits with 77 where a module that they
need is not installed."""

import runpy
import sys
from pathlib import Path

try:
    import numpy  # noqa: F401
    import pytest
except ImportError as reason:
    print(f"skipped: {reason}")
    sys.exit(77)

file = Path(__file__).resolve().parent / sys.argv[1]
if file.name.startswith("test_"):
    code = pytest.main(["-q", "-p", "no:cacheprovider", str(file)])
    sys.exit(int(code))
sys.argv = [str(file), *sys.argv[2:]]
runpy.run_path(str(file), run_name="__main__")
