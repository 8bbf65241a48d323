"""The page for browsers as the daemon serves it, and names of downloads."""
import gzip
import pathlib
import re
import tempfile
import unittest

from harness import ROOT, Daemon, DaemonTest, TenantsDaemon

BROWSER = {"Accept": "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8",
           "Accept-Encoding": "gzip, deflate, br"}
BYTES_MAX = 60 << 10  # all files, gzipped


class Page(DaemonTest):
    device = "cpu"

    def file_names(self):
        document = gzip.decompress(self.daemon.get("/", headers=BROWSER).body).decode()
        return re.findall(r'"/web/([^"]+)"', document)

    def test_curl_gets_a_text_and_a_browser_a_small_page(self):
        self.assertIn(b"curl --data-binary", self.daemon.get("/", headers={"Accept": "*/*"}).body)
        page = self.daemon.get("/", headers=BROWSER)
        self.assertEqual(page.headers["Content-Type"], "text/html; charset=utf-8")
        total = len(page.body)
        for name in self.file_names():
            response = self.daemon.get("/web/" + name, headers=BROWSER)
            self.assertEqual((response.status, response.headers["Content-Encoding"]), (200, "gzip"))
            total += len(response.body)
        self.assertLessEqual(total, BYTES_MAX)
        head = self.daemon.request("HEAD", "/web/" + self.file_names()[0])
        self.assertEqual((head.status, head.body), (200, b""))

    def test_the_page_of_a_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            for name, text in (("index.html", b"<p>mine</p>"), ("own.js", b"let own;")):
                pathlib.Path(folder, name).write_bytes(text)
            daemon = Daemon(device="cpu", arguments=["--web-dir", folder])
            self.addCleanup(daemon.stop)
            page, script = daemon.get("/", headers=BROWSER), daemon.get("/web/own.js", headers=BROWSER)
            self.assertEqual((page.body, script.body), (b"<p>mine</p>", b"let own;"))
            self.assertEqual(script.headers["Cache-Control"], "no-cache")  # it may change
            self.assertEqual(daemon.get("/web/" + self.file_names()[0]).status, 404)

    def test_a_browser_keeps_what_did_not_change(self):
        tag = self.daemon.get("/", headers=BROWSER).headers["ETag"]
        self.assertEqual(self.daemon.get("/", headers={**BROWSER, "If-None-Match": tag}).status, 304)

    def test_other_formats_of_a_result_are_named_after_the_mesh(self):
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        status = self.daemon.wait(self.daemon.submit(kind="voxelize", asset=asset, options={"size": 8}))
        result, grid = f"/v1/jobs/{status['id']}/result", f"/v1/grids/{status['result']['grid']}"
        for path, name in ((result, "sample.voxg"), (result + "?format=vox", "sample.vox"),
                           (result + "?format=vox&filename=knot", "knot.vox"),
                           (result + "?level=1&filename=knot.ply", "knot.voxg"),
                           (grid + "?filename=knot", "knot.voxg"), (grid + "?format=npz&filename=knot", "knot.npz"),
                           (grid + "/render.png?width=16&height=16&filename=knot", "knot.png")):
            with self.subTest(path):
                response = self.daemon.get(path)
                self.assertEqual(response.status, 200, response.body)
                self.assertEqual(response.headers["Content-Disposition"], f'inline; filename="{name}"')
        link = self.daemon.post(result.replace("result", "share") + "?format=vox&filename=knot").json()["url"]
        self.assertEqual(self.daemon.get(link).headers["Content-Disposition"], 'inline; filename="knot.vox"')
        # The name decides nothing about the bytes: both are one stored result.
        hit = self.daemon.get(grid + "?format=npz&filename=other")
        self.assertEqual(hit.headers["Cache-Status"], "voxeld; hit")

    def test_the_tables_of_the_page_have_the_formats_of_the_daemon(self):
        header = (ROOT / "proto/output_format.h").read_text()
        listed = re.findall(r'X\(k\w+, "(\w+)", "[^"]+", "([^"]+)"', header)
        text = (ROOT / "client/web/app/formats.ts").read_text()
        table = text[text.index("const groups"):text.index("const options")]
        page = re.findall(r'"(\w+) (?:([.\w]+):)?[^"]+"', table)
        self.assertGreater(len(listed), 20)
        self.assertEqual(sorted(listed), sorted((name, "." + (extension or name)) for name, extension in page))


class PageWithKeys(unittest.TestCase):
    def test_the_page_is_public_and_the_api_is_not(self):
        with TenantsDaemon({"lab": 1}) as daemons:
            for path in ("/", "/admin"):
                self.assertEqual(daemons.daemon.get(path, headers=BROWSER).status, 200)
            self.assertEqual(daemons.daemon.get("/v1/me").status, 401)
            self.assertEqual(daemons.tenants["lab"].get("/v1/me").status, 200)


if __name__ == "__main__":
    unittest.main()
