"""Real meshes, coloured grids and the frames of animations have one content hash by every driver and pipeline."""
import pathlib
import shutil
import tempfile
import unittest

import test_main_job
from harness import DATA, DEVICES, make_fixtures


class EveryDriverAndPipeline(test_main_job.DriversTest):
    def frames_of(self, daemon, pipeline, file):
        """Content hashes of a file's frames."""
        job = daemon.submit(kind="voxelize", asset=daemon.upload(file), options={
            "animation": "0", "size": 24, "fps": 6, "channels": "color,normal", "pipeline": pipeline})
        status = daemon.wait(job)
        self.assertEqual(status["state"], "done", status)
        return [f["content_hash"] for f in daemon.get(f"/v1/jobs/{job}/frames").json()["frames"]]

    def test_coloured_sample_and_frames_have_one_hash_each(self):
        fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        self.addCleanup(shutil.rmtree, fixtures)
        make_fixtures(fixtures)

        def make(daemon, pipeline):
            query = "size=96&channels=occupancy,color,normal"
            return [[self.hash_of(daemon, pipeline, fixtures / "sample.glb", query)],
                    *(self.frames_of(daemon, pipeline, fixtures / name)
                      for name in ("worm.md5.zip", "spin.glb"))]
        hashes = self.by_each(make, DEVICES)
        self.assertEqual(len(hashes), sum(map(len, DEVICES.values())))
        expected = hashes["cpu", "cpu"]
        self.assertTrue(all(len(set(frames)) > 2 for frames in expected[1:]), expected)
        for what, found in hashes.items():
            self.assertEqual(found, expected, what)

    @unittest.skipUnless(DATA, "VOXELD_DATA_DIR is not set: no real meshes")
    def test_bunny_has_one_hash(self):
        hashes = self.by_each(lambda daemon, pipeline: self.hash_of(
            daemon, pipeline, f"{DATA}/scans/bunny/bun_zipper.ply", "size=256"), DEVICES)
        self.assertEqual(len(set(hashes.values())), 1, hashes)


if __name__ == "__main__":
    unittest.main()
