"""kill -9 of workers and of the gateway: nothing that was acknowledged is lost."""
import os
import shutil
import signal
import tempfile
import unittest

from harness import HANG_SECONDS, Daemon, DaemonTest, until_met, wait_until
from test_private_daemon import has_ended

LONG = {"channels": "occupancy,color,normal", "cache": "no"}
# Long enough on a software driver that a signal meets it in the middle.
LONG_SIZES = (1500, 3000, 6000)


class WorkerKilled(DaemonTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.asset = cls.daemon.upload(cls.fixtures / "sample.glb")

    def submit(self, size):
        return self.daemon.submit(kind="voxelize", asset=self.asset, options={**LONG, "size": size})

    def kill_worker_of(self, job):
        """None: the job has ended before."""
        def pid_or_end():
            workers = self.daemon.request("GET", "/readyz", port=self.daemon.admin_port).json()["workers"]
            pids = [worker["pid"] for worker in workers if worker["connected"] and worker["task"] == job]
            return pids or self.daemon.has_ended(job) and [None]
        killed = wait_until(pid_or_end, f"a worker has {job}")[0]
        if killed:
            os.kill(killed, signal.SIGKILL)
        return killed

    def wait_for_attempt(self, job, attempt):
        def is_reached():
            status = self.daemon.get(f"/v1/jobs/{job}").json()
            self.assertIn(status["state"], ("queued", "running"), status)
            return status["attempt"] >= attempt and status["state"] == "running"
        wait_until(is_reached, f"attempt {attempt}")

    def test_a_job_survives_the_death_of_its_worker(self):
        def survived(size):
            job = self.submit(size)
            killed = self.kill_worker_of(job)
            self.assertEqual(self.daemon.get("/v1/jobs?limit=1").status, 200)  # it keeps responding
            status = self.daemon.wait(job, 300)
            self.assertEqual(status["state"], "done", status)
            return status["attempt"] > 1 and (killed, status)
        killed, status = until_met(LONG_SIZES, survived)
        self.assertEqual(status["attempt"], 2)
        self.assertNotEqual(self.daemon.worker_pid(), killed)

    def test_a_job_that_ends_three_workers_fails_with_that_reason(self):
        job = self.submit(16384)  # it does not have to end
        for attempt in (1, 2, 3):
            self.wait_for_attempt(job, attempt)
            self.kill_worker_of(job)
        status = self.daemon.wait(job)
        self.assertEqual(status["state"], "failed", status)
        self.assertEqual(status["error"]["code"], "worker-crashed")
        self.assertIn("the job ended 3 workers: ", status["error"]["detail"])
        self.assertIn("signal 9", status["error"]["detail"])
        problem = self.assert_problem(self.daemon.get(f"/v1/jobs/{job}/result"), 500,
                                      "worker-crashed")
        self.assertTrue(problem["detail"])
        # Others are served again.
        self.assertEqual(self.daemon.post("/v1/voxelize?size=16&filename=a.glb",
                                          self.fixture("sample.glb")).status, 200)


class GatewayKilled(DaemonTest):
    def test_accepted_jobs_survive_and_finish_after_a_restart(self):
        directory = tempfile.mkdtemp(prefix="voxeld-test-")
        daemon = Daemon(data_dir=directory)
        try:
            asset = daemon.upload(self.fixtures / "sample.glb")

            def survived(size):
                large, small = {**LONG, "size": size}, [{"size": 20 + i, "cache": "no"} for i in range(5)]
                jobs = [daemon.submit(kind="voxelize", asset=asset, options=options) for options in (large, *small)]
                begun_ms = wait_until(lambda: daemon.get(f"/v1/jobs/{jobs[0]}").json()["started_ms"], "it begins")
                worker = daemon.worker_pid()
                self.assertTrue(worker)
                daemon.kill_gateway()
                wait_until(lambda: has_ended(worker), "the worker ends with the gateway")
                daemon.start()
                ends = [daemon.wait(job, 300) for job in jobs]
                self.assertEqual({status["state"] for status in ends}, {"done"}, ends)
                return ends[0]["started_ms"] != begun_ms
            until_met((1200, 3000, 6000), survived)
        finally:
            daemon.stop()
            shutil.rmtree(directory)

    def test_a_second_daemon_cannot_share_the_data(self):
        with self.assertRaisesRegex(AssertionError, rf"is in use by process {self.daemon.process.pid}\b"):
            Daemon(data_dir=self.daemon.data_dir)

    def test_sigterm_ends_the_daemon_and_its_worker(self):
        daemon = Daemon()
        worker = daemon.worker_pid()
        self.assertTrue(worker)
        daemon.process.send_signal(signal.SIGTERM)
        self.assertEqual(daemon.process.wait(HANG_SECONDS), 0)
        self.assertFalse(os.path.exists(f"/proc/{worker}"))
        daemon.stop()


if __name__ == "__main__":
    unittest.main()
