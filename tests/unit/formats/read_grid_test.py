"""The reader of the documentation, docs/read_grid.py, and the oracle of codec small against what the
daemon's encoder was given.

    read_grid_test.py WRITE_SAMPLE    the program that writes the samples
"""
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "docs"))
import read_grid  # noqa: E402
import small_oracle  # noqa: E402
from same_rows import SameRows  # noqa: E402

WRITE_SAMPLE = sys.argv.pop(1)
CHANNELS = ["color", "normal", "material", "label", "distance", "coverage"]


class ReadGrid(SameRows, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory() as directory:
            subprocess.run([WRITE_SAMPLE, directory], check=True)
            folder = pathlib.Path(directory)
            cls.grids = {path.stem: path.read_bytes() for path in folder.glob("*.voxg")}
            cls.voxels = np.loadtxt(folder / "voxels.txt", dtype=int)
            cls.solid = np.loadtxt(folder / "solid.txt", dtype=int)

    def rows(self, grid):
        """Cells and channels as the text has them."""
        columns = [np.asarray(grid["cells"]), *(grid[name].astype(int) for name in CHANNELS)]
        return np.hstack(columns)

    def test_voxels_and_all_their_channels_are_what_was_written(self):
        grid = read_grid.read_grid(self.grids["all"])
        self.assert_same_rows(self.rows(grid), self.voxels)
        self.assertEqual(grid["color"].dtype, np.uint8)
        self.assertEqual(grid["normal"].dtype, np.int8)

    def test_the_grid_has_several_tiles_and_lies_where_it_was_placed(self):
        grid = read_grid.read_grid(self.grids["all"])
        self.assertGreater(len(np.unique(np.asarray(grid["cells"]) // 256, axis=0)), 6)
        self.assertEqual(grid["dims"], (300, 530, 270))
        self.assertEqual(grid["origin"], (-1.5, 0.25, 1e10))
        self.assertEqual(grid["voxel_size"], (0.5, 0.25, 0.125))
        self.assertEqual(grid["meta"], {"units": "mm"})

    def test_channels_that_are_not_there_are_none(self):
        grid = read_grid.read_grid(self.grids["bare"])
        for name in CHANNELS:
            self.assertIsNone(grid[name])
        self.assert_same_rows(np.asarray(grid["cells"]), self.voxels[:, :3])

    def test_voxels_of_full_nodes_are_there_and_have_none_but_coverage(self):
        grid = read_grid.read_grid(self.grids["solid"])
        self.assert_same_rows(self.rows(grid), self.solid)

    def small_voxels(self, name):
        """The voxels of a grid of one tile at the origin, by the oracle of codec small."""
        data = self.grids[name]
        self.assertEqual(data[104], 1)
        channels, = struct.unpack_from("<I", data, 12)
        meta_bytes, = struct.unpack_from("<I", data, 84)
        entry = 128 + (meta_bytes + 7) // 8 * 8
        names = ["octree", *(name for i, name in enumerate(CHANNELS) if channels >> i & 1)]
        at, *sizes = struct.unpack_from(f"<Q{len(names)}I", data, entry + 24)
        streams = {}
        for name, size in zip(names, sizes):
            streams[name] = data[at:at + size]
            at += size
        return small_oracle.read_tile(streams)

    def test_codec_small_is_what_another_reader_of_its_specification_reads(self):
        voxels = self.small_voxels("small")
        grid = read_grid.read_grid(self.grids["small_as_fast"])
        self.assertGreater(sum(bool(channels) for channels in voxels.values()), 1000)
        for i, cell in enumerate(grid["cells"].tolist()):
            got = voxels.pop(tuple(cell))
            for name in CHANNELS:
                expected = tuple(grid[name][i].tolist())
                inside = (255,) if name == "coverage" else (0,) * len(expected)
                self.assertEqual(got.get(name, inside), expected, (cell, name))
        self.assertEqual(list(voxels), [])

    def test_octants_of_codec_small_are_what_another_reader_reads(self):
        voxels = self.small_voxels("split")
        grid = read_grid.read_grid(self.grids["split_as_fast"])
        self.assertEqual(set(voxels), set(map(tuple, grid["cells"].tolist())))

    def test_the_other_codec_is_refused(self):
        with self.assertRaisesRegex(ValueError, "not a voxeld grid of version 3 and codec fast"):
            read_grid.read_grid(self.grids["small"])

    def test_an_empty_grid_has_no_cells(self):
        grid = read_grid.read_grid(self.grids["empty"])
        self.assertEqual(np.asarray(grid["cells"]).shape, (0, 3))

    def test_another_file_is_refused(self):
        with self.assertRaisesRegex(ValueError, "not a voxeld grid of version 3"):
            read_grid.read_grid(b"VOXGRIM" + self.grids["all"][7:])


if __name__ == "__main__":
    unittest.main()
