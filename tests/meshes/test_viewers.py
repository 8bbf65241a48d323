"""GLB as others read it: Khronos' validator, three.js with meshoptimizer's decoder, and Manifold, which takes only closed
manifold meshes. The packages are those of package-lock.json; VOXELD_MESHES_DIR is the folder that uses them."""
import io
import os
import pathlib
import sys
import unittest

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "tests/integration"))
import npm_packages  # noqa: E402
from harness import DaemonTest  # noqa: E402

WORK = pathlib.Path(os.environ.get("VOXELD_MESHES_DIR", ROOT / "build/dev/meshes"))
# The validator knows no rules for these extensions, and so sees no use of what only they refer to.
UNKNOWN_EXTENSIONS = {"UNSUPPORTED_EXTENSION", "UNUSED_OBJECT"}


class Viewers(DaemonTest):
    device = "cpu"

    @classmethod
    def setUpClass(cls):
        cls.reader = npm_packages.Program(HERE, WORK, "read_mesh.mjs")
        cls.addClassCleanup(cls.reader.end)
        super().setUpClass()

    def voxelize(self, query, name="sample.glb"):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename={name}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response.body

    def read(self, query):
        return self.read_file(self.voxelize(query + "&format=glb"))

    def read_file(self, data):
        (WORK / "mesh.glb").write_bytes(data)
        return self.reader("mesh.glb")

    def grid(self, query):
        return np.load(io.BytesIO(self.voxelize(query + "&format=npz")))

    def box(self, grid):
        """The occupied box in world units."""
        cells = np.argwhere(grid["occupancy"])[:, ::-1]
        return [grid["origin"] + at * grid["voxel_size"] for at in (cells.min(0), cells.max(0) + 1)]

    def check_box(self, three, grid, tolerance):
        low, high = self.box(grid)
        np.testing.assert_allclose(three["min"], low, rtol=0, atol=tolerance)
        np.testing.assert_allclose(three["max"], high, rtol=0, atol=tolerance)

    def test_the_validator_has_nothing_to_say(self):
        for query in ("size=32", "size=32&mesh=faces", "size=32&mesh=smooth&fill=solid", "size=200",
                      "size=32&color=none&channels=occupancy", "size=8&bounds=100,100,100,101,101,101",
                      "size=32&units=mm&transform=2,0,0,1,0,2,0,0,0,0,2,0,0,0,0,1"):
            self.assertEqual(self.read(query)["validator"], [], query)
        for query in ("size=32&compress=meshopt", "size=32&mesh=smooth&compress=meshopt", "size=32&mesh=instances"):
            issues = self.read(query)["validator"]
            self.assertLessEqual({issue["code"] for issue in issues}, UNKNOWN_EXTENSIONS, issues)

    def test_a_solid_is_a_closed_manifold_whose_volume_is_that_of_its_voxels(self):
        # A ball of this file has no voxels that touch at an edge alone.
        query = "size=24&fill=solid&rule=none&sign=parity"
        ball = self.ball()
        for more in ("", "&mesh=faces", "&compress=meshopt", "&color=axis&mesh=faces"):
            read = self.read_file(self.post(ball, f"{query}{more}&format=glb"))
            voxels = np.load(io.BytesIO(self.post(ball, query + "&format=npz")))["occupancy"].sum()
            self.assertEqual(read["manifold"], {"volume": int(voxels)}, more)
        smooth = "size=24&fill=solid&mesh=smooth&format=glb&channels=occupancy,"
        for channel in ("distance", "coverage"):
            manifold = self.read_file(self.post(ball, smooth + channel))["manifold"]
            self.assertIn("volume", manifold)
            self.assertAlmostEqual(manifold["volume"] / (4 / 3 * np.pi * 12 ** 3), 1, delta=0.02)

    def ball(self, rows=48):
        """An OBJ of a ball of radius 1."""
        lines, columns = [], 2 * rows
        for i in range(1, rows):
            for k in range(columns):
                polar, around = np.pi * i / rows, 2 * np.pi * k / columns
                lines.append(f"v {np.sin(polar) * np.cos(around)} {np.cos(polar)} {np.sin(polar) * np.sin(around)}")
        lines += ["v 0 1 0", "v 0 -1 0"]
        top, bottom = (rows - 1) * columns + 1, (rows - 1) * columns + 2
        for k in range(columns):
            a, b = k + 1, (k + 1) % columns + 1
            for i in range(rows - 2):
                lines.append(f"f {a + i * columns} {b + i * columns} {b + (i + 1) * columns} {a + (i + 1) * columns}")
            last = (rows - 2) * columns
            lines += [f"f {top} {b} {a}", f"f {bottom} {a + last} {b + last}"]
        return "\n".join(lines).encode()

    def post(self, body, query):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename=ball.obj", body)
        self.assertEqual(response.status, 200, response.body)
        return response.body

    def test_three_reads_the_voxels_at_their_place(self):
        grid = self.grid("size=48")
        voxel = float(grid["voxel_size"][0])
        for query in ("size=48", "size=48&mesh=faces", "size=48&compress=meshopt"):
            three = self.read(query)["three"]
            self.assertEqual((three["meshes"], three["attributes"]), (1, ["color", "position"]))
            self.check_box(three, grid, 1e-5 * voxel)
        plain, packed = (self.read("size=48&mesh=smooth" + more)["three"] for more in ("", "&compress=meshopt"))
        self.assertEqual(packed["triangles"], plain["triangles"])
        self.assertEqual(packed["attributes"], ["color", "normal", "position"])
        for end in ("min", "max"):
            np.testing.assert_allclose(packed[end], plain[end], rtol=0, atol=voxel / 1000)

    def test_compressed_files_are_smaller_and_hold_the_same_triangles(self):
        for more in ("", "&mesh=faces", "&color=none&channels=occupancy"):
            plain, packed = (self.voxelize(f"size=64&format=glb{more}{c}") for c in ("", "&compress=meshopt"))
            self.assertLess(len(packed), len(plain) / 2)
            self.assertEqual(self.read(f"size=64{more}&compress=meshopt")["three"]["triangles"],
                             self.read(f"size=64{more}")["three"]["triangles"])

    def test_instances_are_the_voxels_with_an_outer_face(self):
        for query in ("size=40", "size=40&fill=solid", "size=40&fill=solid&compress=meshopt"):
            grid = self.grid(query.split("&compress")[0])
            padded = np.pad(grid["occupancy"], 1)
            buried = padded.copy()
            for axis in range(3):
                buried &= np.roll(padded, 1, axis) & np.roll(padded, -1, axis)
            outer = int(padded.sum() - buried.sum())
            three = self.read(query + "&mesh=instances")["three"]
            self.assertEqual((three["instances"], three["instance_colors"], three["triangles"]), (outer, outer, 12))
            self.check_box(three, grid, 1e-5)


if __name__ == "__main__":
    unittest.main()
