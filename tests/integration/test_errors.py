"""Bad input: every error code has a test that provokes it from outside, and every bad fixture gets a clear problem."""
import http.client
import json
import pathlib
import re
import socket
import unittest

from harness import HANG_SECONDS, ROOT, DaemonTest

# Codes that no request to a healthy daemon on loopback can provoke, and where they are tested.
TESTED_ELSEWHERE = {
    "unauthorized": "test_tenants",
    "forbidden": "test_web_pages",
    "internal": "unit_proto: the table alone; it means a bug or a driver that failed",
    "worker-crashed": "test_crash",
    "idempotency-mismatch": "test_jobs",
    "range-not-satisfiable": "test_jobs",
    "cancelled": "test_jobs",
    "quota-exceeded": "test_quotas",
    "storage-full": "test_storage",
    "shutting-down": "unit_http: drain",
    "device-unavailable": "unit_jobs: no worker",
    "queue-full": "unit_jobs: queue limit",
    "too-many-requests": "unit_api: cap on requests that wait",
    "malformed-image": "unit_scene_gltf: decode_image; a request gets the warning broken-texture",
    "deadline-exceeded": "unit_http: slow body",
}
PROVOKED = set()


class Errors(DaemonTest):
    arguments = ("--upload-bytes-max", "20000000")

    def provoke(self, response, status, code, *parts):
        PROVOKED.add(code)
        return self.assert_problem(response, status, code, *parts)

    def voxelize(self, query, body=None, **kw):
        return self.daemon.post(f"/v1/voxelize?{query}",
                                self.fixture("sample.ply") if body is None else body, **kw)

    def test_unknown_option_names_the_nearest(self):
        self.provoke(self.voxelize("sise=3"), 400, "unknown-option", "sise", "size")

    def test_invalid_values_say_expected_and_got(self):
        for query, parts in {
                "size=0": ("size", "16384", "0"), "size=abc": ("abc",), "size=3&dims=1,2,3": ("dims",),
                "dims=1,2": ("dims",), "voxel_size=-1": ("voxel_size",), "voxel_size=nan": ("nan",),
                "bounds=0,0,0,0,0,0": ("bounds",), "format=stl": ("npy", "stl"),
                "rule=thick": ("touch", "thin", "center"),
                "rule=none": ("fill is surface", "none"),
                "fill=full": ("surface", "solid", "band"), "interior=nearest": ("solid", "surface"),
                "sign=parity": ("fill",), "distance=world": ("channel distance",),
                "fill=solid&thickness=2": ("shell",), "fill=shell&thickness=257": ("256",),
                "color=blue": ("average",),
                "channels=occupancy,smell": ("smell",), "pipeline=fast": ("raster",),
                "axes=yzx": ("zyx",), "dtype=int7": ("uint8",), "size=8&size=9": ("size",),
                "padding=-1": ("padding",), "up=w": ("up",),
                "animation=": ("animation", "name or number"), "time=-1": ("time", "86400"),
                "frames=5..2": ("frames", "FIRST..LAST"), "frames=0..4096": ("frames", "4096"),
                "fps=0": ("fps", "0.01"), "times=1,0": ("times", "each above"),
                "root_motion=run&time=0": ("keep", "strip"), "root_motion=strip": ("root_motion", "times"),
                "time=1&fps=24": ("time", "fps"), "times=0,1&frames=0": ("times", "frames")}.items():
            with self.subTest(query):
                self.provoke(self.voxelize(query), 400, "invalid-option", *parts)

    def test_impossible_sizes_are_refused_with_the_limit(self):
        self.provoke(self.voxelize("voxel_size=0.00001"), 422, "grid-too-large", "16384")
        self.provoke(self.voxelize("size=2048&format=npy&bounds=-1,-1,-1,1,1,1"), 422,
                     "grid-too-large", "cells")

    def test_render_options(self):
        for query in ("width=0", "height=4097", "projection=fish", "background=red!", "zoom=0",
                      "style=disco", "ground=grass", "exposure=0.5",
                      "section=0,0,0,1", "matrix=1,2", "image=jpg",
                      "image=gif&time=1", "frame=1&time=1", "turntable=1&image=gif", "turntable=8",
                      "turntable=8&image=gif&animation=0", "rate=5", "rate=0.01&image=gif",
                      "columns=0&image=sheet", "columns=2", "frame=3&frames=0..2"):
            with self.subTest(query):
                self.provoke(self.daemon.post(f"/v1/render?{query}", self.fixture("sample.ply")),
                             400, "invalid-option", query.split("=")[0])
        for query in ("image=gif", "frame=1"):  # of an animation that is not there
            with self.subTest(query):
                self.provoke(self.daemon.post(f"/v1/render?{query}", self.fixture("sample.ply")),
                             400, "invalid-option", "an asset with animations", "ply")

    def test_bad_files_of_every_format(self):
        cases = json.loads((self.fixtures / "bad/list.json").read_text())
        self.assertGreater(len(cases), 20)
        for case in cases:
            with self.subTest(case["file"]):
                name = pathlib.Path(case["file"]).name
                response = self.voxelize(f"size=16&filename={name}",
                                         (self.fixtures / "bad" / case["file"]).read_bytes())
                problem = response.json()
                self.assertEqual(problem.get("code"), case["code"], problem)
                self.assertIn(case["message"], problem["detail"] + problem.get("expected", "") +
                              problem.get("got", ""))
                PROVOKED.add(problem["code"])
        # The daemon and its worker live on.
        self.assertEqual(self.voxelize("size=16").status, 200)

    def test_unsupported_media(self):
        self.provoke(self.voxelize("size=16", b"\x00\x01\x02\x03" * 100), 415,
                     "unsupported-media-type", "ply")
        self.provoke(self.voxelize("size=16", headers={"Content-Type": "multipart/form-data; boundary=x"}),
                     415, "unsupported-media-type", "--data-binary")
        self.provoke(self.voxelize("size=16", headers={"Content-Type": "video/mp4"}), 415,
                     "unsupported-media-type", "video/mp4")

    def test_empty_body(self):
        self.provoke(self.voxelize("size=16", b""), 422, "malformed-mesh", "empty")

    def test_a_mesh_without_triangles(self):
        self.provoke(self.voxelize("size=16&filename=a.obj", b"v 0 0 0\n"), 422, "empty-mesh")

    def test_a_required_extension_is_refused_by_name(self):
        gltf = json.dumps({"asset": {"version": "2.0"},
                           "extensionsRequired": ["MPEG_media"],
                           "extensionsUsed": ["MPEG_media"]})
        self.provoke(self.voxelize("size=16&filename=a.gltf", gltf.encode()), 422,
                     "unsupported-feature", "MPEG_media")

    def test_a_hostile_zip(self):
        import io
        import zipfile
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            archive.writestr("../../etc/passwd.obj", "v 0 0 0")
        self.provoke(self.voxelize("size=16&filename=a.zip", buffer.getvalue()), 422,
                     "malformed-bundle", "..")
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("bomb.obj", b"\0" * 50_000_000)
        self.provoke(self.voxelize("size=16&filename=a.zip", buffer.getvalue()), 422,
                     "malformed-bundle", "200 times")

    def test_unknown_paths_and_ids_are_not_found(self):
        self.provoke(self.daemon.get("/v1/nothing"), 404, "not-found")
        self.provoke(self.daemon.get("/v1/jobs/j-" + "0" * 32), 404, "not-found")
        self.provoke(self.daemon.get("/v1/assets/sha256-" + "0" * 64), 404, "not-found")
        self.provoke(self.daemon.get("/v1/grids/sha256-" + "0" * 64), 404, "not-found")
        self.provoke(self.daemon.get("/v1/assets/..%2f..%2fetc"), 404, "not-found")
        for path in ("", "/frames", "/frames/0", "/frames/0/render.png", "/render"):
            self.provoke(self.daemon.get("/v1/sequences/sha256-" + "0" * 64 + path), 404, "not-found",
                         "sequence")
        self.provoke(self.daemon.get("/v1/jobs/j-" + "0" * 32 + "/frames"), 404, "not-found", "job")
        self.provoke(self.daemon.post("/v1/jobs", {"kind": "voxelize",
                                                   "asset": "sha256-" + "1" * 64}), 404, "not-found")

    def test_methods(self):
        response = self.daemon.request("PUT", "/v1/jobs")
        self.provoke(response, 405, "method-not-allowed")
        self.assertIn("POST", response.headers["Allow"])

    def test_formats_that_are_not_acceptable(self):
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        job = self.daemon.submit(kind="voxelize", asset=asset, options={"size": 8})
        self.daemon.wait(job)
        self.provoke(self.daemon.get(f"/v1/jobs/{job}/result", headers={"Accept": "text/html"}),
                     406, "not-acceptable", "npy")

    def test_the_result_of_an_unfinished_job_is_a_conflict(self):
        asset = self.daemon.upload(self.fixtures / "sample.glb")
        job = self.daemon.submit(kind="voxelize", asset=asset,
                                 options={"size": 16384, "channels": "occupancy", "cache": "no"})
        self.provoke(self.daemon.get(f"/v1/jobs/{job}/result"), 409, "conflict")
        self.daemon.request("DELETE", f"/v1/jobs/{job}")

    def test_a_deleted_asset_is_gone(self):
        asset = self.daemon.upload(self.fixtures / "sample.off")
        self.assertEqual(self.daemon.request("DELETE", f"/v1/assets/{asset}").status, 204)
        response = self.daemon.get(f"/v1/assets/{asset}")
        self.provoke(response, 410, "gone")

    def test_large_bodies(self):
        self.provoke(self.voxelize("size=16", b"x" * 20_000_001), 413, "payload-too-large",
                     "20000000")

    def test_a_chunked_body_is_bounded_too(self):
        with socket.create_connection(("127.0.0.1", self.daemon.port), timeout=HANG_SECONDS) as raw:
            raw.sendall(b"POST /v1/voxelize?size=8 HTTP/1.1\r\nHost: localhost\r\n"
                        b"Transfer-Encoding: chunked\r\n\r\n")
            chunk = b"100000\r\n" + b"x" * 0x100000 + b"\r\n"
            response = b""
            # The connection may end before the response was read. A daemon that waits for more lets time run out.
            try:
                for _ in range(40):
                    raw.sendall(chunk)
            except ConnectionError:
                pass
            try:
                while part := raw.recv(65536):
                    response += part
            except ConnectionError:
                pass
            if response:
                self.assertIn(b" 413 ", response.split(b"\r\n")[0])
        PROVOKED.add("payload-too-large")

    def test_a_post_without_length(self):
        with socket.create_connection(("127.0.0.1", self.daemon.port), timeout=HANG_SECONDS) as raw:
            raw.sendall(b"POST /v1/voxelize?size=8 HTTP/1.1\r\nHost: localhost\r\n\r\n")
            response = raw.recv(65536)
        self.assertIn(b" 411 ", response.split(b"\r\n")[0])
        PROVOKED.add("length-required")

    def test_a_grid_has_no_frames(self):
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        status = self.daemon.wait(self.daemon.submit(kind="voxelize", asset=asset, options={"size": 8}))
        self.assertEqual((status["frames_done"], status["frames_total"]), (0, 0))
        self.assertEqual(self.daemon.get(f"/v1/jobs/{status['id']}/frames").json()["frames"], [])
        self.provoke(self.daemon.get(f"/v1/jobs/{status['id']}/frames/0"), 404, "not-found",
                     "0 frames are done")
        grid = f"/v1/grids/{status['result']['grid']}"
        self.provoke(self.daemon.get(f"{grid}?frames=0..3"), 400, "unknown-option",
                     "option 'frames' does not apply to this request")
        self.provoke(self.daemon.get(f"{grid}/render.png?frame=1"), 400, "unknown-option",
                     "option 'frame' does not apply to this request")
        self.provoke(self.daemon.get(f"{grid}/render?image=gif"), 400, "invalid-option", "turntable")
        self.provoke(self.daemon.get(f"{grid}/render.png?image=gif"), 400,
                     "invalid-option", "/render")

    def test_bundles(self):
        mesh = self.daemon.upload(self.fixtures / "sample.stl")
        nothing = "sha256-" + "0" * 64

        def post(files):
            return self.daemon.request(
                "POST", "/v1/assets", body=json.dumps({"files": files}),
                headers={"Content-Type": "application/vnd.voxeld.bundle+json"})
        self.provoke(post([]), 422, "malformed-bundle", "files", "1000")
        self.provoke(post([{"name": "../a.stl", "asset": mesh}]), 422, "malformed-bundle", "..")
        self.provoke(post([{"name": "a.stl", "asset": mesh}, {"name": "a.stl", "asset": mesh}]), 422,
                     "malformed-bundle", "distinct")
        self.provoke(post([{"name": "a.stl", "asset": nothing}]), 404, "not-found", "a.stl", nothing)
        bundle = post([{"name": "a.stl", "asset": mesh}]).json()["id"]
        self.provoke(post([{"name": "b", "asset": bundle}]), 422, "malformed-bundle", "bundle itself")
        self.assertEqual(self.daemon.request("DELETE", f"/v1/assets/{mesh}").status, 204)
        self.provoke(self.daemon.post(f"/v1/voxelize?size=8&asset={bundle}"), 410, "gone", "a.stl")

    def test_bad_json(self):
        for body, part in ((b"{", "byte"), (b'{"kind":"voxelize","kind":"x"}', "kind"),
                           (b"[" * 100_000, "depth"), (b'{"kind":"fly"}', "fly"),
                           (b'{"kind":"voxelize"}', "asset"), (b'{"wat":1}', "wat")):
            with self.subTest(body[:30]):
                response = self.daemon.request("POST", "/v1/jobs", body=body,
                                               headers={"Content-Type": "application/json"})
                self.assertEqual(response.status, 400)
                problem = response.json()
                PROVOKED.add(problem["code"])
                self.assertIn(part, json.dumps(problem))

    def test_a_missing_texture_is_a_named_warning(self):
        obj = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"
        asset = self.daemon.post("/v1/assets?filename=a.obj", obj).json()["id"]
        job = self.daemon.submit(kind="voxelize", asset=asset, options={"size": 8})
        status = self.daemon.wait(job)
        self.assertEqual(status["state"], "done")
        self.assertIn("m.mtl", json.dumps(status["result"]["warnings"]))

    def test_the_specification_names_the_problems_of_each_operation_by_status(self):
        statuses = {str(status) for status in re.findall(r"// (\d{3}) [a-z-]+",
                                                         (ROOT / "proto/error_code.h").read_text())}
        for path, operations in self.daemon.openapi.spec["paths"].items():
            for method, operation in operations.items():
                if method == "parameters":
                    continue
                named = set(operation["responses"])
                self.assertFalse({s for s in named if not s.isdigit()}, (method, path))
                self.assertLessEqual({s for s in named if s >= "400"}, statuses, (method, path))
                self.assertLessEqual({"400", "403"}, named, (method, path))

    def test_zz_every_error_code_is_tested(self):
        """Runs last: each code of proto/error_code.h is provoked here or named with its place."""
        header = (ROOT / "proto/error_code.h").read_text()
        codes = set(re.findall(r"// \d{3} ([a-z-]+)", header))
        self.assertGreater(len(codes), 25)
        missing = codes - PROVOKED - set(TESTED_ELSEWHERE)
        self.assertEqual(missing, set())


if __name__ == "__main__":
    unittest.main()
