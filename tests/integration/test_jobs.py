"""Jobs: submit, long poll, events, cancel, results with ranges and ETags."""
import http.client
import json
import threading
import unittest

from harness import HANG_SECONDS, DaemonTest, wait_until


class Jobs(DaemonTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.asset = cls.daemon.upload(cls.fixtures / "sample.glb")

    def test_a_job_is_accepted_with_a_location_and_ends_done(self):
        response = self.daemon.post("/v1/jobs", {
            "kind": "voxelize", "asset": self.asset, "options": {"size": 33, "format": "npz"}})
        self.assertEqual(response.status, 202, response.body)
        self.assertEqual(response.headers["Location"], "/v1/jobs/" + response.json()["id"])
        status = self.daemon.wait(response.json()["id"])
        self.assertEqual(status["state"], "done", status)
        self.assertEqual(status["tiles_done"], status["tiles_total"])
        self.assertEqual(max(status["result"]["meta"]["dims"]), 33)
        result = self.daemon.get(f"/v1/jobs/{status['id']}/result")
        self.assertEqual(result.status, 200)
        self.assertEqual(len(result.body), status["result"]["bytes"])

    def test_prefer_wait_returns_the_finished_job(self):
        response = self.daemon.post(
            "/v1/jobs", {"kind": "voxelize", "asset": self.asset, "options": {"size": 34}},
            headers={"Prefer": "wait=60"})
        self.assertEqual(response.status, 200, response.body)
        self.assertEqual(response.json()["state"], "done")

    def test_an_idempotency_key_makes_one_job(self):
        job = {"kind": "voxelize", "asset": self.asset, "options": {"size": 35}}
        first = self.daemon.post("/v1/jobs", job, headers={"Idempotency-Key": "abc"}).json()["id"]
        second = self.daemon.post("/v1/jobs", job, headers={"Idempotency-Key": "abc"}).json()["id"]
        self.assertEqual(first, second)
        job["options"]["size"] = 36
        self.assert_problem(self.daemon.post("/v1/jobs", job, headers={"Idempotency-Key": "abc"}),
                            422, "idempotency-mismatch")

    def test_ranges_and_etags_of_results(self):
        job = self.daemon.submit(kind="voxelize", asset=self.asset, options={"size": 37})
        self.daemon.wait(job)
        path = f"/v1/jobs/{job}/result"
        whole = self.daemon.get(path)
        etag = whole.headers["ETag"]
        self.assertEqual(self.daemon.get(path, headers={"If-None-Match": etag}).status, 304)
        part = self.daemon.get(path, headers={"Range": "bytes=10-19"})
        self.assertEqual(part.status, 206)
        self.assertEqual(part.body, whole.body[10:20])
        self.assertEqual(part.headers["Content-Range"], f"bytes 10-19/{len(whole.body)}")
        tail = self.daemon.get(path, headers={"Range": "bytes=-5"})
        self.assertEqual(tail.body, whole.body[-5:])
        clamped = self.daemon.get(path, headers={"Range": "bytes=5-99999999999"})
        self.assertEqual(clamped.body, whole.body[5:])
        self.assert_problem(self.daemon.get(path, headers={"Range": f"bytes={len(whole.body)}-"}),
                            416, "range-not-satisfiable")
        stale = self.daemon.get(path, headers={"Range": "bytes=0-3", "If-Range": '"other"'})
        self.assertEqual(stale.status, 200)

    def test_events_tell_the_whole_story_and_resume(self):
        job = self.daemon.submit(kind="voxelize", asset=self.asset,
                                 options={"size": 300, "channels": "occupancy"})
        events = self.read_events(job)
        self.assertEqual(events[-1]["data"]["state"], "done")
        ids = [event["id"] for event in events]
        self.assertEqual(ids, sorted(set(ids)))
        again = self.read_events(job, last_event_id=ids[-2])
        self.assertEqual([event["id"] for event in again], ids[-1:])

    def read_events(self, job, last_event_id=None):
        connection = http.client.HTTPConnection("127.0.0.1", self.daemon.port, timeout=HANG_SECONDS)
        headers = {} if last_event_id is None else {"Last-Event-ID": str(last_event_id)}
        connection.request("GET", f"/v1/jobs/{job}/events", headers=headers)
        response = connection.getresponse()
        self.assertEqual(response.status, 200)
        self.assertTrue(response.headers["Content-Type"].startswith("text/event-stream"))
        events = []
        for block in response.read().decode().split("\n\n"):
            fields = dict(line.split(": ", 1) for line in block.splitlines()
                          if ": " in line and not line.startswith(":"))
            if "data" in fields:
                events.append({"id": int(fields["id"]), "data": json.loads(fields["data"])})
        connection.close()
        return events

    def test_cancel_takes_effect_within_a_tile(self):
        job = self.daemon.submit(kind="voxelize", asset=self.asset,
                                 options={"size": 16384, "channels": "occupancy,color,normal", "cache": "no"})

        def has_tiles():
            status = self.daemon.get(f"/v1/jobs/{job}").json()
            self.assertIn(status["state"], ("queued", "running"))
            return status["tiles_done"] > 0
        wait_until(has_tiles, "a tile is done")
        response = self.daemon.request("DELETE", f"/v1/jobs/{job}")
        self.assertIn(response.status, (200, 202))
        self.assertLess(response.json()["tiles_done"], response.json()["tiles_total"])
        status = self.daemon.wait(job)  # one whose tiles were all made would be done
        self.assertEqual(status["state"], "cancelled")
        self.assert_problem(self.daemon.get(f"/v1/jobs/{job}/result"), 409, "cancelled")
        # The worker is free again.
        self.assertEqual(self.daemon.post("/v1/voxelize?size=16&filename=a.glb",
                                          self.fixture("sample.glb")).status, 200)

    def test_another_format_of_a_finished_job(self):
        job = self.daemon.submit(kind="voxelize", asset=self.asset, options={"size": 38})
        self.daemon.wait(job)
        vox = self.daemon.get(f"/v1/jobs/{job}/result?format=vox")
        self.assertEqual(vox.body[:4], b"VOX ")
        npy = self.daemon.get(f"/v1/jobs/{job}/result", headers={"Accept": "application/x-npy"})
        self.assertEqual(npy.body[:6], b"\x93NUMPY")

    def test_a_grid_is_served_by_tile_and_previewed(self):
        job = self.daemon.submit(kind="voxelize", asset=self.asset, options={"size": 300})
        grid = self.daemon.wait(job)["result"]["grid"]
        whole = self.daemon.get(f"/v1/grids/{grid}")
        self.assertEqual(whole.status, 200)
        tiles = self.daemon.get(f"/v1/grids/{grid}/tiles").json()
        self.assertGreater(len(tiles["tiles"]), 1)
        first = tiles["tiles"][0]
        tile = self.daemon.get(f"/v1/grids/{grid}/tiles/0")
        self.assertEqual(tile.body, whole.body[first["offset"]:first["offset"] + first["bytes"]])
        png = self.daemon.get(f"/v1/grids/{grid}/render.png?azimuth=10&width=64&height=64")
        self.assertEqual(png.body[:4], b"\x89PNG")
        self.assertEqual(
            self.daemon.get(f"/v1/grids/{grid}/render.png?azimuth=10&width=64&height=64",
                            headers={"If-None-Match": png.headers["ETag"]}).status, 304)

    def test_many_jobs_at_a_time_all_end(self):
        results = []

        def one(size):
            job = self.daemon.submit(kind="voxelize", asset=self.asset, options={"size": size})
            results.append(self.daemon.wait(job)["state"])

        threads = [threading.Thread(target=one, args=(40 + i,)) for i in range(24)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(results, ["done"] * 24)


if __name__ == "__main__":
    unittest.main()
