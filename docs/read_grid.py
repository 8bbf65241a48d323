#!/usr/bin/env python3
"""Reads voxeld's native container (.voxg); the byte map is in proto/README.md.

    grid = read_grid(open("bunny.voxg", "rb").read())
    grid["cells"]   int (n, 3): x, y, z of every voxel, by tile, in Morton order
    grid["color"]   uint8 (n, 4), and so on for CHANNELS: None where the grid has no such channel,
                    0 (coverage: 255) where a voxel has no attributes (the inside of a solid)
"""
import json
import struct
import sys

import numpy as np
import zstandard

# Name, samples per voxel, type; in the order of the header's bits. Distances: 1/128 voxel, or shortest edge (world).
CHANNELS = [("color", 4, "<u1"), ("normal", 3, "<i1"), ("material", 1, "<u2"), ("label", 1, "<u2"),
            ("distance", 1, "<i2"), ("coverage", 1, "<u1")]


def read_octree(octree):
    """Morton codes of the voxels of a tile, ascending, and which of them have attributes."""
    codes, at, full, masks = np.zeros(1, np.int64), 0, [], np.frombuffer(octree, np.uint8)
    bits = np.unpackbits(masks[:, None], axis=1, bitorder="little")
    for level in range(8):  # nodes of 256, 128, ... 2 cells
        cells = 8 ** (8 - level)
        full += [code * cells + np.arange(cells) for code in codes[masks[at:at + len(codes)] == 0]]
        node, child = np.nonzero(bits[at:at + len(codes)])
        at += len(codes)
        codes = codes[node] * 8 + child
    all_codes = np.concatenate([codes, *full])
    order = np.argsort(all_codes)
    return all_codes[order], order < len(codes)


def compact(codes):  # every third bit
    return sum(((codes >> (3 * bit)) & 1) << bit for bit in range(8))


def planes(raw, has_attributes, name, samples, dtype):
    """Planes of differences, one for each byte -> (voxels, samples), as above where are none."""
    count = samples * np.dtype(dtype).itemsize
    out = np.full((len(has_attributes), count), 255 * (name == "coverage"), np.uint8)
    out[has_attributes] = np.frombuffer(raw, np.uint8).reshape(count, -1).cumsum(1, np.uint8).T
    return out.view(dtype)


def read_grid(data):
    if data[:12] != b"VOXGRID\0\3\0\0\0" or data[104:111] != bytes(7):
        raise ValueError("not a voxeld grid of version 3 and codec fast")
    dims, side = struct.unpack_from("<3i", data, 16), 1 << struct.unpack_from("<I", data, 28)[0]
    origin, voxel_size = struct.unpack_from("<3d", data, 32), struct.unpack_from("<3d", data, 56)
    tiles, meta_bytes = struct.unpack_from("<II", data, 80)
    directory = 128 + (meta_bytes + 7) // 8 * 8
    channels = [channel for i, channel in enumerate(CHANNELS) if data[12] >> i & 1]
    row = struct.Struct(f"<4IQQ{1 + len(channels)}I")
    cells, samples = [], {name: [] for name, _, _ in channels}
    for i in range(tiles):
        x, y, z, _, _, at, *sizes = row.unpack_from(data, directory + (row.size + 7) // 8 * 8 * i)
        ends = np.cumsum([at, *sizes])
        streams = [zstandard.decompress(data[a:b]) if a < b else b"" for a, b in zip(ends, ends[1:])]
        codes, has_attributes = read_octree(streams[0])
        cells.append(np.stack([compact(codes >> c) + t * side for c, t in enumerate((x, y, z))], 1))
        for channel, stream in zip(channels, streams[1:]):
            samples[channel[0]].append(planes(stream, has_attributes, *channel))
    return {"dims": dims, "origin": origin, "voxel_size": voxel_size,
            "meta": json.loads(data[128:128 + meta_bytes] or b"{}"),
            "cells": np.concatenate(cells) if cells else np.zeros((0, 3), np.int64),
            **{c[0]: np.concatenate(samples[c[0]]) if samples.get(c[0]) else None for c in CHANNELS}}


if __name__ == "__main__":
    grid = read_grid(open(sys.argv[1], "rb").read())
    print(grid["dims"], grid["origin"], grid["voxel_size"], len(grid["cells"]), "voxels")
