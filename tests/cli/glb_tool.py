"""Checks a binary glTF file and compares its mesh with vertices of a .ply file.

    glb_tool.py FILE.glb TARGETS [MESH.ply [WEIGHT ...]]

TARGETS: number of morph targets. MESH.ply (ASCII or binary little-endian, double coordinates): the mesh that the file shows with the
weights WEIGHT ..., by default its own. Prints the extras.
"""
import json
import struct
import sys


def chunks(data):
    magic, version, length = struct.unpack_from("<4sII", data)
    assert magic == b"glTF" and version == 2 and length == len(data) and length % 4 == 0
    at, out = 12, []
    while at < length:
        size, kind = struct.unpack_from("<I4s", data, at)
        assert size % 4 == 0 and at + 8 + size <= length
        out.append((kind, data[at + 8:at + 8 + size]))
        at += 8 + size
    assert [kind for kind, _ in out] == [b"JSON", b"BIN\0"] and at == length
    return json.loads(out[0][1]), out[1][1]


def read_accessor(gltf, buffer, index, target):
    a = gltf["accessors"][index]
    view = gltf["bufferViews"][a["bufferView"]]
    width, code = {("VEC3", 5126): (3, "f"), ("SCALAR", 5125): (1, "I")}[a["type"], a["componentType"]]
    assert view["target"] == target and view["byteOffset"] % 4 == 0
    assert view["byteLength"] == 4 * width * a["count"] and view["byteOffset"] + view["byteLength"] <= len(buffer)
    values = struct.unpack_from(f"<{width * a['count']}{code}", buffer, view["byteOffset"])
    if width == 3:
        for c in range(3):
            assert min(values[c::3]) == a["min"][c] and max(values[c::3]) == a["max"][c], "min, max"
    return values


def ply_vertices(path):
    with open(path, "rb") as f:
        head, body = f.read().split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    n = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    kinds = [line.split()[1] for line in lines if line.startswith("property") and "list" not in line]
    assert "binary_little_endian" in lines[1] and len(set(kinds)) == 1 and len(kinds) == 3, kinds
    return struct.unpack_from(f"<{3 * n}{'d' if kinds[0] == 'double' else 'f'}", body)


def main(path, n_targets, ply=None, *weights):
    with open(path, "rb") as f:
        gltf, buffer = chunks(f.read())
    assert gltf["asset"]["version"] == "2.0" and gltf["buffers"] == [{"byteLength": len(buffer)}]
    mesh, node = gltf["meshes"][0], gltf["nodes"][gltf["scenes"][gltf["scene"]]["nodes"][0]]
    primitive = mesh["primitives"][0]
    vert = read_accessor(gltf, buffer, primitive["attributes"]["POSITION"], 34962)
    tri = read_accessor(gltf, buffer, primitive["indices"], 34963)
    assert len(tri) % 3 == 0 and max(tri) < len(vert) // 3
    targets = [read_accessor(gltf, buffer, t["POSITION"], 34962) for t in primitive.get("targets", [])]
    assert len(targets) == int(n_targets) == len(mesh.get("weights", [])) == len(mesh["extras"].get("targetNames", [])), len(targets)
    assert node["scale"] == [0.001] * 3 and mesh["extras"]["unit"] == "mm"
    if ply:
        shown = list(vert)
        for w, t in zip([float(w) for w in weights] or mesh.get("weights", []), targets):
            shown = [v + w * d for v, d in zip(shown, t)]
        expected = ply_vertices(ply)
        worst = max(abs(a - b) for a, b in zip(shown, expected, strict=True))
        assert worst < 1e-5, f"a vertex is {worst} mm away"
    print(json.dumps(mesh["extras"]))


main(*sys.argv[1:])
