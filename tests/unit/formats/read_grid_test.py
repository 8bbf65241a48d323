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

WRITE_SAMPLE = sys.argv.pop(1)


class ReadGrid(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory() as directory:
            subprocess.run([WRITE_SAMPLE, directory], check=True)
            folder = pathlib.Path(directory)
            cls.grids = {path.stem: path.read_bytes() for path in folder.glob("*.voxg")}
            cls.voxels = np.loadtxt(folder / "voxels.txt", dtype=int)
            cls.solid = np.loadtxt(folder / "solid.txt", dtype=int)

    def rows(self, grid):
        """Cells and channels in the order of the text: sorted by cell."""
        columns = [np.asarray(grid["cells"]), grid["color"].astype(int),
                   grid["normal"].astype(int)]
        return sorted(map(tuple, np.hstack(columns)))

    def test_voxels_colours_and_normals_are_what_was_written(self):
        grid = read_grid.read_grid(self.grids["all"])
        self.assertEqual(self.rows(grid), sorted(map(tuple, self.voxels)))
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
        self.assertIsNone(grid["color"])
        self.assertIsNone(grid["normal"])
        self.assertEqual(sorted(map(tuple, grid["cells"])),
                         sorted(map(tuple, self.voxels[:, :3])))

    def test_voxels_of_full_nodes_are_there_and_have_no_attributes(self):
        grid = read_grid.read_grid(self.grids["solid"])
        self.assertEqual(self.rows(grid), sorted(map(tuple, self.solid)))

    def small_voxels(self, name):
        """The voxels of a grid of one tile at the origin, by the oracle of codec small."""
        data = self.grids[name]
        self.assertEqual(data[104], 1)
        channels, = struct.unpack_from("<I", data, 12)
        meta_bytes, = struct.unpack_from("<I", data, 84)
        entry = 128 + (meta_bytes + 7) // 8 * 8
        at, *sizes = struct.unpack_from("<Q3I", data, entry + 24)
        streams = []
        for size in sizes:
            streams.append(data[at:at + size])
            at += size
        return small_oracle.read_tile(streams, channels & 1, channels & 2)

    def test_codec_small_is_what_another_reader_of_its_specification_reads(self):
        voxels = self.small_voxels("small")
        grid = read_grid.read_grid(self.grids["small_as_fast"])
        none = [0] * 4, [0] * 3
        for cell, color, normal in zip(grid["cells"].tolist(), grid["color"].tolist(),
                                       grid["normal"].tolist()):
            got = voxels.pop(tuple(cell))
            expected = (None, None) if (color, normal) == none else (tuple(color), tuple(normal))
            self.assertEqual(got, expected, cell)
        self.assertEqual(voxels, {})

    def test_octants_of_codec_small_are_what_another_reader_reads(self):
        voxels = self.small_voxels("split")
        grid = read_grid.read_grid(self.grids["split_as_fast"])
        self.assertEqual(set(voxels), set(map(tuple, grid["cells"].tolist())))

    def test_the_other_codec_is_refused(self):
        with self.assertRaisesRegex(ValueError, "not a voxeld grid of version 2 and codec fast"):
            read_grid.read_grid(self.grids["small"])

    def test_an_empty_grid_has_no_cells(self):
        grid = read_grid.read_grid(self.grids["empty"])
        self.assertEqual(np.asarray(grid["cells"]).shape, (0, 3))

    def test_another_file_is_refused(self):
        with self.assertRaisesRegex(ValueError, "not a voxeld grid of version 2"):
            read_grid.read_grid(b"VOXGRIM" + self.grids["all"][7:])


if __name__ == "__main__":
    unittest.main()
