"""Headers that caches, browsers and clients go by."""
import unittest
import urllib.parse

from harness import DaemonTest


class Headers(DaemonTest):
    device = "cpu"

    def job(self, **options):
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        job = self.daemon.submit(kind="voxelize", asset=asset, options={"size": 8, **options})
        return self.daemon.wait(job)

    def test_a_response_that_depends_on_accept_has_vary_accept(self):
        status = self.job()
        result, grid = f"/v1/jobs/{status['id']}/result", f"/v1/grids/{status['result']['grid']}"
        for path in (result, grid):
            for accept in (None, "*/*", "application/x-npy", "application/vnd.voxeld.grid", "text/html"):
                with self.subTest(path=path, accept=accept):
                    response = self.daemon.get(path, headers={"Accept": accept} if accept else {})
                    self.assertEqual(response.status, 406 if accept == "text/html" else 200)
                    self.assertIn("Accept", response.headers.get("Vary", "").split(", "))
            # The format of the others depends on the URL alone.
            self.assertIsNone(self.daemon.get(path + "?format=npy", headers={"Accept": "text/html"}).headers["Vary"])
            tag = self.daemon.get(path).headers["ETag"]
            known = self.daemon.get(path, headers={"If-None-Match": tag})
            self.assertEqual((known.status, known.headers["Vary"]), (304, "Accept"))
        self.assertIsNone(self.daemon.get("/v1/jobs").headers["Vary"])

    def test_accept_chooses_the_format_of_a_voxelization(self):
        mesh = self.fixture("sample.ply")
        for accept, media_type in ((None, "application/vnd.voxeld.grid"), ("*/*", "application/vnd.voxeld.grid"),
                                   ("application/x-npz, */*;q=0.1", "application/x-npz"),
                                   ("text/*", "text/x-xyz")):
            with self.subTest(accept):
                response = self.daemon.post("/v1/voxelize?size=8&filename=a.ply", mesh,
                                            headers={"Accept": accept} if accept else {})
                self.assertEqual((response.status, response.headers["Content-Type"], response.headers["Vary"]),
                                 (200, media_type, "Accept"))
        refused = self.daemon.post("/v1/voxelize?size=8&filename=a.ply", mesh, headers={"Accept": "image/png"})
        self.assert_problem(refused, 406, "not-acceptable", "application/x-npy", "text/x-xyz", "image/png")
        self.assertEqual(refused.headers["Vary"], "Accept")
        named = self.daemon.post("/v1/voxelize?size=8&filename=a.ply&format=npy", mesh,
                                 headers={"Accept": "image/png"})
        self.assertEqual((named.status, named.headers["Vary"]), (200, None))

    def test_names_of_files_come_through_whole(self):
        for name in ('plain.obj', 'a "quoted".obj', 'back\\slash.obj', 'größe 100%.obj', '模型.obj'):
            with self.subTest(name):
                response = self.daemon.post("/v1/voxelize?size=8&format=npy&filename=" + urllib.parse.quote(name),
                                          b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
                self.assertEqual(response.status, 200, response.body)
                given = self.filename(response.headers["Content-Disposition"])
                self.assertEqual(given.rsplit(".", 1)[0], name.rsplit(".", 1)[0])

    def filename(self, disposition):
        """As RFC 6266 has it: filename* before filename."""
        self.assertTrue(disposition.startswith("inline; "))
        disposition.encode("ascii")
        if "filename*=" in disposition:
            self.assertIn("filename*=UTF-8''", disposition)
            return urllib.parse.unquote(disposition.split("filename*=UTF-8''")[1], errors="strict")
        quoted = disposition.split("filename=", 1)[1]
        self.assertTrue(quoted.startswith('"') and quoted.endswith('"'), quoted)
        name, inner, at = "", quoted[1:-1], 0
        while at < len(inner):
            at += inner[at] == "\\"
            name += inner[at]
            at += 1
        return name

    def test_a_permanent_error_has_no_retry_after(self):
        mesh = self.fixture("sample.ply")
        for query in ("pipeline=compute", "pipeline=raster"):
            refused = self.daemon.post(f"/v1/voxelize?size=8&filename=a.ply&{query}", mesh)
            self.assert_problem(refused, 422, "unsupported-feature", "GL context")
            self.assertIsNone(refused.headers["Retry-After"])
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        job = self.daemon.submit(kind="voxelize", asset=asset, options={"size": 8, "pipeline": "raster"})
        self.assertEqual(self.daemon.wait(job)["state"], "failed")
        refused = self.daemon.get(f"/v1/jobs/{job}/result")
        self.assert_problem(refused, 422, "unsupported-feature")
        self.assertIsNone(refused.headers["Retry-After"])


if __name__ == "__main__":
    unittest.main()
