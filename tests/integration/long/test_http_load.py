"""Connections that are idle or slow cost others nothing: the short form of tests/bench/http_load.py."""
import unittest

import http_load
from harness import DaemonTest


class HttpLoad(DaemonTest):
    device = "cpu"
    arguments = ("--request-threads", "8", "--log-level", "warn")

    def test_idle_and_slow_connections_cost_others_nothing(self):
        asset = self.daemon.upload(self.fixtures / "sample.glb")
        job = self.daemon.submit(kind="voxelize", asset=asset, options={"size": 16})
        self.daemon.wait(job)
        facts = http_load.measure(self.daemon, asset, job, idle=500, slow=50, queued=30, seconds=2)
        print(facts)
        # Bounds of a machine that does other things, too: a thread held by each connection would
        # make these minutes.
        self.assertEqual(facts["idle_open"], 500)
        self.assertLess(facts["livez"]["p99_ms"], 250)
        self.assertLess(facts["cached_get"]["p99_ms"], 250)
        self.assertLess(facts["cancel_max_ms"], 2000)
        self.assertLess(facts["small_job_ms"], 20_000)
        self.assertLess(facts["rss_growth_mb"], 64)


if __name__ == "__main__":
    unittest.main()
