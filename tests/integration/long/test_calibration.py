"""Measuring the pipelines of devices, and the choice that is made by what was measured."""
import json
import pathlib
import shutil
import subprocess
import tempfile
import unittest

from harness import BIN, Daemon, make_fixtures


class Calibration(unittest.TestCase):
    def setUp(self):
        self.data = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-calibration-"))
        self.addCleanup(shutil.rmtree, self.data, ignore_errors=True)
        self.addCleanup(pathlib.Path(f"{self.data}.log").unlink, missing_ok=True)
        self.file = self.data / "calibration.json"

    def doctor(self, *arguments, status=0):
        done = subprocess.run([BIN / "voxeld", "doctor", "--data", self.data, *arguments],
                              capture_output=True, text=True, timeout=300)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done.stdout

    def reason(self, device, query=""):
        """pipeline, pipeline_reason and the log of a daemon on this data directory."""
        daemon = Daemon(device=device, data_dir=str(self.data))
        try:
            make_fixtures(self.data / "fixtures")
            asset = daemon.upload(self.data / "fixtures/sample.ply")
            job = daemon.submit(kind="voxelize", asset=asset,
                                options={"size": 64, "cache": "no", **dict(query or {})})
            meta = daemon.wait(job)["result"]["meta"]
            return meta["pipeline"], meta["pipeline_reason"], daemon.log_tail()
        finally:
            daemon.stop()

    def test_auto_decides_by_the_measurements_of_doctor(self):
        table = self.doctor("--calibrate", "--device", "llvmpipe")
        for pipeline in ("cpu", "compute", "raster"):
            self.assertRegex(table, rf"llvmpipe +{pipeline} +occupancy +\d")
            self.assertRegex(table, rf"llvmpipe +{pipeline} +attributes +\d")
        stored = json.loads(self.file.read_text())
        self.assertEqual([one["device"] for one in stored["devices"]], ["llvmpipe"])
        date = stored["devices"][0]["date"]
        pipeline, reason, _ = self.reason("llvmpipe")
        self.assertRegex(reason, rf"^{pipeline}: predicted [0-9.e+-]+ ms, \w+ [0-9.e+-]+ ms, "
                                 rf"\w+ [0-9.e+-]+ ms \(calibrated {date}\)$")
        # The file decides: a free raster pipeline is chosen.
        for costs in stored["devices"][0]["pipelines"]:
            if costs["pipeline"] == "raster":
                for kind in ("occupancy", "attributes"):
                    for term in costs[kind]:
                        costs[kind][term] = 0
        self.file.write_text(json.dumps(stored))
        pipeline, reason, _ = self.reason("llvmpipe")
        self.assertEqual(pipeline, "raster")
        self.assertTrue(reason.startswith("raster: predicted 0 ms, "), reason)

    def test_measurements_of_another_driver_do_not_count(self):
        self.doctor("--calibrate", "--device", "cpu")
        stored = json.loads(self.file.read_text())
        stored["devices"][0]["key"]["threads"] += 1
        stored["devices"][0]["device"] = "llvmpipe"
        self.file.write_text(json.dumps(stored))
        pipeline, reason, _ = self.reason("llvmpipe")
        self.assertEqual(pipeline, "cpu")
        self.assertIn("calibrated for another renderer", reason)
        self.assertIn("voxeld doctor --calibrate", reason)

    def test_a_broken_file_is_a_warning_and_is_replaced(self):
        self.file.write_text('{"version": 1, "devices": [{"device": 7')
        pipeline, reason, log = self.reason("cpu")
        self.assertEqual(pipeline, "cpu")
        self.assertRegex(log, r"(?i)warn.*the calibration cannot be read")
        self.assertIn("calibration.json", self.doctor())
        report = json.loads(self.doctor("--calibrate", "--device", "cpu", "--json"))
        self.assertIn("the file is replaced", report["calibration"]["warning"])
        self.assertEqual(report["calibration"]["devices"], [{"device": "cpu", "failure": ""}])
        pipeline, reason, _ = self.reason("cpu")
        self.assertRegex(reason, r"^cpu: predicted [0-9.e+-]+ ms \(calibrated [0-9-]+\)$")

    def test_devices_that_do_not_open_are_reported_and_the_others_are_measured(self):
        table = self.doctor("--calibrate", "--device", "egl:15,cpu", status=1)
        self.assertRegex(table, r"egl:15 +could not be measured: .+")
        self.assertRegex(table, r"cpu +cpu +occupancy")
        self.assertEqual(len(json.loads(self.file.read_text())["devices"]), 1)

    def test_names_that_are_no_devices_are_refused(self):
        self.doctor("--calibrate", "--device", "cuda:0", status=64)
        self.assertFalse(self.file.exists())


if __name__ == "__main__":
    unittest.main()
