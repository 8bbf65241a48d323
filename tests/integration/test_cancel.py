"""A cancel ends a job in each stage. How soon is tested by long/test_cancel_times.py."""
import functools
import io
import random
import struct
import time
import unittest
import zipfile
import zlib

from harness import DaemonTest, until_met, wait_until


def zipped(files, compression):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression, compresslevel=1) as bundle:
        for name, data in files.items():
            bundle.writestr(name, data)
    return buffer.getvalue()


def long_mesh(megabytes):
    """An OBJ of many vertices, in a zip: takes seconds to parse."""
    chance = random.Random(1)
    vertices = "".join("v " + " ".join(f"{chance.random():.3f}" for _ in range(3)) + "\n"
                       for _ in range(1000)).encode()  # less than a window of deflate
    return zipped({"a.obj": vertices * (megabytes * 1_000_000 // len(vertices)) + b"f 1 2 3\n"},
                  zipfile.ZIP_DEFLATED)


def png(side, seed):
    line = random.Random(seed).randbytes(3 * side)
    packer = zlib.compressobj(1)
    data = b"".join(packer.compress(b"\0" + line[3 * (y % 97):] + line[:3 * (y % 97)])
                    for y in range(side)) + packer.flush()

    def chunk(name, content):
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0))
            + chunk(b"IDAT", data) + chunk(b"IEND", b""))


def textured_mesh(images, side):
    """A triangle for each of some large images, which take seconds to decode."""
    mesh = "mtllib a.mtl\n" + "".join(
        f"v {i} 0 0\nv {i + 1} 0 0\nv {i} 1 {i}\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m{i}\n"
        "f -3/-3 -2/-2 -1/-1\n" for i in range(images))
    materials = "".join(f"newmtl m{i}\nmap_Kd t{i}.png\n" for i in range(images))
    return zipped({"a.obj": mesh, "a.mtl": materials,
                   **{f"t{i}.png": png(side, i) for i in range(images)}}, zipfile.ZIP_STORED)


def lattice(side):
    """A PLY of separate triangles at the points of a lattice: all their edges are open."""
    vertices, edge = bytearray(), 1e-5
    for number in range(side ** 3):
        x, y, z = ((number // side ** axis % side + 0.5) / side for axis in range(3))
        vertices += struct.pack("<9f", x, y, z, x + edge, y, z, x, y + edge, z)
    faces = b"".join(struct.pack("<B3i", 3, 3 * k, 3 * k + 1, 3 * k + 2) for k in range(side ** 3))
    return (f"ply\nformat binary_little_endian 1.0\nelement vertex {3 * side ** 3}\nproperty float x\n"
            f"property float y\nproperty float z\nelement face {side ** 3}\n"
            "property list uchar int vertex_indices\nend_header\n").encode() + vertices + faces


class CancelLoad:
    """Jobs that take long in one stage: (name of the asset, its bytes, options, that stage). Those that last seconds
    take `scale` times as long; the others last minutes."""

    def __init__(self, fixtures, scale=1):
        self.cases = {
            "parse": ("long.zip", long_mesh(300 * scale), {"size": 8, "cache": "no"}, "parse"),
            "textures": ("textures.zip", textured_mesh(4 * scale, 5000),
                         {"size": 8, "color": "average", "cache": "no"}, "parse"),
            "voxelize": ("sample.glb", (fixtures / "sample.glb").read_bytes(),
                         {"size": 16384, "channels": "occupancy,color,normal", "cache": "no"}, "voxelize"),
            "winding": ("lattice.ply", lattice(28),
                        {"size": 512, "fill": "solid", "sign": "winding", "cache": "no"}, "voxelize"),
            "export": ("sample.glb", (fixtures / "sample.glb").read_bytes(),
                       {"size": int(1000 * scale ** 0.5), "format": "npz", "channels": "occupancy,normal",
                        "dtype": "float32", "cache": "no"}, "encode"),
        }

    def cancel_ms(self, daemon, case, after_seconds):
        """Milliseconds from the cancel, so long after the stage has begun, to the end of the job; its status, also of
        one that ended before."""
        name, body, options, stage = self.cases[case]
        asset = daemon.post(f"/v1/assets?filename={name}", body).json()["id"]
        job = daemon.submit(kind="voxelize", asset=asset, options=options)

        def is_in_stage_or_ended():
            status = daemon.get(f"/v1/jobs/{job}").json()
            return status["stage"] == stage or status["ended_ms"]
        wait_until(is_in_stage_or_ended, f"stage {stage}")
        time.sleep(after_seconds)
        begin = time.monotonic()
        status = daemon.cancel(job)
        return (time.monotonic() - begin) * 1000, status


class Cancel(DaemonTest):
    device = "cpu"
    arguments = ("--workers-per-device", "1")

    def worker(self):
        workers = self.daemon.request("GET", "/readyz", port=self.daemon.admin_port).json()["workers"]
        return workers[0]["pid"], workers[0]["restarts"]

    def test_a_cancel_ends_each_stage_and_costs_no_worker(self):
        load, before = functools.cache(lambda scale: CancelLoad(self.fixtures, scale)), self.worker()
        for case in load(1).cases:
            def is_cancelled(scale):
                _, status = load(scale).cancel_ms(self.daemon, case, 0)  # later, a fast machine may be done
                self.assertIn(status["state"], ("cancelled", "done"), status)
                return status["state"] == "cancelled"
            with self.subTest(case):
                until_met((1, 2, 3), is_cancelled)
                self.assertEqual(self.worker(), before)


if __name__ == "__main__":
    unittest.main()
