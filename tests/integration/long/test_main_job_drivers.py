"""A real mesh has one content hash by every driver and pipeline."""
import unittest

import test_main_job
from harness import DATA


class EveryDriverAndPipeline(test_main_job.DriversTest):
    @unittest.skipUnless(DATA, "VOXELD_DATA_DIR is not set: no real meshes")
    def test_bunny_has_one_hash(self):
        hashes = self.by_each(lambda daemon, pipeline: self.hash_of(
            daemon, pipeline, f"{DATA}/scans/bunny/bun_zipper.ply", "size=256"))
        self.assertEqual(len(set(hashes.values())), 1, hashes)


if __name__ == "__main__":
    unittest.main()
