"""Readers of .ply, .obj and .glb that know what their specifications say, and checks of meshes."""
import json
import re

import numpy as np


class Mesh:
    """points: float64 (N, 3) in world units; colors: float64 (N, 4) in sRGB 0..1 or None; polygons: arrays of indices
    with 3 or 4 columns; comments: lines of the file."""

    def __init__(self, points, colors, polygons, comments=(), normals=None):
        self.points, self.colors, self.polygons = points, colors, [p for p in polygons if len(p)]
        self.comments, self.normals = list(comments), normals

    def triangles(self):
        parts = [np.zeros((0, 3), np.int64)]
        for polygon in self.polygons:
            parts += [polygon[:, [0, i, i + 1]] for i in range(1, polygon.shape[1] - 1)]
        return np.concatenate(parts)

    def volume(self):
        a, b, c = (self.points[self.triangles()[:, i]] for i in range(3))
        return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


PLY_TYPES = {"float": "<f4", "double": "<f8", "uchar": "u1", "int": "<i4"}


def read_ply(data):
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"], lines[:2]
    counts, columns, element = {}, [], None
    for line in lines[2:]:
        words = line.split()
        if words[0] == "element":
            element = words[1]
            counts[element] = int(words[2])
        elif words[0] == "property" and element == "vertex":
            columns.append((words[2], PLY_TYPES[words[1]]))
        elif words[0] == "property":
            assert line == "property list uchar int vertex_indices", line
    vertices = np.frombuffer(body, columns, counts["vertex"])
    names = vertices.dtype.names
    points = np.stack([vertices[c].astype(float) for c in "xyz"], 1)
    colors = normals = None
    if "red" in names:
        colors = np.stack([vertices[c] for c in ("red", "green", "blue", "alpha")], 1) / 255
    if "nx" in names:
        normals = np.stack([vertices[c] for c in ("nx", "ny", "nz")], 1)
    at, polygons = vertices.nbytes, {3: [], 4: []}
    for _ in range(counts["face"]):
        size = body[at]
        polygons[size].append(np.frombuffer(body, "<i4", size, at + 1))
        at += 1 + 4 * size
    assert at == len(body), (at, len(body))
    comments = [line.removeprefix("comment ") for line in lines if line.startswith("comment ")]
    return Mesh(points, colors, [np.array(p, np.int64).reshape(-1, n) for n, p in polygons.items()], comments, normals)


def read_obj(data):
    points, colors, normals, polygons, comments = [], [], [], {3: [], 4: []}, []
    for line in data.decode().splitlines():
        key, *words = line.split(" ")
        if key == "v":
            points.append([float(w) for w in words[:3]])
            colors.append([float(w) for w in words[3:]])
        elif key == "vn":
            normals.append([float(w) for w in words])
        elif key == "f":
            polygons[len(words)].append([int(w.split("/")[0]) - 1 for w in words])
        elif key == "#":
            comments.append(line[2:])
        else:
            assert key == "o", line
    has_colors = bool(colors) and len(colors[0]) == 3
    rgba = np.array([[*c, 1] for c in colors]) if has_colors else None
    return Mesh(np.array(points, float).reshape(-1, 3), rgba,
                [np.array(p, np.int64).reshape(-1, n) for n, p in polygons.items()], comments,
                np.array(normals) if normals else None)


COMPONENTS = {5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
SIZES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


class Glb:
    """The document and arrays of a .glb."""

    def __init__(self, data):
        assert data[:8] == b"glTF\x02\0\0\0" and int.from_bytes(data[8:12], "little") == len(data)
        at, chunks = 12, {}
        while at < len(data):
            size = int.from_bytes(data[at:at + 4], "little")
            assert size % 4 == 0
            chunks[data[at + 4:at + 8]] = data[at + 8:at + 8 + size]
            at += 8 + size
        self.document = json.loads(chunks[b"JSON"])
        self.binary = chunks.get(b"BIN\0", b"")

    def array(self, index):
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        kind, columns = np.dtype(COMPONENTS[accessor["componentType"]]), SIZES[accessor["type"]]
        assert view.get("byteStride", 0) in (0, kind.itemsize * columns)
        values = np.frombuffer(self.binary, kind, accessor["count"] * columns, view["byteOffset"])
        values = values.reshape(-1, columns)
        if "min" in accessor:
            assert (values.min(0) == accessor["min"]).all() and (values.max(0) == accessor["max"]).all()
        return values / np.iinfo(kind).max if accessor.get("normalized") else values


def srgb_of_linear(linear):
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.power(np.maximum(linear, 1e-9), 1 / 2.4) - 0.055)


def read_glb(data):
    glb = Glb(data)
    if "nodes" not in glb.document:
        return Mesh(np.zeros((0, 3)), None, [])
    node = glb.document["nodes"][0]
    primitive = glb.document["meshes"][node["mesh"]]["primitives"][0]
    attributes = primitive["attributes"]
    points = glb.array(attributes["POSITION"]) * np.array(node["scale"]) + node["translation"]
    colors = normals = None
    if "COLOR_0" in attributes:
        colors = glb.array(attributes["COLOR_0"]).copy()
        colors[:, :3] = srgb_of_linear(colors[:, :3])
    if "NORMAL" in attributes:
        normals = glb.array(attributes["NORMAL"]) / np.array(node["scale"])
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    triangles = glb.array(primitive["indices"]).astype(np.int64).reshape(-1, 3)
    return Mesh(points, colors, [triangles], normals=normals)


READERS = {"ply": read_ply, "obj": read_obj, "glb": read_glb}


def unmatched_edges(mesh):
    """Edges between two places that are not passed as often in one direction as in the other."""
    places = np.unique(mesh.points.round(9), axis=0, return_inverse=True)[1].reshape(-1)
    count = np.int64(places.max() + 1)
    edges = []
    for polygon in mesh.polygons:
        at = places[polygon]
        edges.append(np.stack([at, np.roll(at, -1, 1)], 2).reshape(-1, 2))
    edges = np.concatenate(edges)
    assert (edges[:, 0] != edges[:, 1]).all(), "an edge without length"
    forward = np.sort(edges[:, 0] * count + edges[:, 1])
    backward = np.sort(edges[:, 1] * count + edges[:, 0])
    return int((forward != backward).sum())


def number_lists(comments):
    """The numbers after each name of comment lines "name 1 2 3"."""
    return {line.split()[0]: [float(n) for n in re.findall(r"[-+.\deE]+", line.split(" ", 1)[1])]
            for line in comments if re.match(r"(dims|origin|voxel_size) ", line)}
