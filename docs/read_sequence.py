#!/usr/bin/env python3
"""Reads voxeld's sequence container (.voxs); the byte map is in proto/README.md.

    sequence = Sequence(open("bob.voxs", "rb").read())
    sequence.times           seconds, of each frame
    sequence.frame(k)        dict as of read_grid.read_grid(): "cells", "color", ...
Frames are read in any order: each needs at most 8 streams for one of its own.
"""
import json
import struct
import sys

import numpy as np
import zstandard

from read_grid import CHANNELS, compact, planes, read_octree

NONE = 2**32 - 1


class Sequence:
    def __init__(self, data):
        if data[:12] != b"VOXSEQ\0\0\1\0\0\0" or data[104:111] != bytes(7):
            raise ValueError("not a voxeld sequence of version 1 and codec fast")
        self.data = data
        self.dims, self.side = struct.unpack_from("<3i", data, 16), 1 << data[28]
        self.origin = struct.unpack_from("<3d", data, 32)
        self.voxel_size = struct.unpack_from("<3d", data, 56)
        frames, meta_bytes, self.fps = struct.unpack_from("<IId", data, 80)
        at, tiles, streams = struct.unpack_from("<QII", data, 112)
        self.meta = json.loads(data[128:128 + meta_bytes])
        self.channels = [channel for i, channel in enumerate(CHANNELS) if data[12] >> i & 1]
        self.frames = [struct.unpack_from("<dQII", data, at + 24 * i) for i in range(frames)]
        self.times = [frame[0] for frame in self.frames]
        at += 24 * frames
        row = struct.Struct(f"<4IQ{1 + len(self.channels)}I")
        size = (row.size + 7) // 8 * 8
        self.tiles = [row.unpack_from(data, at + size * i) for i in range(tiles)]
        at += size * tiles
        self.streams = [struct.unpack_from("<QII", data, at + 16 * i) for i in range(streams)]

    def stream(self, number):
        if number == NONE:
            return b""
        at, size, base = self.streams[number]
        prefix = None
        if base != NONE:  # a difference to another stream, which is the dictionary
            prefix = zstandard.ZstdCompressionDict(
                self.stream(base), dict_type=zstandard.DICT_TYPE_RAWCONTENT)
        return zstandard.ZstdDecompressor(dict_data=prefix).decompress(self.data[at:at + size])

    def frame(self, index):
        _, _, first, count = self.frames[index]
        cells, samples = [np.zeros((0, 3), np.int64)], {name: [] for name, _, _ in self.channels}
        for x, y, z, _, _, octree, *numbers in self.tiles[first:first + count]:
            codes, has_attributes = read_octree(self.stream(octree))
            origin = np.array((x, y, z)) * self.side
            cells.append(np.stack([compact(codes >> c) for c in range(3)], 1) + origin)
            for channel, number in zip(self.channels, numbers):
                samples[channel[0]].append(planes(self.stream(number), has_attributes, *channel))
        empty = {name: np.zeros((0, n), dtype) for name, n, dtype in CHANNELS}
        return {"dims": self.dims, "origin": self.origin, "voxel_size": self.voxel_size,
                "meta": self.meta, "cells": np.concatenate(cells),
                **{name: np.concatenate([empty[name], *samples[name]]) if name in samples else None
                   for name in empty}}


if __name__ == "__main__":
    sequence = Sequence(open(sys.argv[1], "rb").read())
    print(sequence.dims, sequence.origin, sequence.voxel_size, len(sequence.times), "frames")
    for number, (time, voxels, *_) in enumerate(sequence.frames):
        print(number, f"{time:g} s", voxels, "voxels")
