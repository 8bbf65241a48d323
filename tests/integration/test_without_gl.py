"""A voxeld that was built without OpenGL (VOXELD_WITH_GL=OFF) does the main job by itself."""
import json
import subprocess
import unittest

import test_main_job
import test_render
from harness import BIN, DaemonTest


class Auto(DaemonTest):
    """No driver can be opened, so auto takes the CPU."""
    device = "auto"

    def test_the_daemon_starts_on_the_cpu(self):
        workers = self.daemon.request("GET", "/readyz", port=self.daemon.admin_port).json()["workers"]
        self.assertEqual({one["device"] for one in workers}, {"cpu"})

    def test_doctor_reports_the_reason(self):
        done = subprocess.run([BIN / "voxeld", "doctor", "--json"], capture_output=True, text=True,
                              check=True)
        report = json.loads(done.stdout)
        self.assertEqual(report["auto"]["device"], "cpu")
        self.assertIn("built without OpenGL", report["auto"]["why"])
        works = [one["device"] for one in report["devices"] if one["works"]]
        self.assertEqual(works, ["cpu"])


class MainJob(test_main_job.OneShotWithoutGl):
    device = "auto"


class Render(test_render.Render):
    device = "auto"


class Renderer(test_render.RendererOnCpu):
    device = "auto"


def load_tests(loader, _tests, _pattern):
    suite = unittest.TestSuite()
    for case in (Auto, MainJob, Render, Renderer):
        suite.addTests(loader.loadTestsFromTestCase(case))
    return suite


if __name__ == "__main__":
    unittest.main()
