"""What is kept, for how long, and what a full or damaged disk does."""
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import time
import unittest

from harness import BIN, Daemon, DaemonTest

# A sweep looks at ages every ten seconds.
SWEEP_SECONDS_MAX = 30


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

    def wait_status(self, daemon, path, status):
        deadline = time.monotonic() + SWEEP_SECONDS_MAX
        while True:
            response = daemon.get(path)
            if response.status == status:
                return response
            self.assertLess(time.monotonic(), deadline, f"{path}: {response.status}")
            time.sleep(0.2)

    def metric(self, daemon, name):
        text = daemon.request("GET", "/metrics", port=daemon.admin_port).body.decode()
        return sum(float(line.split()[-1]) for line in text.splitlines()
                   if line.startswith(name) and not line.startswith("#"))

    def wait_evictions(self, daemon, count):
        deadline = time.monotonic() + SWEEP_SECONDS_MAX
        while self.metric(daemon, "voxeld_evictions_total") < count:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.2)

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
        deadline = time.monotonic() + SWEEP_SECONDS_MAX
        while self.metric(daemon, "voxeld_store_bytes") > 900 << 10:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.2)
        self.assertEqual(daemon.get(f"/v1/jobs/{self.voxelize(daemon, 40)}/result").status, 200)

    def test_assets_alone_over_the_limit_refuse_uploads_until_one_is_deleted(self):
        daemon = self.start("--store-bytes-max", "100K")
        asset = daemon.post("/v1/assets?filename=a.obj", b"#" * 200_000).json()["id"]
        deadline = time.monotonic() + SWEEP_SECONDS_MAX
        while True:
            response = daemon.post("/v1/assets?filename=b.obj", os.urandom(100))
            if response.status == 507:
                break
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.1)
        self.assert_problem(response, 507, "storage-full", "delete assets")
        self.assertEqual(daemon.request("DELETE", "/v1/assets/" + asset).status, 204)
        while daemon.post("/v1/assets?filename=b.obj", b"# small").status != 201:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.1)

    def test_what_was_not_used_for_long_expires(self):
        daemon = self.start("--keep-results-days", "0.00002", "--keep-assets-days", "0.00002")
        job = self.voxelize(daemon, 20)
        status = daemon.get(f"/v1/jobs/{job}").json()
        self.wait_evictions(daemon, 2)
        self.assert_problem(daemon.get(f"/v1/jobs/{job}/result"), 410, "gone", "expired")
        self.assertEqual(daemon.get("/v1/assets/" + status["asset"]).status, 410)
        self.assertEqual(daemon.get("/v1/grids/" + status["result"]["grid"]).status, 410)
        code, report = self.doctor(daemon)
        self.assertEqual((code, report["blobs"]), (0, 0), report)

    def test_jobs_are_forgotten(self):
        daemon = self.start("--keep-jobs-days", "0.00002")
        job = self.voxelize(daemon, 20)
        self.wait_status(daemon, f"/v1/jobs/{job}", 404)
        self.assertEqual(daemon.get("/v1/jobs").json()["jobs"], [])


class Damage(Storage):
    def test_damaged_files_are_told_of_not_served_and_repaired(self):
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
        self.assert_problem(daemon.get(f"/v1/jobs/{job}/result"), 410, "gone", "damaged on disk")
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


class FullDisk(Storage):
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
            self.assertIn(daemon.request("DELETE", "/v1/assets/" + asset).status, (204, 507))
        self.assertEqual(daemon.post("/v1/assets?filename=a.obj", self.mesh(1)).status, 201)
        self.assertEqual(daemon.get(f"/v1/jobs/{self.voxelize(daemon, 31)}/result").status, 200)
        for asset in assets[3:]:
            self.assertEqual(daemon.get("/v1/assets/" + asset).status, 200)
        code, report = self.doctor(daemon)
        self.assertEqual(code, 0, report)

    def test_uploads_are_refused_before_the_disk_is_full(self):
        self.check(self.start(data_dir=self.disk + "/data"), hog=False)

    def test_a_full_disk_refuses_what_needs_space_and_recovers(self):
        self.check(self.start("--disk-reserve", "0", data_dir=self.disk + "/data"), hog=True)


if __name__ == "__main__":
    unittest.main()
