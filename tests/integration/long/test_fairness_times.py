"""Shares of a device by weight, and how soon jobs end that are cancelled or have a deadline. tests/bench/fairness.py
measures."""
import time
import unittest

from fairness_load import Contention, shares

END_SECONDS_MAX = 10


class Shares(unittest.TestCase):
    def test_tenants_with_giant_jobs_have_the_device_by_their_weights(self):
        weights = {"one": 1, "two": 2, "four": 4}
        had = shares(weights, seconds=5)
        total = sum(had.values())
        for name, weight in weights.items():
            # Turns are 50 ms and more; on a busy machine single ones are much longer.
            self.assertAlmostEqual(had[name] / total, weight / 7, delta=0.08, msg=str(had))


class Ends(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.load = Contention({"a": 1, "b": 1})
        giants = [cls.load.submit_endless("a") for _ in range(3)]
        cls.load.wait_for_device("a", giants[0])

    @classmethod
    def tearDownClass(cls):
        cls.load.close()

    def test_a_cancel_reaches_a_job_that_waits_for_its_slice(self):
        job = self.load.submit_endless("b")
        self.load.wait_for_device("b", job)
        self.load.cancel("b", job)
        started = time.monotonic()
        self.assertEqual(self.load.tenants["b"].wait(job)["state"], "cancelled")
        self.assertLess(time.monotonic() - started, END_SECONDS_MAX)

    def test_a_deadline_ends_a_job_at_work(self):
        job = self.load.submit_endless("b", deadline_ms=1500)
        status = self.load.tenants["b"].wait(job)
        self.assertEqual((status["error"]["code"], status["attempt"]), ("deadline-exceeded", 1), status)
        self.assertLess(status["ended_ms"] - status["created_ms"], 1000 * END_SECONDS_MAX)


if __name__ == "__main__":
    unittest.main()
