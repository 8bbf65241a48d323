"""Texts that are too long, by the limits that openapi.yaml tells: each is refused, stored nowhere and
echoed nowhere."""
import json
import pathlib
import sqlite3
import unittest
import urllib.parse

from harness import DaemonTest

# No refusal is longer.
RESPONSE_BYTES_MAX = 2048


class ClientTexts(DaemonTest):
    device = "cpu"

    def database_bytes(self):
        """Bytes of the pages in use. The log is not counted, because it is overwritten repeatedly."""
        path = pathlib.Path(self.daemon.data_dir) / "jobs.sqlite"
        with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as reader:
            pages, free, page_bytes = (reader.execute(f"PRAGMA {name}").fetchone()[0]
                                       for name in ("page_count", "freelist_count", "page_size"))
        return (pages - free) * page_bytes

    def refused(self, response, limit, sent):
        self.assertIn(response.status, (400, 413), response.body[:300])
        self.assertLessEqual(len(response.body) + len(str(response.headers)), RESPONSE_BYTES_MAX)
        problem = response.json()
        self.assertEqual((problem["expected"], problem["got"]), (f"at most {limit} bytes", str(sent)))

    def test_every_parameter_of_the_specification(self):
        """A text of one byte more than its maxLength, where a request can hold it."""
        spec, tried = self.daemon.openapi, 0
        for path, operations in spec.spec["paths"].items():
            for method, operation in operations.items():
                if method == "parameters":
                    continue
                for parameter in map(spec.resolve, operation.get("parameters", [])):
                    schema = spec.resolve(parameter["schema"])
                    if parameter["in"] == "query" and schema.get("type") == "string":
                        # Numbers are a pattern of their own; of words, no other is taken.
                        self.assertTrue({"maxLength", "pattern", "enum"} & schema.keys(),
                                        f"{method} {path}: {parameter['name']} has no limit")
                    limit = schema.get("maxLength", 1 << 30)
                    if parameter["in"] == "query" and schema.get("type") == "array":
                        # The limit of the list as text, as the description of JobRequest says.
                        limit = 102_400 if parameter["name"] == "times" else 1024
                    if method != "post" or "{" in path or limit > 4000:
                        continue
                    with self.subTest(f"{method} {path} {parameter['name']}"):
                        text = "A" * (limit + 1)
                        if parameter["in"] == "header":
                            response = self.daemon.post(path, {"kind": "inspect", "asset": "sha256-0"},
                                                      headers={parameter["name"]: text})
                        else:
                            query = urllib.parse.urlencode({parameter["name"]: text})
                            response = self.daemon.post(f"{path}?{query}", b"mesh")
                        self.refused(response, limit, limit + 1)
                        tried += 1
        self.assertGreater(tried, 20)

    def test_every_member_of_a_job(self):
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        before = self.database_bytes()
        spec, tried = self.daemon.openapi, 0
        for job_of_kind in map(spec.resolve, spec.spec["components"]["schemas"]["JobRequest"]["oneOf"]):
            members = job_of_kind["properties"]
            kind, = members["kind"]["enum"]
            for name, schema in members.items():
                if schema.get("type") != "string" or name == "kind":
                    continue
                for length in (schema["maxLength"] + 1, 900_000):
                    with self.subTest(f"{name} of {length} of kind {kind}"):
                        job = {"kind": kind, "asset": asset, name: "A" * length}
                        self.refused(self.daemon.post("/v1/jobs", job), schema["maxLength"], length)
                        tried += 1
        self.assertGreater(tried, 16)
        for value, sent in (("A" * 900_000, 900_000), ([0.125] * 30_000, 179_999)):
            job = {"kind": "voxelize", "asset": asset, "options": {"bounds": value}}
            self.refused(self.daemon.post("/v1/jobs", job), 1024, sent)
        self.assertLess(self.database_bytes() - before, 100_000)

    def test_rows_of_jobs_are_small_whatever_they_say(self):
        asset = self.daemon.upload(self.fixtures / "worm.md5.zip")
        before = self.database_bytes()
        for i in range(10):
            times = [(k + i) / 3e6 for k in range(4096)]
            response = self.daemon.post("/v1/jobs", {
                "kind": "voxelize", "asset": asset, "filename": "n" * 251 + ".zip",
                "options": {"size": 8, "animation": "walk", "times": times}})
            self.assertEqual(response.status, 202, response.body[:300])
            job = response.json()["id"]
            self.assertEqual(len(self.daemon.cancel(job)["options"]["times"]), 4096)
            # Its times are in its row alone: events name them as left out, as lists do.
            events = self.daemon.get(f"/v1/jobs/{job}/events").body.decode()
            states = [json.loads(line[6:]) for line in events.splitlines() if line.startswith("data: ")]
            self.assertTrue(states)
            self.assertTrue(all(state["left_out"] == ["options"] for state in states), states[0])
        # Each has a row of some 90 KB.
        self.assertLess((self.database_bytes() - before) / 10, 120_000)


if __name__ == "__main__":
    unittest.main()
