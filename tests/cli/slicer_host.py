"""A host that calls modules as 3D Slicer does: reads the description beside a module, builds the command
line from it, runs the module, and parses progress, results and files.

    python3 slicer_host.py FOLDER MODULE NAME=VALUE ...

Values of names in the description; files by their path. Rules of Slicer: numbers and enumerations are
always passed; texts, vectors and files only where they are not empty; booleans without a value; results
are read from a file. Prints the results and what the files hold as lines. Needs nibabel and VTK.
"""

import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

ALWAYS = {"integer", "float", "double", "string-enumeration", "integer-enumeration", "double-enumeration"}
FILES = {"image", "geometry", "file", "table", "transform"}


def modules(folder):
    """Names of the modules: executables without a dot in their name."""
    return sorted(p.name for p in Path(folder).iterdir() if "." not in p.name and os.access(p, os.X_OK))


def description(folder, name):
    """The parameters of a module: the file beside it, else its own answer."""
    beside = Path(folder) / f"{name}.xml"
    if beside.exists():
        text = beside.read_text()
    else:
        done = subprocess.run([Path(folder) / name, "--xml"], capture_output=True, text=True, timeout=5, check=True)
        assert not done.stderr, done.stderr
        text = done.stdout
    assert text.startswith("<?xml"), text[:20]
    return [p for group in ElementTree.fromstring(text.encode()).findall("parameters") for p in group
            if p.tag not in ("label", "description")]  # fmt: skip


def of(parameter, tag):
    return parameter.findtext(tag) or ""


def command_line(folder, name, parameters, values, returns):
    """What Slicer runs."""
    line = [str(Path(folder) / name), "--returnparameterfile", returns]
    known = {of(p, "name") for p in parameters}
    assert set(values) <= known, f"no parameters {set(values) - known} in {name}"
    for p in parameters:
        flag, value = of(p, "longflag"), values.get(of(p, "name"), of(p, "default"))
        if not flag:
            continue
        if p.tag == "boolean":
            line += [f"--{flag}"] if value == "true" else []
        elif p.tag in ALWAYS or value:
            line += [f"--{flag}", value]
    return line


def run(line):
    """Runs the module; returns its exit code and the fractions of its progress."""
    done = subprocess.run(line, stdout=subprocess.PIPE, text=True)
    begin, end = "<filter-progress>", "</filter-progress>"
    fractions = [float(t[len(begin) : t.index(end)]) for t in done.stdout.splitlines() if t.startswith(begin)]
    return done.returncode, fractions


def read_results(path, parameters):
    """name = value, for the names of output parameters."""
    wanted = {of(p, "name") for p in parameters if of(p, "channel") == "output" and p.tag not in FILES}
    results = dict(line.split(" = ", 1) if " = " in line else (line.split(" =")[0], "") for line in Path(path).read_text().splitlines())
    assert set(results) == wanted, set(results) ^ wanted
    return results


def describe_file(path):
    """What nibabel or VTK reads from a file."""
    if path.endswith((".nii", ".nii.gz")):
        import nibabel

        image = nibabel.load(path)
        values = image.get_fdata()
        return f"{values.shape} {values.min():.3f} {values.max():.3f} {(values > 0).sum()}"
    import vtk

    if path.endswith(".nrrd"):
        vtk.vtkObjectFactory.SetAllEnableFlags(False, "vtkNrrdReader")  # not the one that needs MPI
        reader = vtk.vtkNrrdReader()
        reader.SetFileName(path)
        reader.Update()
        low, high = reader.GetOutput().GetScalarRange()
        return f"{reader.GetOutput().GetDimensions()} {low:.3f} {high:.3f}"
    reader = vtk.vtkXMLPolyDataReader() if path.endswith(".vtp") else vtk.vtkPLYReader()
    reader.SetFileName(path)
    reader.Update()
    mass = vtk.vtkMassProperties()
    mass.SetInputData(reader.GetOutput())
    return f"{reader.GetOutput().GetNumberOfPoints()} points, volume {mass.GetVolume():.3f}"


def main():
    folder, name = sys.argv[1:3]
    values = dict(word.split("=", 1) for word in sys.argv[3:])
    print("modules", *modules(folder))
    parameters = description(folder, name)
    with tempfile.TemporaryDirectory() as scratch:
        returns = str(Path(scratch) / "1_a.params")
        code, fractions = run(command_line(folder, name, parameters, values, returns))
        print("progress", len(fractions), *([f"{fractions[-1]:g}"] if fractions else []))
        assert fractions == sorted(fractions) or name == "SdmgenFit", fractions
        if code == 0:
            for key, value in read_results(returns, parameters).items():
                print(f"{key}: {value}")
    for p in parameters:
        path = values.get(of(p, "name"), "")
        if p.tag in ("image", "geometry") and of(p, "channel") == "output" and path and code == 0:
            print(f"file {of(p, 'name')}: {describe_file(path)}")
    sys.exit(code)


main()
