#!/usr/bin/env python3
"""Throughput of an animation's job, its parts per frame, and what separate requests would take.

  /usr/bin/python3 tests/bench/animation.py ASSET [--bin build/bench/bin] [--animation 0] [--sizes 128,256] [--device cpu]
                   [--pipeline cpu] [--runs 3] [--separate 12] [--set NAME=VALUE ...]
  /usr/bin/python3 tests/bench/animation.py ASSET --hashes llvmpipe,lavapipe,osmesa [--sizes 128] [--frames 0..19]

Starts a daemon of its own; ASSET is a file or a folder, which is zipped. Prints for each size the median
of the runs after one that warms up: frames per second of the whole job (from its start to its end, with the
result written as a native sequence), milliseconds per frame of its stages and of the passes of
voxelizing (those run beside encoding, so that the stages say what is waited for), bytes per frame as
stored containers, in the sequence and in npz. `--separate` frames are also voxelized by a request of
their own each, in the same box, to tell the ratio. Times are for reading beside each other, never for
passing a test. With `--hashes` nothing is timed: the frames' content hashes by every pipeline of every
device are compared, and the exit status is 1 when one differs.
"""
import argparse
import io
import json
import pathlib
import statistics
import sys
import time
import urllib.error
import urllib.request
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from suite_parts.programs import Daemon, Programs  # noqa: E402


def call(url, body=None, headers=None):
    request = urllib.request.Request(url, data=body, headers=headers or {})
    try:
        with urllib.request.urlopen(request, timeout=600) as response:
            return response.read()
    except urllib.error.HTTPError as error:
        raise RuntimeError(f"{url}: {error.code}: {error.read()[:500].decode(errors='replace')}") from error


def asset_bytes(path):
    if path.is_file():
        return path.name, path.read_bytes()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as file:
        for entry in sorted(p for p in path.rglob("*") if p.is_file()):
            file.write(entry, entry.relative_to(path))
    return path.name + ".zip", packed.getvalue()


def run_job(url, job):
    """The job's status when it is done, and the seconds from its submission."""
    begin = time.perf_counter()
    told = json.loads(call(f"{url}/v1/jobs", json.dumps(job).encode(), {"Content-Type": "application/json"}))
    while told["state"] in ("queued", "running"):
        told = json.loads(call(f"{url}/v1/jobs/{told['id']}", headers={"Prefer": "wait=30"}))
    if told["state"] != "done":
        raise RuntimeError(json.dumps(told.get("error", told)))
    return told, time.perf_counter() - begin


def job_of(asset, options):
    return {"kind": "voxelize", "asset": asset, "options": {**options, "cache": "no"}}


def measure(url, asset, options, runs):
    results = []
    for _ in range(runs + 1):
        told, seconds = run_job(url, job_of(asset, options))
        results.append((seconds, told))
    results = sorted(results[1:], key=lambda result: result[0])
    return results[len(results) // 2]


def separate(url, asset, options, times, meta):
    """Median seconds of requests for single times in the animation's box."""
    low, size = meta["origin"], meta["voxel_size"]
    high = [o + s * d for o, s, d in zip(low, size, meta["dims"])]
    box = {**{k: v for k, v in options.items() if k != "size"}, "dims": ",".join(map(str, meta["dims"])),
           "bounds": ",".join(repr(v) for v in low + high)}
    return statistics.median(run_job(url, job_of(asset, {**box, "time": t}))[1] for t in times)


def report(size, seconds, told, alone, sizes):
    meta = told["result"]["meta"]
    frames = meta["frames"]
    print(f"\n### {size}: {'x'.join(map(str, meta['dims']))}, {frames} frames by {meta['pipeline']}\n")
    print(f"{frames / seconds:.1f} frames/s ({1e3 * seconds / frames:.1f} ms a frame, whole job)")
    parts = {**told["timings"], **{f"pass {k}": v for k, v in meta["passes_ms"].items()}}
    print("ms a frame: " + ", ".join(f"{k} {v / frames:.2f}" for k, v in parts.items()))
    if alone:
        print(f"by a request for each frame: {1e3 * alone:.1f} ms, {alone * frames / seconds:.1f} times as long")
    print("bytes a frame: " + ", ".join(f"{k} {v / frames:.0f}" for k, v in sizes.items()))


def stored_bytes(url, told):
    job = told["id"]
    frames = json.loads(call(f"{url}/v1/jobs/{job}/frames"))
    grids = {frame["grid"] for frame in frames["frames"]}
    return frames, {
        "containers": sum(len(call(f"{url}/v1/grids/{grid}")) for grid in grids),
        "sequence": len(call(f"{url}/v1/jobs/{job}/result")),
        "npz": len(call(f"{url}/v1/sequences/{frames['sequence']}?format=npz"))}


def frame_hashes(programs, device, name, body, options, pipelines):
    """By pipeline: the content hashes of all frames."""
    with Daemon(programs, device) as daemon:
        asset = json.loads(call(f"{daemon.url}/v1/assets?filename={name}", body))["id"]
        hashes = {}
        for pipeline in pipelines:
            told, _ = run_job(daemon.url, job_of(asset, {**options, "pipeline": pipeline}))
            listed = json.loads(call(f"{daemon.url}/v1/jobs/{told['id']}/frames"))
            hashes[pipeline] = [frame["content_hash"] for frame in listed["frames"]]
        return hashes


def compare_hashes(programs, devices, name, body, options):
    """Prints a table; whether all are equal."""
    expected = frame_hashes(programs, "cpu", name, body, options, ["cpu"])["cpu"]
    print(f"\n{name}, {options}: {len(expected)} frames, {len(set(expected))} different ones\n")
    print("| device | pipeline | frames | equal to cpu |\n|---|---|---|---|")
    all_equal = len(expected) > 0
    for device in devices:
        for pipeline, found in frame_hashes(programs, device, name, body, options,
                                            ["cpu", "compute", "raster"]).items():
            equal = sum(a == b for a, b in zip(found, expected))
            all_equal = all_equal and found == expected
            print(f"| {device} | {pipeline} | {len(found)} | {equal} |", flush=True)
    return all_equal


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("asset", type=pathlib.Path)
    parser.add_argument("--bin", default=HERE.parents[1] / "build/bench/bin", help="folder of voxeld")
    parser.add_argument("--animation", default="0")
    parser.add_argument("--sizes", default="128,256")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--pipeline", default="cpu")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--separate", type=int, default=12)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--hashes", default="", metavar="DEVICES")
    parser.add_argument("--frames", default="", help="with --hashes: of the animation, as 0..19")
    args = parser.parse_args()
    name, body = asset_bytes(args.asset)
    settings = dict(pair.split("=", 1) for pair in args.set)
    programs = Programs(args.bin, 3600)
    if args.hashes:
        frames = {"frames": args.frames} if args.frames else {}
        sys.exit(not all([compare_hashes(
            programs, args.hashes.split(","), name, body,
            {"animation": args.animation, "size": int(size), **frames, **settings})
            for size in args.sizes.split(",")]))
    with Daemon(programs, args.device) as daemon:
        asset = json.loads(call(f"{daemon.url}/v1/assets?filename={name}", body))["id"]
        for size in args.sizes.split(","):
            options = {"animation": args.animation, "size": int(size), "pipeline": args.pipeline,
                       **settings}
            seconds, told = measure(daemon.url, asset, options, args.runs)
            frames, sizes = stored_bytes(daemon.url, told)
            every = max(1, len(frames["frames"]) // max(1, args.separate))
            times = [frame["time_s"] for frame in frames["frames"]][::every] if args.separate else []
            alone = separate(daemon.url, asset, options, times, told["result"]["meta"]) if times else None
            report(size, seconds, told, alone, sizes)


if __name__ == "__main__":
    main()
