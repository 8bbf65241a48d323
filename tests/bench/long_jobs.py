#!/usr/bin/python3
"""Jobs of every kind that are long in one of their parts: what was expected, and how soon a cancel could end them.

    tests/bench/long_jobs.py [--device cpu] [--seconds 30] [--only NAME …]

Hostile files are made here; real ones are read from VOXELD_DATA_DIR and left out without it.

Prints for each job the seconds that a dry run expected, before the daemon had run any, and those that it took; then
what its worker reports: the stage with the longest work that no cancel could have ended, and its milliseconds. `-`:
less than 50. Jobs that take longer than --seconds are cancelled. VOXELD_BIN_DIR chooses the daemon."""
import argparse
import io
import json
import os
import pathlib
import re
import struct
import sys
import time
import zipfile

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "integration"))
from harness import daemon_with_fixtures  # noqa: E402  (needs the path above)
from test_cancel import lattice, long_mesh, textured_mesh  # noqa: E402

DATA = os.environ.get("VOXELD_DATA_DIR") and pathlib.Path(os.environ["VOXELD_DATA_DIR"])


def slivers(count):
    """An STL of thin triangles across the whole box, in all directions."""
    chance = np.random.default_rng(3)
    ends = chance.random((count, 2, 3), dtype=np.float32)
    record = np.zeros(count, dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    record["v"][:, :2], record["v"][:, 2] = ends, ends[:, 0] + np.float32(1e-4)
    return bytes(80) + struct.pack("<I", count) + record.tobytes()


def long_gltf(nodes):
    """A glTF of many nodes that show one triangle."""
    data = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
    document = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(nodes))}],
                "nodes": [{"mesh": 0, "translation": [k % 100, k // 100 % 100, k // 10000]} for k in range(nodes)],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                               "min": [0, 0, 0], "max": [1, 1, 0]}],
                "bufferViews": [{"buffer": 0, "byteLength": len(data)}], "buffers": [{"byteLength": len(data)}]}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


class Cases:
    """(name, file, kind of job, options): files are made when they are asked for."""

    def __init__(self, fixtures):
        self.files = {
            "sample.glb": lambda: (fixtures / "sample.glb").read_bytes(),
            "long.zip": lambda: long_mesh(300),
            "textures.zip": lambda: textured_mesh(4, 5000),
            "one.zip": lambda: textured_mesh(1, 8192),
            "lattice28.ply": lambda: lattice(28),
            "lattice64.ply": lambda: lattice(64),
            "slivers.stl": lambda: slivers(1_000_000),
            "nodes.glb": lambda: long_gltf(100_000),
        }
        solid = {"size": 512, "fill": "solid", "sign": "winding"}
        self.jobs = [
            ("OBJ", "long.zip", "voxelize", {"size": 8}),
            ("description", "long.zip", "inspect", {}),
            ("glTF nodes", "nodes.glb", "voxelize", {"size": 64}),
            ("PNG", "textures.zip", "voxelize", {"size": 8, "color": "average"}),
            ("one PNG", "one.zip", "voxelize", {"size": 2048, "channels": "color"}),
            ("winding 28", "lattice28.ply", "voxelize", solid),
            ("winding 64", "lattice64.ply", "voxelize", solid),
            ("parity 64", "lattice64.ply", "voxelize", {"size": 512, "fill": "solid"}),
            ("components", "lattice64.ply", "inspect", {}),
            ("slivers", "slivers.stl", "voxelize", {"size": 256}),
            ("surface", "sample.glb", "voxelize", {"size": 4096, "channels": "occupancy"}),
            ("colours", "sample.glb", "voxelize", {"size": 1024, "channels": "color,normal"}),
            ("solid", "sample.glb", "voxelize", {"size": 1024, "fill": "solid"}),
            ("distance", "sample.glb", "voxelize", {"size": 512, "channels": "distance"}),
            ("shell", "sample.glb", "voxelize", {"size": 512, "fill": "shell", "thickness": 8}),
            ("hollow", "sample.glb", "voxelize", {"size": 512, "fill": "solid", "hollow": 4}),
            ("dilate", "sample.glb", "voxelize", {"size": 512, "dilate": 8}),
            ("keep", "lattice64.ply", "voxelize", {"size": 512, "keep": "largest"}),
            ("palette", "sample.glb", "voxelize", {"size": 1024, "channels": "color", "palette": "64"}),
            *[(name, "sample.glb", "voxelize", {"size": size, "format": name, **more})
              for name, size, more in (
                  ("npy", 1024, {}), ("npz", 1024, {}), ("vti", 512, {}), ("nrrd", 512, {}), ("vox", 512, {}),
                  ("glb", 1024, {"mesh": "greedy"}), ("ply", 1024, {"mesh": "faces"}),
                  ("obj", 1024, {"mesh": "smooth"}), ("xyz", 1024, {}), ("vdb", 1024, {}),
                  ("schem", 250, {}), ("litematic", 250, {}), ("zarr", 512, {}), ("binvox", 512, {}))],
            ("image", "sample.glb", "render", {"size": 512, "width": 2048, "height": 2048, "samples": 4}),
            ("turntable", "sample.glb", "render",
             {"size": 256, "width": 1024, "height": 1024, "samples": 4, "image": "gif", "turntable": 36}),
        ]
        if DATA:
            self.add_real()

    def add_real(self):
        def bundle(*names):
            data = io.BytesIO()
            with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
                for name in names:
                    archive.write(DATA / name, pathlib.Path(name).name)
            return data.getvalue()

        bob = ["Bob.md5anim", "Bob.md5mesh", "guard1_body.png", "guard1_face.png", "guard1_helmet.png",
               "iron_grill.png", "round_grill.png"]
        self.files |= {
            "bunny.ply": (DATA / "scans/bunny/bun_zipper.ply").read_bytes,
            "bunny.stl": (DATA / "scans/bunny/bunny_69451.stl").read_bytes,
            "dragon.ply": (DATA / "scans/dragon/dragon_vrip_res2.ply").read_bytes,
            "buddha.obj": (DATA / "scans/buddha/buddha_100k.obj").read_bytes,
            "spot.zip": lambda: bundle("obj/spot/spot_triangulated.obj", "obj/spot/spot_texture.png"),
            "bob.zip": lambda: bundle(*["md5/bob/" + name for name in bob]),
            "fox.glb": (DATA / "gltf/CesiumMan.glb").read_bytes,
        }
        for name, size, more in (
                ("16", 16, {}), ("64", 64, {}), ("256", 256, {}), ("1024", 1024, {}), ("npy", 256, {"format": "npy"}),
                ("solid", 256, {"fill": "solid"}), ("solid 512", 512, {"fill": "solid"}), ("normals", 512, {"channels": "normal"}),
                ("distance", 128, {"channels": "distance"}), ("vox", 256, {"format": "vox"}),
                ("glb", 256, {"format": "glb"}), ("smooth", 256, {"format": "obj", "mesh": "smooth"}),
                ("schem", 128, {"format": "schem"}), ("npz", 512, {"format": "npz", "layout": "sparse"})):
            self.jobs.append((f"bunny {name}", "bunny.ply", "voxelize", {"size": size, **more}))
        self.jobs += [
            ("bunny.stl", "bunny.stl", "voxelize", {"size": 256}),
            ("dragon", "dragon.ply", "voxelize", {"size": 1024}),
            ("dragon solid", "dragon.ply", "voxelize", {"size": 256, "fill": "solid"}),
            ("buddha", "buddha.obj", "voxelize", {"size": 512}),
            ("spot", "spot.zip", "voxelize", {"size": 256}),
            ("spot 1024", "spot.zip", "voxelize", {"size": 1024}),
            ("spot picture", "spot.zip", "render", {"size": 256}),
            ("spot GIF", "spot.zip", "render", {"size": 128, "image": "gif", "turntable": 36}),
            ("spot facts", "spot.zip", "inspect", {}),
            ("bob", "bob.zip", "voxelize", {"size": 64, "animation": "0"}),
            ("fox", "fox.glb", "voxelize", {"size": 128, "animation": "0", "fps": 12}),
        ]


def end_of(daemon, job, seconds):
    """The last state of a job, which is cancelled after so many seconds."""
    deadline = time.monotonic() + seconds
    while not (status := daemon.get(f"/v1/jobs/{job}", headers={"Prefer": "wait=1"}).json())["ended_ms"]:
        if time.monotonic() > deadline:
            return daemon.cancel(job)
    return status


def longest_of(daemon, job):
    """(stage, milliseconds) as the job's workers report them."""
    found = [("", 0)]
    for line in daemon.log_tail(10_000_000).splitlines():
        if "a cancellation point came late" in line and job in line:
            found.append((re.search(r"stage\W+(\w+)", line)[1], float(re.search(r"\bms\W+([\d.]+)", line)[1])))
    return max(found, key=lambda one: one[1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("--only", nargs="*")
    arguments = parser.parse_args()
    with daemon_with_fixtures(arguments.device, ["--workers-per-device", "1"]) as (daemon, fixtures):
        cases = Cases(fixtures)
        assets, jobs = {}, []
        for name, file, kind, options in cases.jobs:
            if arguments.only and name not in arguments.only:
                continue
            if file not in assets:
                assets[file] = daemon.post(f"/v1/assets?filename={file}", cases.files[file]()).json()["id"]
            body = {"kind": kind, "asset": assets[file], "options": {**options, "cache": "no"} if options else {}}
            estimate = daemon.post("/v1/jobs?dry_run=1", body)
            assert estimate.status == 200, (name, estimate.body)
            jobs.append((name, body, estimate.json()["estimate"]["seconds"]))
        print(f"{'job':14} {'state':9} {'expected s':>10} {'took s':>8}   {'stage':10} {'ms':>6}")
        for name, body, expected in jobs:
            status = end_of(daemon, daemon.submit(**body), arguments.seconds)
            stage, ms = longest_of(daemon, status["id"])
            took = (status["ended_ms"] - status["started_ms"]) / 1e3
            error = status.get("error", {}).get("detail", "")
            print(f"{name:14} {status['state']:9} {expected:10.2f} {took:8.2f}   {stage:10} {f'{ms:.0f}' if ms else '-':>6}"
                  f"  {error}", flush=True)


if __name__ == "__main__":
    main()
