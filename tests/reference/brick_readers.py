"""Readers of LDraw's models and of OctoMap's octrees, written from their specifications, with numpy alone.

    read_ldr(data) -> Bricks: cells of the grid, the colour that the file names for each, and the comments
    read_bt(data) -> Octree: leaves with their keys and sides in cells, and the comments
"""
import re
from dataclasses import dataclass

import numpy as np

STUDS = {"3005.dat": 1, "3004.dat": 2, "3622.dat": 3, "3010.dat": 4, "3009.dat": 6, "3008.dat": 8}


@dataclass
class Bricks:
    cells: np.ndarray  # (N, 3) x, y, z; each voxel once
    colors: list  # N texts
    comments: list
    count: int  # bricks
    steps: int


def read_ldr(data):
    """A brick of n studs is the box 20 n x 24 x 20 under its place, the middle of its top, turned by its matrix."""
    cells, colors, comments, count, steps, height = [], [], [], 0, 0, 0
    text = data.decode("ascii")
    assert text.endswith("\r\n") and text.count("\n") == text.count("\r\n")
    for line in text.split("\r\n")[:-1]:
        words = line.split(" ")
        if words[0] == "0":
            if words[1:] == ["STEP"]:
                steps += 1
            elif words[1] == "//":
                comments.append(line[5:])
            continue
        assert words[0] == "1" and len(words) == 15, line
        place, matrix = np.array(words[2:5], int), np.array(words[5:14], int).reshape(3, 3)
        assert place[1] <= height, "bricks are not in the order of building"
        height = place[1]
        assert round(np.linalg.det(matrix)) == 1
        along = 20 * np.arange(STUDS[words[14]]) - 10 * STUDS[words[14]] + 10
        middles = place + (matrix @ np.stack([along, np.full_like(along, 12), 0 * along])).T
        middles = middles * [1, -1, -1] - [10, 12, 10]
        assert (middles % [20, 24, 20] == 0).all(), line
        cells.append(middles // [20, 24, 20])
        colors += [words[1]] * len(along)
        count += 1
    cells = np.concatenate(cells) if cells else np.zeros((0, 3), int)
    assert len(np.unique(cells, axis=0)) == len(cells), "bricks overlap"
    return Bricks(cells, colors, comments, count, steps)


def color_table(source):
    """{code: sRGB} of the C++ source's lines {4, "Red", {0xb4, 0x00, 0x00}}."""
    table = {}
    for code, *color in re.findall(r'\{(\d+), "\w+", \{0x(\w\w), 0x(\w\w), 0x(\w\w)\}\}', source):
        table[code] = [int(part, 16) for part in color]
    return table


@dataclass
class Octree:
    keys: np.ndarray  # (N, 3) of the leaves' first cells, from the middle of the lattice
    sides: np.ndarray  # (N,) in cells
    resolution: float
    comments: list
    body: bytes  # of the tree
    size: int


def read_bt(data):
    head, body = data.split(b"\ndata\n", 1)
    lines = head.decode("ascii").split("\n")
    assert lines[0] == "# Octomap OcTree binary file"
    comments = [line[2:] for line in lines[1:] if line.startswith("# ")]
    words = dict(line.split(" ", 1) for line in lines if not line.startswith("#"))
    assert words["id"] == "OcTree"
    keys, sides, nodes = [], [], 0
    at, stack = 0, [((0, 0, 0), 65536)] if int(words["size"]) else []
    while stack:
        key, side = stack.pop()
        nodes += 1
        bits, at = int.from_bytes(body[at:at + 2], "little"), at + 2
        assert bits not in (0, 0xaaaa), "not pruned"
        inner = []
        for child in range(8):
            first = tuple(k + side // 2 * (child >> axis & 1) for axis, k in enumerate(key))
            state = bits >> 2 * child & 3
            assert state != 1, "a free leaf"
            if state == 2:
                keys.append(first)
                sides.append(side // 2)
            elif state == 3:
                inner.append((first, side // 2))
        stack += reversed(inner)
    assert at == len(body)
    nodes += len(keys)
    assert nodes == int(words["size"])
    return Octree(np.array(keys, int).reshape(-1, 3) - 32768, np.array(sides, int), float(words["res"]), comments, body,
                  nodes)


def leaf_cells(keys, sides):
    """The cells of all leaves; they must not overlap."""
    parts = []
    for side in np.unique(sides):
        inside = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)
        parts.append((keys[sides == side][:, None] + inside).reshape(-1, 3))
    cells = np.concatenate(parts) if parts else np.zeros((0, 3), int)
    assert len(np.unique(cells, axis=0)) == len(cells), "leaves overlap"
    return cells
