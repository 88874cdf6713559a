"""Copies the declarations of the public C headers into sdmgen/_declarations.py.

    python3 declarations.py           writes the file
    python3 declarations.py --check   fails if the file is not up to date
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
TARGET = HERE / "sdmgen" / "_declarations.py"
FOLDERS = ("framework", "shapes", "runtime", "trainer")

HEAD = '''"""The declarations of the C headers; written by declarations.py, do not edit."""

TEXT = """\\
'''


def header_files(root: Path) -> list[Path]:
    """The headers for users, each after those that it includes."""
    found = {f"sdm/{p.name}": p for folder in FOLDERS for p in sorted((root / folder / "include" / "sdm").glob("*.h"))}
    ordered: list[Path] = []

    def add(name: str) -> None:
        path = found[name]
        if path in ordered:
            return
        for included in re.findall(r'^#include "(sdm/\w+\.h)"', path.read_text(), re.M):
            add(included)
        ordered.append(path)

    for name in found:
        add(name)
    return ordered


def statements(text: str) -> list[str]:
    """The declarations of one header, without comments and attributes, each on one line."""
    constants = re.findall(r"^#define (SDM_\w+) (\d+)u?$", text, re.M)
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
    text = re.sub(r"//[^\n]*", " ", text)
    text = text.replace("\\\n", " ")
    text = re.sub(r"#ifdef __cplusplus.*?#endif", " ", text, flags=re.S)
    text = re.sub(r"^[ \t]*#[^\n]*", " ", text, flags=re.M)
    text = re.sub(r"SDM_PRINTF\([^)]*\)", " ", text)
    result = [f"enum {{ {name} = {value} }};" for name, value in constants]
    depth = 0
    start = 0
    for at, letter in enumerate(text):
        depth += (letter == "{") - (letter == "}")
        if letter == ";" and depth == 0:
            line = " ".join(text[start : at + 1].split())
            start = at + 1
            if line.startswith(("typedef struct", "typedef enum")):
                result.append(line)
            elif line.startswith("SDM_API "):
                result.append(line[len("SDM_API ") :].replace(" ;", ";"))
    return result


def generated(root: Path) -> str:
    lines = [line for path in header_files(root) for line in statements(path.read_text())]
    return HEAD + "\n".join(lines) + '\n"""\n'


def main() -> int:
    text = generated(HERE.parent)
    if "--check" not in sys.argv[1:]:
        TARGET.write_text(text)
        return 0
    if TARGET.exists() and TARGET.read_text() == text:
        return 0
    print(f"{TARGET.name} differs from the headers: run python3 python/declarations.py", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
