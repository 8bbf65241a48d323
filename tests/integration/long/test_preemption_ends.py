"""Preempted jobs whose workers and gateway are killed, preempted sequences, and a tenant's own urgent work."""
import time
import unittest

from fairness_load import SMALL
from harness import wait_until
from test_preemption import MEDIUM, PreemptionTest


class PreemptedEnds(PreemptionTest):
    def test_although_their_workers_and_the_gateway_are_killed(self):
        job, options, giants = self.until_preempted({**MEDIUM, "padding": 2})
        for _ in range(2):
            self.load.daemon.kill_worker()  # of anybody, who may just have been asked to preempt
            time.sleep(0.3)
        self.load.daemon.kill_gateway()
        self.load.daemon.start()
        self.load.connect()
        self.cancel(giants)
        status = self.load.tenants["a"].wait(job, 600)
        self.assertEqual(status["state"], "done", status)
        whole = self.load.tenants["a"].wait(self.load.submit("a", options), 600)
        self.assertEqual(status["result"]["blob"], whole["result"]["blob"])

    def test_frames_are_made_once(self):
        d = self.load.tenants["d"]
        worm = d.upload(self.load.fixtures / "worm.md5.zip")
        options = {"animation": "walk", "size": 700, "fps": 240, "cache": "no"}
        giants = self.submit_giants("ab")
        job = d.submit(kind="voxelize", asset=worm, options=options)
        self.assertTrue(self.is_preempted("d", job), "it ended before it was preempted")
        self.assertGreater(self.load.status("d", job)["frames_done"], 0)
        self.cancel(giants)
        status = d.wait(job, 600)
        self.assertEqual((status["state"], status["attempt"]), ("done", 1), status)
        whole = d.wait(d.submit(kind="voxelize", asset=worm, options=options), 600)
        self.assertEqual(status["result"]["sequence"], whole["result"]["sequence"])
        self.assertEqual(status["result"]["blob"], whole["result"]["blob"])

    def test_more_urgent_work_of_the_tenant_has_its_worker(self):
        giants = self.submit_giants("abc")
        self.addCleanup(self.cancel, giants)
        wait_until(lambda: self.load.status("a", giants["a"])["device_ms"] > 0, "the giant of a has the device")
        job = self.load.submit("a", SMALL, priority=50)
        self.assertEqual(self.load.tenants["a"].wait(job)["state"], "done")
        self.assertNotEqual(self.load.status("a", giants["a"])["state"], "done")


if __name__ == "__main__":
    unittest.main()
