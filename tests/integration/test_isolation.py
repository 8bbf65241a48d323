"""Workers are shut in on every device, and what takes too much memory or time ends alone."""
import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from harness import BIN, DEVICES, Daemon, DaemonTest, make_fixtures, wait_until
from test_cancel import lattice


def status_lines(path, *names):
    text = pathlib.Path(path).read_text()
    return tuple(re.search(rf"^{name}:\s*(\S+)", text, re.M)[1] for name in names)


class ShutIn(unittest.TestCase):
    """Every integration test runs with --sandbox require; here it is looked at from outside."""

    @classmethod
    def setUpClass(cls):
        cls.fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        make_fixtures(cls.fixtures)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.fixtures, ignore_errors=True)

    def test_workers_of_all_devices_are_shut_in_with_all_their_threads(self):
        for device in DEVICES:
            with self.subTest(device):
                daemon = Daemon(device=device, arguments=["--workers-per-device", "1"])
                try:
                    self.look_at(daemon)
                finally:
                    daemon.stop()

    def look_at(self, daemon):
        asset = daemon.upload(self.fixtures / "sample.ply")
        job = daemon.submit(kind="render", asset=asset, options={"size": 32, "width": 32, "height": 32})
        self.assertEqual(daemon.wait(job)["state"], "done")
        workers = daemon.request("GET", "/readyz", port=daemon.admin_port).json()["workers"]
        self.assertEqual([worker["sandbox"] for worker in workers], ["full"])
        pid = workers[0]["pid"]
        seen = set()
        for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
            try:
                filters = status_lines(task / "status", "NoNewPrivs", "Seccomp", "Seccomp_filters")
            except (FileNotFoundError, ProcessLookupError):
                continue  # a thread that has ended since
            self.assertEqual(filters, ("1", "2", "2"), task)
            seen.add(task.name)
        self.assertIn(str(pid), seen)
        limits = pathlib.Path(f"/proc/{pid}/limits").read_text()
        self.assertRegex(limits, r"Max core file size +0 +0 ")
        self.assertRegex(limits, r"Max open files +1024 +1024 ")
        self.assertEqual(pathlib.Path(f"/proc/{pid}/oom_score_adj").read_text().strip(), "500")
        # Nothing of the data directory is open but the worker's own folder, and no input is left.
        root = pathlib.Path(daemon.data_dir).resolve()
        for fd in pathlib.Path(f"/proc/{pid}/fd").iterdir():
            try:
                target = os.readlink(fd)
            except FileNotFoundError:
                continue  # closed since
            self.assertFalse(target.startswith(f"{root}/") and "/scratch/" not in target, target)
        folders = list((root / "run/scratch").iterdir())
        self.assertEqual(len(folders), 1)

        def left():
            return [path for name in ("in", "out", "taken") for path in (folders[0] / name).iterdir()]
        wait_until(lambda: not left(), left)  # a moment after the job's end is visible

    def hide(self, folder, megabytes):
        """Bytes below 45 folders, as a worker that was taken over would write them."""
        deep = folder.joinpath(*["n"] * 45)
        deep.mkdir(parents=True)
        (deep / "hidden").write_bytes(bytes(megabytes << 20))

    def test_bytes_below_45_folders_count_towards_a_workers_limit_and_go_with_it(self):
        daemon = Daemon(device="cpu", arguments=["--worker-scratch-max", "20M", "--workers-per-device", "1"])
        try:
            # Takes minutes, and writes nothing before its end.
            asset = daemon.post("/v1/assets?filename=lattice.ply", lattice(28)).json()["id"]
            job = daemon.submit(kind="voxelize", asset=asset, options={
                "size": 512, "fill": "solid", "sign": "winding", "cache": "no"})
            daemon.wait_state(job, "running")
            scratch = pathlib.Path(daemon.data_dir, "run/scratch")
            folder, = scratch.iterdir()
            self.hide(folder / "out", 80)
            status = daemon.wait(job)
            self.assertEqual((status["state"], status["error"]["code"]), ("failed", "storage-full"), status)
            self.assertIn("the job writes more than one worker may", status["error"]["detail"])
            wait_until(lambda: not folder.exists(), "the worker's folder is removed whole")
            # A gateway that is killed leaves the folders to the next start.
            daemon.kill_gateway()
            self.hide(scratch / "left/out", 80)
            daemon.start()
            self.assertFalse((scratch / "left").exists())
        finally:
            daemon.stop()

    def test_sandbox_off_is_off_and_doctor_reports_the_kernels_features(self):
        daemon = Daemon(device="cpu", arguments=["--sandbox", "off"])
        try:
            workers = daemon.request("GET", "/readyz", port=daemon.admin_port).json()["workers"]
            self.assertEqual(workers[0]["sandbox"], "off")
            self.assertEqual(status_lines(f"/proc/{workers[0]['pid']}/status", "Seccomp"), ("0",))
        finally:
            daemon.stop()
        text = subprocess.run([BIN / "voxeld", "doctor"], capture_output=True, text=True).stdout
        self.assertIn("isolation of workers: full", text)

    def test_inputs_that_are_bundles_grids_and_sequences_are_handed_over(self):
        daemon = Daemon(device="cpu")
        try:
            moving = daemon.upload(self.fixtures / "worm.md5.zip")
            job = daemon.submit(kind="voxelize", asset=moving,
                                options={"size": 16, "animation": "walk", "frames": "0..3"})
            status = daemon.wait(job)
            self.assertEqual(status["state"], "done", status)
            sequence = status["result"]["sequence"]
            for request in ({"kind": "export", "sequence": sequence, "options": {"format": "npy"}},
                            {"kind": "render", "sequence": sequence,
                             "options": {"width": 32, "height": 32, "image": "gif"}}):
                self.assertEqual(daemon.wait(daemon.submit(**request))["state"], "done", request)
        finally:
            daemon.stop()


class Drivers(unittest.TestCase):
    """Devices are probed in the sandbox of the workers that would use them."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-driver-")).resolve()
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def probe(self, sandbox, **variables):
        done = subprocess.run([BIN / "voxeld", "probe-device", "--device", "lavapipe", "--sandbox", sandbox],
                              capture_output=True, text=True, timeout=120, env={**os.environ, **variables})
        self.assertEqual(done.returncode, 0, done)
        return json.loads(done.stdout)

    def test_a_vulkan_driver_outside_of_the_systems_folders_opens(self):
        manifests = sorted(pathlib.Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json"))
        if not manifests or "lavapipe" not in DEVICES:
            self.skipTest("no lavapipe")
        manifest = json.loads(manifests[0].read_text())
        library = pathlib.Path(manifest["ICD"]["library_path"])
        if not library.is_absolute():
            library = pathlib.Path("/usr/lib/x86_64-linux-gnu") / library
        (self.folder / "lib").mkdir()
        shutil.copy(library, self.folder / "lib/libdriver.so")
        manifest["ICD"]["library_path"] = "./lib/libdriver.so"
        named = self.folder / "driver.json"
        named.write_text(json.dumps(manifest))
        for sandbox in ("off", "require"):
            with self.subTest(sandbox):
                found = self.probe(sandbox, VK_DRIVER_FILES=str(named), VK_ICD_FILENAMES=str(named))
                self.assertTrue(found["works"], found)
                self.assertIn("zink", found["info"]["renderer"])

    def test_a_driver_that_the_sandbox_keeps_out_is_told_apart_by_doctor(self):
        # The sandbox opens the folder that the variable names, not the one that a link in it leads to.
        driver = pathlib.Path("/usr/lib/x86_64-linux-gnu/dri/swrast_dri.so")
        if not driver.exists() or driver.resolve().name == "libdril_dri.so":
            self.skipTest(f"{driver} is no driver of its own: Mesa from 24.2 on has all in one library")
        for name in ("named", "elsewhere"):
            (self.folder / name).mkdir()
        shutil.copy(driver, self.folder / "elsewhere/swrast_dri.so")
        (self.folder / "named/swrast_dri.so").symlink_to(self.folder / "elsewhere/swrast_dri.so")
        done = subprocess.run([BIN / "voxeld", "doctor", "--json"], capture_output=True, text=True, timeout=120,
                              env={**os.environ, "LIBGL_DRIVERS_PATH": str(self.folder / "named")})
        found = {device["device"]: device for device in json.loads(done.stdout)["devices"]}["llvmpipe"]
        self.assertEqual((found["works"], found["is_kept_out"]), (False, True), found)
        self.assertRegex(found["reason"], "; outside of the sandbox it opens, as llvmpipe.*: the sandbox of workers keeps")
        self.assertIn("strace -f -Z voxeld probe-device --device llvmpipe", found["hint"])
        # A worker names the sandbox as a suspect.
        with tempfile.TemporaryDirectory() as data:
            done = subprocess.run([BIN / "voxeld", "serve", "--listen", "127.0.0.1:0", "--admin-listen", "none",
                                   "--data", data, "--device", "llvmpipe"], capture_output=True, text=True,
                                  timeout=60, env={**os.environ, "LIBGL_DRIVERS_PATH": str(self.folder / "named")})
        self.assertNotEqual(done.returncode, 0, done)
        self.assertIn("EGL_NOT_INITIALIZED", done.stderr)
        self.assertIn("the sandbox may keep a file or system call from the driver", done.stderr)


class Caps(DaemonTest):
    device = "cpu"
    arguments = ("--worker-memory-max", "250M")

    def test_a_job_that_takes_too_much_memory_fails_at_once_and_the_next_one_runs(self):
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        before = self.daemon.worker_pid()
        job = self.daemon.submit(kind="voxelize", asset=asset,
                                 options={"size": 2048, "fill": "solid"})
        status = self.daemon.wait(job)
        self.assertEqual(status["state"], "failed", status)
        self.assertEqual(status["error"]["code"], "grid-too-large", status)
        self.assertRegex(status["error"]["detail"], r"^memory: \d+ MB, limit 262 MB$")
        self.assertEqual(status["attempt"], 1)
        small = self.daemon.submit(kind="voxelize", asset=asset, options={"size": 16})
        self.assertEqual(self.daemon.wait(small)["state"], "done")
        self.assertNotEqual(self.daemon.worker_pid(), before)


class Slow(DaemonTest):
    device = "cpu"
    arguments = ("--job-seconds-max", "0.5")

    def test_a_job_that_runs_too_long_is_ended(self):
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        job = self.daemon.submit(kind="voxelize", asset=asset,
                                 options={"size": 4096, "fill": "solid"})
        status = self.daemon.wait(job)
        self.assertEqual(status["state"], "failed", status)
        self.assertEqual(status["error"]["code"], "deadline-exceeded", status)
        self.assertIn("ran too long", status["error"]["detail"])

        def small():
            # On a busy machine any job may take longer than the limit.
            return self.daemon.wait(self.daemon.submit(kind="voxelize", asset=asset, options={"size": 16}))
        wait_until(lambda: small()["state"] == "done", "a small job is done")


if __name__ == "__main__":
    unittest.main()
