"""A database that is missing, empty, old or another store's: the files stay, and come back."""
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import time
import unittest

from harness import BIN, HANG_SECONDS, Daemon, DaemonTest, wait_until

DATABASE = ("jobs.sqlite", "jobs.sqlite-wal", "jobs.sqlite-shm")


class Recovery(DaemonTest):
    device = "cpu"

    files_before = 0

    def setUp(self):
        self.data = tempfile.mkdtemp(prefix="voxeld-recovery-")
        self.addCleanup(shutil.rmtree, self.data, ignore_errors=True)
        self.addCleanup(pathlib.Path(self.data + ".log").unlink, missing_ok=True)

    def run_daemon(self, *arguments):
        daemon = Daemon(device="cpu", arguments=arguments, data_dir=self.data)
        self.addCleanup(daemon.stop)
        return daemon

    def make(self, daemon):
        """An asset, a bundle, a grid and a result, as they are known to clients."""
        asset = daemon.upload(self.fixtures / "sample.ply")
        bundle = daemon.request("POST", "/v1/assets", json.dumps(
            {"files": [{"name": "sample.ply", "asset": asset}]}),
            {"Content-Type": "application/vnd.voxeld.bundle+json"}).json()["id"]
        job = daemon.submit(kind="voxelize", asset=asset, options={"size": 24, "format": "npy"})
        status = daemon.wait(job)
        self.assertEqual(status["state"], "done", status)
        return {"asset": asset, "bundle": bundle, "job": job, "grid": status["result"]["grid"]}

    def files(self, folder="blobs"):
        return {path.name for path in pathlib.Path(self.data, folder).rglob("sha256-*")}

    def remove_database(self):
        for name in DATABASE:
            pathlib.Path(self.data, name).unlink(missing_ok=True)

    def start_fails(self, *arguments):
        """The error text of a start that fails. A daemon that starts instead has looked for orphans by its end."""
        process = subprocess.Popen(
            [BIN / "voxeld", "serve", "--listen", "127.0.0.1:0", "--admin-listen", "127.0.0.1:0", "--data",
             self.data, "--device", "cpu", *arguments],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        try:
            _, text = process.communicate(timeout=HANG_SECONDS)
        except subprocess.TimeoutExpired:
            process.terminate()
            _, text = process.communicate(timeout=HANG_SECONDS)
            self.fail(f"it started, and of {self.files_before} files {len(self.files())} are left\n{text}")
        self.assertEqual(process.returncode, 1, text)
        return text.splitlines()[-1]

    def refused(self, *parts):
        before = self.files()
        self.files_before = len(before)
        text = self.start_fails()
        for part in (*parts, "Put back the database", "voxeld doctor --rebuild --data " + self.data,
                     "--adopt", self.data + "/quarantine"):
            self.assertIn(part, text)
        self.assertEqual(self.files(), before)

    def doctor(self, *arguments):
        done = subprocess.run([BIN / "voxeld", "doctor", "--json", "--data", self.data, *arguments],
                              capture_output=True, text=True)
        self.assertEqual(done.stderr, "")
        return done.returncode, json.loads(done.stdout)


class Refused(Recovery):
    def test_the_database_moved_away_as_for_a_corrupt_one(self):
        daemon = self.run_daemon()
        made = self.make(daemon)
        daemon.stop()
        with open(self.data + "/jobs.sqlite", "r+b") as file:
            file.write(b"not a database at all, by a disk that failed")
        text = self.start_fails()
        self.assertIn("job database is corrupt", text)
        self.assertIn("run voxeld doctor --rebuild", text)
        self.remove_database()  # "move jobs.sqlite and jobs.sqlite-wal away"
        self.refused("is missing or new, but", "none that names any file")
        self.assertIn(made["asset"], self.files())

    def test_an_empty_database(self):
        daemon = self.run_daemon()
        self.make(daemon)
        daemon.stop()
        self.remove_database()
        pathlib.Path(self.data, "jobs.sqlite").touch()
        self.refused("is missing or new, but")

    def test_a_killed_daemon_whose_wal_was_removed(self):
        daemon = self.run_daemon()
        made = self.make(daemon)
        daemon.stop()
        daemon.start()
        daemon.upload(self.fixtures / "sample.glb")
        daemon.kill_gateway()
        self.assertGreater(pathlib.Path(self.data, "jobs.sqlite-wal").stat().st_size, 0)
        for name in DATABASE[1:]:
            pathlib.Path(self.data, name).unlink()
        self.refused("is older than the files", "jobs.sqlite-wal was removed")
        daemon.arguments = ["--adopt"]
        daemon.start()  # what is known is there
        self.assertEqual(daemon.get("/v1/grids/" + made["grid"]).status, 200)

    def test_an_older_copy(self):
        daemon = self.run_daemon()
        self.make(daemon)
        daemon.stop()
        shutil.copy(self.data + "/jobs.sqlite", self.data + "/copy")
        daemon.start()
        daemon.upload(self.fixtures / "sample.glb")
        daemon.stop()
        os.replace(self.data + "/copy", self.data + "/jobs.sqlite")
        self.refused("is older than the files")


class Adopted(Recovery):
    def test_blobs_unknown_to_the_database_are_quarantined_until_the_right_one_is_back(self):
        daemon = self.run_daemon()
        made = self.make(daemon)
        daemon.stop()
        shutil.copy(self.data + "/jobs.sqlite", self.data + "/old")
        daemon.start()
        later = daemon.upload(self.fixtures / "sample.glb")
        daemon.stop()
        shutil.copy(self.data + "/jobs.sqlite", self.data + "/right")
        shutil.copy(self.data + "/blobs/mark", self.data + "/right-mark")
        os.replace(self.data + "/old", self.data + "/jobs.sqlite")
        daemon.arguments = ["--adopt"]
        daemon.start()
        wait_until(lambda: later in self.files("quarantine"), lambda: self.files("quarantine"))
        self.assertEqual(daemon.get("/v1/assets/" + later).status, 404)
        self.assertEqual(daemon.get("/v1/grids/" + made["grid"]).status, 200)
        daemon.stop()
        daemon.arguments = []
        daemon.start()  # it is adopted for good
        daemon.stop()
        os.replace(self.data + "/right", self.data + "/jobs.sqlite")
        daemon.arguments = ["--adopt"]
        daemon.start()
        self.assertEqual(daemon.get("/v1/assets/" + later).status, 200)
        self.assertIn(later, self.files())
        self.assertEqual(self.files("quarantine"), set())

    def test_the_same_bytes_uploaded_again_are_taken_out_of_quarantine(self):
        daemon = self.run_daemon()
        made = self.make(daemon)
        daemon.stop()
        self.remove_database()
        daemon.arguments = ["--adopt"]
        daemon.start()
        wait_until(lambda: made["asset"] in self.files("quarantine"), lambda: self.files("quarantine"))
        self.assertEqual(daemon.upload(self.fixtures / "sample.ply"), made["asset"])
        daemon.stop()
        daemon.arguments = []
        daemon.start()
        self.assertEqual(daemon.get("/v1/assets/" + made["asset"]).status, 200)
        wait_until(lambda: made["asset"] not in self.files("quarantine"), lambda: self.files("quarantine"))
        self.assertIn(made["grid"], self.files("quarantine"))

    def test_quarantine_ends_after_its_days(self):
        daemon = self.run_daemon()
        self.make(daemon)
        daemon.stop()
        old, recent = "sha256-" + "0" * 64, "sha256-" + "1" * 64
        for age_days, name in ((9, old), (3, recent)):
            day = time.strftime("%Y-%m-%d", time.gmtime(time.time() - age_days * 86400))
            folder = pathlib.Path(self.data, "quarantine", day)
            folder.mkdir(parents=True)
            (folder / name).write_bytes(b"x")
        daemon.start()
        wait_until(lambda: self.files("quarantine") == {recent}, lambda: self.files("quarantine"))


class Rebuilt(Recovery):
    def test_without_its_database_a_store_gives_assets_and_grids_again(self):
        daemon = self.run_daemon()
        made = self.make(daemon)
        grid = daemon.get(f"/v1/grids/{made['grid']}").body
        result = daemon.get(f"/v1/jobs/{made['job']}/result").body
        daemon.stop()
        self.remove_database()
        code, report = self.doctor("--rebuild")
        self.assertEqual(code, 0)
        # The array is an asset: it could have been uploaded.
        self.assertEqual((report["assets"], report["grids"], report["outputs"]), (3, 1, 0), report)
        daemon.start()
        self.assertEqual(daemon.get("/v1/grids/" + made["grid"]).body, grid)
        for asset in (made["asset"], made["bundle"]):
            self.assertEqual(daemon.get("/v1/assets/" + asset).status, 200)
            job = daemon.submit(kind="voxelize", asset=asset, options={"size": 24, "format": "npy"})
            self.assertEqual(daemon.wait(job)["state"], "done")
            self.assertEqual(daemon.get(f"/v1/jobs/{job}/result").body, result)
        code, report = self.doctor("--store")
        self.assertEqual((code, report["problems"]), (0, []))

    def test_a_running_daemon_is_left_alone(self):
        daemon = self.run_daemon()
        done = subprocess.run([BIN / "voxeld", "doctor", "--rebuild", "--data", self.data],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn(f"in use by process {daemon.process.pid}", done.stderr)


if __name__ == "__main__":
    unittest.main()
