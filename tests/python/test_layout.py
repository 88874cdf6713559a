"""The declarations of the package are those of the headers, and ctypes lays structures out as C does."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import pytest

from sdmgen import _abi

SOURCE = Path(__file__).resolve().parents[2]
INCLUDES = [f"-I{SOURCE / part / 'include'}" for part in ("framework", "runtime", "shapes", "trainer")]


def compiled(folder, text):
    """What a C program prints."""
    source, program = folder / "layout.c", folder / "layout"
    source.write_text(text)
    compiler = os.environ.get("CC", "cc")
    subprocess.run([compiler, "-std=c11", "-Wall", "-Werror", *INCLUDES, source, "-o", program], check=True)
    return subprocess.run([program], check=True, capture_output=True, text=True).stdout


def test_declarations_are_up_to_date():
    subprocess.run([sys.executable, SOURCE / "python/declarations.py", "--check"], check=True)


def test_layouts_and_constants(tmp_path):
    lines, expected = [], []
    for name, struct in _abi.structs.items():
        lines.append(f'printf("{name} %zu\\n", sizeof({name}));')
        expected.append(f"{name} {ctypes.sizeof(struct)}")
        for member, _ in struct._fields_:
            lines.append(f'printf("{name}.{member} %zu %zu\\n", offsetof({name}, {member}), sizeof((({name} *)0)->{member}));')
            field = getattr(struct, member)
            expected.append(f"{name}.{member} {field.offset} {field.size}")
    for name, value in _abi.constants.items():
        lines.append(f'printf("{name} %lld\\n", (long long){name});')
        expected.append(f"{name} {value}")
    head = '#include "sdm/sdmgen.h"\n#include <stdio.h>\nint main(void) {\n'
    printed = compiled(tmp_path, head + "\n".join(lines) + "\nreturn 0; }\n")
    assert printed.splitlines() == expected
    assert len(_abi.structs) > 40 and len(_abi.constants) > 60


def size_of(kind):
    return 0 if kind is None else ctypes.sizeof(kind)


def test_functions_have_the_types_of_their_declarations(tmp_path):
    """Calls with the types that ctypes uses compile without a warning."""
    names = {
        ctypes.c_bool: "bool",
        ctypes.c_double: "double",
        ctypes.c_float: "float",
        ctypes.c_int: "int",
        ctypes.c_size_t: "size_t",
        ctypes.c_uint32: "uint32_t",
        ctypes.c_int64: "int64_t",
        ctypes.c_uint64: "uint64_t",
        None: "void",
    }

    def pointer(kind):
        return kind in (ctypes.c_void_p, ctypes.c_char_p)

    lines = []
    for name, (result, parameters) in _abi.functions.items():
        if name in ("sdm_fail", "sdm_fail_in"):
            continue  # with a variable number of arguments
        values = ["(void *)0" if pointer(p) else f"({names.get(p) or p.__name__}){{0}}" for p in parameters]
        call = f"{name}({', '.join(values)})"
        if result is None:
            lines.append(f"if (never) {call};")
        elif pointer(result):
            lines.append(f"if (never) {{ const void *r = {call}; (void)r; }}")
        else:
            kind = names.get(result) or result.__name__
            lines.append(f"if (never) {{ {kind} r = {call}; (void)r; }}")
            lines.append(f"_Static_assert(sizeof({call}) == {size_of(result)}, \"{name}\");")
    text = '#include "sdm/sdmgen.h"\nint run(int never);\nint run(int never) {\n' + "\n".join(lines) + "\nreturn 0; }\n"
    source = tmp_path / "functions.c"
    source.write_text(text)
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wno-missing-field-initializers", "-fsyntax-only"]
    subprocess.run([os.environ.get("CC", "cc"), *flags, *INCLUDES, source], check=True)
    assert len(_abi.functions) > 100


def test_a_wrong_layout_is_found(tmp_path):
    """The comparison fails when a member is missing."""
    short = type("sdm_grid", (ctypes.Structure,), {"_fields_": _abi.structs["sdm_grid"]._fields_[:-1]})
    kept = _abi.structs["sdm_grid"]
    _abi.structs["sdm_grid"] = short
    try:
        with pytest.raises(AssertionError):
            test_layouts_and_constants(tmp_path)
    finally:
        _abi.structs["sdm_grid"] = kept


def test_numpy_is_asked_for():
    code = "import sys; sys.modules['numpy'] = None; import sdmgen"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "sdmgen needs NumPy: install python3-numpy" in done.stderr and "During handling" not in done.stderr
