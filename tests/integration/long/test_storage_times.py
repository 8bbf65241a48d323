"""Stored data expires by age. The daemon looks at ages every ten seconds: one look notes them, a later one acts."""
import unittest

import test_storage
from harness import wait_until

AGE_DAYS = "0.00002"  # 1.7 s


class Ages(test_storage.Storage):
    def test_unused_results_and_assets_expire(self):
        daemon = self.start("--keep-results-days", AGE_DAYS, "--keep-assets-days", AGE_DAYS)
        job = self.voxelize(daemon, 20)
        status = daemon.get(f"/v1/jobs/{job}").json()
        self.wait_evictions(daemon, 2)
        self.assert_problem(daemon.get(f"/v1/jobs/{job}/result"), 410, "gone", "expired")
        self.assertEqual(daemon.get("/v1/assets/" + status["asset"]).status, 410)
        self.assertEqual(daemon.get("/v1/grids/" + status["result"]["grid"]).status, 410)
        code, report = self.doctor(daemon)
        self.assertEqual((code, report["blobs"]), (0, 0), report)

    def test_jobs_are_forgotten(self):
        daemon = self.start("--keep-jobs-days", AGE_DAYS)
        job = self.voxelize(daemon, 20)
        wait_until(lambda: daemon.get(f"/v1/jobs/{job}").status == 404, "the job is forgotten")
        self.assertEqual(daemon.get("/v1/jobs").json()["jobs"], [])


class FullDisk(test_storage.FullDiskTest):
    def test_on_a_full_disk_results_are_evicted(self):
        daemon, greedy, _ = self.tenants("--keep-results-days", AGE_DAYS, "--disk-reserve", "0")
        asset = greedy.upload(self.fixtures / "sample.ply")
        state, job = self.run_job(greedy, asset, 200)
        self.assertEqual(state, "done")
        result_bytes = len(greedy.get(f"/v1/jobs/{job}/result").body)
        self.take_the_rest()
        self.wait_evictions(daemon, 1)  # to ask for the result would be a use
        self.assertEqual(greedy.get(f"/v1/jobs/{job}/result").status, 410)
        wait_until(lambda: self.free_bytes() + self.ballast_bytes() >= result_bytes,  # the ballast comes back first
                   lambda: (self.free_bytes(), self.ballast_bytes()))


if __name__ == "__main__":
    unittest.main()
