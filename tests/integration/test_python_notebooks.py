"""The notebooks of the Python package run from the first cell to the last, against a daemon of their own."""
import base64
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import python_package
from harness import DaemonTest

NOTEBOOKS = python_package.PACKAGE / "notebooks"
RUN_SECONDS = 600
COMMITTED_BYTES_MAX = 64 * 1024
NBCONVERT = shutil.which("jupyter-nbconvert", path="/usr/bin")


class Notebooks(DaemonTest):
    device = "cpu"

    def run_notebook(self, name):
        """The cells of code after their run."""
        if NBCONVERT is None:
            self.skipTest("jupyter-nbconvert is not installed")
        with tempfile.TemporaryDirectory() as folder:
            shutil.copy(NOTEBOOKS / f"{name}.ipynb", folder)
            environment = {"PATH": "/usr/bin:/bin", "HOME": folder, "LANG": "C.UTF-8", **python_package.ENVIRONMENT,
                           "VOXELD_URL": self.daemon.url, "VOXELD_SAMPLES": str(self.fixtures),
                           # A quarter of the side, so that a run takes seconds.
                           "NOTEBOOK_SIZE": os.environ.get("NOTEBOOK_SIZE", "1024")}
            done = subprocess.run([NBCONVERT, "--to", "notebook", "--execute", "--output", "done.ipynb",
                                   f"{name}.ipynb"], cwd=folder, env=environment, capture_output=True, text=True,
                                  timeout=RUN_SECONDS)
            self.assertEqual(done.returncode, 0, done.stderr)
            cells = json.loads(pathlib.Path(folder, "done.ipynb").read_text())["cells"]
        return [cell for cell in cells if cell["cell_type"] == "code"]

    def images(self, cells):
        """The first bytes of the PNGs that the cells show."""
        return [base64.b64decode(output["data"]["image/png"])[:8] for cell in cells for output in cell["outputs"]
                if "image/png" in output.get("data", {})]

    def texts(self, cells):
        return "".join("".join(output.get("text", [])) for cell in cells for output in cell["outputs"])

    def grids(self):
        """The number of jobs that have made grids."""
        jobs = self.daemon.get("/v1/jobs?limit=1000").json()["jobs"]
        return sum(job["kind"] == "voxelize" for job in jobs)

    def test_dataset(self):
        before = self.grids()
        cells = self.run_notebook("dataset")
        self.assertEqual(len(self.images(cells)), 1)
        self.assertRegex(self.texts(cells), r"accuracy (0\.[6-9]\d|1\.00) of 5 classes")
        self.assertEqual(self.grids() - before, 50)

    def test_animation(self):
        cells = self.run_notebook("animation")
        self.assertEqual(self.images(cells), [b"\x89PNG\r\n\x1a\n"])
        self.assertIn("0 0.000 s", self.texts(cells))
        self.assertTrue(any("data:image/gif" in "".join(output.get("data", {}).get("text/html", ""))
                            for output in cells[-1]["outputs"]))

    def test_big_grid(self):
        cells = self.run_notebook("big_grid")
        self.assertEqual(self.images(cells), [b"\x89PNG\r\n\x1a\n"] * 3)
        self.assertRegex(self.texts(cells), r"5 \(\d+, \d+, \d+\) \d+")


class Committed(unittest.TestCase):
    def test_notebooks_are_small_and_have_no_outputs(self):
        found = sorted(NOTEBOOKS.glob("*.ipynb"))
        self.assertEqual([path.stem for path in found], ["animation", "big_grid", "dataset"])
        for path in found:
            self.assertLess(path.stat().st_size, COMMITTED_BYTES_MAX)
            for cell in json.loads(path.read_text())["cells"]:
                self.assertFalse(cell.get("outputs"), path)
                self.assertIsNone(cell.get("execution_count"), path)


if __name__ == "__main__":
    unittest.main()
