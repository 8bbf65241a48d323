"""A worker process that has read a tenant's file gets no task of another one."""
import re
import unittest

from harness import TenantsDaemon, wait_until

OPTIONS = {"size": 700, "fill": "solid", "cache": "no", "channels": "occupancy"}


class WorkerIsolation(unittest.TestCase):
    def workers(self, lab):
        ready = lab.daemon.request("GET", "/readyz", port=lab.daemon.admin_port)
        return [worker for worker in ready.json()["workers"] if worker["connected"]]

    def wait_for_workers(self, lab, count):
        wait_until(lambda: len(self.workers(lab)) == count, lambda: self.workers(lab))

    def run_job(self, lab, tenant):
        """The worker process that ran a job of the tenant. None: it was not seen before the job ended."""
        who = lab.tenants[tenant]
        asset = who.upload(lab.fixtures / "sample.ply")
        job = who.submit(kind="voxelize", asset=asset, options=OPTIONS)

        def pids():
            has_ended = who.get(f"/v1/jobs/{job}").json()["state"] not in ("queued", "running")
            return [worker["pid"] for worker in self.workers(lab) if worker["task"] == job] or has_ended and [None]
        pid = wait_until(pids, lambda: who.get(f"/v1/jobs/{job}").body)[0]
        status = who.wait(job)
        self.assertEqual((status["state"], status["attempt"]), ("done", 1))
        return pid

    def pid_of_job(self, lab, tenant):
        """The worker process that ran a job of the tenant."""
        return wait_until(lambda: self.run_job(lab, tenant), "a job whose worker is seen")

    def pids_of_tenants(self, lab, rounds):
        pids = {tenant: set() for tenant in lab.tenants}
        for _ in range(rounds):
            for tenant in lab.tenants:
                pids[tenant].add(self.pid_of_job(lab, tenant))
        return pids

    def assert_no_crash(self, lab):
        metrics = lab.daemon.request("GET", "/metrics", port=lab.daemon.admin_port).body.decode()
        restarts = re.findall(r"^voxeld_worker_restarts_total\{.*", metrics, re.M)
        self.assertEqual([line for line in restarts if not line.endswith(" 0")], [])
        return metrics

    def test_isolation_begins_with_the_key_of_a_second_tenant(self):
        with TenantsDaemon({"ada": 1}, arguments=["--workers-per-device", "2"]) as lab:
            self.wait_for_workers(lab, 2)
            both = {worker["pid"] for worker in self.workers(lab)}
            # More jobs than processes: one of them has a second task.
            self.assertLessEqual({self.pid_of_job(lab, "ada") for _ in range(3)}, both)
            for name in ("ben", "cleo", "dora"):
                lab.keys[name] = lab.voxeld_keys("add", name)
            lab.connect()
            self.wait_for_workers(lab, 3)  # with a fresh one in reserve
            pids = self.pids_of_tenants(lab, rounds=3)
            for one in pids:
                for other in pids:
                    self.assertTrue(one == other or not pids[one] & pids[other], pids)
            self.assertRegex(self.assert_no_crash(lab), r"voxeld_worker_replacements_total\{.*\} [1-9]")

    def test_by_task_each_process_gets_one(self):
        with TenantsDaemon({"ada": 1}, arguments=["--worker-isolation", "task"]) as lab:
            pids = [self.pid_of_job(lab, "ada") for _ in range(5)]
            self.assertEqual(len(set(pids)), 5)
            self.assert_no_crash(lab)

    def test_none_shares_processes_between_tenants(self):
        arguments = ["--worker-isolation", "none", "--workers-per-device", "1"]
        with TenantsDaemon({"ada": 1, "ben": 1}, arguments=arguments) as lab:
            pids = self.pids_of_tenants(lab, rounds=2)
            self.assertEqual(pids["ada"], pids["ben"])


if __name__ == "__main__":
    unittest.main()
