"""More tenants than workers: started jobs give theirs up and go on later with what they have done."""
import os
import time
import unittest

from fairness_load import GIANT, SMALL, Contention

TWO_WORKERS = ("--workers-per-device", "2")
# Some seconds on any machine, and more where others work beside it.
MEDIUM = {"size": 5000, "channels": "occupancy,normal", "cache": "no"}


class PreemptionTest(unittest.TestCase):
    def wait_for(self, condition, seconds=120):
        deadline = time.monotonic() + seconds
        while not condition():
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)

    def wait_preempted(self, load, name, job):
        """Its status, once it was preempted: tiles and frames of others end first, which takes as
        long as the machine lets them."""
        deadline = time.monotonic() + 600
        while True:
            status = load.status(name, job)
            if status["preempted"] > 0:
                return status
            self.assertIn(status["state"], ("queued", "running"), "it was never preempted")
            self.assertLess(time.monotonic(), deadline, status)
            time.sleep(0.02)

    def parts(self, load, job):
        folder = os.path.join(load.data_dir, "parts", job)
        return os.listdir(folder) if os.path.isdir(folder) else []


class Giants(PreemptionTest):
    """Three tenants have a giant job each, and there are two workers."""

    @classmethod
    def setUpClass(cls):
        cls.load = Contention({"a": 1, "b": 1, "c": 1, "d": 1}, arguments=TWO_WORKERS)

    @classmethod
    def tearDownClass(cls):
        cls.load.close()

    def setUp(self):
        self.giants = {name: self.load.submit(name, GIANT) for name in "abc"}

    def tearDown(self):
        for name, job in self.giants.items():
            self.load.cancel(name, job)
            self.load.tenants[name].wait(job)

    def statuses(self):
        return {name: self.load.status(name, job) for name, job in self.giants.items()}

    def test_every_giant_is_started_and_a_small_job_ends_beside_them(self):
        self.wait_for(lambda: all(s["device_ms"] > 0 for s in self.statuses().values()))
        for _ in range(3):
            job = self.load.submit("d", SMALL)
            self.assertEqual(self.load.tenants["d"].wait(job, 120)["state"], "done")
        for status in self.statuses().values():
            self.assertIn(status["state"], ("queued", "running"))
            self.assertLessEqual(status["attempt"], 1, status)
        self.assertGreater(sum(s["preempted"] for s in self.statuses().values()), 0)

    def test_a_preempted_job_is_queued_with_its_progress(self):
        def preempted():
            return [s for s in self.statuses().values() if s["preempted"] and s["state"] == "queued"]
        self.wait_for(preempted)
        status = preempted()[0]
        self.assertGreater(status["tiles_done"], 0)
        self.assertGreater(status["tiles_total"], status["tiles_done"])
        self.assertEqual(status["waiting_for"], "a worker")
        self.assertGreater(status["expected_end_ms"], status["created_ms"])
        self.assertTrue(self.parts(self.load, status["id"]))
        metrics = self.load.daemon.request("GET", "/metrics", port=self.load.daemon.admin_port)
        self.assertRegex(metrics.body.decode(),
                         r'voxeld_jobs_preempted_total\{kind="voxelize",tenant="[abc]"\} [1-9]')

    def test_more_urgent_work_of_the_tenant_has_its_worker(self):
        self.wait_for(lambda: self.load.status("a", self.giants["a"])["device_ms"] > 0)
        job = self.load.submit("a", SMALL, priority=50)
        self.assertEqual(self.load.tenants["a"].wait(job, 120)["state"], "done")
        self.assertNotEqual(self.load.status("a", self.giants["a"])["state"], "done")


class Ends(PreemptionTest):
    """Jobs that were preempted end as if they had not been."""

    @classmethod
    def setUpClass(cls):
        cls.load = Contention({"a": 1, "b": 1, "c": 1, "d": 1}, arguments=TWO_WORKERS)

    @classmethod
    def tearDownClass(cls):
        cls.load.close()

    def finish(self, jobs):
        return {name: self.load.tenants[name].wait(job, 600) for name, job in jobs.items()}

    def until_preempted(self, name, options, tenants="abc"):
        """Giants of the other tenants; a job of this one, once it was preempted."""
        others = {other: self.load.submit(other, GIANT) for other in tenants if other != name}
        job = self.load.submit(name, options)
        self.wait_preempted(self.load, name, job)
        return job, others

    def cancel(self, jobs):
        for name, job in jobs.items():
            self.load.cancel(name, job)
        self.finish(jobs)

    def test_with_the_same_bytes(self):
        job, others = self.until_preempted("a", {**MEDIUM, "padding": 1})
        self.cancel(others)
        status = self.load.tenants["a"].wait(job, 600)
        self.assertEqual((status["state"], status["attempt"]), ("done", 1), status)
        self.assertFalse(self.parts(self.load, job))
        whole = self.load.tenants["a"].wait(self.load.submit("a", {**MEDIUM, "padding": 1}), 600)
        self.assertEqual(whole["preempted"], 0)
        self.assertEqual(status["result"]["blob"], whole["result"]["blob"])

    def test_by_a_cancel_in_the_queue(self):
        job, others = self.until_preempted("a", GIANT)
        self.wait_for(lambda: self.load.status("a", job)["state"] == "queued")
        self.load.cancel("a", job)
        self.assertEqual(self.load.tenants["a"].wait(job)["state"], "cancelled")
        self.wait_for(lambda: not self.parts(self.load, job), 10)
        self.cancel(others)

    def test_although_their_workers_and_the_gateway_are_killed(self):
        job, others = self.until_preempted("a", {**MEDIUM, "padding": 2})
        for _ in range(2):
            self.load.daemon.kill_worker()  # of anybody, who may just have been asked to preempt
            time.sleep(0.3)
        self.load.daemon.kill_gateway()
        self.load.daemon.start()
        self.load.connect()
        self.cancel(others)
        status = self.load.tenants["a"].wait(job, 600)
        self.assertEqual(status["state"], "done", status)
        whole = self.load.tenants["a"].wait(self.load.submit("a", {**MEDIUM, "padding": 2}), 600)
        self.assertEqual(status["result"]["blob"], whole["result"]["blob"])

    def test_frames_are_made_once(self):
        worm = self.load.tenants["d"].upload(self.load.fixtures / "worm.md5.zip")
        options = {"animation": "walk", "size": 700, "fps": 240, "cache": "no"}
        d = self.load.tenants["d"]
        others = {name: self.load.submit(name, GIANT) for name in "ab"}
        job = d.submit(kind="voxelize", asset=worm, options=options)
        self.assertGreater(self.wait_preempted(self.load, "d", job)["frames_done"], 0)
        self.cancel(others)
        status = d.wait(job, 600)
        self.assertEqual((status["state"], status["attempt"]), ("done", 1), status)
        whole = d.wait(d.submit(kind="voxelize", asset=worm, options=options), 600)
        self.assertEqual(status["result"]["sequence"], whole["result"]["sequence"])
        self.assertEqual(status["result"]["blob"], whole["result"]["blob"])


class OneAfterTheOther(PreemptionTest):
    def test_without_fair_queueing_nothing_is_preempted(self):
        with Contention({"a": 1, "b": 1}, arguments=["--scheduler", "fifo"]) as load:
            giant = load.submit("a", GIANT)
            load.wait_for_device("a", giant)
            small = load.submit("b", SMALL, priority=100)
            time.sleep(2.5)
            self.assertEqual(load.status("b", small)["state"], "queued")
            self.assertEqual(load.status("a", giant)["preempted"], 0)


if __name__ == "__main__":
    unittest.main()
