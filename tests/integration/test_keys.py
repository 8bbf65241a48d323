"""API keys over HTTP, by admins, beside the command line on the same key file."""
import json
import pathlib
import shutil
import tempfile
import unittest

from harness import Daemon, wait_until
from test_tenants import add_key, key_id, keys

UNKNOWN = "aaaaaaaa"


class Keys(unittest.TestCase):
    def setUp(self):
        self.data_dir = tempfile.mkdtemp(prefix="voxeld-test-")
        self.boss_key = add_key(self.data_dir, "boss", "--admin")
        self.daemon = Daemon(device="cpu", data_dir=self.data_dir)
        self.boss = self.daemon.holding(self.boss_key)

    def tearDown(self):
        self.daemon.stop()
        shutil.rmtree(self.data_dir, ignore_errors=True)
        pathlib.Path(self.data_dir + ".log").unlink()

    def problem(self, response, status, code, *parts):
        self.assertEqual(response.status, status, response.body)
        problem = response.json()
        self.assertEqual(problem["code"], code)
        for part in parts:
            self.assertIn(part, json.dumps(problem))

    def patch(self, who, one, body):
        return who.request("PATCH", f"/v1/keys/{one}", body=json.dumps(body),
                           headers={"Content-Type": "application/json"})

    def add(self, **members):
        response = self.boss.post("/v1/keys", members)
        self.assertEqual(response.status, 201, response.body)
        self.assertEqual(response.headers["Cache-Control"], "no-store")
        return response.json()

    def revoke(self, who, one):
        return who.request("DELETE", f"/v1/keys/{one}")

    def listed(self):
        """The keys by both ways, which must agree."""
        by_http = self.boss.get("/v1/keys").json()["keys"]
        self.assertEqual(by_http, json.loads(keys(self.data_dir, "list", "--json").stdout))
        return {one["id"]: one for one in by_http}

    def test_a_key_is_added_used_limited_and_revoked(self):
        added = self.add(name="lab", expires="90d", weight=3)
        lab = self.daemon.holding(added.pop("key"))
        self.assertEqual(lab.get("/v1/me").json()["tenant"], "lab")
        self.assertEqual(self.listed()[added["id"]], added)
        self.assertAlmostEqual(added["expires_ms"] - added["created_ms"], 90 * 86_400_000, delta=1000)
        changed = self.patch(self.boss, added["id"], {"bytes": 100, "cells": 8, "queued_jobs": 2})
        self.assertEqual(changed.status, 200, changed.body)
        self.assertEqual(changed.json()["limits"],
                         {"requests_per_minute": 0, "queued_jobs": 2, "bytes": 100, "cells": 8})
        # In force with the next request.
        self.assertEqual(lab.get("/v1/me").json()["limits"]["cells"], 8)
        self.problem(lab.post("/v1/assets?filename=a.obj", b"#" * 200), 413, "payload-too-large")
        revoked = self.revoke(self.boss, added["id"])
        self.assertEqual((revoked.status, revoked.json()["state"]), (200, "revoked"))
        self.assertEqual(lab.get("/v1/me").status, 401)
        self.assertEqual(self.revoke(self.boss, added["id"]).body, revoked.body)

    def test_limits_are_of_the_tenant_and_a_rate_is_told_at_once(self):
        first, second = self.add(name="shop", rate="1/s"), self.add(name="shop")
        self.assertEqual(second["limits"]["requests_per_minute"], 60)
        shop = self.daemon.holding(second["key"])
        wait_until(lambda: shop.get("/v1/jobs").status == 429, "the rate is in force")
        self.assertEqual(self.patch(self.boss, first["id"], {"rate": "0"}).status, 200)
        self.assertEqual([shop.get("/v1/jobs").status for _ in range(6)], [200] * 6)

    def test_the_command_line_and_the_api_see_each_others_changes(self):
        by_http = self.add(name="one")
        by_hand = add_key(self.data_dir, "two", "--rate", "10/s")
        self.assertEqual({one["name"] for one in self.listed().values()}, {"boss", "one", "two"})
        keys(self.data_dir, "set", by_http["id"], "--weight", "7")
        self.assertEqual(self.listed()[by_http["id"]]["weight"], 7)
        self.assertEqual(self.revoke(self.boss, key_id(by_hand)).status, 200)
        self.assertEqual(self.daemon.holding(by_hand).get("/v1/me").status, 401)
        keys(self.data_dir, "revoke", by_http["id"])
        self.assertEqual(self.daemon.holding(by_http["key"]).get("/v1/me").status, 401)
        self.assertEqual({one["state"] for one in self.listed().values()}, {"live", "revoked"})

    def test_a_tenant_can_do_nothing_with_keys(self):
        lab_key = add_key(self.data_dir, "lab")
        lab = self.daemon.holding(lab_key)
        for response in (lab.get("/v1/keys"), lab.post("/v1/keys", {"name": "lab", "admin": True}),
                         self.patch(lab, key_id(lab_key), {"weight": 1000}),
                         self.revoke(lab, key_id(self.boss_key)), self.revoke(lab, UNKNOWN)):
            self.problem(response, 403, "forbidden", "admin")
        self.assertEqual({one["state"] for one in self.listed().values()}, {"live"})
        self.assertEqual(len(self.listed()), 2)

    def test_the_last_key_of_an_admin_stays(self):
        self.problem(self.revoke(self.boss, key_id(self.boss_key)), 409, "conflict", "last",
                     "voxeld keys revoke")
        second = self.daemon.holding(self.add(name="chief", admin=True)["key"])
        self.assertEqual(self.revoke(second, key_id(self.boss_key)).status, 200)
        self.assertEqual(self.boss.get("/v1/keys").status, 401)
        self.assertEqual(second.get("/v1/keys").status, 200)
        keys(self.data_dir, "revoke", key_id(second.key))  # the command line may
        self.assertEqual(second.get("/v1/keys").status, 401)

    def test_mistakes_are_told(self):
        for body, part in (({}, "name"), ({"name": "Two Words"}, "a-z"), ({"name": "a", "role": "b"}, "admin"),
                           ({"name": "a", "expires": "soon"}, "30d"), ({"name": "a", "rate": "fast"}, "30/m"),
                           ({"name": "a", "weight": 0}, "1 to 1000"), ({"name": "a", "bytes": "x"}, "integer")):
            response = self.boss.post("/v1/keys", body)
            self.assertEqual(response.status, 400, response.body)
            self.assertIn(part, response.body.decode())
        self.problem(self.boss.post("/v1/keys", "name=lab"), 415, "unsupported-media-type")
        self.problem(self.patch(self.boss, UNKNOWN, {}), 404, "not-found", "no such key")
        self.problem(self.revoke(self.boss, UNKNOWN), 404, "not-found", "no such key")
        self.assertEqual(len(self.listed()), 1)

    def test_changes_are_logged_and_no_secret_is(self):
        added = self.add(name="lab")
        self.assertEqual(self.patch(self.boss, added["id"], {"weight": 2}).status, 200)
        self.problem(self.revoke(self.boss, added["key"]), 404, "not-found")  # a whole key is no id
        self.assertEqual(self.revoke(self.boss, added["id"]).status, 200)
        self.daemon.stop()  # the log is whole
        log = pathlib.Path(self.data_dir + ".log").read_text()
        for event in ("added", "changed", "revoked"):
            self.assertRegex(log, f'API key {event} key={added["id"]} tenant=lab role=tenant '
                                  f"by=boss by_key={key_id(self.boss_key)} ")
        for key in (added["key"], self.boss_key):
            secret = key.split("_")[2]
            self.assertNotIn(secret, log)
            for path in pathlib.Path(self.data_dir).rglob("*"):
                if path.is_file():
                    self.assertNotIn(secret.encode(), path.read_bytes(), path)


class Open(unittest.TestCase):
    def test_a_daemon_without_keys_names_the_command_for_the_first(self):
        daemon = Daemon(device="cpu")
        try:
            for response in (daemon.get("/v1/keys"), daemon.post("/v1/keys", {"name": "boss", "admin": True}),
                             daemon.request("DELETE", f"/v1/keys/{UNKNOWN}")):
                self.assertEqual(response.status, 409, response.body)
                self.assertIn("voxeld keys add NAME --admin", response.json()["expected"])
            self.assertFalse((pathlib.Path(daemon.data_dir) / "keys").exists())
        finally:
            daemon.stop()


if __name__ == "__main__":
    unittest.main()
