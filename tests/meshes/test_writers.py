"""GLB as others write it: glTF-Transform with the encoders of Draco and meshoptimizer. The packages are those of
package-lock.json; VOXELD_MESHES_DIR is the folder that uses them."""
import io
import json
import os
import pathlib
import shutil
import subprocess
import sys
import unittest

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "tests/integration"))
import npm_packages  # noqa: E402
from harness import DaemonTest  # noqa: E402

WORK = pathlib.Path(os.environ.get("VOXELD_MESHES_DIR", ROOT / "build/dev/meshes"))
EXTENSIONS = {"draco-edgebreaker": "KHR_draco_mesh_compression", "draco-sequential": "KHR_draco_mesh_compression",
              "meshopt": "EXT_meshopt_compression", "meshopt-filters": "EXT_meshopt_compression"}
# Voxels whose colours may differ: encoders quantize, so an edge of a triangle moves to the next cell.
DIFFERENT_PART_MAX = 0.01


def grown(voxels):
    """The cells at most one cell away from a voxel, in the last three axes."""
    for axis in (-3, -2, -1):
        ends = [(0, 0)] * voxels.ndim
        ends[axis] = (1, 1)
        padded = np.pad(voxels, ends)
        cells = voxels.shape[axis]
        voxels = np.logical_or.reduce([np.take(padded, range(at, at + cells), axis) for at in range(3)])
    return voxels


class Writers(DaemonTest):
    device = "cpu"

    @classmethod
    def setUpClass(cls):
        npm_packages.prepare(HERE, WORK)
        shutil.copyfile(HERE / "compress.mjs", WORK / "compress.mjs")
        super().setUpClass()

    def compressed(self, name, kind):
        (WORK / name).write_bytes(self.fixture(name))
        done = subprocess.run(["node", "compress.mjs", name, f"{kind}.glb", kind], cwd=WORK, timeout=300,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, 0, done.stderr[-4000:])
        data = (WORK / f"{kind}.glb").read_bytes()
        document = json.loads(data[20:20 + int.from_bytes(data[12:16], "little")])
        self.assertIn(EXTENSIONS[kind], document["extensionsRequired"])
        return data

    def grid(self, query, data):
        response = self.daemon.post(f"/v1/voxelize?{query}&format=npz&filename=a.glb", data)
        self.assertEqual(response.status, 200, response.body)
        return np.load(io.BytesIO(response.body))

    def check(self, name, query):
        expected = self.grid(query, self.fixture(name))
        voxels = expected["occupancy"] > 0
        for kind in EXTENSIONS:
            with self.subTest(kind=kind):
                grid = self.grid(query, self.compressed(name, kind))
                self.assertEqual(grid["occupancy"].shape, voxels.shape)
                found = grid["occupancy"] > 0
                self.assertFalse((found & ~grown(voxels)).any())
                self.assertFalse((voxels & ~grown(found)).any())
                if "color" in expected:
                    both = found & voxels
                    far = np.abs(grid["color"][both].astype(int) - expected["color"][both]).max(axis=1) > 8
                    self.assertLess(np.count_nonzero(far), DIFFERENT_PART_MAX * np.count_nonzero(both))

    def test_a_textured_mesh(self):
        self.check("sample.glb", "size=96&channels=color")

    def test_an_animated_mesh(self):
        self.check("spin.glb", "size=48&animation=0&frames=0..6")


if __name__ == "__main__":
    unittest.main()
