"""Small files that would blow up: each cap of server/worker/README.md, on both of its sides where that is cheap.

A refusal must name the limit, and the worker that looked at the file must not have grown."""
import base64
import io
import json
import os
import struct
import subprocess
import unittest
import zipfile
import zlib

from harness import DaemonTest

WORKER_GROWTH_MB_MAX = 400
TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def zipped(entries, method=zipfile.ZIP_DEFLATED):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, data in entries:
            archive.writestr(name, data)
    return bytearray(buffer.getvalue())


def with_declared_bytes(archive, count):
    """The first entry of the archive, saying that it inflates to `count` bytes."""
    directory = archive.rindex(b"PK\1\2")
    struct.pack_into("<I", archive, directory + 24, count)
    struct.pack_into("<I", archive, archive.index(b"PK\3\4") + 22, count)
    return archive


def png_head(width, height):
    """A PNG of that size whose pixels are missing."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    head = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0" * 100))
            + chunk(b"IEND", b""))


def nested_gltf(depth):
    """Valid but for what lies `depth` brackets deep in it."""
    return b'{"asset":{"version":"2.0"},"extras":' + b"[" * depth + b"]" * depth + b"}"


def gltf_chain(nodes):
    """A mesh below so many nodes."""
    positions = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    uri = "data:application/octet-stream;base64," + base64.b64encode(positions).decode()
    chain = [{"children": [i + 1]} for i in range(nodes - 1)] + [{"mesh": 0}]
    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": chain,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                       "min": [0, 0, 0], "max": [1, 1, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": uri, "byteLength": 36}]}).encode()


def ply_polygon(corners):
    """One polygon, around its first corner."""
    head = (f"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
            f"property float z\nelement face 1\nproperty list int int vertex_indices\nend_header\n"
            f"0 0 0\n1 0 0\n0 1 0\n{corners} ").encode()
    return head + b" ".join(b"%d" % (i % 3) for i in range(corners)) + b"\n"


def ply_of_claims(vertices, faces):
    return (f"ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\n"
            f"property float y\nproperty float z\nelement face {faces}\n"
            f"property list uchar int vertex_indices\nend_header\n").encode() + b"\0" * 1000


class Bombs(DaemonTest):
    device = "cpu"
    arguments = ("--workers-per-device", "1")

    def worker_peak_mb(self):
        with open(f"/proc/{self.daemon.worker_pid()}/status", encoding="ascii") as status:
            return next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024

    def setUp(self):
        self.peak_before, self.worker_before = self.worker_peak_mb(), self.daemon.worker_pid()

    def tearDown(self):
        self.assertEqual(self.daemon.worker_pid(), self.worker_before, "the worker died")
        self.assertLess(self.worker_peak_mb() - self.peak_before, WORKER_GROWTH_MB_MAX)

    def voxelize(self, name, body, query="size=8"):
        return self.daemon.request("POST", f"/v1/voxelize?{query}&filename={name}", body)

    def refuse(self, name, body, code, *parts, query="size=8", status=422):
        self.assert_problem(self.voxelize(name, bytes(body), query), status, code, *parts)

    def accept(self, name, body, query="size=8"):
        response = self.voxelize(name, bytes(body), query)
        self.assertEqual(response.status, 200, response.body)

    def test_heads(self):
        for length, status in ((31_000, 200), (33_000, 400)):
            response = self.daemon.request("GET", "/v1/jobs", headers={"X-Long": "x" * length})
            self.assertEqual(response.status, status)

    def test_json_of_requests(self):
        def post(body):
            return self.daemon.request("POST", "/v1/jobs", body,
                                       {"Content-Type": "application/json"})
        self.assert_problem(post(b'{"kind":"' + b"x" * (1 << 20) + b'"}'), 413, "payload-too-large",
                            "1048576")
        self.assert_problem(post(b'{"kind":' + b"[" * 64 + b"]" * 64 + b"}"), 400, "bad-request",
                            "depth", "64")
        self.assertNotIn("depth", post(b'{"kind":' + b"[" * 63 + b"]" * 63 + b"}").json()["detail"])

    def test_gltf(self):
        self.refuse("a.gltf", nested_gltf(128), "malformed-mesh", "128")
        self.assertNotIn("128", self.voxelize("a.gltf", nested_gltf(126)).json()["detail"])
        self.accept("a.gltf", gltf_chain(512))
        self.refuse("a.gltf", gltf_chain(514), "malformed-mesh", "512")

    def test_zip(self):
        mesh = ("a.obj", TRIANGLE + b"f 1 2 3\n")
        self.accept("a.zip", zipped([mesh] + [(f"{i}.txt", b"") for i in range(999)]))
        self.refuse("a.zip", zipped([mesh] + [(f"{i}.txt", b"") for i in range(1000)]),
                    "malformed-bundle", "1000")
        self.refuse("a.zip", zipped([("a.obj", b"#" * 50_000_000)]), "malformed-bundle", "200 times")
        noise = os.urandom(300_000)
        self.refuse("a.zip", with_declared_bytes(zipped([("a.obj", noise + b"\n" * 900_000)]), 1_000),
                    "malformed-bundle")

    def test_a_zip_of_more_than_it_may_inflate_to(self):
        # 41 entries of 210 MB, each said to be within the ratio, are 8.6 GB.
        archive = zipped([(f"{i}.obj", os.urandom(1_060_000)) for i in range(41)], zipfile.ZIP_STORED)
        at = 0
        while (at := archive.find(b"PK\1\2", at)) >= 0:
            struct.pack_into("<H", archive, at + 10, 8)  # deflated
            struct.pack_into("<I", archive, at + 24, 210_000_000)
            at += 4
        self.refuse("a.zip", archive, "malformed-bundle", str(8 << 30))

    def test_counts_in_headers(self):
        for vertices, faces in ((200_000_001, 1), (3, 200_000_001), (2_000_000_000, 2_000_000_000)):
            self.refuse("a.ply", ply_of_claims(vertices, faces), "malformed-mesh", "200000000")
        self.refuse("a.ply", ply_of_claims(100_000_000, 1), "malformed-mesh")  # not in 1000 bytes
        self.refuse("a.stl", b"\0" * 80 + struct.pack("<I", 4_000_000_000) + b"\0" * 1001,
                    "malformed-mesh")
        self.refuse("a.off", b"OFF\n4000000000 1 0\n0 0 0\n", "malformed-mesh")
        self.refuse("a.md5mesh", b'MD5Version 10\ncommandline ""\nnumJoints 2000000000\n'
                    b"numMeshes 1\njoints {\n}\n", "malformed-mesh")

    def test_polygons(self):
        self.accept("a.ply", ply_polygon(65_536))
        self.refuse("a.ply", ply_polygon(65_537), "malformed-mesh", "65536")

    def test_images_are_left_out_with_a_warning(self):
        mesh = b"mtllib a.mtl\n" + TRIANGLE + b"vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n"
        for width, height, part in ((9_000, 9_000, "67108864"), (40_000, 1, "32768")):
            bundle = zipped([("a.obj", mesh), ("a.mtl", b"newmtl m\nmap_Kd a.png\n"),
                             ("a.png", png_head(width, height))])
            asset = self.daemon.post("/v1/assets?filename=a.zip", bytes(bundle)).json()["id"]
            status = self.daemon.wait(self.daemon.submit(kind="voxelize", asset=asset,
                                                         options={"size": 8, "channels": "color"}))
            self.assertEqual(status["state"], "done", status)
            self.assertIn(part, json.dumps(status["result"]["warnings"]))

    def test_grids(self):
        mesh = TRIANGLE + b"f 1 2 3\n"
        self.refuse("a.obj", mesh, "invalid-option", "16384", query="size=16385", status=400)
        self.refuse("a.obj", mesh, "grid-too-large", query="dims=2048,2048,2048&format=npy")

    def test_bodies_that_inflate(self):
        body = subprocess.run(["gzip", "-9"], input=b"#" * 200_000_000, capture_output=True,
                              check=True).stdout
        response = self.daemon.request("POST", "/v1/voxelize?size=8&filename=a.obj", body,
                                       {"Content-Encoding": "gzip"})
        self.assert_problem(response, 413, "payload-too-large", "200 times")


if __name__ == "__main__":
    unittest.main()
