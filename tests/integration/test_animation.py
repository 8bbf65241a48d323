"""Animations through the whole service: frames while they are made, in every pipeline, as files and images."""
import json
import pathlib
import struct
import sys
import tempfile
import unittest
import zipfile

import numpy as np

from harness import ROOT, DaemonTest, wait_until

sys.path.insert(0, str(ROOT / "docs"))
import read_grid  # noqa: E402
import read_sequence  # noqa: E402

WALK = {"animation": "walk", "size": 32}  # 6 frames at 12 per second, of which the last two are equal


def gif_size(data):
    """(width, height, images) of a GIF, by its blocks."""
    assert data[:6] == b"GIF89a", data[:6]
    width, height, flags = struct.unpack("<HHB", data[6:11])
    at, images = 13 + (3 << ((flags & 7) + 1) if flags & 128 else 0), 0
    while data[at] != 0x3b:
        if data[at] == 0x2c:
            images += 1
            at += 10 + (3 << ((data[at + 9] & 7) + 1) if data[at + 9] & 128 else 0) + 1
        else:
            at += 2
        while data[at]:
            at += data[at] + 1
        at += 1
    return width, height, images


def png_size(data):
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", data[16:24])


class Animation(DaemonTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.worm = cls.daemon.upload(cls.fixtures / "worm.md5.zip")
        cls.spin = cls.daemon.upload(cls.fixtures / "spin.glb")

    def finish(self, job):
        status = self.daemon.wait(job)
        self.assertEqual(status["state"], "done", status)
        return status

    def frames(self, job):
        response = self.daemon.get(f"/v1/jobs/{job}/frames")
        self.assertEqual(response.status, 200, response.body)
        return response.json()

    def voxelize(self, asset, **options):
        job = self.daemon.submit(kind="voxelize", asset=asset, options=options)
        return job, self.finish(job)

    def test_an_asset_describes_its_animations(self):
        told = self.daemon.get(f"/v1/assets/{self.worm}").json()
        self.assertEqual([joint["name"] for joint in told["joints"]], ["root", "middle", "top"])
        self.assertEqual([a["name"] for a in told["animations"]], ["walk", "wave"])
        self.assertEqual(told["animations"][0]["frames"], 6)
        self.assertEqual(told["animations"][0]["frame_rate"], 12)
        self.assertTrue(told["materials"][0]["found"])
        told = self.daemon.get(f"/v1/assets/{self.spin}").json()
        self.assertEqual([(a["name"], a["duration_s"]) for a in told["animations"]],
                         [("spin", 1), ("hop", 0.5)])

    def test_each_animation_of_a_zip_stands_for_itself(self):
        with zipfile.ZipFile(self.fixtures / "worm.md5.zip") as worm:
            files = {name: worm.read(name) for name in worm.namelist()}
        walk = files["walk.md5anim"]
        files["cut.md5anim"] = walk[:len(walk) // 2]
        files["foreign.md5anim"] = walk.replace(b'"top"', b'"hat"')
        path = pathlib.Path(tempfile.mkdtemp(dir=self.fixtures)) / "mixed.zip"
        with zipfile.ZipFile(path, "w") as mixed:
            for name in sorted(files):
                mixed.writestr(name, files[name])
        asset = self.daemon.upload(path)
        told = self.daemon.get(f"/v1/assets/{asset}").json()
        self.assertEqual(told["joint_count"], 3)
        reasons = {a["name"]: a["unusable"] for a in told["animations"]}
        self.assertEqual(sorted(reasons), ["cut", "foreign", "walk", "wave"])
        self.assertIn("cut.md5anim line ", reasons["cut"])
        self.assertIn("foreign.md5anim does not fit worm.md5mesh", reasons["foreign"])
        self.assertIsNone(reasons["walk"])
        self.assertIsNone(reasons["wave"])
        job, _ = self.voxelize(asset, **WALK)
        alone, _ = self.voxelize(self.worm, **WALK)
        self.assertEqual([f["content_hash"] for f in self.frames(job)["frames"]],
                         [f["content_hash"] for f in self.frames(alone)["frames"]])
        for name in ("cut", "foreign"):
            failed = self.daemon.wait(self.daemon.submit(
                kind="voxelize", asset=asset, options={"animation": name, "size": 32}))
            self.assertEqual(failed["state"], "failed", failed)
            self.assertEqual(failed["error"]["code"], "malformed-mesh")
            self.assertTrue(failed["error"]["detail"], failed)
            self.assertIn(failed["error"]["detail"], reasons[name])

    def test_an_animation_alone_is_to_be_bundled_with_its_mesh(self):
        with zipfile.ZipFile(self.fixtures / "worm.md5.zip") as worm:
            path = pathlib.Path(worm.extract("walk.md5anim", tempfile.mkdtemp(dir=self.fixtures)))
        asset = self.daemon.upload(path)
        self.assert_problem(self.daemon.get(f"/v1/assets/{asset}"), 415, "unsupported-media-type",
                            "walk.md5anim: an MD5 animation, which moves a mesh")

    def test_a_sequence_lists_its_frames_and_equal_ones_are_one_grid(self):
        job, status = self.voxelize(self.worm, **WALK)
        self.assertEqual((status["frames_done"], status["frames_total"]), (6, 6))
        told = self.frames(job)
        self.assertEqual(told["frames_total"], 6)
        self.assertTrue(told["sequence"])
        self.assertEqual([f["index"] for f in told["frames"]], list(range(6)))
        self.assertAlmostEqual(told["frames"][3]["time_s"], 0.25)
        grids = [frame["grid"] for frame in told["frames"]]
        self.assertEqual(grids[4], grids[5])
        self.assertEqual(len(set(grids)), 5)

    def test_a_frame_is_a_request_for_its_time_in_the_same_box(self):
        box = dict(size=32, bounds="-6,-6,-6,6,8,8")
        job, _ = self.voxelize(self.worm, animation="wave", **box)
        frames = self.frames(job)["frames"]
        self.assertEqual(len(frames), 4)
        self.assertGreater(len({frame["content_hash"] for frame in frames}), 2)
        for frame in frames:
            _, still = self.voxelize(self.worm, animation="wave", time=frame["time_s"], **box)
            self.assertEqual(still["result"]["meta"]["content_hash"], frame["content_hash"])

    def test_the_sequence_of_a_job_has_the_voxels_of_its_frames(self):
        job, status = self.voxelize(self.worm, channels="color,normal", **WALK)
        result = self.daemon.get(f"/v1/jobs/{job}/result").body
        told = self.frames(job)
        self.assertEqual(self.daemon.get(f"/v1/sequences/{told['sequence']}").body, result)
        sequence = read_sequence.Sequence(result)
        self.assertEqual(sequence.times, [frame["time_s"] for frame in told["frames"]])
        self.assertEqual(sequence.meta["frames"], 6)
        for number, frame in enumerate(told["frames"]):
            grid = read_grid.read_grid(self.daemon.get(f"/v1/grids/{frame['grid']}").body)
            there = sequence.frame(number)
            for name in ("cells", "color", "normal"):
                self.assertTrue(np.array_equal(there[name], grid[name]), (number, name))
        self.assertGreater(status["result"]["meta"]["host_bytes_estimate"], 0)

    def test_frames_can_be_fetched_while_the_job_runs_and_stay_after_a_cancel(self):
        # Enough frames that the job does not end before it is cancelled.
        times = [k / 10_000 for k in range(4096)]
        job = self.daemon.submit(kind="voxelize", asset=self.worm, options={
            "animation": "walk", "size": 400, "times": times, "pipeline": "cpu"})
        first = wait_until(lambda: self.frames(job)["frames"], lambda: self.frames(job))[0]
        response = self.daemon.get(f"/v1/jobs/{job}/frames/0")
        self.assertEqual(response.status, 200, response.body)
        self.assertEqual(response.body[:7], b"VOXGRID")
        self.daemon.request("DELETE", f"/v1/jobs/{job}")
        status = self.daemon.wait(job)
        self.assertEqual(status["state"], "cancelled", status)
        told = self.frames(job)
        self.assertIsNone(told["sequence"])
        self.assertGreaterEqual(len(told["frames"]), 1)
        self.assertLess(len(told["frames"]), len(times))
        self.assertEqual(told["frames"][0], first)
        response = self.daemon.get(f"/v1/grids/{first['grid']}")
        self.assertEqual(response.status, 200)
        self.assertEqual(response.body[:7], b"VOXGRID")

    def test_frames_as_gif_sheet_apng_and_one_image(self):
        views = dict(WALK, width=48, height=40)
        for image, columns in (("gif", None), ("apng", None), ("sheet", 4)):
            options = dict(views, image=image, **({"columns": columns} if columns else {}))
            job = self.daemon.submit(kind="render", asset=self.worm, options=options)
            self.finish(job)
            body = self.daemon.get(f"/v1/jobs/{job}/result").body
            if image == "gif":
                self.assertEqual(gif_size(body), (48, 40, 6))
            elif image == "apng":
                self.assertEqual(png_size(body), (48, 40))
                at = body.index(b"acTL") + 4
                self.assertEqual(struct.unpack(">II", body[at:at + 8]), (6, 0))
            else:
                self.assertEqual(png_size(body), (4 * 48, 2 * 40))
        images = set()
        for frame in (0, 2):
            job = self.daemon.submit(kind="render", asset=self.worm, options=dict(views, frame=frame))
            self.finish(job)
            images.add(self.daemon.get(f"/v1/jobs/{job}/result").body)
        self.assertEqual(len(images), 2)

    def test_a_turntable_of_one_grid(self):
        job = self.daemon.submit(kind="render", asset=self.spin, options={
            "size": 24, "image": "gif", "turntable": 6, "width": 32, "height": 32})
        self.finish(job)
        self.assertEqual(gif_size(self.daemon.get(f"/v1/jobs/{job}/result").body), (32, 32, 6))

    def test_unknown_animations_frames_and_times_are_refused(self):
        def refused(asset, *parts, **options):
            job = self.daemon.submit(kind="voxelize", asset=asset, options=dict(options, size=16))
            status = self.daemon.wait(job)
            self.assertEqual(status["state"], "failed", status)
            self.assertEqual(status["error"]["code"], "invalid-option")
            for part in parts:
                self.assertIn(part, json.dumps(status["error"]))
        refused(self.worm, "walk", "wave", "run", animation="run")
        refused(self.worm, "there are 6 frames", frames="4..6")
        refused(self.worm, "0.416667", time=2)
        still = self.daemon.upload(self.fixtures / "sample.ply")
        refused(still, "an asset with animations", animation=0)


if __name__ == "__main__":
    unittest.main()