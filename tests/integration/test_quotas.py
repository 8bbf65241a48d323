"""Limits of tenants: each of them hit from outside, and told with its numbers."""
import gzip
import json
import pathlib
import shutil
import subprocess
import tempfile
import time
import unittest

from harness import BIN, Daemon, make_fixtures
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
        key, lab = self.tenant("often", "--rate", "2/s")
        answers = [lab.get("/v1/jobs") for _ in range(8)]
        self.assertEqual(answers[0].headers["RateLimit-Policy"], '"requests";q=4;w=2')
        self.assertRegex(answers[0].headers["RateLimit"], r'^"requests";r=3;t=\d+$')
        refused = [answer for answer in answers if answer.status == 429]
        self.assertTrue(refused)
        self.problem(refused[0], 429, "too-many-requests", "2/s")
        time.sleep(int(refused[0].headers["Retry-After"]) + 0.1)
        self.assertEqual(lab.get("/v1/jobs").status, 200)
        # Changed while the daemon runs, without a new secret.
        keys(self.data_dir, "set", key_id(key), "--rate", "0")
        self.assertEqual([lab.get("/v1/jobs").status for _ in range(8)], [200] * 8)
        self.assertNotIn("RateLimit", lab.get("/v1/jobs").headers)

    def test_bytes(self):
        mesh = (self.fixtures / "sample.ply").read_bytes()
        key, lab = self.tenant("small", "--bytes", str(len(mesh) + 100))
        self.assertEqual(lab.post("/v1/assets?filename=a.ply", mesh).status, 201)
        used = lab.get("/v1/me").json()["usage"]["bytes"]
        self.assertEqual(used, len(mesh))
        self.problem(lab.post("/v1/assets", b"x" * 101), 507, "quota-exceeded",
                     f"101 beside {used} used")
        self.problem(lab.post("/v1/assets", gzip.compress(b"x" * 101),
                              headers={"Content-Encoding": "gzip"}), 507, "quota-exceeded")
        self.problem(lab.post("/v1/assets", b"x" * (len(mesh) + 101)), 413, "payload-too-large",
                     "ever")
        # What a job leaves counts, too.
        asset = lab.get("/v1/assets").json()["assets"][0]["id"]
        status = lab.wait(lab.submit(kind="voxelize", asset=asset, options={"size": 64}))
        self.assertEqual((status["state"], status["error"]["code"]), ("failed", "quota-exceeded"))
        self.assertEqual(lab.get("/v1/me").json()["usage"]["bytes"], used)
        keys(self.data_dir, "set", key_id(key), "--bytes", "1M")
        status = lab.wait(lab.submit(kind="voxelize", asset=asset, options={"size": 64}))
        self.assertEqual(status["state"], "done", status)
        self.assertEqual(lab.get("/v1/me").json()["usage"]["bytes"],
                         used + status["result"]["bytes"])
        self.assertEqual(lab.request("DELETE", f"/v1/assets/{asset}").status, 204)
        self.assertEqual(lab.get("/v1/me").json()["usage"]["bytes"], status["result"]["bytes"])

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
        asset = lab.upload(self.fixtures / "sample.glb")
        options = {"size": 1500, "cache": "no", "fill": "solid"}
        jobs = []
        answer = None
        for _ in range(6):  # the first ones may run
            answer = lab.post("/v1/jobs", {"kind": "voxelize", "asset": asset, "options": options})
            if answer.status == 429:
                break
            jobs.append(answer.json()["id"])
        self.problem(answer, 429, "too-many-requests", "fewer than 2")
        self.assertIn("Retry-After", answer.headers)
        for job in jobs:
            lab.request("DELETE", f"/v1/jobs/{job}")
        for job in jobs:
            lab.wait(job)

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
        self.assertIn("tenant       cli", voxel("whoami"))
        self.assertIn("of 1048576", voxel("whoami"))
        self.assertEqual(json.loads(voxel("whoami", "--json"))["tenant"], "cli")
        url = voxel("share", job, "--seconds", "60").strip()
        fetched = subprocess.run(["curl", "-sf", url], capture_output=True, check=True).stdout
        self.assertEqual(fetched, lab.get(f"/v1/jobs/{job}/result").body)


if __name__ == "__main__":
    unittest.main()
