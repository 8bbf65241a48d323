"""Sequences in every format against what the daemon's encoders were given: the reader of the
documentation, docs/read_sequence.py; numpy; and a reader of animated .vox by the format's text.

    read_sequence_test.py WRITE_SEQUENCE_SAMPLE    the program that writes the samples
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "docs"))
import read_sequence  # noqa: E402
from same_rows import SameRows  # noqa: E402
from vox_scene import Vox  # noqa: E402

WRITE_SAMPLE = sys.argv.pop(1)
CHANNELS = {"color": 4, "normal": 3, "material": 1, "label": 1, "distance": 1, "coverage": 1}


class ReadSequence(SameRows, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        subprocess.run([WRITE_SAMPLE, cls.folder.name], check=True)
        cls.path = pathlib.Path(cls.folder.name)
        cls.voxels = {name: np.loadtxt(cls.path / f"{name}.txt", dtype=int)
                      for name in ("small", "wide")}

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def expected(self, name, frame):
        rows = self.voxels[name]
        return rows[rows[:, 0] == frame, 1:]

    def sequence(self, name):
        return read_sequence.Sequence((self.path / name).read_bytes())

    def test_frames_of_the_container_are_what_was_written(self):
        sequence = self.sequence("small.voxs")
        self.assertEqual(sequence.times, [i / 12.5 for i in range(6)])
        self.assertEqual((sequence.dims, sequence.fps), ((70, 40, 50), 12.5))
        self.assertEqual(sequence.meta, {"units": "mm"})
        self.assertTrue(any(base != read_sequence.NONE for *_, base in sequence.streams))
        for index in (5, 0, 3, 1, 2, 4):
            frame = sequence.frame(index)
            columns = [frame["cells"], *(frame[name].astype(int) for name in CHANNELS)]
            self.assert_same_rows(np.hstack(columns), self.expected("small", index))
            self.assertEqual(sequence.frames[index][1], len(frame["cells"]))

    def test_tiles_come_and_go_and_channels_that_are_not_there_are_none(self):
        sequence = self.sequence("wide.voxs")
        for index in range(4):
            frame = sequence.frame(index)
            self.assertIsNone(frame["normal"])
            rows = np.hstack([frame["cells"], frame["color"].astype(int)])
            self.assert_same_rows(rows, self.expected("wide", index)[:, :7])
        self.assertEqual(len(sequence.frame(2)["cells"]), 0)

    def test_the_other_codec_and_other_files_are_refused(self):
        for name in ("codec_small.voxs", "small.vox"):
            with self.assertRaisesRegex(ValueError, "not a voxeld sequence of version 1 and codec"):
                self.sequence(name)

    def assert_array(self, array, rows, columns):
        """Frames in front and z, y, x: samples of the voxels, and nothing elsewhere."""
        at = tuple(rows[:, [0, 3, 2, 1]].T)
        values = array[at].reshape(len(rows), -1)
        self.assertTrue(np.array_equal(values, columns))
        self.assertEqual(np.count_nonzero(array), np.count_nonzero(columns))

    def test_npz_has_a_frame_axis_first(self):
        rows = self.voxels["small"]
        with np.load(self.path / "small.npz") as arrays:
            self.assertEqual(set(arrays), {"occupancy", "times", "origin", "voxel_size", "meta",
                                           *CHANNELS})
            self.assertEqual(arrays["times"].dtype, np.float64)
            self.assertEqual(arrays["times"].tolist(), [i / 12.5 for i in range(6)])
            self.assertEqual(arrays["voxel_size"].tolist(), [0.5, 0.25, 0.125])
            self.assertEqual(arrays["meta"].tobytes(), b'{"units":"mm"}')
            self.assertEqual(arrays["occupancy"].shape, (6, 50, 40, 70))
            self.assertEqual(arrays["color"].shape, (6, 50, 40, 70, 4))
            self.assert_array(arrays["occupancy"], rows, np.ones((len(rows), 1)))
            column = 4
            for name, count in CHANNELS.items():
                if name != "distance":  # it has values everywhere
                    self.assert_array(arrays[name], rows, rows[:, column:column + count])
                column += count

    def test_npz_in_fortran_order_has_it_last(self):
        with np.load(self.path / "xyz.npz") as arrays, np.load(self.path / "small.npz") as zyx:
            for name in ("occupancy", "material", "distance"):
                self.assertTrue(arrays[name].flags.f_contiguous)
                self.assertEqual(arrays[name].shape, (70, 40, 50, 6))
                self.assertTrue(np.array_equal(arrays[name].T, zyx[name]), name)
            self.assertEqual(arrays["color"].shape, (70, 40, 50, 4, 6))
            alpha = np.moveaxis(arrays["color"], 3, 0)[3]
            self.assertTrue(np.allclose(alpha.T * 255, zyx["color"][..., 3], atol=1e-4))

    def test_npy_is_the_occupancy(self):
        array, rows = np.load(self.path / "small.npy", mmap_mode="r"), self.voxels["small"]
        self.assertEqual((array.dtype, array.shape), (np.bool_, (6, 50, 40, 70)))
        self.assert_array(array, rows, np.ones((len(rows), 1)))

    def vox_rows(self, name, frame, dims):
        """Rows of the text: cells as .vox has them, and colours."""
        rows = self.expected(name, frame)
        x, y, z = rows[:, 0], rows[:, 1], rows[:, 2]
        return np.stack([x - dims[0] // 2, dims[2] - 1 - z - dims[2] // 2, y, *rows[:, 3:6].T], 1)

    def test_animated_vox_has_the_cells_and_colours_of_every_frame(self):
        vox = Vox((self.path / "wide.vox").read_bytes())
        self.assertEqual((vox.version, vox.range, vox.loop), (200, "0 3", "1"))
        self.assertEqual(vox.attributes["dims"], "300,40,530")
        self.assertEqual(len(vox.children), 6)
        for index in range(4):
            self.assert_same_rows(vox.frame(index), self.vox_rows("wide", index, (300, 40, 530)))

    def test_animated_vox_shares_one_palette_and_equal_models(self):
        vox = Vox((self.path / "small.vox").read_bytes())
        labels = {label for index in range(6) for label in self.expected("small", index)[:, 11]}
        self.assertEqual(len(vox.models), 5 * len(labels))  # the last frame was there before
        self.assertEqual(len(vox.shapes), len(labels))
        for shape in vox.shapes.values():
            self.assertEqual([frame for frame, _ in shape], list(range(6)))
            self.assertEqual(shape[5][1], shape[1][1])
            self.assertEqual(len({model for _, model in shape}), 5)
        for index in range(6):
            rows = vox.frame(index)
            self.assert_same_rows(rows[:, :3], self.vox_rows("small", index, (70, 40, 50))[:, :3])


if __name__ == "__main__":
    unittest.main()
