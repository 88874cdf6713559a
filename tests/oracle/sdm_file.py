"""Reads model files and checkpoints, written from docs/model-file.md alone: the container with all its checks, and the lines of `meta`."""
import struct

import numpy as np

MAGIC = b"SDMGEN\r\n"
VERSION, ALIGN, SECTIONS_MAX = 4, 64, 64
HEADER = struct.Struct("<8sIIQ")
ENTRY = struct.Struct("<24sQQQ")


def _crc_table():
    crc = np.arange(256, dtype=np.uint64)
    for _ in range(8):
        crc = np.where(crc & np.uint64(1), (crc >> np.uint64(1)) ^ np.uint64(0xC96C5795D7870F42), crc >> np.uint64(1))
    return [int(c) for c in crc]


_TABLE = _crc_table()


def crc64(data):
    """CRC-64/XZ."""
    crc = 0xFFFFFFFFFFFFFFFF
    for byte in bytes(data):
        crc = _TABLE[(crc ^ byte) & 255] ^ crc >> 8
    return crc ^ 0xFFFFFFFFFFFFFFFF


class Refused(ValueError):
    """The file is no sound container."""


def _demand(condition, reason):
    if not condition:
        raise Refused(reason)


def sections(data):
    """List of (name, bytes) of a container; raises Refused."""
    size = len(data)
    _demand(data[:8] == MAGIC, "signature")
    _demand(size >= HEADER.size + ENTRY.size + 16, "too short")
    _, version, count, length = HEADER.unpack_from(data)
    _demand(version == VERSION, "version")
    _demand(length == size, "length")
    _demand(1 <= count <= SECTIONS_MAX, "number of sections")
    table_end = HEADER.size + count * ENTRY.size
    _demand(table_end + 16 <= size, "table")
    _demand(struct.unpack_from("<Q", data, table_end)[0] == crc64(data[:table_end]), "checksum of the header")
    found, end = [], table_end + 8
    for i in range(count):
        name, at, length, crc = ENTRY.unpack_from(data, HEADER.size + i * ENTRY.size)
        _demand(name[23] == 0, "name")
        _demand(at % ALIGN == 0 and end <= at <= size - 8 and length <= size - 8 - at, "place")
        end = at + length
        _demand(crc == crc64(data[at:end]), "checksum of a section")
        found.append((name.split(b"\0")[0].decode(), data[at:end]))
    _demand(struct.unpack_from("<Q", data, size - 8)[0] == crc64(data[:-8]), "checksum of the file")
    return found


def meta(data):
    """List of (key, value) of the section `meta`, in order: some keys occur several times."""
    text = dict(reversed(sections(data)))["meta"].decode()
    return [tuple(line.split("=", 1)) for line in text.splitlines()]


def build(parts):
    """A container with these (name, bytes)."""
    at = -(-(HEADER.size + len(parts) * ENTRY.size + 8) // ALIGN) * ALIGN
    table, body, start = b"", b"", at
    for name, content in parts:
        table += ENTRY.pack(name.encode(), at, len(content), crc64(content))
        content += bytes(-len(content) % ALIGN)
        body += content
        at += len(content)
    head = HEADER.pack(MAGIC, VERSION, len(parts), at + 8) + table
    head += struct.pack("<Q", crc64(head))
    head += bytes(start - len(head))
    return head + body + struct.pack("<Q", crc64(head + body))


def sealed(data):
    """The same bytes with the checksums of header and file computed anew."""
    data = bytearray(data)
    count = struct.unpack_from("<I", data, 12)[0]
    table_end = HEADER.size + count * ENTRY.size
    if count <= SECTIONS_MAX and table_end + 16 <= len(data):
        struct.pack_into("<Q", data, table_end, crc64(data[:table_end]))
    struct.pack_into("<Q", data, len(data) - 8, crc64(data[:-8]))
    return bytes(data)
