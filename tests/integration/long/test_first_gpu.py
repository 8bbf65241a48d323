"""docker/first-gpu, with Mesa's software driver under the name of a GPU."""
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from harness import BIN, ROOT

FAKE = {"force_gl_renderer": "FakeGPU"}


class FirstGpu(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-first-gpu-test-"))
        self.addCleanup(shutil.rmtree, self.folder)

    def check(self, *arguments, binaries=BIN, **environment):
        """The finished script and its report, or None."""
        out = self.folder / "report.md"
        done = subprocess.run([ROOT / "docker/first-gpu", "--quick", "--bin", binaries, "--out", out, *arguments],
                              capture_output=True, text=True, timeout=850, env={**os.environ, **environment})
        return done, out.read_text() if out.exists() else None

    def test_equal_grids_and_times_are_reported(self):
        done, report = self.check(**FAKE)
        self.assertEqual(done.returncode, 0, done)
        compared = int(re.search(r"All (\d+) results are equal to those of the CPU\.", report).group(1))
        self.assertGreaterEqual(compared, 25)
        for heading in ("Machine", "voxeld doctor", "Times"):
            self.assertIn(f"\n## {heading}\n", report)
        self.assertRegex(report, r"egl:0 +FakeGPU")
        for pipeline in ("compute", "raster", "cpu"):
            self.assertRegex(report, rf"\| sample\.glb size=256 channels=occupancy \| {pipeline} \| \d+\.\d\d \| \w+ \d")

    def test_what_fails_is_named(self):
        shaders = self.folder / "shaders"
        shutil.copytree(ROOT / "shaders", shaders)
        with open(shaders / "batch_classify.comp", "a") as file:
            file.write("\nvoid unfinished( {\n")
        done, report = self.check("--", "--shader-dir", shaders, **FAKE)
        self.assertEqual(done.returncode, 1, done)
        self.assertRegex(report, r"\*\*\d+ of \d+ results differ or failed\.\*\*")
        failures = [line for line in report.splitlines() if "batch_classify.comp" in line and line.startswith("- ")]
        self.assertTrue(failures)
        self.assertTrue(all("compute" in line or "worm.md5.zip" in line for line in failures), failures)

    def test_without_a_gpu_it_says_why_it_cannot_run(self):
        done, report = self.check()
        self.assertEqual(done.returncode, 2, done)
        self.assertIsNone(report)
        self.assertRegex(done.stderr, r"error: voxeld does not start on egl:0:\n(.|\n)*is no GPU")

    def test_without_programs_it_names_the_command_that_builds_them(self):
        done, report = self.check(binaries=self.folder)
        self.assertEqual((done.returncode, report), (2, None))
        self.assertIn(f"{self.folder / 'voxeld'} is missing; tools/demo builds it", done.stderr)


if __name__ == "__main__":
    unittest.main()
