"""Dry runs predict about the time that jobs take on this machine."""
import unittest

from harness import DaemonTest

FACTOR_MAX = 4  # machines are shared


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


if __name__ == "__main__":
    unittest.main()
