"""More tenants than workers: started jobs give theirs up and go on later with what they have done. Tests that take
longer are in long/test_preemption_ends.py, those of the rules in tests/unit/jobs/scheduling/preemption_test.cpp."""
import os
import re
import unittest

from fairness_load import LONG, SMALL, Contention
from harness import wait_until

TWO_WORKERS = ("--workers-per-device", "2")
# Jobs that end: some seconds on two cores, and four times as long for each next one, for machines that are faster.
MEDIUM_SIZES = (4000, 8000, 16384)
MEDIUM = {"channels": "occupancy,normal", "cache": "no"}


class PreemptionTest(unittest.TestCase):
    """Four tenants and two workers."""

    @classmethod
    def setUpClass(cls):
        cls.load = Contention({"a": 1, "b": 1, "c": 1, "d": 1}, arguments=TWO_WORKERS)

    @classmethod
    def tearDownClass(cls):
        cls.load.close()

    def is_preempted(self, name, job):
        """Waits until the job is preempted, or has ended before."""
        def preempted_or_ended():
            status = self.load.status(name, job)
            return status if status["preempted"] or status["state"] not in ("queued", "running") else None
        return wait_until(preempted_or_ended, lambda: self.load.status(name, job))["preempted"] > 0

    def submit_giants(self, tenants):
        return {name: self.load.submit(name, LONG) for name in tenants}

    def until_preempted(self, options, sizes=MEDIUM_SIZES):
        """A job of tenant a that was preempted, its options, and the giants of b and c for which it was. The job is the
        first of growing ones that is not done before."""
        for size in sizes:
            sized = {**options, "size": size}
            job = self.load.submit("a", sized)
            self.load.wait_for_device("a", job)
            giants = self.submit_giants("bc")
            if self.is_preempted("a", job):
                return job, sized, giants
            self.cancel(giants)
        self.fail(f"never preempted: {self.load.status('a', job)}")

    def cancel(self, jobs):
        for name, job in jobs.items():
            self.load.cancel(name, job)
        for name, job in jobs.items():
            self.load.tenants[name].wait(job)

    def parts(self, job):
        folder = os.path.join(self.load.data_dir, "parts", job)
        return os.listdir(folder) if os.path.isdir(folder) else []


class Giants(PreemptionTest):
    """Three tenants have a giant job each."""

    def setUp(self):
        self.giants = self.submit_giants("abc")
        self.addCleanup(self.cancel, self.giants)

    def statuses(self):
        return [self.load.status(name, job) for name, job in self.giants.items()]

    def test_every_giant_is_started_and_a_small_job_ends_beside_them(self):
        wait_until(lambda: all(status["device_ms"] > 0 for status in self.statuses()), self.statuses)
        job = self.load.submit("d", SMALL)
        self.assertEqual(self.load.tenants["d"].wait(job)["state"], "done")
        for status in self.statuses():
            self.assertIn(status["state"], ("queued", "running"))
            self.assertLessEqual(status["attempt"], 1, status)
        self.assertGreater(sum(status["preempted"] for status in self.statuses()), 0)

    def test_a_preempted_job_is_queued_with_its_progress(self):
        def preempted():
            return [s for s in self.statuses() if s["preempted"] and s["state"] == "queued"]
        status = wait_until(preempted, self.statuses)[0]
        self.assertGreater(status["tiles_done"], 0)
        self.assertGreater(status["tiles_total"], status["tiles_done"])
        self.assertEqual(status["waiting_for"], "a worker")
        self.assertGreater(status["expected_end_ms"], status["created_ms"])
        self.assertTrue(self.parts(status["id"]))

        def metrics():
            return self.load.daemon.request("GET", "/metrics", port=self.load.daemon.admin_port).body.decode()
        counted = re.compile(r'voxeld_jobs_preempted_total\{kind="voxelize",tenant="[abc]"\} [1-9]')
        wait_until(lambda: counted.search(metrics()), metrics)  # a moment after the state has changed


class Ends(PreemptionTest):
    """Jobs that were preempted end as if they had not been."""

    def test_with_the_same_bytes(self):
        job, options, giants = self.until_preempted({**MEDIUM, "padding": 1})
        self.cancel(giants)
        status = self.load.tenants["a"].wait(job)
        self.assertEqual((status["state"], status["attempt"]), ("done", 1), status)
        wait_until(lambda: not self.parts(job), "its parts are removed")
        whole = self.load.tenants["a"].wait(self.load.submit("a", options))
        self.assertEqual(whole["preempted"], 0)
        self.assertEqual(status["result"]["blob"], whole["result"]["blob"])

    def test_by_a_cancel_in_the_queue(self):
        job, _, giants = self.until_preempted(LONG, [LONG["size"]])
        wait_until(lambda: self.load.status("a", job)["state"] == "queued", lambda: self.load.status("a", job))
        self.load.cancel("a", job)
        self.assertEqual(self.load.tenants["a"].wait(job)["state"], "cancelled")
        wait_until(lambda: not self.parts(job), "its parts are removed")
        self.cancel(giants)


if __name__ == "__main__":
    unittest.main()
