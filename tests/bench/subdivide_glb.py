#!/usr/bin/env python3
"""Cuts the triangles of a skinned .glb into four, TIMES times: a model of the same shape and animation with more of them.

  /usr/bin/python3 tests/bench/subdivide_glb.py IN.glb OUT.glb TIMES

Reads one mesh of one primitive with indices, POSITION, NORMAL, TEXCOORD_0, JOINTS_0 (16 bits) and WEIGHTS_0 (floats).
A new vertex has the mean of its two neighbours' attributes and their four largest weights.
"""
import json
import struct
import sys

FORMATS = {5121: ("B", 1), 5123: ("H", 2), 5125: ("I", 4), 5126: ("f", 4)}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
FLOAT, UINT16, UINT32 = 5126, 5123, 5125


def read_accessor(gltf, data, index):
    accessor = gltf["accessors"][index]
    view = gltf["bufferViews"][accessor["bufferView"]]
    letter, size = FORMATS[accessor["componentType"]]
    width = WIDTHS[accessor["type"]]
    stride = view.get("byteStride", width * size)
    first = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    rows = [struct.unpack_from(f"<{width}{letter}", data, first + i * stride) for i in range(accessor["count"])]
    return [row[0] for row in rows] if width == 1 else rows


def mean(a, b):
    return tuple((x + y) / 2 for x, y in zip(a, b))


def mean_influences(a, b):
    """a, b: (joints, weights) of two vertices."""
    weights = {}
    for joints, of_joints in (a, b):
        for joint, weight in zip(joints, of_joints):
            weights[joint] = weights.get(joint, 0) + weight
    largest = sorted(weights.items(), key=lambda item: -item[1])[:4]
    largest += [(0, 0.0)] * (4 - len(largest))
    total = sum(weight for _, weight in largest)
    return tuple(j for j, _ in largest), tuple(w / total for _, w in largest)


def subdivide(indices, vertices):
    """vertices: (position, normal, uv, joints, weights); returns the new indices, vertices grow."""
    middles, out = {}, []

    def middle(a, b):
        key = (min(a, b), max(a, b))
        if key not in middles:
            middles[key] = len(vertices)
            u, v = vertices[a], vertices[b]
            vertices.append(tuple(mean(u[k], v[k]) for k in range(3)) + mean_influences(u[3:], v[3:]))
        return middles[key]

    for t in range(0, len(indices), 3):
        a, b, c = indices[t:t + 3]
        ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
        out += [a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca]
    return out


def add_accessor(gltf, data, rows, component, kind):
    letter, size = FORMATS[component]
    data += b"\0" * (-len(data) % 4)
    gltf["bufferViews"].append({"buffer": 0, "byteOffset": len(data),
                                "byteLength": len(rows) * WIDTHS[kind] * size})
    for row in rows:
        data += struct.pack(f"<{WIDTHS[kind]}{letter}", *(row if kind != "SCALAR" else (row,)))
    accessor = {"bufferView": len(gltf["bufferViews"]) - 1, "componentType": component, "count": len(rows), "type": kind}
    if kind == "VEC3":
        accessor["min"] = [min(column) for column in zip(*rows)]
        accessor["max"] = [max(column) for column in zip(*rows)]
    gltf["accessors"].append(accessor)
    return len(gltf["accessors"]) - 1


def main():
    source, target, times = sys.argv[1], sys.argv[2], int(sys.argv[3])
    with open(source, "rb") as file:
        glb = file.read()
    json_bytes = struct.unpack_from("<I", glb, 12)[0]
    gltf = json.loads(glb[20:20 + json_bytes])
    data = bytearray(glb[20 + json_bytes + 8:])
    primitive = gltf["meshes"][0]["primitives"][0]
    names = ["POSITION", "NORMAL", "TEXCOORD_0", "JOINTS_0", "WEIGHTS_0"]
    vertices = list(zip(*(read_accessor(gltf, data, primitive["attributes"][name]) for name in names)))
    indices = read_accessor(gltf, data, primitive["indices"])
    for _ in range(times):
        indices = subdivide(indices, vertices)
    types = [(FLOAT, "VEC3"), (FLOAT, "VEC3"), (FLOAT, "VEC2"), (UINT16, "VEC4"), (FLOAT, "VEC4")]
    for name, rows, (component, kind) in zip(names, zip(*vertices), types):
        primitive["attributes"][name] = add_accessor(gltf, data, rows, component, kind)
    primitive["indices"] = add_accessor(gltf, data, indices, UINT32, "SCALAR")
    data += b"\0" * (-len(data) % 4)
    gltf["buffers"][0]["byteLength"] = len(data)
    text = json.dumps(gltf, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    with open(target, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(data), b"BIN\0") + bytes(data))
    print(f"{len(indices) // 3} triangles, {len(vertices)} vertices")


if __name__ == "__main__":
    main()
