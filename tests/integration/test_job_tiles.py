"""GET /v1/jobs/ID/tiles: the tiles of a grid while it grows; all of them together are the grid."""
import json
import struct
import sys
import time
import unittest

import numpy as np

from harness import ROOT, Daemon, DaemonTest, until_met

sys.path.insert(0, str(ROOT / "docs"))
import read_grid  # noqa: E402

LARGE = {"channels": "occupancy,color", "cache": "no"}
# From some hundred tiles on.
LARGE_SIZES = (1600, 3200, 4800)


class JobTiles(DaemonTest):
    device = "cpu"
    arguments = ("--part-seconds", "0")

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.asset = cls.daemon.upload(cls.fixtures / "sample.glb")

    def submit(self, daemon=None, **options):
        return (daemon or self.daemon).submit(kind="voxelize", asset=self.asset, options=options)

    def tiles(self, job, after=0, wait=0, daemon=None):
        headers = {"Prefer": f"wait={wait}"} if wait else {}
        return (daemon or self.daemon).get(f"/v1/jobs/{job}/tiles?after={after}", headers=headers)

    def follow(self, job, daemon=None, after_each=lambda containers: None):
        """The containers of all tiles, and the states of the job at their time."""
        containers, states, after = [], [], 0
        deadline = time.monotonic() + 600
        while time.monotonic() < deadline:
            response = self.tiles(job, after, wait=10, daemon=daemon)
            if response.status == 204:
                return containers, states
            self.assertIn(response.status, (200, 202), response.body)
            if response.status == 202:
                continue
            self.assertEqual(json.loads(response.body[128:].split(b"}")[0] + b"}"),
                             {"job": job, "first_tile": after})
            after += struct.unpack_from("<I", response.body, 80)[0]
            self.assertEqual(response.headers["X-Voxeld-Next"], str(after))
            containers.append(response.body)
            states.append((daemon or self.daemon).get(f"/v1/jobs/{job}").json()["state"])
            after_each(containers)
        self.fail("the job did not end")

    def assert_union(self, containers, grid):
        """The tiles are those of the grid that was read, cell by cell and in its order."""
        parts = [read_grid.read_grid(part) for part in containers]
        for name in ("dims", "origin", "voxel_size"):
            self.assertEqual({part[name] for part in parts}, {grid[name]})
        for name in ("cells", "color"):
            np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), grid[name])

    def grid_of(self, job, daemon=None):
        status = (daemon or self.daemon).wait(job, 600)
        self.assertEqual(status["state"], "done", status)
        return read_grid.read_grid((daemon or self.daemon).get(f"/v1/grids/{status['result']['grid']}").body)

    def test_all_tiles_together_are_the_grid_cell_by_cell(self):
        def followed(size):
            job = self.submit(**LARGE, size=size, padding=1)
            containers, states = self.follow(job)
            return "running" in states and len(containers) > 4 and (job, containers)
        job, containers = until_met(LARGE_SIZES, followed)
        grid = self.grid_of(job)
        self.assert_union(containers, grid)
        # The same from the stored grid, for a client that comes late.
        late, _ = self.follow(job)
        self.assertLess(len(late), len(containers))
        self.assert_union(late, grid)

    def test_a_job_whose_worker_and_gateway_die_goes_on_with_the_next_tile(self):
        daemon = Daemon(device="cpu", arguments=self.arguments)
        try:
            daemon.upload(self.fixtures / "sample.glb")

            def interrupted(size):
                job = self.submit(daemon, **LARGE, size=size, padding=2)
                begun_ms = []

                def after_each(containers):
                    if len(containers) == 3:
                        daemon.kill_worker()
                    if len(containers) == 5:
                        begun_ms.append(daemon.get(f"/v1/jobs/{job}").json()["started_ms"])
                        daemon.kill_gateway()
                        daemon.start()
                containers, _ = self.follow(job, daemon, after_each)
                # Begun again after the second death.
                was_in_time = begun_ms and daemon.wait(job)["started_ms"] != begun_ms[0]
                return was_in_time and (job, containers)
            job, containers = until_met(LARGE_SIZES, interrupted)
            self.assert_union(containers, self.grid_of(job, daemon))
        finally:
            daemon.stop()

    def test_other_formats_and_images_of_a_mesh_give_the_tiles_of_their_grid(self):
        for kind, options in (("voxelize", {"size": 300, "format": "npz"}),
                              ("render", {"size": 300, "width": 64, "height": 64})):
            with self.subTest(kind=kind, **options):
                job = self.daemon.submit(kind=kind, asset=self.asset, options=options)
                containers, _ = self.follow(job)
                self.assert_union(containers, self.grid_of(job))

    def test_a_solid_comes_with_the_end_of_its_job(self):
        job = self.submit(size=300, fill="solid", cache="no")
        containers, states = self.follow(job)
        self.assertEqual(set(states), {"done"})
        self.assert_union(containers, self.grid_of(job))

    def test_a_cancelled_job_has_no_tiles(self):
        job = self.submit(**LARGE, size=16384)
        while (response := self.tiles(job, wait=60)).status == 202:
            pass
        self.assertEqual(response.status, 200)
        self.daemon.request("DELETE", f"/v1/jobs/{job}")
        self.assertEqual(self.daemon.wait(job)["state"], "cancelled")
        self.assert_problem(self.tiles(job), 409, "cancelled")

    def test_animations_unknown_jobs_and_tiles_beyond_the_grid_are_refused(self):
        worm = self.daemon.upload(self.fixtures / "worm.md5.zip")
        job = self.daemon.submit(kind="voxelize", asset=worm, options={"animation": "walk", "size": 16})
        for _ in range(2):
            self.assert_problem(self.tiles(job), 409, "conflict", "/frames")
            self.daemon.wait(job)
        job = self.submit(size=300, level=1)  # the grid that is stored is that of the level
        self.assert_problem(self.tiles(job), 409, "conflict", "a level or region of a grid")
        self.assert_problem(self.tiles("j-" + "0" * 32), 404, "not-found")
        job = self.submit(size=32)
        self.grid_of(job)
        self.assertEqual(self.tiles(job, after=1).status, 204)
        self.assert_problem(self.tiles(job, after=2), 400, "invalid-option", "0 to 1")
        self.assert_problem(self.tiles(job, after="x"), 400, "invalid-option", "number from 0 on")


if __name__ == "__main__":
    unittest.main()
