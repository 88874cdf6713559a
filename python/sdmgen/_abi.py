"""The structures, constants and functions of the C headers as ctypes, from their declarations."""

from __future__ import annotations

import ctypes
import re
from typing import Any

from ._declarations import TEXT

_SIMPLE: dict[str, Any] = {
    "bool": ctypes.c_bool,
    "char": ctypes.c_char,
    "double": ctypes.c_double,
    "float": ctypes.c_float,
    "int": ctypes.c_int,
    "int32_t": ctypes.c_int32,
    "int64_t": ctypes.c_int64,
    "size_t": ctypes.c_size_t,
    "uint32_t": ctypes.c_uint32,
    "uint64_t": ctypes.c_uint64,
    "uint8_t": ctypes.c_uint8,
    "void": None,
}

#: values of the enumerations and numeric macros by name
constants: dict[str, int] = {}
#: the structures by name
structs: dict[str, type[ctypes.Structure]] = {}
#: declarations of the functions by name: type of the result, types of the parameters
functions: dict[str, tuple[Any, list[Any]]] = {}
_enums: set[str] = set()


def _base(text: str) -> Any:
    """The type that a declaration begins with."""
    name = text.replace("const ", "").replace("struct ", "").strip()
    if name in _enums:
        return ctypes.c_int
    if name in _SIMPLE:
        return _SIMPLE[name]
    return structs.get(name)  # None: an opaque type, always behind a pointer


def _size(text: str) -> int:
    return int(text) if text.isdigit() else constants[text]


def _parameter(text: str) -> Any:
    """The type of a parameter; every pointer and array is an address."""
    if "*" in text or "[" in text:
        return ctypes.c_char_p if re.match(r"const char \*(?![*c])", text) else ctypes.c_void_p
    return _base(re.sub(r"\w+$", "", text) if " " in text else text)


def _parameters(text: str) -> list[Any]:
    return [] if text == "void" else [_parameter(p.strip()) for p in text.split(",") if p.strip() != "..."]


def _split(text: str) -> list[str]:
    """Splits a list of declarators at the commas outside of parentheses."""
    return re.split(r",\s*(?![^()]*\))", text)


def _members(text: str) -> list[tuple[str, Any]]:
    """name and type of the members of a structure"""
    result: list[tuple[str, Any]] = []
    for member in filter(None, (m.strip() for m in re.split(r";", text))):
        callback = re.match(r"(.+?)\(\*(\w+)\)\((.*)\)$", member)
        if callback:
            restype = _parameter(callback[1].strip())
            result.append((callback[2], ctypes.CFUNCTYPE(restype, *_parameters(callback[3]))))
            continue
        head = re.match(r"((?:const |struct )*\w+)\s*(.*)$", member)
        assert head, member
        base = _base(head[1])
        for declarator in _split(head[2]):
            name = re.search(r"\w+", declarator.replace("const ", ""))
            assert name, member
            if "*" in declarator:
                text_pointer = head[1] == "const char" and declarator.count("*") == 1
                result.append((name[0], ctypes.c_char_p if text_pointer else ctypes.c_void_p))
                continue
            kind = base
            for length in reversed(re.findall(r"\[(\w+)\]", declarator)):
                kind = kind * _size(length)
            result.append((name[0], kind))
    return result


def _enumerate(body: str) -> None:
    value = -1
    for item in body.split(","):
        name, _, given = (part.strip() for part in item.partition("="))
        value = int(given) if given else value + 1
        constants[name] = value


def _declare(line: str) -> None:
    enum = re.match(r"(?:typedef )?enum ?(\w*) ?\{(.*)\} ?(\w*);$", line)
    if enum:
        _enums.add(enum[1])
        _enumerate(enum[2])
        return
    struct = re.match(r"typedef struct (\w+) \{(.*)\} (\w+);$", line)
    if struct:
        structs[struct[1]] = type(struct[1], (ctypes.Structure,), {"_fields_": _members(struct[2])})
        return
    function = re.match(r"([\w ]+[ *]+)(sdm_\w+)\((.*)\);$", line)
    if function:
        functions[function[2]] = (_parameter(function[1].strip()), _parameters(function[3]))


for _line in TEXT.splitlines():
    _declare(_line)
