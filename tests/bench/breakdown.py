#!/usr/bin/env python3
"""Where the time of one request goes: whole process and server-side stages, as a Markdown table.

  /usr/bin/python3 tests/bench/breakdown.py MESH [--sizes 128,256,512,1024] [--device llvmpipe]
                   [--pipeline auto] [--format npy] [--channels occupancy] [--runs 5]

Starts a daemon of its own; each row is the median of the runs after one that warms up, with the cache
of results off. "client" is what curl measures from the first byte sent to the last received; the
stages come from Server-Timing. Times are for reading beside each other, never for passing a test.
"""
import argparse
import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from suite_parts.programs import Daemon, Programs, Skipped  # noqa: E402


def server_timing(header):
    stages = {}
    for part in (header or "").split(","):
        name, _, duration = part.strip().partition(";dur=")
        if duration:
            stages[name] = float(duration)
    return stages


def request(url, mesh, query, keep=None):
    """Milliseconds at the client, those of the stages, and bytes of the response.

    keep: a file that the response is copied to.
    Raises RuntimeError with the daemon's words, OSError where there is no curl.
    """
    with tempfile.NamedTemporaryFile() as body, tempfile.NamedTemporaryFile() as head:
        out = subprocess.run(
            ["curl", "-sS", "-o", body.name, "-D", head.name, "-w", "%{http_code} %{time_total}",
             "--data-binary", f"@{mesh}", f"{url}/v1/voxelize?{query}"],
            check=False, capture_output=True, text=True).stdout.split()
        headers = {}
        for line in open(head.name):
            name, _, value = line.partition(":")
            headers[name.strip().lower()] = value.strip()
        if not out or out[0] != "200":
            text = open(body.name, errors="replace").read()[:500]
            raise RuntimeError(f"{query}: {out[0] if out else 'no response'}: {text}")
        if keep:
            shutil.copyfile(body.name, keep)
        return float(out[1]) * 1e3, server_timing(headers.get("server-timing")), os.path.getsize(body.name)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("mesh")
    parser.add_argument("--sizes", default="128,256,512,1024")
    parser.add_argument("--device", default="llvmpipe")
    parser.add_argument("--pipeline", default="auto")
    parser.add_argument("--format", default="npy")
    parser.add_argument("--channels", default="occupancy")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--bin", default=HERE.parents[1] / "build/bench/bin",
                        help="where voxeld is")
    arguments = parser.parse_args()
    programs = Programs(arguments.bin, limit_seconds=900)
    try:
        tabulate(arguments, programs)
    except (RuntimeError, Skipped) as reason:
        sys.exit(str(reason))
    finally:
        programs.close()


def tabulate(arguments, programs):
    with Daemon(programs, arguments.device) as daemon:
        rows, names = [], []
        for size in arguments.sizes.split(","):
            query = (f"size={size}&format={arguments.format}&pipeline={arguments.pipeline}&cache=no"
                     f"&channels={arguments.channels}&filename={os.path.basename(arguments.mesh)}")
            runs = [request(daemon.url, arguments.mesh, query) for _ in range(arguments.runs + 1)][1:]
            for run in runs:
                names += [name for name in run[1] if name not in names]
            rows.append((size, runs))
        print(f"{os.path.basename(arguments.mesh)}, {arguments.device}, {arguments.pipeline}, "
              f"{arguments.format}, {arguments.channels}: milliseconds, median of {arguments.runs}\n")
        print("| size | client | " + " | ".join(names) + " | bytes |")
        print("|---" * (len(names) + 3) + "|")
        for size, runs in rows:
            cells = [f"{statistics.median(run[0] for run in runs):.0f}"]
            cells += [f"{statistics.median(run[1].get(name, 0) for run in runs):.1f}" for name in names]
            print(f"| {size} | " + " | ".join(cells) + f" | {runs[-1][2]} |")


if __name__ == "__main__":
    main()
