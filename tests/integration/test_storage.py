"""Limits of stored data, and behaviour with a full or damaged disk. Ages are tested by long/test_storage_times.py, and
with a clock of the test's own by tests/unit/jobs/retention/store_sweep_test.cpp."""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import unittest

from harness import BIN, Daemon, DaemonTest, wait_until


class Storage(DaemonTest):
    device = "cpu"

    def start(self, *arguments, data_dir=None):
        daemon = Daemon(device="cpu", arguments=arguments, data_dir=data_dir)
        self.addCleanup(daemon.stop)
        return daemon

    def voxelize(self, daemon, size, **options):
        asset = daemon.upload(self.fixtures / "sample.ply")
        job = daemon.submit(kind="voxelize", asset=asset,
                            options={"size": size, "format": "npy", **options})
        self.assertEqual(daemon.wait(job)["state"], "done")
        return job

    def metric(self, daemon, name):
        text = daemon.request("GET", "/metrics", port=daemon.admin_port).body.decode()
        return sum(float(line.split()[-1]) for line in text.splitlines()
                   if line.startswith(name) and not line.startswith("#"))

    def wait_evictions(self, daemon, count):
        wait_until(lambda: self.metric(daemon, "voxeld_evictions_total") >= count, f"{count} evictions")

    def doctor(self, daemon):
        done = subprocess.run([BIN / "voxeld", "doctor", "--store", "--json", "--data", daemon.data_dir],
                              capture_output=True, text=True)
        return done.returncode, json.loads(done.stdout)

    def file_of(self, daemon, blob):
        return pathlib.Path(daemon.data_dir, "blobs", blob[7:9], blob)


class Limits(Storage):
    def test_over_the_limit_the_results_go_that_were_not_used_for_longest(self):
        daemon = self.start("--store-bytes-max", "900K")  # the asset takes most of it
        jobs = [self.voxelize(daemon, size) for size in range(40, 56)]
        self.wait_evictions(daemon, 1)  # to ask for results would be a use
        problem = self.assert_problem(daemon.get(f"/v1/jobs/{jobs[0]}/result"), 410, "gone",
                                      "made room")
        self.assertIn("submit the job again", problem["detail"])
        self.assertEqual(daemon.get(f"/v1/jobs/{jobs[0]}").status, 200)
        self.assertEqual(daemon.get(f"/v1/jobs/{jobs[-1]}/result").status, 200)
        wait_until(lambda: 0 < self.metric(daemon, "voxeld_store_bytes") <= 900 << 10, "the store is within its limit")
        self.assertEqual(daemon.get(f"/v1/jobs/{self.voxelize(daemon, 40)}/result").status, 200)

    def test_beside_assets_that_take_nearly_all_the_newest_results_stay(self):
        limit = 4 << 20
        daemon = self.start("--store-bytes-max", str(limit))
        mesh = daemon.upload(self.fixtures / "sample.ply")
        mesh_bytes = daemon.get("/v1/assets/" + mesh).json()["bytes"]
        daemon.post("/v1/assets?filename=a.obj", os.urandom(limit * 97 // 100 - mesh_bytes))
        for size in range(40, 100, 2):
            job = self.voxelize(daemon, size)
            if self.metric(daemon, "voxeld_evictions_total") > 0:
                break
        self.wait_evictions(daemon, 1)
        self.assertEqual(daemon.get(f"/v1/jobs/{job}/result").status, 200)

    def test_assets_alone_over_the_limit_refuse_uploads_until_one_is_deleted(self):
        daemon = self.start("--store-bytes-max", "100K")
        asset = daemon.post("/v1/assets?filename=a.obj", b"#" * 200_000).json()["id"]

        def refused():
            response = daemon.post("/v1/assets?filename=b.obj", os.urandom(100))
            return response if response.status != 201 else None
        response = wait_until(refused, "an upload is refused")
        self.assert_problem(response, 507, "storage-full", "delete assets")
        self.assertEqual(daemon.request("DELETE", "/v1/assets/" + asset).status, 204)
        wait_until(lambda: daemon.post("/v1/assets?filename=b.obj", b"# small").status == 201, "an upload is accepted")


class Damage(Storage):
    def test_damaged_files_are_reported_not_served_and_repaired(self):
        daemon = self.daemon
        job = self.voxelize(daemon, 24)
        status = daemon.get(f"/v1/jobs/{job}").json()
        self.assertEqual(self.doctor(daemon)[0], 0)
        result = daemon.get(f"/v1/jobs/{job}/result")
        blob = result.headers["ETag"].strip('"')
        for damaged in (blob, status["asset"]):
            with open(self.file_of(daemon, damaged), "r+b") as file:
                byte = file.read(1)
                file.seek(0)
                file.write(bytes([byte[0] ^ 255]))
        self.assertEqual(self.metric(daemon, "voxeld_store_damaged_blobs"), 0)
        self.assert_problem(daemon.get(f"/v1/jobs/{job}/result"), 410, "gone", "damaged on disk")
        wait_until(lambda: self.metric(daemon, "voxeld_store_damaged_blobs") > 0, "a damaged file is counted")
        code, report = self.doctor(daemon)
        self.assertEqual(code, 1)
        self.assertEqual({(one["kind"], one["what"]) for one in report["problems"]},
                         {("damaged", blob), ("damaged", status["asset"])})
        text = subprocess.run([BIN / "voxeld", "doctor", "--store", "--data", daemon.data_dir],
                              capture_output=True, text=True)
        self.assertIn("2 problems", text.stdout)
        broken = daemon.submit(kind="voxelize", asset=status["asset"], options={"size": 25})
        self.assertEqual(daemon.wait(broken)["error"]["code"], "gone")
        again = self.voxelize(daemon, 24)  # uploads the asset again
        self.assertEqual(daemon.get(f"/v1/jobs/{again}/result").body, result.body)
        self.assertEqual(daemon.get(f"/v1/jobs/{job}/result").body, result.body)
        self.assertEqual(self.doctor(daemon)[0], 0)


class FullDiskTest(Storage):
    """A small file system of its own."""

    def setUp(self):
        self.disk = tempfile.mkdtemp(prefix="voxeld-disk-")
        self.addCleanup(shutil.rmtree, self.disk, ignore_errors=True)
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", self.disk],
                                 capture_output=True, text=True)
        if mounted.returncode != 0:
            self.skipTest(f"no file system of a limited size can be mounted: {mounted.stderr.strip()}")
        self.addCleanup(subprocess.run, ["umount", "-l", self.disk], check=False)

    def mesh(self, megabytes):
        """Bytes that nobody sent before, and a triangle."""
        return (b"# " + os.urandom(megabytes << 19).hex().encode() +
                b"\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")

    def fill(self, daemon):
        assets = []
        for _ in range(100):
            response = daemon.post("/v1/assets?filename=a.obj", self.mesh(2))
            if response.status != 201:
                self.assert_problem(response, 507, "storage-full")
                return assets
            assets.append(response.json()["id"])
        self.fail("the disk is not full yet")

    def check(self, daemon, hog):
        job = self.voxelize(daemon, 20)
        assets = self.fill(daemon)
        if hog:  # something else takes the rest
            with open(self.disk + "/hog", "wb", buffering=0) as file:
                try:
                    while True:
                        file.write(bytes(4096))
                except OSError:
                    pass
        refused = daemon.post("/v1/jobs", {"kind": "voxelize", "asset": assets[0],
                                           "options": {"size": 30}}) if hog else None
        if refused is not None and refused.status != 202:
            self.assert_problem(refused, 507, "storage-full")
        self.assertEqual(daemon.request("GET", "/livez", port=daemon.admin_port).status, 200)
        self.assertEqual(daemon.get(f"/v1/jobs/{job}/result").status, 200)
        listed = {asset["id"] for asset in daemon.get("/v1/assets").json()["assets"]}
        self.assertLessEqual(set(assets), listed)
        if hog:
            os.unlink(self.disk + "/hog")
        for asset in assets[:3]:
            self.assertEqual(daemon.request("DELETE", "/v1/assets/" + asset).status, 204)
        self.wait_ready(daemon, 200)  # files are removed after the response
        self.assertEqual(daemon.post("/v1/assets?filename=a.obj", self.mesh(1)).status, 201)
        self.assertEqual(daemon.get(f"/v1/jobs/{self.voxelize(daemon, 31)}/result").status, 200)
        for asset in assets[3:]:
            self.assertEqual(daemon.get("/v1/assets/" + asset).status, 200)
        code, report = self.doctor(daemon)
        self.assertEqual(code, 0, report)

    def free_bytes(self):
        disk = os.statvfs(self.disk)
        return disk.f_bavail * disk.f_frsize

    def ballast_bytes(self):
        ballast = pathlib.Path(self.disk, "data", "ballast")
        return ballast.stat().st_size if ballast.exists() else 0

    def take_the_rest(self):
        with open(self.disk + "/hog", "wb", buffering=0) as file:
            try:
                while True:
                    file.write(bytes(4096))
            except OSError:
                pass

    def ready(self, daemon):
        return daemon.request("GET", "/readyz", port=daemon.admin_port)

    def wait_ready(self, daemon, status):
        wait_until(lambda: self.ready(daemon).status == status, lambda: self.ready(daemon).body)

    def tenants(self, *arguments):
        data = self.disk + "/data"
        keys = {name: subprocess.run([BIN / "voxeld", "keys", "add", name, "--data", data], check=True,
                                     capture_output=True, text=True).stdout.strip()
                for name in ("greedy", "modest")}
        daemon = self.start(*arguments, data_dir=data)
        return daemon, daemon.holding(keys["greedy"]), daemon.holding(keys["modest"])

    def run_job(self, daemon, asset, size, **options):
        """How it ended; "refused": it was not taken."""
        response = daemon.post("/v1/jobs", {
            "kind": "voxelize", "asset": asset,
            "options": {"size": size, "format": "npy", "cache": "no", **options}})
        if response.status == 507:
            return "refused", None
        return daemon.wait(response.json()["id"])["state"], response.json()["id"]

    def run_jobs_until_one_fails(self, daemon, asset, sizes):
        """How that one ended. Every size gives other bytes, since equal ones would be stored once."""
        for size in sizes:
            state, job = self.run_job(daemon, asset, size)
            if state != "done":
                return state, job
        self.fail(f"jobs of {sizes} did not fill the disk")


class FullDisk(FullDiskTest):
    def test_outputs_of_one_tenant_leave_the_reserve_and_others_can_delete(self):
        daemon, greedy, modest = self.tenants()
        mine = [modest.post("/v1/assets?filename=a.obj", self.mesh(1)).json()["id"] for _ in range(3)]
        asset = greedy.upload(self.fixtures / "sample.ply")
        reserve = (64 << 20) // 20
        # 8 to 17 MB each. Not even one is accepted where less than 1 MB is free beside the reserve.
        state, job = self.run_jobs_until_one_fails(greedy, asset, range(200, 260))
        if state == "refused":
            self.assertEqual(modest.request("DELETE", "/v1/assets/" + mine.pop()).status, 204)
            self.wait_ready(daemon, 200)
            state, job = self.run_jobs_until_one_fails(greedy, asset, range(260, 280))
        self.assertEqual(state, "failed")
        error = greedy.get(f"/v1/jobs/{job}").json()["error"]
        self.assertEqual(error["code"], "storage-full", error)
        # The output would have cut into the reserve.
        self.assertRegex(error["detail"], "the disk is nearly full; (outputs|uploads and results) are refused")
        # Failed outputs are removed; small ones take the rest of the disk, except for the reserve.
        self.run_jobs_until_one_fails(greedy, asset, range(100, 160))  # 1 to 4 MB each
        self.run_jobs_until_one_fails(greedy, asset, range(40, 100))
        self.assertGreater(self.free_bytes(), reserve // 2)
        # The ballast is there, or there again, although failed outputs had filled the disk.
        self.assertGreater(self.ballast_bytes(), 0)
        self.take_the_rest()
        self.assertLess(self.free_bytes(), 64 << 10)
        self.wait_ready(daemon, 503)
        self.assertIn("the disk is nearly full", self.ready(daemon).json()["reason"])
        self.assert_problem(modest.post("/v1/assets?filename=b.obj", self.mesh(1)), 507, "storage-full")
        self.assert_problem(modest.post("/v1/jobs", {"kind": "voxelize", "asset": asset}), 507,
                            "storage-full", "jobs are refused")
        for one in mine:
            self.assertEqual(modest.request("DELETE", "/v1/assets/" + one).status, 204)
            self.assertEqual(modest.get("/v1/assets/" + one).status, 410)
        os.unlink(self.disk + "/hog")
        self.wait_ready(daemon, 200)
        self.assertEqual(modest.post("/v1/assets?filename=b.obj", self.mesh(1)).status, 201)

    def leave(self, free):
        """Something else takes all but so many bytes."""
        hog = self.disk + "/hog"
        if os.path.exists(hog):
            os.unlink(hog)
        with open(hog, "wb") as file:
            os.posix_fallocate(file.fileno(), 0, self.free_bytes() - free)

    def test_outputs_of_several_workers_leave_the_reserve_while_they_are_written(self):
        daemon = self.start("--workers-per-device", "3", data_dir=self.disk + "/data")
        asset = daemon.upload(self.fixtures / "sample.ply")
        reserve = (64 << 20) // 20
        self.leave(reserve + (20 << 20))
        jobs = [daemon.submit(kind="voxelize", asset=asset, options={"size": size, "format": "npy", "cache": "no"})
                for size in range(245, 251)]  # 15 MB each, and their grids
        least = self.free_bytes()
        while any(not daemon.get(f"/v1/jobs/{job}").json()["ended_ms"] for job in jobs):
            least = min(least, self.free_bytes())
        self.assertGreater(least, reserve // 2)
        ends = [daemon.get(f"/v1/jobs/{job}").json() for job in jobs]
        self.assertIn("failed", [end["state"] for end in ends])
        for end in ends:
            self.assertIn((end["state"], end.get("error", {}).get("code")), (("done", None), ("failed", "storage-full")))

    def test_readiness_is_what_a_submit_gets(self):
        daemon = self.start(data_dir=self.disk + "/data")
        asset = daemon.upload(self.fixtures / "sample.ply")
        reserve = (64 << 20) // 20
        job = {"kind": "voxelize", "asset": asset, "options": {"size": 8, "cache": "no"}}
        known = None
        for free, submitted, ready in ((reserve + (1 << 19), 507, 503), (reserve + (8 << 20), 202, 200),
                                       (reserve - (1 << 19), 507, 503)):
            self.leave(free)
            with self.subTest(free=free):
                self.wait_ready(daemon, ready)
                response = daemon.post("/v1/jobs", job, headers={"Idempotency-Key": str(free)})
                self.assertEqual(response.status, submitted, response.body)
                if submitted == 202:
                    known = response.json()["id"]
                    self.assertEqual(daemon.wait(known)["state"], "done")
        again = daemon.post("/v1/jobs", job, headers={"Idempotency-Key": str(reserve + (8 << 20))})
        self.assertEqual((again.status, again.json().get("id")), (200, known), again.body)

    def test_on_a_full_disk_jobs_can_be_cancelled_and_their_failure_is_stored(self):
        daemon = self.start("--disk-reserve", "0", "--workers-per-device", "1", data_dir=self.disk + "/data")
        asset = daemon.upload(self.fixtures / "sample.ply")
        running = daemon.submit(kind="voxelize", asset=asset,
                                options={"size": 16384, "channels": "occupancy", "cache": "no"})
        daemon.wait_state(running, "running")
        # Rows of some 90 KB each, which have to be written anew.
        queued = [daemon.submit(kind="voxelize", asset=asset, options={
            "size": 8, "animation": "0", "times": [(k + i) / 3e6 for k in range(4096)]}) for i in range(20)]
        doomed = daemon.submit(kind="voxelize", asset=asset, options={"size": 9, "animation": "0"})
        # The worker's output would take what the daemon sets free for its rows.
        worker = daemon.worker_pid()
        os.kill(worker, signal.SIGSTOP)
        self.take_the_rest()
        for job in (*queued, running):
            response = daemon.request("DELETE", f"/v1/jobs/{job}")
            self.assertIn(response.status, (200, 202), response.body)
        os.kill(worker, signal.SIGCONT)
        for job in (*queued, running):
            self.assertEqual(daemon.wait(job)["state"], "cancelled")
        # The mesh has no animation: its job fails, and that is stored, too.
        status = daemon.wait(doomed)
        self.assertEqual((status["state"], status["error"]["code"]), ("failed", "invalid-option"), status)

    def test_a_daemon_starts_on_a_full_disk_and_deletes(self):
        for end in (Daemon.kill_gateway, Daemon.stop):
            with self.subTest(end.__name__):
                self.check_start(end)
                shutil.rmtree(self.disk + "/data")

    def check_start(self, end):
        daemon = self.start("--disk-reserve", "0", "--workers-per-device", "1", data_dir=self.disk + "/data")
        done = self.voxelize(daemon, 200)
        blob = self.file_of(daemon, daemon.get(f"/v1/jobs/{done}/result").headers["ETag"].strip('"'))
        result_bytes = blob.stat().st_size
        asset = daemon.upload(self.fixtures / "sample.ply")
        giant = {"size": 16384, "channels": "occupancy", "cache": "no"}
        running, queued = (daemon.submit(kind="voxelize", asset=asset, options=giant) for _ in range(2))
        daemon.wait_state(running, "running")
        # A removed file would be the room that the daemon needs.
        wait_until(lambda: not os.listdir(self.disk + "/data/trash"), "the second copy of the mesh is removed")
        end(daemon)
        self.take_the_rest()
        daemon.start(until_ready=False)  # it takes no uploads
        for job in (running, queued):
            self.assertEqual(daemon.cancel(job)["state"], "cancelled")
        self.assertEqual(daemon.get(f"/v1/jobs/{done}/result").status, 200)
        for path, status in ((f"jobs/{done}/result", 204), (f"jobs/{done}?ended=remove", 200),
                             (f"assets/{asset}", 204)):
            self.assertEqual(daemon.request("DELETE", "/v1/" + path).status, status, path)
        wait_until(lambda: self.free_bytes() + self.ballast_bytes() >= result_bytes,
                   lambda: (self.free_bytes(), self.ballast_bytes()))
        os.unlink(self.disk + "/hog")
        daemon.stop()

    def test_a_job_that_writes_more_than_one_worker_may_fails_alone(self):
        daemon = self.start("--worker-scratch-max", "2M", data_dir=self.disk + "/data")
        asset = daemon.upload(self.fixtures / "sample.ply")
        state, job = self.run_job(daemon, asset, 250)  # 15 MB
        self.assertEqual(state, "failed")
        error = daemon.get(f"/v1/jobs/{job}").json()["error"]
        self.assertEqual(error["code"], "storage-full", error)
        self.assertIn("the job writes more than one worker may", error["detail"])
        self.assertEqual(error["expected"], "at most 2097152 bytes")
        self.assertEqual(self.run_job(daemon, asset, 40)[0], "done")
        self.assertEqual(self.ready(daemon).status, 200)

    def test_uploads_are_refused_before_the_disk_is_full(self):
        self.check(self.start(data_dir=self.disk + "/data"), hog=False)

    def test_a_full_disk_refuses_requests_that_need_space_and_recovers(self):
        self.check(self.start("--disk-reserve", "0", data_dir=self.disk + "/data"), hog=True)


if __name__ == "__main__":
    unittest.main()
