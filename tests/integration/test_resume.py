"""Jobs go on after the tiles and frames of an earlier attempt, and the queue tells what to expect."""
import os
import re
import unittest

from harness import HANG_SECONDS, Daemon, DaemonTest, until_met, wait_until

LARGE = {"channels": "occupancy,color", "cache": "no"}
# From some hundred tiles on.
LARGE_SIZES = (3000, 6000, 8000)
# Minutes: it is cancelled.
GIANT = {**LARGE, "size": 16384}


class Resume(DaemonTest):
    device = "cpu"
    arguments = ("--part-seconds", "0")

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.asset = cls.daemon.upload(cls.fixtures / "sample.glb")
        cls.worm = cls.daemon.upload(cls.fixtures / "worm.md5.zip")

    def parts(self, daemon, job):
        folder = os.path.join(daemon.data_dir, "parts", job)
        return sorted(os.listdir(folder)) if os.path.isdir(folder) else []

    def started_after(self, daemon, job):
        """Steps that attempts after the first one found done."""
        with open(daemon.data_dir.rstrip("/") + ".log", encoding="utf-8") as log:
            return [int(n) for n in re.findall(
                rf"goes on after an earlier attempt job={job} steps_done=(\d+)", log.read())]

    def done(self, daemon, job):
        status = daemon.wait(job)
        self.assertEqual(status["state"], "done", status)
        return status

    def check(self, daemon, interrupt, **options):
        def interrupted(size):
            sized = {**LARGE, **options, "size": size}
            job = daemon.submit(kind="voxelize", asset=self.asset, options=sized)
            wait_until(lambda: len(self.parts(daemon, job)) >= 4 or daemon.has_ended(job), "four parts")
            begun_ms = daemon.get(f"/v1/jobs/{job}").json()["started_ms"]
            interrupt()
            status = self.done(daemon, job)
            return status["started_ms"] != begun_ms and (sized, status)
        options, status = until_met(LARGE_SIZES, interrupted)
        steps = self.started_after(daemon, status["id"])
        self.assertEqual(len(steps), 1)
        self.assertGreaterEqual(steps[0], 4)
        wait_until(lambda: not self.parts(daemon, status["id"]), "the parts go with the job")
        # The container that an uninterrupted job leaves, byte by byte.
        whole = self.done(daemon, daemon.submit(kind="voxelize", asset=self.asset, options=options))
        self.assertEqual(status["result"]["grid"], whole["result"]["grid"])

    def test_after_the_death_of_its_worker(self):
        self.check(self.daemon, self.daemon.kill_worker, padding=1)

    def test_after_the_death_of_the_gateway_and_its_worker(self):
        daemon = Daemon(device="cpu", arguments=self.arguments)
        try:
            daemon.upload(self.fixtures / "sample.glb")

            def restart():
                daemon.kill_gateway()
                daemon.start()
            self.check(daemon, restart, padding=2)
        finally:
            daemon.stop()

    def test_a_cancelled_job_leaves_no_parts(self):
        job = self.daemon.submit(kind="voxelize", asset=self.asset, options=GIANT)
        wait_until(lambda: self.parts(self.daemon, job), "a part")
        self.daemon.request("DELETE", f"/v1/jobs/{job}")
        self.assertEqual(self.daemon.wait(job)["state"], "cancelled")
        wait_until(lambda: not self.parts(self.daemon, job), "the parts go with the job")

    def frames_made(self):
        metrics = self.daemon.request("GET", "/metrics", port=self.daemon.admin_port).body.decode()
        return float(re.search(r"^voxeld_frames_done_total (\S+)$", metrics, re.M)[1])

    def test_frames_that_are_listed_are_not_made_again(self):
        def grids(job):
            return [f["grid"] for f in self.daemon.get(f"/v1/jobs/{job}/frames").json()["frames"]]

        def interrupted(fps):
            options = {"animation": "walk", "size": 700, "fps": fps, "cache": "no"}
            made_before = self.frames_made()
            job = self.daemon.submit(kind="voxelize", asset=self.worm, options=options)
            wait_until(lambda: len(grids(job)) >= 3, lambda: grids(job))
            self.daemon.kill_worker()
            before = grids(job)
            status = self.done(self.daemon, job)
            return status["attempt"] > 1 and (options, before, status, self.frames_made() - made_before)
        options, before, status, made = until_met((60, 240, 960), interrupted)
        self.assertEqual(status["attempt"], 2, status)
        self.assertEqual(grids(status["id"])[:len(before)], before)
        # The last frame is made in any case.
        self.assertLessEqual(made, status["frames_total"] + 1)
        again = self.done(self.daemon, self.daemon.submit(kind="voxelize", asset=self.worm, options=options))
        self.assertEqual(again["result"]["sequence"], status["result"]["sequence"])
        self.assertEqual(again["result"]["blob"], status["result"]["blob"])


class Estimates(DaemonTest):
    device = "cpu"

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.asset = cls.daemon.upload(cls.fixtures / "sample.glb")

    def estimate(self, daemon=None, **options):
        response = (daemon or self.daemon).post("/v1/jobs?dry_run=1", {
            "kind": "voxelize", "asset": self.asset, "options": options})
        self.assertEqual(response.status, 200, response.body)
        return response.json()

    def test_a_dry_run_learns_the_cost_of_jobs(self):
        daemon = Daemon(device="cpu")
        try:
            daemon.upload(self.fixtures / "sample.glb")
            fresh = self.estimate(daemon, size=640)
            self.assertEqual(fresh["estimate"]["learned_from"], 0)
            for size in range(200, 1100, 75):
                daemon.wait(daemon.submit(kind="voxelize", asset=self.asset,
                                          options={"size": size, "cache": "no"}))

            def learned_from_all():
                estimate = self.estimate(daemon, size=640)["estimate"]
                return estimate if estimate["learned_from"] == 12 else None
            # A moment after the last job's end is visible.
            learned = wait_until(learned_from_all, lambda: self.estimate(daemon, size=640))
            self.assertLess(learned["seconds_low"], learned["seconds_high"])
            self.assertNotEqual(learned["seconds"], fresh["estimate"]["seconds"])
            job = daemon.wait(daemon.submit(kind="voxelize", asset=self.asset, options={"size": 640}))
            self.assertLess(abs(learned["result_bytes"] / job["result"]["bytes"] - 1), 0.5)
            self.assertTrue(self.estimate(daemon, size=640)["cached"])
            daemon.process.terminate()
            daemon.process.wait(HANG_SECONDS)
            daemon.start()
            self.assertEqual(self.estimate(daemon, size=333)["estimate"]["learned_from"], 13)
        finally:
            daemon.stop()

    def test_waiting_jobs_tell_when_they_are_expected(self):
        # None of them ends before it is cancelled.
        first = self.daemon.submit(kind="voxelize", asset=self.asset, options={**GIANT, "padding": 5})
        jobs = [self.daemon.submit(kind="voxelize", asset=self.asset,
                                   options={**GIANT, "padding": 6 + i}) for i in range(3)]
        self.daemon.wait_state(first, "running")
        # By one forecast: while they run, it changes.
        ends = self.daemon.get(f"/v1/jobs?limit={len(jobs)}").json()["jobs"][::-1]
        self.assertEqual([status["id"] for status in ends], jobs)
        for earlier, later in zip(ends, ends[1:]):
            self.assertLess(earlier["expected_end_ms"], later["expected_end_ms"])
            self.assertLessEqual(earlier["expected_start_ms"], later["expected_start_ms"])
        estimated = self.estimate(size=64)
        self.assertGreaterEqual(estimated["expected_end_ms"], ends[-1]["created_ms"])
        self.assertGreaterEqual(estimated["queue_position"], 4)
        for job in [first, *jobs]:
            ended = self.daemon.cancel(job)
            self.assertNotIn("estimate", ended)


if __name__ == "__main__":
    unittest.main()
