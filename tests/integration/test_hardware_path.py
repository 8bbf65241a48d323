"""The path of hardware without a GPU: it is refused. long/test_hardware_self_test.py runs it by Mesa's software driver
under another name, which compiles the shaders of the self-test for minutes."""
import json
import subprocess
import tempfile
import unittest

from harness import BIN, HANG_SECONDS


class WithoutGpu(unittest.TestCase):
    def test_a_device_by_number_is_no_software_renderer(self):
        with tempfile.TemporaryDirectory() as data:
            done = subprocess.run([BIN / "voxeld", "serve", "--listen", "127.0.0.1:0", "--admin-listen", "none",
                                   "--data", data, "--device", "egl:0"], capture_output=True, text=True,
                                  timeout=HANG_SECONDS)
        self.assertNotEqual(done.returncode, 0, done)
        self.assertEqual(done.stdout, "")
        self.assertRegex(done.stderr, r"egl:0 \(.+\) is no GPU: .+; software renderers are chosen by name, as llvmpipe")
        self.assertRegex(done.stderr, r"expected a hardware renderer, got llvmpipe")

    def test_doctor_reports_the_missing_driver(self):
        done = subprocess.run([BIN / "voxeld", "doctor", "--json"], capture_output=True, text=True,
                              timeout=HANG_SECONDS)
        devices = {device["device"]: device for device in json.loads(done.stdout)["devices"]}
        egl = devices["egl:0"]
        self.assertIs(egl["works"], False)
        self.assertIn(egl["hint"], egl["reason"])
        self.assertRegex(egl["hint"], r"/dev/(nvidia|dri)")


if __name__ == "__main__":
    unittest.main()
