"""check_container.py PROGRAM GOLDEN_FOLDER: a reader of model files in Python, written from docs/model-file.md, and the program's own one
judge the same files alike: those that the program has written, every wrong bit of a header, cut files, and files whose checksums are right
and whose numbers are not. Tests: container.c"""
import pathlib
import struct
import subprocess
import sys
import tempfile

try:
    import numpy  # noqa: F401 (of sdm_file)
except ImportError:
    sys.exit(77)
import sdm_file

ENTRY_0 = sdm_file.HEADER.size


def put(data, form, at, value):
    data = bytearray(data)
    struct.pack_into(form, data, at, value)
    return sdm_file.sealed(data)


def cases(data):
    """Pairs of a name and the bytes of a file."""
    count = struct.unpack_from("<I", data, 12)[0]
    table_end = ENTRY_0 + 48 * count
    yield "whole", data
    yield "sealed again", sdm_file.sealed(data)
    for bit in range(8 * (table_end + 8)):
        changed = bytearray(data)
        changed[bit // 8] ^= 1 << bit % 8
        yield f"bit {bit}", bytes(changed)
    for at in range(table_end + 8, len(data), max(1, len(data) // 97)):
        changed = bytearray(data)
        changed[at] ^= 16
        yield f"byte {at}", bytes(changed)
    for size in [*range(0, table_end + 8, 7), *range(table_end, len(data), len(data) // 53 + 1)]:
        yield f"cut to {size}", data[:size]
        if size >= 32:
            yield f"cut to {size}, length mended", put(data[:size], "<Q", 16, size)
    yield "longer", data + b"\0"
    large = [0, 1, 63, 64, 65, 2**31, 2**32, 2**42 + 1, 2**63 - 1, 2**63, 2**64 - 64, 2**64 - 1, len(data), len(data) - 8, table_end]
    for value in large:
        yield f"length {value}", put(data, "<Q", 16, value)
        yield f"version {value}", put(data, "<I", 8, value % 2**32)
        for i in range(min(count, 3)):
            yield f"offset {i} {value}", put(data, "<Q", ENTRY_0 + 48 * i + 24, value)
            yield f"size {i} {value}", put(data, "<Q", ENTRY_0 + 48 * i + 32, value)
    for value in [0, 1, count - 1, count + 1, 64, 65, 2**31, 2**32 - 1]:
        yield f"sections {value}", put(data, "<I", 12, value)
    for i in range(min(count, 3)):
        yield f"name {i} without end", put(data, "24s", ENTRY_0 + 48 * i, b"x" * 24)
        yield f"name {i} empty", put(data, "24s", ENTRY_0 + 48 * i, b"")
        yield f"name {i} with an end in it", put(data, "24s", ENTRY_0 + 48 * i, b"meta\0rest")
    first = struct.unpack_from("<Q", data, ENTRY_0 + 24)[0]
    yield "overlap", put(data, "<Q", ENTRY_0 + 48 + 24, first) if count > 1 else data


def main(program, folder):
    files = [path.read_bytes() for path in sorted(pathlib.Path(folder).glob("*.sdm"))]
    assert len(files) >= 7, f"{len(files)} files in {folder}"
    whole = files[0]
    parts = sdm_file.sections(whole)
    assert sdm_file.build(parts) == whole, "a container that is built again has other bytes"
    files = files[1:] + [sdm_file.build([("a", b"")]), sdm_file.build([(f"s{i}", bytes(i)) for i in range(64)])]
    tried = [*cases(whole), *((f"file {i}", data) for i, data in enumerate(files)), *cases(sdm_file.build([("meta", b"kind=x\n")]))]
    with tempfile.TemporaryDirectory() as work:
        paths, mine = [], []
        for i, (_, data) in enumerate(tried):
            paths.append(f"{work}/{i}")
            pathlib.Path(paths[-1]).write_bytes(data)
            try:
                mine.append(f"sound {len(sdm_file.sections(data))}")
            except sdm_file.Refused:
                mine.append("refused")
        its = []
        for i in range(0, len(paths), 500):
            its += subprocess.run([program, *paths[i : i + 500]], check=True, capture_output=True, text=True).stdout.splitlines()
    wrong = [(tried[i][0], a, b) for i, (a, b) in enumerate(zip(mine, its)) if a != b]
    refused = mine.count("refused")
    assert len(its) == len(mine) and not wrong, wrong[:10]
    assert refused > 500 and len(mine) - refused > 10, (refused, len(mine))
    print(f"{len(mine)} files judged alike, {refused} refused")


main(sys.argv[1], sys.argv[2])
