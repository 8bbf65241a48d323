"""Dry runs predict about the time that jobs take on this machine."""
import statistics
import sys
import unittest

from harness import ROOT, DaemonTest

sys.path.insert(0, str(ROOT / "tests/bench"))
from long_jobs import Cases, end_of  # noqa: E402  (needs the path above)

FACTOR_MAX = 4  # machines are shared
HANG_SECONDS = 900  # that one job may take on the slowest machine
SECONDS_MIN = 0.1  # below, a job's start is most of its time
# Hostile jobs of the bench that nothing in their request tells of, and those that take minutes.
UNTOLD = ("glTF nodes", "winding 28", "winding 64", "image", "turntable", "solid", "obj")


class EstimateTimes(DaemonTest):
    device = "cpu"

    def test_a_dry_run_predicts_the_time_of_a_job(self):
        asset = self.daemon.upload(self.fixtures / "sample.glb")

        def estimate():
            response = self.daemon.post("/v1/jobs?dry_run=1", {
                "kind": "voxelize", "asset": asset, "options": {"size": 640}})
            self.assertEqual(response.status, 200, response.body)
            return response.json()["estimate"]

        fresh = estimate()
        for size in range(200, 1100, 75):
            self.daemon.wait(self.daemon.submit(kind="voxelize", asset=asset, options={"size": size, "cache": "no"}))
        learned = estimate()
        self.assertLess(learned["seconds_high"] / learned["seconds_low"],
                        fresh["seconds_high"] / fresh["seconds_low"])
        job = self.daemon.wait(self.daemon.submit(kind="voxelize", asset=asset, options={"size": 640}))
        measured = sum(ms for stage, ms in job["timings"].items() if stage != "queue") / 1000
        self.assertLess(measured / FACTOR_MAX, learned["seconds"])
        self.assertGreater(measured * FACTOR_MAX, learned["seconds"])


class FreshDaemon(DaemonTest):
    device = "cpu"

    def test_a_daemon_that_has_run_nothing_expects_hostile_and_real_jobs_as_they_are(self):
        cases = Cases(self.fixtures)
        assets, expected = {}, {}
        jobs = [job for job in cases.jobs if job[0] not in UNTOLD]
        self.assertGreaterEqual(len(jobs), 25)
        for name, file, kind, options in jobs:
            if file not in assets:
                assets[file] = self.daemon.post(f"/v1/assets?filename={file}", cases.files[file]()).json()["id"]
            body = {"kind": kind, "asset": assets[file], "options": {**options, "cache": "no"} if options else {}}
            expected[name] = body, self.daemon.post("/v1/jobs?dry_run=1", body).json()["estimate"]["seconds"]
        ratios = {}
        for name, (body, seconds) in expected.items():
            status = end_of(self.daemon, self.daemon.submit(**body), HANG_SECONDS)
            self.assertEqual(status["state"], "done", (name, status))
            took = (status["ended_ms"] - status["started_ms"]) / 1e3
            ratios[name] = max(took, SECONDS_MIN) / max(seconds, SECONDS_MIN)
            print(f"| {name} | {seconds:.2f} | {took:.2f} |", flush=True)
        usual = statistics.median(ratios.values())  # how fast the machine is
        wrong = {name: ratio / usual for name, ratio in ratios.items()
                 if not 1 / FACTOR_MAX < ratio / usual < FACTOR_MAX}
        self.assertEqual(wrong, {}, usual)


if __name__ == "__main__":
    unittest.main()
