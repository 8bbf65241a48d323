"""Memory of the gateway for 200 connections of a tenant that read lists, tiles and long jobs slowly or not at all."""
import contextlib
import json
import random
import resource
import select
import socket
import struct
import unittest

from harness import DaemonTest

CLIENTS = 200
JOBS = 120
TIMES = 4096
RESIDENT_MB_MAX = 512
TILES_PER_SIDE = 12
TILE_SIDE = 256
# Address space that a gateway may take beyond what it has when it is idle.
SPARE_MB = (1, 4, 16, 64)


def status_mb(pid, name):
    with open(f"/proc/{pid}/status") as status:
        line = next(line for line in status if line.startswith(name + ":"))
    return int(line.split()[1]) / 1024


def sparse_mesh(side):
    """A PLY with one small triangle in the middle of each cell of a grid of side³ cells."""
    corners = []
    for z in range(side):
        for y in range(side):
            for x in range(side):
                at = [x + 0.5, y + 0.5, z + 0.5]
                for axis in range(3):
                    corners.append([c + 0.01 * (i == axis) for i, c in enumerate(at)])
    # The corners of the whole, so that cells are tiles.
    for at in (0.0, float(side)):
        corners.append([at + 0.001 * (at == 0), at, at])
        corners.append([at, at + 0.001 * (at == 0) - 0.001 * (at > 0), at])
        corners.append([at, at, at + 0.001 * (at == 0) - 0.001 * (at > 0)])
    faces = len(corners) // 3
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(corners)}\nproperty float x\n"
            f"property float y\nproperty float z\nelement face {faces}\n"
            f"property list uchar int vertex_indices\nend_header\n").encode()
    return (head + b"".join(struct.pack("<3f", *corner) for corner in corners)
            + b"".join(struct.pack("<B3i", 3, 3 * i, 3 * i + 1, 3 * i + 2) for i in range(faces)))


class ResponseMemory(DaemonTest):
    device = "cpu"
    arguments = ("--workers-per-device", "1")

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        asset = cls.daemon.post("/v1/assets?filename=sparse.ply", sparse_mesh(TILES_PER_SIDE)).json()["id"]
        cls.job = cls.daemon.submit(kind="voxelize", asset=asset, options={
            "size": TILES_PER_SIDE * TILE_SIDE, "color": "none", "format": "native"})
        status = cls.daemon.wait(cls.job, 600)
        assert status["state"] == "done", status
        cls.grid = status["result"]["grid"]
        # They never run: what they work on has no animation, and is busy first with a job like it.
        chance = random.Random(1)
        times = sorted(chance.uniform(0, 80_000) for _ in range(TIMES))
        cls.jobs = [cls.daemon.submit(kind="voxelize", asset=asset, options={
            "size": 8 + i, "animation": "0", "times": times}) for i in range(JOBS)]

    def resident_mb(self):
        return status_mb(self.daemon.process.pid, "VmHWM")

    def ask_without_reading(self, paths, count=CLIENTS):
        """Connections whose responses have begun; self.heads are the first bytes of these."""
        clients, self.heads = [], set()
        for i in range(count):
            client = socket.socket()
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            client.connect(("127.0.0.1", self.daemon.port))
            client.sendall(f"GET {paths[i % len(paths)]} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
            clients.append(client)
        for client in clients:
            if select.select([client], [], [], 300)[0]:
                with contextlib.suppress(OSError):  # it is cut
                    self.heads.add(client.recv(12, socket.MSG_PEEK))
        return clients

    def assert_bounded(self, paths):
        clients = self.ask_without_reading(paths)
        try:
            self.assertIsNone(self.daemon.process.poll(), self.daemon.log_tail())
            self.assertIn(b"HTTP/1.1 200", self.heads)
            self.assertLess(self.resident_mb(), RESIDENT_MB_MAX)
            self.assertEqual(self.daemon.get("/v1/me").status, 200)
        finally:
            for client in clients:
                client.close()

    def test_1_lists_of_jobs_with_long_options_are_bounded(self):
        self.assert_bounded(["/v1/jobs?limit=1000", "/v1/queue?limit=200"])

    def test_2_jobs_with_long_options_are_bounded(self):
        self.assert_bounded([f"/v1/jobs/{job}" for job in self.jobs])

    def test_3_tiles_are_bounded(self):
        self.assert_bounded([f"/v1/grids/{self.grid}/tiles", f"/v1/grids/{self.grid}/tiles/0",
                             f"/v1/jobs/{self.job}/tiles"])

    def test_4_every_tile_is_listed_once_over_the_pages(self):
        seen, after = [], ""
        while after is not None:
            page = self.daemon.get(f"/v1/grids/{self.grid}/tiles?limit=500&after={after}").json()
            seen += [tile["index"] for tile in page["tiles"]]
            after = page.get("next")
        self.assertEqual(seen, list(range(page["tile_count"])))
        self.assertGreaterEqual(len(seen), TILES_PER_SIDE ** 3)

    def test_5_a_body_of_very_many_values_is_refused(self):
        body = '{"kind":"voxelize","asset":"a","options":' + "[" + ",".join("[]" for _ in range(300_000)) + "]}"
        response = self.daemon.post("/v1/jobs", body, headers={"Content-Type": "application/json"})
        self.assert_problem(response, 400, "bad-request", "too many values", "at most 32768")

    def test_6_without_memory_requests_fail_and_the_daemon_goes_on(self):
        pid = self.daemon.process.pid
        paths = [f"/v1/grids/{self.grid}/tiles", "/v1/jobs?limit=1000", f"/v1/jobs/{self.jobs[0]}",
                 f"/v1/jobs/{self.job}/tiles"]
        for spare_mb in SPARE_MB:
            limit = int((status_mb(pid, "VmSize") + spare_mb) * (1 << 20))
            before = resource.prlimit(pid, resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))
            try:
                for client in self.ask_without_reading(paths, count=50):
                    client.close()
            finally:
                if self.daemon.process.poll() is None:
                    resource.prlimit(pid, resource.RLIMIT_AS, before)
            self.assertIsNone(self.daemon.process.poll(), f"{spare_mb} MB: {self.daemon.log_tail()}")
            self.assertEqual(self.daemon.get("/v1/jobs?limit=1").status, 200)


if __name__ == "__main__":
    unittest.main()
