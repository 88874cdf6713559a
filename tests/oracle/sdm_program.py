"""Runs the program in a temporary folder, for the scripts check_*.py: the first argument names the program."""

import os
import subprocess
import sys
import tempfile

program = sys.argv[1]
folder = tempfile.TemporaryDirectory()
os.chdir(folder.name)


def sdmgen(*arguments):
    return subprocess.run([program, *arguments], capture_output=True, text=True, errors="replace")


def done(*arguments):
    """What the program prints; it must succeed."""
    result = sdmgen(*arguments)
    assert result.returncode == 0, (arguments, result.stderr)
    return result.stdout


def refused(code, what, *arguments):
    """The program must end with this code, one line that holds `what`, and no file never.ssm."""
    result = sdmgen(*arguments)
    assert result.returncode == code, (arguments, result)
    assert result.stderr.count("\n") == 1 and what in result.stderr, (arguments, result.stderr)
    assert not os.path.exists("never.ssm"), arguments
