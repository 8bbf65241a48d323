"""Reads animated .vox by the text of the format, for tests alone."""
import struct

import numpy as np


class Vox:
    """Animated .vox: models, shapes with keyframes, transforms; cells with z up."""

    def __init__(self, data):
        magic, self.version = struct.unpack_from("<4si", data)
        name, content, children = struct.unpack_from("<4sII", data, 8)
        if (magic, name, content, 20 + children) != (b"VOX ", b"MAIN", 0, len(data)):
            raise ValueError("not a .vox")
        self.models, self.shapes, self.transforms, self.children = [], {}, {}, []
        at = 20
        while at < len(data):
            name, size, inner = struct.unpack_from("<4sII", data, at)
            assert inner == 0
            self.data, self.at = data[at + 12:at + 12 + size], 0
            getattr(self, name.decode())()
            assert name in (b"XYZI", b"RGBA") or self.at == size, name
            at += 12 + size

    def i32(self):
        self.at += 4
        return struct.unpack_from("<i", self.data, self.at - 4)[0]

    def text(self):
        size = self.i32()
        self.at += size
        return self.data[self.at - size:self.at].decode()

    def dict(self):
        return {self.text(): self.text() for _ in range(self.i32())}

    def SIZE(self):
        self.size = np.array([self.i32() for _ in range(3)])

    def XYZI(self):
        count = self.i32()
        voxels = np.frombuffer(self.data, np.uint8, offset=4).reshape(-1, 4).astype(int)
        assert len(voxels) == count and (voxels[:, :3] < self.size).all()
        self.models.append((self.size, voxels))

    def nTRN(self):
        node, attributes, child, reserved, _, frames = self.i32(), self.dict(), *(
            self.i32() for _ in range(4))
        assert (reserved, frames) == (-1, 1)
        self.transforms[child] = self.dict()
        if node == 0:
            self.attributes = attributes

    def nGRP(self):
        self.i32(), self.dict()
        self.children = [self.i32() for _ in range(self.i32())]

    def nSHP(self):
        node, self.loop = self.i32(), self.dict()["_loop"]
        models = [(self.i32(), int(self.dict()["_f"])) for _ in range(self.i32())]
        self.shapes[node] = [(frame, model) for model, frame in models]
        assert self.shapes[node] == sorted(self.shapes[node]) and self.shapes[node][0][0] == 0

    def RGBA(self):
        self.palette = np.frombuffer(self.data, np.uint8).reshape(256, 4)

    def META(self):
        self.range = self.dict()["_anim_range"]

    def frame(self, index):
        """Rows x y z r g b, in the scene."""
        rows = [np.zeros((0, 6), int)]
        for shape in self.shapes:
            model = [model for frame, model in self.shapes[shape] if frame <= index][-1]
            size, voxels = self.models[model]
            place = np.array([int(n) for n in self.transforms[shape]["_t"].split()]) - size // 2
            rows.append(np.hstack([voxels[:, :3] + place, self.palette[voxels[:, 3] - 1, :3]]))
        return np.concatenate(rows)
