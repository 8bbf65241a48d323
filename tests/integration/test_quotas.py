"""Limits of tenants: each of them hit from outside, and told with its numbers."""
import gzip
import json
import pathlib
import shutil
import socket
import subprocess
import tempfile
import time
import unittest

from fairness_load import GIANT
from harness import BIN, Daemon, make_fixtures, wait_until
from test_tenants import add_key, key_id, keys


class Quotas(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        make_fixtures(cls.fixtures)
        cls.data_dir = tempfile.mkdtemp(prefix="voxeld-test-")
        add_key(cls.data_dir, "boss", "--admin")
        cls.daemon = Daemon(device="cpu", data_dir=cls.data_dir)

    @classmethod
    def tearDownClass(cls):
        cls.daemon.stop()
        for directory in (cls.fixtures, cls.data_dir):
            shutil.rmtree(directory, ignore_errors=True)
        pathlib.Path(cls.data_dir + ".log").unlink()

    def tenant(self, name, *limits):
        key = add_key(self.data_dir, name, *limits)
        return key, self.daemon.holding(key)

    def problem(self, response, status, code, *parts):
        self.assertEqual(response.status, status, response.body)
        problem = response.json()
        self.assertEqual(problem["code"], code)
        for part in parts:
            self.assertIn(part, json.dumps(problem))
        return problem

    def test_requests_per_second(self):
        key, lab = self.tenant("often", "--rate", "1/s")
        first = lab.get("/v1/jobs")
        self.assertEqual(first.headers["RateLimit-Policy"], '"requests";q=2;w=2')
        self.assertRegex(first.headers["RateLimit"], r'^"requests";r=1;t=\d+$')
        # Changed while the daemon runs, without a new secret. The next request comes back in a minute.
        keys(self.data_dir, "set", key_id(key), "--rate", "1/m")
        responses = [lab.get("/v1/jobs") for _ in range(8)]
        self.assertEqual([response.status for response in responses], [200] + [429] * 7)
        self.problem(responses[1], 429, "too-many-requests", "1/m")
        self.assertIn(int(responses[1].headers["Retry-After"]), range(1, 61))
        keys(self.data_dir, "set", key_id(key), "--rate", "1/s")
        response = lab.get("/v1/jobs")
        if response.status == 429:
            time.sleep(int(response.headers["Retry-After"]) + 0.1)
            response = lab.get("/v1/jobs")
        self.assertEqual(response.status, 200)
        keys(self.data_dir, "set", key_id(key), "--rate", "0")
        self.assertEqual([lab.get("/v1/jobs").status for _ in range(8)], [200] * 8)
        self.assertNotIn("RateLimit", lab.get("/v1/jobs").headers)

    def usage(self, lab):
        return lab.get("/v1/me").json()["usage"]["bytes"]

    def remove_jobs(self, lab, jobs):
        """Cancels them where they have not ended, and removes their records."""
        for job in jobs:
            wait_until(lambda: lab.request("DELETE", f"/v1/jobs/{job}?ended=remove").status == 404, f"the record of {job} is gone")

    def test_bytes(self):
        mesh = (self.fixtures / "sample.ply").read_bytes()
        key, lab = self.tenant("small")
        self.assertEqual(lab.post("/v1/assets?filename=a.ply", mesh).status, 201)
        used = self.usage(lab)
        self.assertGreater(used, len(mesh))  # with its row
        keys(self.data_dir, "set", key_id(key), "--bytes", str(used + 100))
        self.problem(lab.post("/v1/assets", b"x" * 101), 507, "quota-exceeded",
                     f"101 beside {used} used")
        self.problem(lab.post("/v1/assets", gzip.compress(b"x" * 101),
                              headers={"Content-Encoding": "gzip"}), 507, "quota-exceeded")
        self.problem(lab.post("/v1/assets", b"x" * (used + 101)), 413, "payload-too-large",
                     "ever")
        # Rows of jobs count, and their results.
        asset = lab.get("/v1/assets").json()["assets"][0]["id"]
        job = {"kind": "voxelize", "asset": asset, "options": {"size": 64}}
        self.problem(lab.post("/v1/jobs", job), 507, "quota-exceeded")
        keys(self.data_dir, "set", key_id(key), "--bytes", str(used + 5000))
        failed = lab.wait(lab.submit(**job))
        self.assertEqual((failed["state"], failed["error"]["code"]), ("failed", "quota-exceeded"))
        self.remove_jobs(lab, [failed["id"]])
        self.assertEqual(self.usage(lab), used)
        keys(self.data_dir, "set", key_id(key), "--bytes", "1M")
        status = lab.wait(lab.submit(**job))
        self.assertEqual(status["state"], "done", status)
        self.assertGreater(self.usage(lab), used + status["result"]["bytes"])
        self.assertEqual(lab.request("DELETE", f"/v1/jobs/{status['id']}/result").status, 204)
        self.remove_jobs(lab, [status["id"]])
        self.assertEqual(self.usage(lab), used)
        self.assertEqual(lab.request("DELETE", f"/v1/assets/{asset}").status, 204)
        self.assertEqual(self.usage(lab), 0)

    def test_jobs_on_one_small_asset_do_not_pass_the_quota_by_their_rows(self):
        _, lab = self.tenant("rows", "--bytes", "300K")
        _, other = self.tenant("others")
        asset = lab.post("/v1/assets?filename=a.obj", b"# " + b"m" * 118 + b"\n").json()["id"]
        before, jobs, response = self.usage(lab), [], None
        for number in range(1000):
            response = lab.post("/v1/jobs", json.dumps({
                "kind": "voxelize", "asset": asset, "filename": f"{'n' * 240}{number}.obj",
                "options": {"size": 8, "animation": "0", "times": [(k + number) / 3e6 for k in range(300)]}}),
                headers={"Content-Type": "application/json", "Idempotency-Key": f"{'k' * 240}{number}"})
            if response.status != 202:
                break
            jobs.append(response.json()["id"])
        self.problem(response, 507, "quota-exceeded", "beside")
        self.assertLess(len(jobs), 100)
        self.assertLessEqual(self.usage(lab), 320_000)  # and the ends of those jobs
        theirs = other.upload(self.fixtures / "sample.ply")
        self.assertEqual(other.wait(other.submit(kind="voxelize", asset=theirs, options={"size": 8}))["state"], "done")
        self.remove_jobs(lab, jobs)
        self.assertEqual(self.usage(lab), before)

    def test_deleted_results_count_while_slow_readers_hold_them(self):
        _, lab = self.tenant("reader")
        asset = lab.upload(self.fixtures / "sample.ply")
        before, jobs = self.usage(lab), []

        def is_counted():
            """Whether one is seen to count: its reader is cut some seconds after its file was deleted."""
            status = lab.wait(lab.submit(kind="voxelize", asset=asset,
                                         options={"size": 300 + len(jobs), "format": "npy"}))
            self.assertEqual(status["state"], "done", status)
            self.assertGreater(status["result"]["bytes"], 10_000_000)
            jobs.append(status["id"])
            with socket.socket() as client:
                client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                client.connect(("127.0.0.1", self.daemon.port))
                client.sendall(f"GET /v1/jobs/{status['id']}/result HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                               f"Authorization: Bearer {lab.key}\r\n\r\n".encode())
                self.assertEqual(client.recv(12), b"HTTP/1.1 200")  # and no more
                self.assertEqual(lab.request("DELETE", f"/v1/jobs/{status['id']}/result").status, 204)
                end = time.monotonic() + 10
                while not (counts := self.usage(lab) > before + 10_000_000) and time.monotonic() < end:
                    time.sleep(0.02)
                return counts
        wait_until(is_counted, lambda: self.usage(lab))
        wait_until(lambda: self.usage(lab) < before + 100_000, lambda: self.usage(lab))
        self.remove_jobs(lab, jobs)
        self.assertEqual(self.usage(lab), before)

    def test_a_full_tenant_frees_space_with_the_command_line_client(self):
        key, lab = self.tenant("full", "--bytes", "1M")
        mesh = (self.fixtures / "sample.ply").read_bytes()
        asset = lab.upload(self.fixtures / "sample.ply")
        moving = lab.upload(self.fixtures / "worm.md5.zip")
        still = lab.wait(lab.submit(kind="voxelize", asset=asset, options={"size": 16}))
        image = lab.wait(lab.submit(kind="render", grid=still["result"]["grid"],
                                      options={"width": 16, "height": 16}))
        frames = lab.wait(lab.submit(kind="voxelize", asset=moving,
                                     options={"size": 16, "animation": "walk", "frames": "0..2"}))
        self.assertEqual([job["state"] for job in (still, image, frames)], ["done"] * 3)
        keys(self.data_dir, "set", key_id(key), "--bytes", "1")
        self.problem(lab.post("/v1/assets?filename=b.ply", mesh + b"\n"), 413, "payload-too-large")
        # The same bytes cost nothing, though nothing is left.
        for headers in ({}, {"Content-Encoding": "gzip"}):
            body = gzip.compress(mesh) if headers else mesh
            response = lab.post("/v1/assets?filename=sample.ply", body, headers=headers)
            self.assertEqual(response.status, 200, response.body)

        def voxel(*arguments, status=0):
            done = subprocess.run([BIN / "voxel", *arguments, "--url", self.daemon.url, "--key", key],
                                  text=True, capture_output=True)
            self.assertEqual(done.returncode, status, done)
            return done.stdout if status == 0 else done.stderr
        listed = {}
        for kind in ("results", "grids", "sequences", "assets"):
            listed[kind] = json.loads(voxel("ls", kind, "--json"))[kind]
            for item in listed[kind]:
                self.assertIn(item["job"] if kind == "results" else item["id"], voxel("ls", kind))
        self.assertEqual([len(listed[kind]) for kind in ("results", "grids", "sequences", "assets")],
                         [3, 1, 1, 2])
        self.assertEqual({item["job"] for item in listed["results"]},
                         {job["id"] for job in (still, image, frames)})
        used = lab.get("/v1/me").json()["usage"]["bytes"]
        for kind, thing in (("result", image["id"]), ("grid", still["result"]["grid"]),
                            ("sequence", frames["result"]["sequence"])):
            self.assertEqual(voxel("rm", thing), f"{kind} {thing}\n")
            left = lab.get("/v1/me").json()["usage"]["bytes"]
            self.assertLess(left, used)
            used = left
        self.assertIn("was deleted", voxel("rm", image["id"], status=2))
        self.assertEqual(json.loads(voxel("rm", asset, moving, "--json"))["deleted"],
                         [{"id": asset, "kind": "asset"}, {"id": moving, "kind": "asset"}])
        for path in (f"/v1/jobs/{still['id']}/result", f"/v1/grids/{still['result']['grid']}",
                     f"/v1/sequences/{frames['result']['sequence']}",
                     f"/v1/jobs/{frames['id']}/frames/0"):
            self.problem(lab.get(path), 410, "gone", "was deleted")
        # The records of jobs are left.
        self.remove_jobs(lab, [job["id"] for job in (still, image, frames)])
        self.assertEqual(self.usage(lab), 0)
        gone = [still["result"]["grid"], image["result"]["blob"], frames["result"]["sequence"], asset]

        def files():
            return [path for one in gone for path in pathlib.Path(self.data_dir).rglob(one)]
        wait_until(lambda: not files(), files)  # they go with the next sweep

    def test_pages_of_lists(self):
        _, lab = self.tenant("pages")
        asset = lab.upload(self.fixtures / "sample.ply")
        jobs = [lab.wait(lab.submit(kind="voxelize", asset=asset, options={"size": size}))["id"]
                for size in (8, 9, 10)]
        seen, path = [], "/v1/results?limit=2"
        while path:
            page = lab.get(path).json()
            seen += [item["job"] for item in page["results"]]
            path = page.get("next") and f"/v1/results?limit=2&after={page['next']}"
        self.assertEqual(seen, jobs[::-1])
        self.problem(lab.get("/v1/grids?limit=1001"), 400, "invalid-option", "from 1 to 1000")
        self.problem(lab.get("/v1/grids?after=x"), 400, "invalid-option", "earlier page of this list")
        self.problem(lab.get("/v1/grids?page=2"), 400, "unknown-option", "limit, after")

    def test_one_of_several_tenants_leaves_places_in_the_queue(self):
        with tempfile.TemporaryDirectory() as directory:
            data_dir = directory + "/data"
            made = [add_key(data_dir, name) for name in ("greedy", "modest")]
            daemon = Daemon(device="cpu", data_dir=data_dir,
                            arguments=["--queued-jobs-max", "20", "--workers-per-device", "1"])
            try:
                greedy, modest = (daemon.holding(key) for key in made)
                asset = greedy.upload(self.fixtures / "sheets.obj")
                responses = [greedy.post("/v1/jobs", {"kind": "voxelize", "asset": asset,
                                                    "options": GIANT}) for _ in range(14)]
                self.problem(responses[-1], 429, "too-many-requests", "share of the queue", "places")
                mine = modest.upload(self.fixtures / "sheets.obj")
                response = modest.post("/v1/jobs", {"kind": "voxelize", "asset": mine,
                                                  "options": GIANT})
                self.assertEqual(response.status, 202, response.body)
            finally:
                daemon.kill_gateway()

    def test_cells(self):
        _, lab = self.tenant("coarse", "--cells", "1000")
        asset = lab.upload(self.fixtures / "sample.ply")
        self.assertEqual(lab.post(f"/v1/voxelize?size=10&asset={asset}").status, 200)
        self.problem(lab.post(f"/v1/voxelize?dims=11,11,11&asset={asset}"), 422, "grid-too-large",
                     "at most 1000", "11 x 11 x 11 = 1331")
        moving = lab.upload(self.fixtures / "worm.md5.zip")
        self.problem(lab.post(f"/v1/voxelize?dims=9,9,9&animation=walk&frames=0..1&asset={moving}"),
                     422, "grid-too-large", "in each of 2 frames")

    def test_queued_jobs(self):
        _, lab = self.tenant("few", "--queued-jobs", "2")
        asset = lab.upload(self.fixtures / "sheets.obj")
        jobs = []
        response = None
        for _ in range(6):  # the first ones may run
            response = lab.post("/v1/jobs", {"kind": "voxelize", "asset": asset, "options": GIANT})
            if response.status == 429:
                break
            jobs.append(response.json()["id"])
        self.problem(response, 429, "too-many-requests", "fewer than 2")
        self.assertIn("Retry-After", response.headers)
        for job in jobs:
            lab.cancel(job)

    def test_a_new_key_of_a_tenant_has_its_limits(self):
        first, _ = self.tenant("kept", "--rate", "30/m", "--bytes", "5G", "--weight", "4")
        second, lab = self.tenant("kept")
        listed = {item["id"]: item for item in json.loads(
            keys(self.data_dir, "list", "--json").stdout)}
        self.assertEqual(listed[key_id(first)]["limits"], listed[key_id(second)]["limits"])
        self.assertEqual(listed[key_id(second)]["weight"], 4)
        self.assertIn("30/m", keys(self.data_dir, "list").stdout)
        me = lab.get("/v1/me").json()
        self.assertEqual(me["limits"], {"requests_per_minute": 30, "queued_jobs": None,
                                        "bytes": 5 << 30, "cells": None})
        for wrong in (("--rate", "fast"), ("--bytes", "-1"), ("--queued-jobs", "x")):
            keys(self.data_dir, "set", key_id(first), *wrong,
                 status=64)

    def test_the_command_line_client(self):
        key, lab = self.tenant("cli", "--bytes", "1M")
        asset = lab.upload(self.fixtures / "sample.ply")
        job = lab.submit(kind="voxelize", asset=asset, options={"size": 16})
        lab.wait(job)

        def voxel(*arguments):
            return subprocess.run([BIN / "voxel", *arguments, "--url", self.daemon.url, "--key", key],
                                  text=True, capture_output=True, check=True).stdout
        self.assertIn("tenant        cli", voxel("whoami"))
        self.assertIn("of 1.0 MB", voxel("whoami"))
        self.assertEqual(json.loads(voxel("whoami", "--json"))["tenant"], "cli")
        url = voxel("share", job, "--seconds", "60").strip()
        fetched = subprocess.run(["curl", "-sf", url], capture_output=True, check=True).stdout
        self.assertEqual(fetched, lab.get(f"/v1/jobs/{job}/result").body)


if __name__ == "__main__":
    unittest.main()
