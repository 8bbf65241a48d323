"""The CLI voxel, as a person or a script uses it."""
import io
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np

from harness import BIN, DaemonTest


class Cli(DaemonTest):
    def setUp(self):
        self.directory = tempfile.TemporaryDirectory()
        self.dir = pathlib.Path(self.directory.name)

    def tearDown(self):
        self.directory.cleanup()

    def voxel(self, *arguments, stdin=None, url=None):
        return subprocess.run([BIN / "voxel", *map(str, arguments)], input=stdin, capture_output=True,
                              env={**os.environ, "VOXELD_URL": url or self.daemon.url}, timeout=120)

    def test_format_by_extension(self):
        for name, magic in (("a.npy", b"\x93NUMPY"), ("a.npz", b"PK"), ("a.vox", b"VOX ")):
            done = self.voxel(self.fixtures / "sample.ply", "-o", self.dir / name, "--size", 32)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(done.stdout, b"")
            self.assertTrue((self.dir / name).read_bytes().startswith(magic))

    def test_pipes(self):
        done = self.voxel("-", "-o", "-", "--format", "npy", "--size", 16, "--filename", "a.ply",
                          stdin=self.fixture("sample.ply"))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(max(np.load(io.BytesIO(done.stdout)).shape), 16)

    def test_render(self):
        done = self.voxel("render", self.fixtures / "sample.glb", "-o", self.dir / "a.png",
                          "--size", 32, "--width", 64, "--height", 64)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((self.dir / "a.png").read_bytes().startswith(b"\x89PNG"))

    def test_info_jobs_and_json(self):
        done = self.voxel(self.fixtures / "sample.ply", "-o", self.dir / "a.voxg", "--size", 32, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(max(json.loads(done.stdout)["meta"]["dims"]), 32)
        info = self.voxel("info", self.dir / "a.voxg", "--json")
        self.assertEqual(max(json.loads(info.stdout)["dims"]), 32)
        self.assertEqual(self.voxel("info", self.fixtures / "sample.glb").returncode, 0)
        jobs = self.voxel("jobs", "--json")
        self.assertEqual(jobs.returncode, 0, jobs.stderr)
        self.assertTrue(json.loads(jobs.stdout))

    def test_exit_codes(self):
        sample = self.fixtures / "sample.ply"
        out = self.dir / "a.npy"
        self.assertEqual(self.voxel("--nonsense").returncode, 2)
        self.assertEqual(self.voxel(sample, "-o", out, "--size", "many").returncode, 2)
        (self.dir / "bad.obj").write_text("v 1 2\nf 1 2 3\n")
        bad = self.voxel(self.dir / "bad.obj", "-o", out)
        self.assertEqual(bad.returncode, 3)
        self.assertIn(b"line 1", bad.stderr)
        self.assertEqual(self.voxel(sample, "-o", out, "--voxel-size", "1e-7").returncode, 4)
        self.assertEqual(self.voxel(sample, "-o", out, url="http://127.0.0.1:9").returncode, 5)
        self.assertFalse(out.exists())

    def test_help_names_every_option(self):
        text = self.voxel("--help").stdout.decode() + self.voxel("render", "--help").stdout.decode()
        for flag in ("--size", "--dims", "--voxel-size", "--padding", "--bounds", "--color",
                     "--channels", "--pipeline", "--format", "--azimuth", "--section"):
            self.assertIn(flag, text)


if __name__ == "__main__":
    unittest.main()
