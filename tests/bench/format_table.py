#!/usr/bin/python3
"""Bytes, time and memory of a stored grid in every format, as a Markdown table.

    tests/bench/format_table.py MESH... [--sizes 256,1024] [--channels color] [--rounds 3] [--formats vdb,glb]

Each mesh is voxelized once for each size; then the grid is asked for in each format, not from the cache. Columns: bytes
of the file; the median time in milliseconds of a request, from its first byte to the last one of the file; the highest
resident memory of the worker in MiB. A format that refuses the grid says why. VOXELD_BIN_DIR chooses the daemon."""
import argparse
import pathlib
import re
import statistics
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "integration"))
from harness import ROOT, Daemon  # noqa: E402  (needs the path above)


def all_formats():
    return re.findall(r'X\(k\w+, "(\w+)"', (ROOT / "proto/output_format.h").read_text())


def grid_of(daemon, mesh, size, channels):
    asset = daemon.upload(mesh)
    job = daemon.submit(kind="voxelize", asset=asset, options={"size": size, "channels": channels.split(",")})
    status = daemon.wait(job, seconds=600)
    if status["state"] != "done":
        sys.exit(f"{mesh} at {size}: {status['error']}")
    return status["result"]["grid"], status["result"]["meta"]


def export(daemon, grid, name):
    """Milliseconds, bytes and MiB; or the reason of a refusal."""
    begin = time.perf_counter()
    job = daemon.submit(kind="export", grid=grid, options={"format": name, "cache": "no"})
    status = daemon.wait(job, seconds=600)
    if status["state"] != "done":
        return status["error"]["detail"]
    body = daemon.get(f"/v1/jobs/{job}/result", timeout=600).body
    milliseconds = (time.perf_counter() - begin) * 1e3
    daemon.request("DELETE", f"/v1/jobs/{job}")
    return milliseconds, len(body), status["result"]["meta"].get("host_bytes_peak", 0) / 2**20


def tabulate(daemon, arguments):
    for mesh in arguments.mesh:
        for size in map(int, arguments.sizes.split(",")):
            grid, meta = grid_of(daemon, mesh, size, arguments.channels)
            print(f"\n{pathlib.Path(mesh).name} at {size}, {arguments.channels}: {meta['voxel_count']:,} voxels\n")
            print("| format | bytes | ms | MiB |\n|---|---|---|---|")
            for name in arguments.formats.split(",") if arguments.formats else all_formats():
                rounds = [export(daemon, grid, name) for _ in range(arguments.rounds)]
                if isinstance(rounds[0], str):
                    print(f"| `{name}` | {rounds[0]} | | |", flush=True)
                    continue
                milliseconds, sizes, peaks = zip(*rounds)
                print(f"| `{name}` | {sizes[0]:,} | {statistics.median(milliseconds):.0f} | {max(peaks):.0f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mesh", nargs="+")
    parser.add_argument("--sizes", default="256,1024")
    parser.add_argument("--channels", default="color")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--formats", default="")
    arguments = parser.parse_args()
    daemon = Daemon(device="cpu")
    try:
        tabulate(daemon, arguments)
    finally:
        daemon.stop()


if __name__ == "__main__":
    main()
