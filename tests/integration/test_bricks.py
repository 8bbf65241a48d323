"""OctoMap's octrees, by OctoMap's own tools, and LDraw's bricks, by a reader of the specification; both compared with
the npz of the same grid."""
import io
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import zipfile

import numpy as np

from harness import ROOT, DaemonTest
from minecraft_readers import oklab

sys.path.insert(0, str(ROOT / "tests/reference"))
import brick_readers as readers  # noqa: E402

SURFACE = "size=61&channels=color,normal,label&labels=material"
SOLID = "size=48&fill=solid&channels=color,material,coverage"
BAND = "size=40&fill=band"
QUERIES = (SURFACE, SOLID, "size=48&fill=solid&channels=occupancy", BAND)
PLACES = ("", "&level=1", "&region=10,5,3,36,17,18", "&region=10,5,3,36,17,18&level=1")
COLORS = readers.color_table((ROOT / "server/formats/points/ldraw_colors.cpp").read_text())
BOX = re.compile(r"translation (\S+) (\S+) (\S+) *\n *children \[ Shape \{ geometry Box \{ size (\S+) ")


def tool(*arguments):
    subprocess.run(arguments, check=True, capture_output=True)


def comment(comments, name):
    """The numbers of the comment with this name."""
    text, = [line[len(name) + 1:] for line in comments if line.startswith(name + " ")]
    return np.array(text.split(), float)


class Bricks(DaemonTest):
    def voxelize(self, query, name="sample.obj.zip"):
        response = self.daemon.post(f"/v1/voxelize?{query}&filename={name}", self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return response

    def npz(self, query):
        return np.load(io.BytesIO(self.voxelize(query + "&format=npz").body))

    def occupied(self, grid):
        return np.argwhere(grid["occupancy"])[:, ::-1]

    def check_same_cells(self, got, wanted, name):
        order = np.lexsort(got.T), np.lexsort(wanted.T)
        self.assertEqual(got.shape, wanted.shape, name)
        self.assertTrue((got[order[0]] == wanted[order[1]]).all(), name)

    def boxes(self, directory):
        """(centre, edge) of each occupied leaf as OctoMap reads the file."""
        tool("bt2vrml", directory / "a.bt")
        return np.array(BOX.findall((directory / "a.bt.wrl").read_text()), float).reshape(-1, 4)

    def test_octomap_reads_the_voxels_at_their_places(self):
        # bt2vrml writes six digits, so the voxel size is one that has few.
        for query in (q.replace(re.match(r"size=\d+", q)[0], "voxel_size=0.125") for q in QUERIES):
            for place in PLACES[:2]:
                grid = self.npz(query + place)
                data = self.voxelize(query + place + "&format=bt").body
                comments = readers.read_bt(data).comments
                size = grid["voxel_size"][0]
                with tempfile.TemporaryDirectory() as name:
                    (pathlib.Path(name) / "a.bt").write_bytes(data)
                    boxes = self.boxes(pathlib.Path(name))
                sides = np.round(boxes[:, 3] / size).astype(int)
                corners = boxes[:, :3] - boxes[:, 3:] / 2 + comment(comments, "offset")
                cells = (corners - grid["origin"]) / size
                np.testing.assert_allclose(cells, np.round(cells), atol=1e-2)
                self.check_same_cells(readers.leaf_cells(np.round(cells).astype(int), sides), self.occupied(grid),
                                      (query, place))
                if "solid" in query and not place:
                    self.assertGreater(sides.max(), 1)

    def test_octomap_writes_the_same_tree(self):
        for query in QUERIES:
            for place in PLACES:
                data = self.voxelize(query + place + "&format=bt").body
                with tempfile.TemporaryDirectory() as name:
                    source, copy = pathlib.Path(name) / "a.bt", pathlib.Path(name) / "b.bt"
                    source.write_bytes(data)
                    tool("edit_octree", "-o", copy, source)
                    ours, theirs = readers.read_bt(data), readers.read_bt(copy.read_bytes())
                self.assertEqual(ours.body, theirs.body)
                self.assertEqual(ours.size, theirs.size)

    def test_a_bt_has_the_voxels_of_the_npz_and_their_place(self):
        for query in QUERIES:
            for place in PLACES:
                grid = self.npz(query + place)
                octree = readers.read_bt(self.voxelize(query + place + "&format=bt").body)
                size = grid["voxel_size"][0]
                self.assertEqual(octree.resolution, size)
                offset = comment(octree.comments, "offset")
                self.assertLessEqual(np.abs(offset).max(), size * 0.5001)
                first = (grid["origin"] - offset) / size
                np.testing.assert_allclose(first, np.round(first), atol=1e-9)
                cells = readers.leaf_cells(octree.keys, octree.sides) - np.round(first).astype(int)
                self.check_same_cells(cells, self.occupied(grid), (query, place))
                np.testing.assert_array_equal(comment(octree.comments, "origin"), grid["origin"])
                np.testing.assert_array_equal(comment(octree.comments, "dims"), grid["occupancy"].shape[::-1])

    def test_an_octree_far_from_the_origin_begins_at_0(self):
        query = "size=30&transform=1,0,0,500000,0,1,0,0,0,0,1,0,0,0,0,1"
        grid = self.npz(query)
        response = self.voxelize(query + "&format=bt")
        octree = readers.read_bt(response.body)
        offset = comment(octree.comments, "offset")
        self.assertEqual(offset[0], grid["origin"][0])
        self.assertLess(np.abs(offset[1:]).max(), grid["voxel_size"][0])
        cells = readers.leaf_cells(octree.keys, octree.sides)
        self.check_same_cells(cells - np.round((grid["origin"] - offset) / grid["voxel_size"]).astype(int),
                              self.occupied(grid), "far")

    def check_colors(self, bricks, grid):
        x, y, z = bricks.cells.T
        own = grid["color"][z, y, x]
        codes = list(COLORS)
        chosen = np.array([codes.index(color) for color in bricks.colors])
        colored = own[:, 3] > 0  # not inside
        unique, inverse = np.unique(own[colored][:, :3], axis=0, return_inverse=True)
        far = np.linalg.norm(oklab(unique)[:, None] - oklab(np.array(list(COLORS.values())))[None], axis=2)
        self.assertLess((far[inverse, chosen[colored]] - far.min(1)[inverse]).max(), 1e-5)
        self.assertLessEqual(len(set(chosen[~colored])), 1)

    def test_bricks_cover_each_voxel_once_in_its_nearest_colour(self):
        self.assertGreater(len(COLORS), 40)
        for query in (SURFACE, SOLID, "size=48&fill=solid&channels=occupancy", BAND + "&channels=distance"):
            for place in PLACES:
                grid = self.npz(query + place)
                bricks = readers.read_ldr(self.voxelize(query + place + "&format=ldr").body)
                self.check_same_cells(bricks.cells, self.occupied(grid), (query, place))
                self.assertLess(bricks.count, len(bricks.cells))
                self.assertEqual(bricks.steps, len(np.unique(bricks.cells[:, 1])))
                np.testing.assert_array_equal(comment(bricks.comments, "origin"), grid["origin"])
                np.testing.assert_array_equal(comment(bricks.comments, "voxel_size"), grid["voxel_size"])
                if "color" in grid.files:
                    self.check_colors(bricks, grid)
                else:
                    self.assertEqual(set(bricks.colors), {"71"})

    def test_colours_of_a_palette_and_of_labels_are_direct(self):
        query = "size=40&channels=color&palette=%23ff0000,%2300ff00,%230000ff,%23808080"
        grid = self.npz(query)
        bricks = readers.read_ldr(self.voxelize(query + "&format=ldr").body)
        x, y, z = bricks.cells.T
        wanted = ["0x2%02X%02X%02X" % tuple(color) for color in grid["color"][z, y, x, :3]]
        self.assertEqual(bricks.colors, wanted)
        query = "size=40&channels=label&labels=material"
        grid = self.npz(query)
        bricks = readers.read_ldr(self.voxelize(query + "&format=ldr").body)
        x, y, z = bricks.cells.T
        pairs = set(zip(bricks.colors, grid["label"][z, y, x].tolist()))
        self.assertEqual(len(pairs), len(np.unique(grid["label"][z, y, x])))
        self.assertTrue(all(color.startswith("0x2") for color, _ in pairs))

    def test_voxels_of_the_proportions_of_bricks_keep_the_shape(self):
        query = "voxel_size=0.1,0.12,0.1"
        grid = self.npz(query)
        bricks = readers.read_ldr(self.voxelize(query + "&format=ldr").body)
        self.check_same_cells(bricks.cells, self.occupied(grid), query)
        octree = readers.read_bt(self.voxelize(query + "&format=bt").body)
        self.assertEqual(octree.resolution, 0.1)

    def test_frames_are_a_zip_of_files(self):
        query = "animation=walk&size=24"
        frames = np.load(io.BytesIO(self.voxelize(query + "&format=npz", "worm.md5.zip").body))["occupancy"]
        for form in ("bt", "ldr"):
            response = self.voxelize(f"{query}&format={form}", "worm.md5.zip")
            self.assertEqual(response.headers["Content-Type"], "application/zip")
            archive = zipfile.ZipFile(io.BytesIO(response.body))
            self.assertEqual(archive.namelist(), [f"frame-{i:04}.{form}" for i in range(len(frames))])
            for name, occupancy in zip(archive.namelist(), frames):
                data, wanted = archive.read(name), np.argwhere(occupancy)[:, ::-1]
                if form == "ldr":
                    self.check_same_cells(readers.read_ldr(data).cells, wanted, name)
                    continue
                octree = readers.read_bt(data)
                origin, offset = comment(octree.comments, "origin"), comment(octree.comments, "offset")
                first = np.round((origin - offset) / octree.resolution).astype(int)
                self.check_same_cells(readers.leaf_cells(octree.keys, octree.sides) - first, wanted, name)


if __name__ == "__main__":
    unittest.main()
