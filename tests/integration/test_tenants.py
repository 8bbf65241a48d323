"""API keys and tenants: two of them attack each other's data on every route."""
import json
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from fairness_load import GIANT
from harness import BIN, HANG_SECONDS, Daemon, make_fixtures, wait_until

NO_ID = "sha256-" + "0" * 64
NO_JOB = "j-" + "0" * 32
# Headers that may differ from one request to the next.
VOLATILE = {"x-request-id", "traceresponse", "date"}


def keys(data_dir, *arguments, status=0):
    done = subprocess.run([BIN / "voxeld", "keys", *arguments, "--data", data_dir], text=True,
                          capture_output=True)
    assert done.returncode == status, (arguments, done)
    return done


def add_key(data_dir, *arguments):
    return keys(data_dir, "add", *arguments).stdout.strip()


def key_id(key):
    return key.split("_")[1]


def seen(response, *ids):
    """A response as a receiver compares it, with the requested ids replaced by ID."""
    headers = {name.lower(): value for name, value in response.headers.items()
               if name.lower() not in VOLATILE}
    body = re.sub(r'"trace_id":"[0-9a-f]{32}"', '"trace_id":""', response.body.decode("latin-1"))
    text = json.dumps([response.status, sorted(headers.items()), body])
    for one in ids:
        text = text.replace(one, "ID")
    return text


class Tenants(unittest.TestCase):
    device = "cpu"

    @classmethod
    def setUpClass(cls):
        cls.fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        make_fixtures(cls.fixtures)
        cls.data_dir = tempfile.mkdtemp(prefix="voxeld-test-")
        cls.keys = {name: add_key(cls.data_dir, name) for name in ("lab", "studio")}
        cls.keys["boss"] = add_key(cls.data_dir, "boss", "--admin")
        cls.daemon = Daemon(device=cls.device, data_dir=cls.data_dir)
        cls.lab, cls.studio, cls.boss = (cls.daemon.holding(cls.keys[name])
                                         for name in ("lab", "studio", "boss"))
        cls.things = cls.make_things(cls.lab)

    @classmethod
    def tearDownClass(cls):
        cls.daemon.stop()
        for directory in (cls.fixtures, cls.data_dir):
            shutil.rmtree(directory, ignore_errors=True)
        pathlib.Path(cls.data_dir + ".log").unlink()

    @classmethod
    def make_things(cls, lab):
        """One of everything, of the tenant lab."""
        asset = lab.upload(cls.fixtures / "sample.ply")
        job = lab.submit(kind="voxelize", asset=asset, options={"size": 16})
        grid = lab.wait(job)["result"]["grid"]
        moving = lab.upload(cls.fixtures / "worm.md5.zip")
        frames = lab.submit(kind="voxelize", asset=moving,
                            options={"size": 16, "animation": "walk", "frames": "0..1"})
        status = lab.wait(frames)
        assert status["state"] == "done", status
        return {"asset": asset, "job": job, "grid": grid, "frames": frames,
                "sequence": status["result"]["sequence"],
                "frame": lab.get(f"/v1/jobs/{frames}/frames").json()["frames"][0]["grid"]}

    # --- 404 for what is another's, in the words for what never was

    def attacks(self):
        """For each operation of the specification: the requests that name something of another, as
        (path, body), with {…} where the thing's id stands, and the kind of the thing."""
        def job(**members):
            return json.dumps({"kind": "voxelize", **members})
        on = {
            ("post", "/v1/voxelize"): [("/v1/voxelize?size=16&asset={}", "", "asset")],
            ("post", "/v1/render"): [(f"/v1/render?width=16&height=16&{kind}={{}}", "", kind)
                                     for kind in ("asset", "grid", "sequence")],
            ("post", "/v1/jobs"): [
                ("/v1/jobs", job(asset="{}"), "asset"),
                ("/v1/jobs?dry_run=1", job(asset="{}"), "asset"),
                ("/v1/jobs", job(kind="render", grid="{}"), "grid"),
                ("/v1/jobs", job(kind="render", grid="{}"), "frame"),
                ("/v1/jobs?dry_run=1", job(kind="export", grid="{}"), "grid"),
                ("/v1/jobs", job(kind="export", sequence="{}"), "sequence"),
                ("/v1/jobs?dry_run=1", job(kind="export", sequence="{}"), "sequence"),
                ("/v1/jobs", job(kind="inspect", asset="{}"), "asset")],
            ("post", "/v1/assets"): [
                ("/v1/assets", json.dumps({"files": [{"name": "a.ply", "asset": "{}"}]}), "asset")],
        }
        for template, operations in self.daemon.openapi.spec["paths"].items():
            for method in operations:
                if (method, template) in on or method not in ("get", "delete", "post", "put", "patch"):
                    continue
                match = re.match(r"^/v1/(assets|jobs|grids|sequences)/\{id\}(.*)$", template)
                if not match:
                    continue
                kinds = {"assets": ["asset"], "jobs": ["job", "frames"], "grids": ["grid", "frame"],
                         "sequences": ["sequence"]}[match[1]]
                key = ".zgroup" if "/zarr2/" in template else "zarr.json"
                path = template.replace("{id}", "{}").replace("{index}", "0").replace("{key}", key)
                on[method, template] = [(path, None, kind) for kind in kinds]
        return on

    def test_every_route_hides_the_resources_of_other_tenants(self):
        on = self.attacks()
        public = {("get", "/"), ("get", "/admin"), ("get", "/web/{name}"), ("get", "/openapi.json")}
        # These routes list data of the caller alone.
        lists = {("get", "/v1/assets"), ("get", "/v1/jobs"), ("get", "/v1/queue"), ("get", "/v1/me"),
                 ("get", "/v1/results"), ("get", "/v1/grids"), ("get", "/v1/sequences")}
        admins = {("get", "/v1/keys"), ("post", "/v1/keys"), ("patch", "/v1/keys/{id}"),
                  ("delete", "/v1/keys/{id}")}
        for template, operations in self.daemon.openapi.spec["paths"].items():
            for method in set(operations) - {"parameters"}:
                # A new route: say here how one tenant could reach another's things by it.
                self.assertIn((method, template), set(on) | public | lists | admins)
        for method, template in admins:
            path = template.replace("{id}", key_id(self.keys["studio"]))
            self.assertEqual(self.lab.request(method.upper(), path).status, 403, (method, template))
        for (method, template), requests in on.items():
            for path, body, kind in requests:
                with self.subTest(f"{method} {path} {kind}"):
                    self.attack(method, path, body, kind)
        # Nothing was lost by the attempts to cancel and to delete.
        self.assertEqual(self.lab.get(f"/v1/assets/{self.things['asset']}").status, 200)
        self.assertEqual(self.lab.get(f"/v1/jobs/{self.things['job']}").json()["state"], "done")
        for path in ("jobs/{job}/result", "grids/{grid}", "grids/{frame}", "sequences/{sequence}"):
            self.assertEqual(self.lab.get("/v1/" + path.format(**self.things)).status, 200, path)

    def attack(self, method, path, body, kind):
        thing = self.things[kind]
        nothing = NO_JOB if thing.startswith("j-") else NO_ID
        headers = {}
        if path == "/v1/assets":
            headers["Content-Type"] = "application/vnd.voxeld.bundle+json"
        elif body is not None:
            headers["Content-Type"] = "application/json"
        responses = []
        for one in (thing, nothing):
            text = None if body is None else body.replace("{}", one)
            for prefer in ({}, {"Prefer": "wait=1", "If-None-Match": '"1"', "Range": "bytes=0-1"}):
                response = self.studio.request(method.upper(), path.replace("{}", one), body=text,
                                               headers={**headers, **prefer})
                self.assertEqual(response.status, 404, response.body)
                self.assertEqual(response.json()["code"], "not-found")
                responses.append(seen(response, one))
        self.assertEqual(len(set(responses)), 1, responses)
        # With its owner's key the request succeeds; otherwise the responses above would prove nothing.
        of_other_kind = {("job", "/frames/"), ("frames", "/tiles")}
        if method == "get" and not any(kind == one and part in path for one, part in of_other_kind):
            owners = self.lab.get(path.replace("{}", thing))
            self.assertEqual(owners.status, 200, owners.body)

    def test_lists_show_only_the_callers_own_resources(self):
        for path, name in (("/v1/assets", "assets"), ("/v1/jobs", "jobs")):
            ours = {item["id"] for item in self.lab.get(path).json()[name]}
            theirs = {item["id"] for item in self.studio.get(path).json()[name]}
            self.assertTrue(ours)
            self.assertIn(self.things["asset" if name == "assets" else "job"], ours)
            if name == "jobs":
                self.assertFalse(ours & theirs)
            self.assertNotIn(self.things["asset" if name == "assets" else "job"], theirs)
            self.assertLessEqual(ours, {item["id"] for item in self.boss.get(path).json()[name]})

    def test_lists_of_results_show_only_the_callers_own_after_any_cursor(self):
        for kind, thing in (("results", "job"), ("grids", "grid"), ("sequences", "sequence")):
            name = "job" if kind == "results" else "id"
            ours = self.lab.get(f"/v1/{kind}?limit=1000").json()[kind]
            self.assertIn(self.things[thing], [item[name] for item in ours])
            theirs = self.studio.get(f"/v1/{kind}").json()[kind]
            self.assertNotIn(self.things[thing], [item[name] for item in theirs])
            last = self.lab.get(f"/v1/{kind}?limit=1").json().get("next", "9999")
            behind = self.studio.get(f"/v1/{kind}?after={last}").json()[kind]
            self.assertFalse({item["job"] for item in behind} & {item["job"] for item in ours})

    def test_the_queue_shows_ones_own_jobs_and_how_many_others_have(self):
        asset = self.lab.upload(self.fixtures / "sheets.obj")
        jobs = [self.lab.submit(kind="voxelize", asset=asset, options=GIANT) for _ in range(3)]
        try:
            self.lab.wait_state(jobs[0], "running")
            lab, studio, boss = (one.get("/v1/queue").json()
                                 for one in (self.lab, self.studio, self.boss))
            self.assertLessEqual({job["id"] for job in lab["jobs"]}, set(jobs))
            self.assertGreaterEqual(len(lab["jobs"]), 2)
            self.assertEqual({job["tenant"] for job in lab["jobs"]}, {"lab"})
            waiting = [job["queue_position"] for job in lab["jobs"] if job["state"] == "queued"]
            self.assertEqual(waiting, sorted(waiting))
            self.assertEqual(studio["jobs"], [])
            self.assertGreaterEqual(studio["others"]["queued"], 1)
            self.assertEqual([device["jobs"] for device in studio["devices"]], [[]])
            # Three, and a fresh one in reserve; replaced ones take a moment to connect.
            wait_until(lambda: [device["workers"] for device in
                                self.studio.get("/v1/queue").json()["devices"]] == [4], "four workers")
            self.assertNotIn("j-", json.dumps(studio))
            self.assertNotIn("lab", json.dumps(studio))
            self.assertLessEqual({job["id"] for job in boss["jobs"]}, set(jobs))
            self.assertEqual(boss["others"], {"queued": 0, "running": 0})
            self.assertEqual({job["tenant"] for job in boss["jobs"]}, {"lab"})
            # Memory and storage, which reveal what others do, are for an admin.
            for tenant in (lab, studio):
                self.assertNotIn("store", tenant)
                self.assertNotIn("memory_bytes", tenant["devices"][0])
            self.assertGreater(boss["devices"][0]["memory_bytes"], 0)
            self.assertGreater(boss["store"]["disk_bytes"], boss["store"]["disk_free_bytes"])
        finally:
            for job in jobs:
                self.lab.cancel(job)

    # --- links

    def test_a_link_opens_its_resource_and_nothing_else(self):
        job, grid = self.things["job"], self.things["grid"]
        made = self.lab.post(f"/v1/jobs/{job}/share?seconds=3600").json()
        anyone = self.daemon.holding(None)
        whole = anyone.get(made["url"])
        self.assertEqual(whole.status, 200)
        self.assertEqual(whole.body, self.lab.get(f"/v1/jobs/{job}/result").body)
        part = anyone.get(made["url"], headers={"Range": "bytes=0-3"})
        self.assertEqual((part.status, part.body), (206, whole.body[:4]))
        etag = whole.headers["ETag"]
        self.assertEqual(anyone.get(made["url"], headers={"If-None-Match": etag}).status, 304)
        self.assertEqual(anyone.request("HEAD", made["url"]).status, 200)
        image = self.lab.post(f"/v1/grids/{grid}/share?view=render.png&width=16&height=16").json()
        self.assertEqual(anyone.get(image["url"]).headers["Content-Type"], "image/png")
        # The signature is of this path and this query.
        for url in (made["url"].replace("/result", ""), made["url"] + "&format=vox",
                    made["url"].replace(job, self.things["frames"]),
                    made["url"].replace(job, NO_JOB), made["url"].replace("key=", "key=a"),
                    image["url"].replace("width=16", "width=17"),
                    image["url"].replace("/render.png", "/tiles")):
            response = anyone.get(url)
            self.assertEqual((response.status, response.json()["detail"]), (404, "no such link"), url)
        self.assertEqual(anyone.post(made["url"].replace("/result", "/share")).status, 401)
        self.assertEqual(self.studio.post(f"/v1/jobs/{job}/share").status, 404)

    def test_links_that_could_not_work_are_refused(self):
        job, grid = self.things["job"], self.things["grid"]
        for path in (f"/v1/jobs/{job}/share?format=hologram", f"/v1/jobs/{job}/share?format=vox&level=99",
                     f"/v1/grids/{grid}/share?level=99", f"/v1/grids/{grid}/share?view=render&width=0",
                     f"/v1/grids/{grid}/share?view=render.png&format=vox"):
            response = self.lab.post(path)
            self.assertEqual(response.status, 400, path)
            self.assertIn(response.json()["code"], ("invalid-option", "unknown-option"), path)
        asset = self.lab.post("/v1/assets?filename=damaged.ply", b"ply\nformat").json()["id"]
        failed = self.lab.submit(kind="voxelize", asset=asset, options={"size": 11})
        self.assertEqual(self.lab.wait(failed)["state"], "failed")
        why, refused = self.lab.get(f"/v1/jobs/{failed}/result"), self.lab.post(f"/v1/jobs/{failed}/share")
        self.assertEqual((refused.status, refused.json()["code"]), (why.status, why.json()["code"]))

    def test_links_end_in_time_with_their_key_and_with_their_secret(self):
        key = add_key(self.data_dir, "shop")
        shop = self.daemon.holding(key)
        asset = shop.upload(self.fixtures / "sample.ply")
        job = shop.submit(kind="voxelize", asset=asset, options={"size": 11})
        shop.wait(job)
        anyone = self.daemon.holding(None)
        short = shop.post(f"/v1/jobs/{job}/share?seconds=1").json()["url"]
        wait_until(lambda: anyone.get(short).status == 410, "the link ends")
        self.assertEqual(anyone.get(short).json()["code"], "gone")
        first = shop.post(f"/v1/jobs/{job}/share").json()["url"]
        keys(self.data_dir, "rotate-urls")
        second = shop.post(f"/v1/jobs/{job}/share").json()["url"]
        self.assertEqual([anyone.get(url).status for url in (first, second)], [200, 200])
        keys(self.data_dir, "rotate-urls")
        self.assertEqual([anyone.get(url).status for url in (first, second)], [404, 200])
        keys(self.data_dir, "revoke", key_id(key))
        self.assertEqual(anyone.get(second).status, 404)

    # --- no oracle by an upload or by the cache

    def test_the_same_bytes_are_a_first_upload_and_first_work_for_each(self):
        body = (self.fixtures / "sample.off").read_bytes()
        path = "/v1/assets?filename=sample.off"
        first = self.lab.post(path, body)
        second = self.studio.post(path, body)
        self.assertEqual((first.status, second.status), (201, 201))
        plain = re.compile(r'\\"created_ms\\": ?\d+')
        self.assertEqual(plain.sub("", seen(first)), plain.sub("", seen(second)))
        self.assertEqual(self.studio.post(path, body).status, 200)
        asset = first.json()["id"]
        self.assertEqual(len(list(pathlib.Path(self.data_dir).rglob(asset))), 1)

        def voxelize(who):
            response = who.post(f"/v1/voxelize?size=12&asset={asset}")
            self.assertEqual(response.status, 200, response.body)
            return response
        made = voxelize(self.lab)
        self.assertEqual(voxelize(self.lab).headers["Cache-Status"], "voxeld; hit")
        other = voxelize(self.studio)
        self.assertEqual(other.headers["Cache-Status"], "voxeld; fwd=miss")
        self.assertIn("voxelize;dur=", other.headers["Server-Timing"])
        self.assertEqual(other.body, made.body)
        self.assertEqual(voxelize(self.studio).headers["Cache-Status"], "voxeld; hit")
        # The bytes go when the last who has them lets go.
        self.assertEqual(self.lab.request("DELETE", f"/v1/assets/{asset}").status, 204)
        self.assertEqual(self.lab.get(f"/v1/assets/{asset}").status, 410)
        self.assertEqual(self.studio.get(f"/v1/assets/{asset}").status, 200)
        self.assertEqual(self.studio.request("DELETE", f"/v1/assets/{asset}").status, 204)
        # Files are unlinked after the response: its time must not reveal whether others have the bytes.
        wait_until(lambda: not list(pathlib.Path(self.data_dir).rglob(asset)), "the files are unlinked")

    def test_an_idempotency_key_is_each_tenants_own(self):
        job = {"kind": "voxelize", "options": {"size": 9}}
        made = []
        for who in (self.lab, self.studio):
            asset = who.upload(self.fixtures / "sample.stl")
            response = who.request("POST", "/v1/jobs", body=json.dumps({**job, "asset": asset}),
                                   headers={"Idempotency-Key": "once", "Content-Type": "application/json"})
            self.assertIn(response.status, (200, 202), response.body)
            made.append(response.json()["id"])
        self.assertEqual(len(set(made)), 2)

    # --- admin

    def test_an_admin_sees_and_cancels_jobs_of_other_tenants(self):
        asset = self.studio.upload(self.fixtures / "sheets.obj")
        job = self.studio.submit(kind="voxelize", asset=asset, options=GIANT)
        self.assertEqual(self.boss.get(f"/v1/jobs/{job}").status, 200)
        self.assertEqual(self.boss.cancel(job)["state"], "cancelled")
        image = self.boss.get(f"/v1/grids/{self.things['grid']}/render.png?width=16&height=16")
        self.assertEqual(image.status, 200, image.body)
        again = self.boss.post(f"/v1/voxelize?size=16&asset={self.things['asset']}")
        self.assertEqual(again.status, 200, again.body)

    # --- keys

    def test_without_a_valid_key_every_route_responds_alike(self):
        revoked = add_key(self.data_dir, "gone")
        keys(self.data_dir, "revoke", key_id(revoked))
        wrong = self.keys["lab"][:-1] + ("q" if self.keys["lab"].endswith("a") else "a")
        unknown = "vxk_aaaaaaaa_" + "a" * 52
        for template, operations in self.daemon.openapi.spec["paths"].items():
            path = template.replace("{id}", self.things["job"]).replace("{index}", "0")
            for method in set(operations) - {"parameters"}:
                responses = {seen(self.daemon.holding(key).request(method.upper(), path))
                           for key in (None, "", "x", wrong, unknown, revoked)}
                with self.subTest(f"{method} {template}"):
                    self.assertEqual(len(responses), 1, responses)
                    status = json.loads(responses.pop())[0]
                    public = {"/": 200, "/admin": 200, "/openapi.json": 200, "/web/{name}": 404}
                    self.assertEqual(status, public.get(template, 401))

    def test_keys_count_and_end_while_the_daemon_runs(self):
        key = add_key(self.data_dir, "guest", "--expires", "1h", "--weight", "3")
        guest = self.daemon.holding(key)
        self.assertEqual(guest.get("/v1/jobs").json()["jobs"], [])
        listed = {item["id"]: item for item in json.loads(
            keys(self.data_dir, "list", "--json").stdout)}[key_id(key)]
        self.assertEqual((listed["name"], listed["weight"], listed["admin"], listed["state"]),
                         ("guest", 3, False, "live"))
        self.assertAlmostEqual(listed["expires_ms"] - listed["created_ms"], 3_600_000, delta=60_000)
        second = add_key(self.data_dir, "guest")  # rotation: the same tenant, another key
        asset = guest.upload(self.fixtures / "sample.ply")
        keys(self.data_dir, "revoke", key_id(key))
        self.assertEqual(guest.get("/v1/jobs").status, 401)
        self.assertEqual(self.daemon.holding(second).get(f"/v1/assets/{asset}").status, 200)

    def test_mistakes_of_the_keys_command_are_reported(self):
        for arguments, part in ((("add", "Two Words"), "a-z"), (("add", "a", "--expires", "soon"), "30d"),
                                (("add", "a", "--expires", "2001-01-01"), "to come"),
                                (("revoke", "aaaaaaaa"), "no such key"), (("revoke", "x"), "list")):
            self.assertIn(part, keys(self.data_dir, *arguments, status=64).stderr)

    def test_a_key_is_nowhere_but_with_its_holder(self):
        secrets = [key.split("_")[2] for key in self.keys.values()]
        self.assertEqual(self.lab.get("/v1/jobs").status, 200)
        self.assertEqual(self.daemon.holding(self.keys["lab"] + "x").get("/v1/jobs").status, 401)
        listed = keys(self.data_dir, "list").stdout + keys(self.data_dir, "list", "--json").stdout
        log = pathlib.Path(self.data_dir + ".log").read_text()
        self.assertIn(f"key={key_id(self.keys['lab'])}", log)
        for secret in secrets:
            self.assertNotIn(secret, log + listed)
            for path in pathlib.Path(self.data_dir).rglob("*"):
                if path.is_file():
                    self.assertNotIn(secret.encode(), path.read_bytes(), path)
        mode = (pathlib.Path(self.data_dir) / "keys").stat().st_mode & 0o777
        self.assertEqual(mode, 0o600)

    def test_the_command_line_client_takes_its_key_from_a_flag_a_variable_or_a_file(self):
        with tempfile.TemporaryDirectory() as directory:
            file = pathlib.Path(directory) / "key"
            file.write_text(self.keys["lab"] + "\n")

            def voxel(*arguments, **variables):
                return subprocess.run([BIN / "voxel", "jobs", *arguments], text=True,
                                      capture_output=True,
                                      env={"PATH": "/usr/bin", "VOXELD_URL": self.daemon.url, **variables})
            for done in (voxel("--key", self.keys["lab"]), voxel(VOXELD_KEY=self.keys["lab"]),
                         voxel(VOXELD_KEY_FILE=str(file))):
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn(self.things["job"], done.stdout)
            for done in (voxel(), voxel("--key", self.keys["lab"] + "a"),
                         voxel(VOXELD_KEY="vxk_nonsense")):
                self.assertEqual(done.returncode, 2)
                self.assertIn("API key", done.stderr)
                self.assertNotIn(self.keys["lab"], done.stderr + done.stdout)
            misspelled = voxel("--kye=" + self.keys["lab"])
            self.assertEqual(misspelled.returncode, 2)
            self.assertNotIn(self.keys["lab"].split("_")[2], misspelled.stderr + misspelled.stdout)


class Start(unittest.TestCase):
    """Keys at the start of a daemon: refusals, and changes while it runs."""

    def setUp(self):
        self.directory = tempfile.TemporaryDirectory()
        self.data_dir = self.directory.name + "/data"

    def tearDown(self):
        self.directory.cleanup()

    def refused(self, *arguments):
        given = {"--listen": "127.0.0.1:0", "--admin-listen": "127.0.0.1:0",
                 **dict(zip(arguments[::2], arguments[1::2]))}
        done = subprocess.run([BIN / "voxeld", "serve", "--data", self.data_dir, "--device", "cpu",
                               *(part for pair in given.items() for part in pair)],
                              text=True, capture_output=True, timeout=HANG_SECONDS)
        self.assertEqual(done.returncode, 1, done)
        return done.stderr

    def test_a_broken_list_is_refused_with_its_line(self):
        add_key(self.data_dir, "lab")
        with open(self.data_dir + "/keys", "a") as file:
            file.write("nonsense\n")
        self.assertIn(f"{self.data_dir}/keys line 3: fields: expected 12", self.refused())

    def test_other_machines_are_not_let_in_without_keys_and_never_to_the_admin_port(self):
        self.assertIn("voxeld keys add", self.refused("--listen", "0.0.0.0:0"))
        add_key(self.data_dir, "lab")
        self.assertIn("--admin-listen", self.refused("--admin-listen", "0.0.0.0:0"))

    def test_an_open_daemon_closes_with_its_first_key_and_an_admin_inherits(self):
        daemon = Daemon(device="cpu", data_dir=self.data_dir)
        try:
            self.assertIn("there are no API keys", daemon.log_tail())
            ready = daemon.request("GET", "/readyz", port=daemon.admin_port).json()
            self.assertEqual(ready["access"], "open")
            asset = daemon.post("/v1/assets?filename=a.obj",
                                b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").json()["id"]
            lab = daemon.holding(add_key(self.data_dir, "lab"))
            boss = daemon.holding(add_key(self.data_dir, "boss", "--admin"))
            self.assertEqual(daemon.get("/v1/assets").status, 401)
            self.assertEqual(lab.get(f"/v1/assets/{asset}").status, 404)
            self.assertEqual(boss.get(f"/v1/assets/{asset}").status, 200)
            ready = daemon.request("GET", "/readyz", port=daemon.admin_port).json()
            self.assertEqual(ready["access"], "keys")
        finally:
            daemon.stop()


if __name__ == "__main__":
    unittest.main()
