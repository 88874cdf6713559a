#!/usr/bin/env bash
# Segmentations of 3D Slicer as outputs: read back by this program and by a reader of its own (Python: header and gzip), and by teem's unu
# where it is installed.
# Tests: output.c
. "$(dirname "$0")/common.sh"

expect 0 - sdmgen exact --shape ellipsoid --spacing 0.3 -o map.nrrd -o inside.seg.nrrd
expect 0 - sdmgen phantom --shape ellipsoid --spacing 0.5 --seed 1 --label label.seg.nrrd
sdmgen info label.seg.nrrd | grep -q ellipsoid || bad 'the labels of a phantom have no segment'
cat >read.py <<'PYTHON'
import gzip, struct, sys

def read(path):
    head, data = open(path, "rb").read().split(b"\n\n", 1)
    lines = head.decode("utf-8").split("\n")
    assert lines[0] == "NRRD0005", lines[0]
    fields = dict(line.split(": ", 1) for line in lines[1:] if ": " in line and ":=" not in line)
    keys = dict(line.split(":=", 1) for line in lines[1:] if ":=" in line)
    sizes = [int(n) for n in fields["sizes"].split()]
    kind = {"float": "f", "unsigned char": "B"}[fields["type"]]
    count = sizes[0] * sizes[1] * sizes[2]
    return sizes, keys, fields, struct.unpack("<%d%s" % (count, kind), gzip.decompress(data))

sizes, _, where, distances = read("map.nrrd")
of_labels, keys, there, labels = read("inside.seg.nrrd")
# the description says what the voxels hold; shape and parameters are the same
text, of_map = there["content"], where["content"]
assert ": labels, 1 inside, 0 outside; exact: ellipsoid " in text and ": mm, negative inside; exact: ellipsoid " in of_map, (text, of_map)
assert text.split("; ")[1:] == of_map.split("; ")[1:], (text, of_map)
assert sizes == of_labels and all(where[k] == there[k] for k in ("space directions", "space origin"))
assert [d < 0 for d in distances] == [bool(v) for v in labels] and max(labels) == 1
assert keys["Segment0_Name"] == keys["Segment0_ID"] == "ellipsoid" and keys["Segment0_LabelValue"] == "1"
assert len(keys["Segment0_Color"].split()) == 3 and all(0 <= float(v) <= 1 for v in keys["Segment0_Color"].split())
assert keys["Segment0_Tags"].startswith("TerminologyEntry:") and keys["Segment0_Tags"].count("~") == 6
inside = [(i % sizes[0], i // sizes[0] % sizes[1], i // sizes[0] // sizes[1]) for i, v in enumerate(labels) if v]
assert len(inside) > 1000
box = [f(p[a] for p in inside) for a in range(3) for f in (min, max)]
assert [int(v) for v in keys["Segment0_Extent"].split()] == box, (keys["Segment0_Extent"], box)
PYTHON
python3 read.py || bad 'the segmentation, read by Python'
expect 0 - sdmgen info inside.seg.nrrd
has 'ellipsoid'
expect 0 - sdmgen verify inside.seg.nrrd
if unu=$(command -v unu || command -v teem-unu); then
    "$unu" head inside.seg.nrrd >head.txt 2>&1 || bad "unu head: $(cat head.txt)"
    grep -q 'Segment0_Name:=ellipsoid' head.txt || bad 'unu head: no name of the segment'
    "$unu" minmax inside.seg.nrrd | grep -q 'max: 1' || bad 'unu minmax'
fi
# a segmentation without voxels is not written
sdmgen exact --shape ellipsoid --size 5,5,5 --spacing 0.1 --origin 50,50,50 -o none.seg.nrrd >out 2>err
[ $? -eq 2 ] || bad 'a segmentation without voxels has another exit code than 2'
grep -q "no voxel belongs to the segment 'ellipsoid'" err || bad "a segmentation without voxels: $(cat err)"
absent none.seg.nrrd
finish
