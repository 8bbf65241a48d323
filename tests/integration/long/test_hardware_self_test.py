"""The path of hardware and its self-test, run by Mesa's software driver under another name."""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

from harness import BIN, ROOT, Daemon, make_fixtures, wait_until

sys.path.insert(0, str(ROOT / "docker"))
from gpu_requests import FEATURES, TEXTURED  # noqa: E402

# Mesa then reports this renderer, and voxeld takes llvmpipe for a GPU.
FAKE = ["env", "force_gl_renderer=FakeGPU"]


class FakeGpu(Daemon):
    """A daemon that takes llvmpipe for a GPU, with the self-test's outcome of an earlier one."""
    program = [*FAKE, *Daemon.program]
    outcome = None  # self_test.json; a daemon with other shaders does not believe it

    def start(self):
        record = pathlib.Path(self.data_dir) / "self_test.json"
        if FakeGpu.outcome is not None and not record.exists():
            record.parent.mkdir(mode=0o700, exist_ok=True)
            record.write_text(FakeGpu.outcome)
        super().start()
        if FakeGpu.outcome is None:
            FakeGpu.outcome = record.read_text()


class AsHardware(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        cls.addClassCleanup(shutil.rmtree, cls.fixtures, ignore_errors=True)
        make_fixtures(cls.fixtures)
        cls.gpu = FakeGpu(device="egl:0")
        cls.addClassCleanup(cls.gpu.stop)
        cls.cpu = Daemon(device="cpu")
        cls.addClassCleanup(cls.cpu.stop)

    def meta(self, daemon, name, options):
        asset = daemon.upload(self.fixtures / name)
        status = daemon.wait(daemon.submit(kind="voxelize", asset=asset, options={"cache": "no", **options}))
        self.assertEqual(status["state"], "done", status)
        return status["result"]["meta"]

    def test_every_request_gives_the_grid_of_the_cpu(self):
        for name, requests in (("sample.glb", FEATURES), ("sample.obj.zip", TEXTURED)):
            for options in requests:
                with self.subTest(name=name, **options):
                    options = {"size": 80, **options}
                    expected = self.meta(self.cpu, name, options)
                    self.assertGreater(expected["voxel_count"], 1000)
                    for pipeline in ("compute", "raster"):
                        found = self.meta(self.gpu, name, {"pipeline": pipeline, **options})
                        self.assertEqual(found["pipeline"], pipeline)
                        self.assertIn("FakeGPU", found["renderer"])
                        self.assertEqual(found["content_hash"], expected["content_hash"])

    def test_every_frame_of_an_animation_gives_the_grid_of_the_cpu(self):
        def hashes(daemon, pipeline):
            job = daemon.submit(kind="voxelize", asset=daemon.upload(self.fixtures / "worm.md5.zip"), options={
                "size": 60, "animation": "walk", "fps": 8, "cache": "no", "pipeline": pipeline})
            self.assertEqual(daemon.wait(job)["state"], "done")
            return [frame["content_hash"] for frame in daemon.get(f"/v1/jobs/{job}/frames").json()["frames"]]
        expected = hashes(self.cpu, "cpu")
        self.assertGreater(len(expected), 3)
        self.assertEqual(hashes(self.gpu, "compute"), expected)

    def test_timer_queries_measure_the_passes(self):
        passes = self.meta(self.gpu, "sample.glb", {"size": 100, "pipeline": "compute"})["passes_ms"]
        self.assertTrue({"classify", "small", "large", "gather"} <= set(passes), passes)


class OwnShaders(unittest.TestCase):
    """A daemon whose shaders can be broken."""

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-shaders-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        make_fixtures(cls.folder / "fixtures")
        cls.shaders = cls.folder / "shaders"
        shutil.copytree(ROOT / "shaders", cls.shaders)
        cls.break_before_start()
        cls.daemon = FakeGpu(device="egl:0", arguments=["--shader-dir", str(cls.shaders), "--workers-per-device", "1"],
                             data_dir=str(cls.folder / "data"))
        cls.addClassCleanup(cls.daemon.stop)

    @classmethod
    def break_before_start(cls):
        pass

    @classmethod
    def break_syntax(cls, *names):
        for name in names:
            with open(cls.shaders / name, "a") as file:
                file.write("\nvoid unfinished( {\n")

    def first_worker(self):
        return self.daemon.request("GET", "/readyz", port=self.daemon.admin_port).json()["workers"][0]

    def worker(self):
        """The first worker, once it has connected: a daemon that starts is ready before."""
        wait_until(lambda: self.first_worker()["connected"], self.first_worker)
        return self.first_worker()

    def degraded(self):
        text = self.daemon.request("GET", "/metrics", port=self.daemon.admin_port).body.decode()
        return [line.rsplit(" ", 1)[1] for line in text.splitlines()
                if line.startswith('voxeld_device_degraded{device="egl:0"}')]

    def restart(self):
        self.daemon.stop()
        self.daemon.start()

    def make(self, kind, **options):
        asset = self.daemon.upload(self.folder / "fixtures/sample.glb")
        return self.daemon.wait(self.daemon.submit(kind=kind, asset=asset, options=options))


class DifferentDevice(OwnShaders):
    """A driver that gives other voxels in one pipeline and compiles no images: the rest of it is used."""

    @classmethod
    def break_before_start(cls):
        cls.break_syntax("raymarch.frag")
        path = cls.shaders / "voxelize_touch.frag"
        text = path.read_text()
        loses = text.replace("  uint m = tile_morton", "  if (((i + j + k) & 15) == 3) return;\n  uint m = tile_morton")
        assert loses != text
        path.write_text(loses)

    def test_what_agrees_is_used_and_what_differs_is_not(self):
        failure = self.worker()["device_failure"]
        self.assertRegex(failure, r"^self-test: raster: touch: \d+ voxels, \d+ on the CPU; ")
        self.assertRegex(failure, r"images: .*raymarch\.frag")
        self.assertNotIn("compute", failure.split("; images")[0])
        self.assertEqual(self.degraded(), ["1"])

        meta = self.make("voxelize", size=64, cache="no")["result"]["meta"]
        self.assertEqual(meta["pipeline"], "compute")
        self.assertTrue(meta["pipeline_reason"].endswith("; the device failed the self-test of raster"), meta)
        self.assertNotIn("device_failure", meta)
        refused = self.make("voxelize", size=64, cache="no", pipeline="raster", color="none")
        self.assertEqual((refused["state"], refused["error"]["code"]), ("failed", "unsupported-feature"))
        self.assertRegex(refused["error"]["detail"], r"pipeline raster failed the device's self-test \(touch: \d+ voxels")
        image = self.make("render", size=32, width=64, height=64)
        self.assertEqual(image["result"]["meta"]["drawn_by"], "cpu")
        refused = self.make("render", size=32, width=64, height=64, renderer="gl")
        self.assertEqual((refused["state"], refused["error"]["code"]), ("failed", "unsupported-feature"))
        # A job that went well does not hide the faults.
        self.assertEqual((self.worker()["device_failure"], self.degraded()), (failure, ["1"]))

    def test_doctor_names_the_differences_and_a_later_start_knows_them(self):
        done = subprocess.run([*FAKE, BIN / "voxeld", "doctor", "--json", "--data", self.daemon.data_dir],
                              capture_output=True, text=True, timeout=120)
        devices = {device["device"]: device for device in json.loads(done.stdout)["devices"]}
        self.assertRegex(devices["egl:0"]["self_test"], r"^differs from the CPU: raster: touch: ")
        log = self.daemon.log_tail(1 << 20)
        self.assertEqual((log.count('was_known=1'), log.count('was_known=0')), (0, 1), log)
        self.restart()
        log = self.daemon.log_tail(1 << 20)
        self.assertEqual((log.count('was_known=1'), log.count('was_known=0')), (1, 1), log)
        self.assertRegex(self.worker()["device_failure"], "^self-test: raster: touch: ")

    def test_hardware_that_was_not_tested_is_not_used(self):
        record = pathlib.Path(self.daemon.data_dir) / "self_test.json"
        text = record.read_text()
        self.addCleanup(self.restart)
        self.addCleanup(record.write_text, text)
        changed = json.loads(text)
        changed["devices"][0]["key"]["driver"] = "an older one"
        record.write_text(json.dumps(changed))
        os.kill(self.worker()["pid"], signal.SIGKILL)
        wait_until(lambda: "an older one" in self.first_worker()["device_failure"], self.first_worker)


class BrokenShader(OwnShaders):
    """A driver that does not compile a shader: auto goes on on the CPU, and says so."""

    def test_a_grid_and_an_image_are_made_on_the_cpu(self):
        self.assertEqual((self.worker()["device_failure"], self.degraded()), ("", ["0"]))
        self.break_syntax("batch_classify.comp", "raymarch.frag")  # after the self-test
        asset = self.daemon.upload(self.folder / "fixtures/sample.glb")

        def voxelize(**options):
            return self.daemon.wait(self.daemon.submit(kind="voxelize", asset=asset,
                                                       options={"size": 64, "cache": "no", **options}))
        meta = voxelize()["result"]["meta"]
        self.assertEqual(meta["pipeline"], "cpu")
        self.assertIn("batch_classify.comp", meta["device_failure"])
        self.assertEqual(meta["pipeline_reason"], "cpu: compute failed on the device: " + meta["device_failure"])
        self.assertEqual((self.worker()["device_failure"], self.degraded()), (meta["device_failure"], ["1"]))

        # The device's raster pipeline still works, and makes the same bytes.
        by_raster = voxelize(pipeline="raster")["result"]["meta"]
        self.assertEqual(by_raster["content_hash"], meta["content_hash"])
        self.assertEqual((self.worker()["device_failure"], self.degraded()), ("", ["0"]))

        refused = voxelize(pipeline="compute")
        self.assertEqual((refused["state"], refused["error"]["code"]), ("failed", "internal"))
        self.assertIn("batch_classify.comp", refused["error"]["detail"])

        image = self.daemon.wait(self.daemon.submit(kind="render", asset=asset,
                                                    options={"size": 32, "width": 64, "height": 64}))
        self.assertEqual(image["state"], "done", image)
        self.assertEqual(image["result"]["meta"]["drawn_by"], "cpu")
        self.assertIn("raymarch.frag", image["result"]["meta"]["device_failure"])
        by_gl = self.daemon.wait(self.daemon.submit(kind="render", asset=asset, options={
            "size": 32, "width": 64, "height": 64, "renderer": "gl"}))
        self.assertEqual((by_gl["state"], by_gl["error"]["code"]), ("failed", "internal"))


if __name__ == "__main__":
    unittest.main()
