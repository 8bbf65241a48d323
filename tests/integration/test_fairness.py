"""Nobody's giant job keeps others out. Shares by weight are tested with an injected clock in
tests/unit/jobs/scheduling/time_slices_test.cpp, with a daemon in long/test_fairness_times.py; tests/bench/fairness.py
measures them."""
import re
import unittest

from fairness_load import SMALL, Contention
from harness import wait_until
from test_cancel import lattice


class Contended(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.load = Contention({"a": 1, "b": 1})
        cls.giants = [cls.load.submit_endless("a") for _ in range(3)]
        cls.load.wait_for_device("a", cls.giants[0])

    @classmethod
    def tearDownClass(cls):
        cls.load.close()

    def workers(self):
        daemon = self.load.daemon
        return daemon.request("GET", "/readyz", port=daemon.admin_port).json()["workers"]

    def test_a_small_job_ends_while_anothers_giants_run_and_wait(self):
        for _ in range(3):
            job = self.load.submit("b", SMALL)
            status = self.load.tenants["b"].wait(job)
            self.assertEqual(status["state"], "done", status)

        def states():
            return sorted(self.load.status("a", job)["state"] for job in self.giants)
        # The last worker is not theirs.
        wait_until(lambda: states() == ["queued", "running", "running"], states)

    def test_the_workers_of_a_device_are_distinguished(self):
        def of_all_slots():
            workers = self.workers()
            return workers if [worker["slot"] for worker in workers] == [0, 1, 2, 3] else None
        workers = wait_until(of_all_slots, self.workers)  # one of them in reserve
        self.assertEqual(len({worker["pid"] for worker in workers}), 4)
        self.assertEqual({worker["device"] for worker in workers}, {"cpu"})

    def test_a_waiting_job_reports_its_resource(self):
        def second():
            return self.load.status("a", self.giants[1])
        wait_until(lambda: second()["state"] == "running", second)
        self.assertEqual(self.load.status("a", self.giants[2])["waiting_for"], "a worker")
        wait_until(lambda: second()["waiting_for"] == "a time slice on cpu: another job of the tenant before", second)

    def test_a_cancel_reaches_a_job_that_waits_for_its_slice(self):
        self.load.wait_for_device("a", self.giants[0])
        job = self.load.submit_endless("b")
        self.load.wait_for_device("b", job)
        self.load.cancel("b", job)
        self.assertEqual(self.load.tenants["b"].wait(job)["state"], "cancelled")

    def test_a_deadline_ends_a_job_in_the_queue_and_one_at_work(self):
        queued = self.load.submit_endless("a", deadline_ms=300, priority=-5)
        status = self.load.tenants["a"].wait(queued)
        self.assertEqual((status["state"], status["error"]["code"], status["attempt"]),
                         ("failed", "deadline-exceeded", 0))
        for deadline_ms in (1500, 6000, 24000):  # the first that a busy machine starts the job within
            running = self.load.submit_endless("b", deadline_ms=deadline_ms)
            status = self.load.tenants["b"].wait(running)
            self.assertEqual((status["state"], status["error"]["code"]), ("failed", "deadline-exceeded"), status)
            self.assertGreaterEqual(status["ended_ms"] - status["created_ms"], deadline_ms)
            if status["attempt"] > 0:
                break
        self.assertEqual(status["attempt"], 1)

    def test_one_shot_requests_take_a_priority_and_a_deadline(self):
        b = self.load.tenants["b"]
        body = (self.load.fixtures / "sample.ply").read_bytes()
        late = b.post("/v1/voxelize?size=16384&channels=occupancy,normal&cache=no&deadline_ms=400", body)
        self.assertEqual((late.status, late.json()["code"]), (504, "deadline-exceeded"))
        self.assertEqual(b.post("/v1/voxelize?size=20&priority=-7", body).status, 200)
        newest = b.get("/v1/jobs?limit=1").json()["jobs"][0]
        self.assertEqual(newest["priority"], -7)
        for query, got in (("priority=101", "101"), ("priority=x", "x"), ("deadline_ms=0", "0"),
                           ("deadline_ms=99999999999999999999", "9999")):
            response = b.post("/v1/voxelize?size=20&" + query, body)
            self.assertEqual((response.status, response.json()["code"]), (400, "invalid-option"))
            self.assertIn(got, response.json()["got"])

    def test_device_time_of_each_tenant_is_measured(self):
        self.load.tenants["b"].wait(self.load.submit("b", SMALL))
        daemon = self.load.daemon
        text = daemon.request("GET", "/metrics", port=daemon.admin_port).body.decode()
        for series in ('voxeld_device_seconds_total{device="cpu",tenant="a"}',
                       'voxeld_queue_wait_seconds_count{tenant="b"}',
                       'voxeld_time_slice_seconds_count{device="cpu"}'):
            value = re.search("^" + re.escape(series) + " (.*)$", text, re.M)
            self.assertTrue(value and float(value[1]) > 0, series)
        self.assertIn('voxeld_time_slice_seconds_bucket{device="cpu",le="0.25"} ', text)


class HostileMesh(unittest.TestCase):
    def test_a_mesh_that_is_one_long_piece_of_work_gives_the_device_to_others(self):
        """21,952 triangles that touch none: each cell asks for the winding number of all of them."""
        with Contention({"a": 1, "b": 1}) as load:
            a = load.tenants["a"]
            asset = a.post("/v1/assets?filename=lattice.ply", lattice(28)).json()["id"]
            hostile = a.submit(kind="voxelize", asset=asset, options={
                "fill": "solid", "sign": "winding", "size": 512, "cache": "no"})
            load.wait_for_device("a", hostile)

            def slices():
                daemon = load.daemon
                text = daemon.request("GET", "/metrics", port=daemon.admin_port).body.decode()
                found = re.search(r'^voxeld_time_slice_seconds_count\{device="cpu"\} (\S+)$', text, re.M)
                return float(found[1]) if found else 0
            def tiles_done():
                return load.status("a", hostile)["tiles_done"]
            # Nobody else wants the device, so each renewal shows: there are more of them than tiles.
            before = slices()
            wait_until(lambda: slices() - before > tiles_done() + 20, lambda: (before, slices(), tiles_done()))
            for _ in range(3):
                status = load.tenants["b"].wait(load.submit("b", SMALL))
                self.assertEqual(status["state"], "done", status)
            status = load.status("a", hostile)
            self.assertEqual((status["state"], status["attempt"]), ("running", 1))
            load.cancel("a", hostile)
            self.assertEqual(a.wait(hostile)["state"], "cancelled")


class UnpreemptableJobs(unittest.TestCase):
    def test_a_tenant_gets_a_worker_while_fills_of_others_have_all(self):
        with Contention({name: 1 for name in "abcd"}) as load:
            fills = {}
            for name in "abc":
                tenant = load.tenants[name]
                asset = tenant.post("/v1/assets?filename=lattice.ply", lattice(28)).json()["id"]
                fills[name] = tenant.submit(kind="voxelize", asset=asset, options={
                    "fill": "solid", "sign": "winding", "size": 512, "cache": "no"})
            for name, fill in fills.items():
                load.wait_for_device(name, fill)
            status = load.tenants["d"].wait(load.submit("d", SMALL))
            self.assertEqual(status["state"], "done", status)
            for name, fill in fills.items():
                status = load.status(name, fill)
                self.assertEqual((status["state"], status["attempt"], status["preempted"]), ("running", 1, 0))
            for name, fill in fills.items():
                load.cancel(name, fill)


class Memory(unittest.TestCase):
    def test_a_job_that_can_never_fit_is_refused_with_the_numbers(self):
        with Contention({"a": 1}, arguments=["--memory-max", "400M"]) as load:
            job = load.submit("a", {"size": 2048, "format": "xyz", "cache": "no"})
            status = load.tenants["a"].wait(job)
            self.assertEqual(status["error"]["code"], "grid-too-large", status)
            self.assertIn("at most 0.4 GB", status["error"]["expected"])
            self.assertEqual(load.tenants["a"].wait(load.submit("a", SMALL))["state"], "done")


class Fifo(unittest.TestCase):
    def test_jobs_run_one_after_the_other_as_they_arrived(self):
        with Contention({"a": 1, "b": 9}, arguments=["--scheduler", "fifo"]) as load:
            giant = load.submit_endless("a")
            load.wait_for_device("a", giant)
            urgent = load.submit("b", SMALL, priority=100)
            # Twice as long as a job works before it may be preempted.
            enough_ms = load.status("a", giant)["device_ms"] + 2000
            wait_until(lambda: load.status("a", giant)["device_ms"] > enough_ms, lambda: load.status("a", giant))
            self.assertEqual(load.status("b", urgent)["state"], "queued")
            self.assertEqual(load.status("a", giant)["preempted"], 0)
            load.cancel("a", giant)
            self.assertEqual(load.tenants["b"].wait(urgent)["state"], "done")


if __name__ == "__main__":
    unittest.main()
