"""The main job: a mesh in, a grid and an image out, the same bytes on every driver and pipeline."""
import hashlib
import io
import subprocess
import unittest

import numpy as np

from harness import DEVICES, PIPELINES, Daemon, DaemonTest, make_fixtures, oracle

import pathlib
import shutil
import tempfile


class OneShot(DaemonTest):
    pipelines = PIPELINES

    def test_curl_gets_a_grid_that_numpy_loads(self):
        out = subprocess.run(
            ["curl", "-fsS", "--data-binary", f"@{self.fixtures}/sample.ply",
             f"{self.daemon.url}/v1/voxelize?size=64&format=npy"], check=True, capture_output=True)
        grid = np.load(io.BytesIO(out.stdout))
        dims, occupied, _ = oracle(self.fixtures / "sample.ply", 64)
        self.assertEqual(grid.dtype, np.uint8)
        self.assertEqual(grid.shape, dims[::-1])
        self.assertEqual(max(grid.shape), 64)
        self.assertEqual(int(grid.sum()), occupied)

    def test_each_rule_matches_the_oracle_by_every_pipeline(self):
        counts = {}
        for rule in ("touch", "thin", "center"):
            dims, occupied, sha256 = oracle(self.fixtures / "sample.ply", 48, rule)
            counts[rule] = occupied
            for pipeline in self.pipelines:
                with self.subTest(f"{rule} {pipeline}"):
                    response = self.daemon.post(
                        f"/v1/voxelize?size=48&format=npy&rule={rule}&pipeline={pipeline}",
                        self.fixture("sample.ply"))
                    self.assertEqual(response.status, 200, response.body)
                    self.assertEqual(response.headers["X-Voxeld-Pipeline"], pipeline)
                    grid = np.load(io.BytesIO(response.body))
                    self.assertEqual(grid.shape, dims[::-1])
                    self.assertEqual(int(grid.sum()), occupied)
                    self.assertEqual("sha256-" + hashlib.sha256(grid.tobytes()).hexdigest(), sha256)
        self.assertGreater(counts["touch"], counts["thin"])
        self.assertGreaterEqual(counts["thin"], counts["center"])

    def test_npz_carries_colour_and_place(self):
        response = self.daemon.post("/v1/voxelize?size=48&format=npz&filename=sample.glb",
                                    self.fixture("sample.glb"))
        self.assertEqual(response.status, 200, response.body)
        grid = np.load(io.BytesIO(response.body))
        occupied = grid["occupancy"].astype(bool)
        self.assertEqual(grid["color"].shape, occupied.shape + (4,))
        self.assertTrue((grid["color"][~occupied] == 0).all())
        self.assertGreater(len(np.unique(grid["color"][occupied], axis=0)), 10)
        self.assertEqual(grid["origin"].dtype, np.float64)
        self.assertEqual(grid["voxel_size"].shape, (3,))
        self.assertIn("voxelize", response.headers["Server-Timing"])
        for header in ("ETag", "X-Voxeld-Pipeline", "X-Voxeld-Device", "X-Voxeld-Content-Hash"):
            self.assertTrue(response.headers[header], header)

    def test_the_same_request_twice_computes_once(self):
        path = "/v1/voxelize?size=40&format=native&filename=sample.ply"
        first = self.daemon.post(path, self.fixture("sample.ply"))
        second = self.daemon.post(path, self.fixture("sample.ply"))
        self.assertEqual(first.body, second.body)
        self.assertEqual(first.headers["ETag"], second.headers["ETag"])
        self.assertIn("hit", second.headers.get("Cache-Status", ""))

    def test_every_sample_of_the_project_is_voxelized_exactly(self):
        for name in ("sample.glb", "sample.ply", "sample.stl", "sample.off", "sample.obj.zip"):
            with self.subTest(name):
                response = self.daemon.post(f"/v1/voxelize?size=50&format=npy&filename={name}",
                                            self.fixture(name))
                self.assertEqual(response.status, 200, response.body)
                grid = np.load(io.BytesIO(response.body))
                _, occupied, digest = oracle(self.fixtures / name, 50)
                self.assertEqual(int(grid.sum()), occupied)
                self.assertEqual("sha256-" + hashlib.sha256(grid.tobytes()).hexdigest(), digest)

    def test_an_image_is_a_png_of_the_size_asked_for(self):
        response = self.daemon.post("/v1/render?size=64&width=320&height=200&filename=sample.glb",
                                    self.fixture("sample.glb"))
        self.assertEqual(response.status, 200, response.body)
        self.assertEqual(response.body[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(int.from_bytes(response.body[16:20], "big"), 320)
        self.assertEqual(int.from_bytes(response.body[20:24], "big"), 200)


class OneShotWithoutGl(OneShot):
    """The same on a worker that has no GL context."""
    device = "cpu"
    pipelines = ("cpu",)

    def test_the_response_names_pipeline_and_device(self):
        response = self.daemon.post("/v1/voxelize?size=32&filename=sample.ply&cache=no",
                                    self.fixture("sample.ply"))
        self.assertEqual(response.status, 200, response.body)
        self.assertEqual(response.headers["X-Voxeld-Pipeline"], "cpu")
        self.assertEqual(response.headers["X-Voxeld-Device"].split()[0], "cpu")

    def test_pipelines_that_this_device_will_never_have_are_no_reason_to_try_again(self):
        for pipeline in ("compute", "raster"):
            response = self.daemon.post(
                f"/v1/voxelize?size=32&filename=sample.ply&pipeline={pipeline}",
                self.fixture("sample.ply"))
            self.assert_problem(response, 422, "unsupported-feature", pipeline, "GL context")
            self.assertNotIn("Retry-After", response.headers)


class DriversTest(unittest.TestCase):
    def by_each(self, make, devices):
        """What make(daemon, pipeline) returns, by (device, pipeline)."""
        result = {}
        for device, pipelines in devices.items():
            daemon = Daemon(device=device)
            try:
                for pipeline in pipelines:
                    result[device, pipeline] = make(daemon, pipeline)
            finally:
                daemon.stop()
        return result

    def hash_of(self, daemon, pipeline, mesh, query):
        """The content hash of a mesh's grid."""
        mesh = pathlib.Path(mesh)
        response = daemon.post(
            f"/v1/voxelize?{query}&pipeline={pipeline}&cache=no&format=native&filename={mesh.name}",
            mesh.read_bytes())
        self.assertEqual(response.status, 200, response.body)
        self.assertEqual(response.headers["X-Voxeld-Pipeline"], pipeline)
        return response.headers["X-Voxeld-Content-Hash"]


class EveryDriver(DriversTest):
    """One content hash for all of them. long/test_main_job_drivers.py has their other pipelines, whose shaders take
    long to compile."""

    def test_a_coloured_sample_has_one_hash(self):
        fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        self.addCleanup(shutil.rmtree, fixtures)
        make_fixtures(fixtures)
        hashes = self.by_each(
            lambda daemon, pipeline: self.hash_of(
                daemon, pipeline, fixtures / "sample.glb", "size=96&channels=occupancy,color,normal"),
            {device: pipelines[:1] for device, pipelines in DEVICES.items()})
        self.assertEqual(len(hashes), len(DEVICES))
        self.assertEqual(len(set(hashes.values())), 1, hashes)


if __name__ == "__main__":
    unittest.main()
