"""Reads ONNX files without the package onnx, and evaluates them with numpy.

    onnx_tool.py params FILE.onnx N OUT.csv       N rows of parameters: the defaults, then random ones in the ranges of the metadata
    onnx_tool.py run FILE.onnx PARAMS.csv OUT.f32 evaluates all rows as one batch (operators of `pod` only)
    onnx_tool.py compare A.f32 LIMIT MAP.npy ...  prints the root mean square difference; exit code 1 if that of any map exceeds LIMIT mm
"""
import json
import random
import struct
import sys

import numpy as np


def fields(data):
    """(number, value) of each field of a message; value: an integer, 4 or 8 bytes, or the bytes of the field."""
    at = 0

    def varint():
        nonlocal at
        v = shift = 0
        while True:
            byte = data[at]
            at += 1
            v |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return v

    while at < len(data):
        tag = varint()
        if tag & 7 == 0:
            yield tag >> 3, varint()
            continue
        size = {1: 8, 2: None, 5: 4}[tag & 7]
        size = varint() if size is None else size
        assert at + size <= len(data), "a field ends behind its message"
        yield tag >> 3, data[at:at + size]
        at += size


def message(data):
    """The fields of a message as lists by number."""
    out = {}
    for number, value in fields(data):
        out.setdefault(number, []).append(value)
    return out


def signed(v):
    return v - (1 << 64) if v >> 63 else v


def text(v):
    return bytes(v).decode()


def tensor(data):
    m = message(data)
    kind = {1: "<f4", 6: "<i4", 7: "<i8"}[m[2][0]]
    return text(m[8][0]), np.frombuffer(m[9][0], kind).reshape([int(d) for d in m.get(1, [])])


def attributes(node):
    out = {}
    for a in map(message, node.get(5, [])):
        kind = a[20][0]
        out[text(a[1][0])] = {1: lambda: struct.unpack("<f", a[2][0])[0], 2: lambda: signed(a[3][0]),
                              7: lambda: [signed(v) for v in a[8]]}[kind]()
    return out


class Graph:
    def __init__(self, path):
        with open(path, "rb") as f:
            model = message(memoryview(f.read()))
        assert model[1] == [7] and message(model[8][0])[2] == [13], "IR version 7, opset 13"
        self.metadata = {text(m[1][0]): text(m[2][0]) for m in map(message, model[14])}
        graph = message(model[7][0])
        self.tensors = dict(map(tensor, graph[5]))
        self.nodes = [message(n) for n in graph[1]]
        assert text(message(graph[11][0])[1][0]) == "params" and text(message(graph[12][0])[1][0]) == "sdm"

    def run(self, params):
        values = dict(self.tensors, params=params)
        ops = {
            "Add": lambda a, x, y: x + y, "Sub": lambda a, x, y: x - y, "Mul": lambda a, x, y: x * y,
            "MatMul": lambda a, x, y: np.matmul(x, y), "Identity": lambda a, x: x,
            "Concat": lambda a, *x: np.concatenate(x, a["axis"]), "Gather": lambda a, x, i: np.take(x, i, a["axis"]),
            "Reshape": lambda a, x, d: x.reshape(d), "Transpose": lambda a, x: x.transpose(a["perm"]),
            "Slice": lambda a, x, b, e, axis: x[(slice(None),) * int(axis[0]) + (slice(int(b[0]), int(e[0])),)], "Sigmoid": lambda a, x: 1 / (1 + np.exp(-x)),
            "Tanh": lambda a, x: np.tanh(x), "Relu": lambda a, x: np.maximum(x, 0),
            "LeakyRelu": lambda a, x: np.where(x < 0, np.float32(a["alpha"]) * x, x),
        }
        for node in self.nodes:
            inputs = [values[text(n)] for n in node.get(1, [])]
            values[text(node[2][0])] = ops[text(node[4][0])](attributes(node), *inputs)
        assert values["sdm"].dtype == np.float32
        return values["sdm"]


def make_params(path, n, out):
    params = json.loads(Graph(path).metadata["parameters"])
    draw = random.Random(7)
    with open(out, "w") as f:
        print(",".join(p["name"] for p in params), file=f)
        for i in range(int(n)):
            row = [p["min"] + draw.uniform(0.01, 0.99) * (p["max"] - p["min"]) if i else p["default"] for p in params]
            print(",".join(repr(float(np.float32(v))) for v in row), file=f)


def run(path, table, out):
    g = Graph(path)
    rows = np.loadtxt(table, np.float32, delimiter=",", skiprows=1, ndmin=2)
    sdm = g.run(rows)
    grid = json.loads(g.metadata["grid"])
    assert list(sdm.shape) == [len(rows)] + grid["size"][::-1], sdm.shape
    assert (g.metadata["unit"], g.metadata["sign"], g.metadata["frame"]) == ("mm", "negative inside", "LPS")
    sdm.tofile(out)


def compare(path, limit, *maps):
    a = np.fromfile(path, np.float32)
    b = np.stack([np.load(m) for m in maps])
    rms = np.sqrt(np.mean((a.reshape(b.shape).astype(float) - b) ** 2, axis=(1, 2, 3)))
    print("rms of the difference:", *(f"{r:.2e}" for r in rms), "mm")
    return 0 if rms.max() <= float(limit) else 1


if __name__ == "__main__":
    sys.exit({"params": make_params, "run": run, "compare": compare}[sys.argv[1]](*sys.argv[2:]))
