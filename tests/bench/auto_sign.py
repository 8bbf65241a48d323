#!/usr/bin/python3
"""Solids of meshes that do not close: sign=auto against majority, and against what a dry run expected.

    tests/bench/auto_sign.py [--device cpu] [--runs 5] [--sizes 64 128 256]

Meshes: triangles at random places, spheres with cracks, and one whose triangles are wound at random. Prints the least
seconds of so many runs, their ratio (goal: at most 10), and the seconds that a dry run expected of auto. VOXELD_BIN_DIR
chooses the daemon."""
import argparse
import pathlib
import struct
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "integration"))
from harness import Daemon  # noqa: E402  (needs the path above)

CRACK = 6e-4  # standard deviation by which corners are moved, of the radius


def stl(triangles):
    record = np.zeros(len(triangles), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    record["v"] = triangles
    return bytes(80) + struct.pack("<I", len(triangles)) + record.tobytes()


def sphere(splits):
    """Triangles (N, 3, 3) of an octahedron that is split so many times, on the unit sphere."""
    signs = [np.diag([x, y, z]) for x in (1, -1) for y in (1, -1) for z in (1, -1)]
    triangles = np.array([one if np.linalg.det(one) > 0 else one[::-1] for one in signs], dtype=float)
    for _ in range(splits):
        a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
        ab, bc, ca = a + b, b + c, c + a
        parts = [np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        triangles = np.concatenate(parts)
        triangles /= np.linalg.norm(triangles, axis=2, keepdims=True)
    return triangles


def meshes(chance):
    def soup(count):
        return chance.random((count, 1, 3)) + chance.normal(0, 0.03, (count, 3, 3))

    def cracked(splits):
        whole = sphere(splits)
        return whole + chance.normal(0, CRACK, whole.shape)
    wound_at_random = cracked(6)
    turned = chance.random(len(wound_at_random)) < 0.5
    wound_at_random[turned] = wound_at_random[turned][:, ::-1]
    return {"soup of 5,120": soup(5120), "soup of 100,000": soup(100_000), "cracked, 131,072": cracked(7),
            "wound at random, 32,768": wound_at_random}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--sizes", type=int, nargs="+", default=[64, 128, 256])
    arguments = parser.parse_args()
    daemon = Daemon(device=arguments.device)
    try:
        print("| mesh | size | majority, s | auto, s | ratio | expected, s |\n|---|---|---|---|---|---|")
        for name, triangles in meshes(np.random.default_rng(1)).items():
            asset = daemon.post("/v1/assets?filename=mesh.stl", stl(triangles)).json()["id"]
            for size in arguments.sizes:
                body = {"kind": "voxelize", "asset": asset, "options": {"size": size, "fill": "solid", "cache": "no"}}
                expected = daemon.post("/v1/jobs?dry_run=1", body).json()["estimate"]["seconds"]
                least = {}
                for sign in ("majority", "auto"):
                    body["options"]["sign"] = sign
                    ended = [daemon.wait(daemon.submit(**body)) for _ in range(arguments.runs)]
                    least[sign] = min(job["ended_ms"] - job["started_ms"] for job in ended) / 1e3
                print(f"| {name} | {size} | {least['majority']:.3f} | {least['auto']:.3f} | "
                      f"{least['auto'] / max(least['majority'], 1e-3):.1f} | {expected:.3f} |", flush=True)
    finally:
        daemon.stop()


if __name__ == "__main__":
    main()
