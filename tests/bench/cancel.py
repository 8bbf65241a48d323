#!/usr/bin/python3
"""How long a cancel takes in each stage.

    tests/bench/cancel.py [--rounds 10] [--device cpu]

Cancels jobs that parse, decode textures, voxelize and export, at times spread over the stage, and prints the
median and the largest time from the request to the job's end, in milliseconds. VOXELD_BIN_DIR chooses the daemon."""
import argparse
import pathlib
import statistics
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "integration"))
from harness import daemon_with_fixtures  # noqa: E402  (needs the path above)
from test_cancel import CancelLoad  # noqa: E402


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--device", default="cpu")
    arguments = parser.parse_args()
    with daemon_with_fixtures(arguments.device, ["--workers-per-device", "1"]) as (daemon, fixtures):
        load = CancelLoad(fixtures)
        for case in load.cases:
            times = []
            for i in range(arguments.rounds):
                ms, status = load.cancel_ms(daemon, case, 0.8 * i / arguments.rounds)
                if status["state"] == "cancelled":  # not where it was done before
                    times.append(ms)
            print(f"{case:9} {len(times):3d} cancels: median {statistics.median(times):6.0f} ms, "
                  f"at most {max(times):6.0f} ms", flush=True)


if __name__ == "__main__":
    main()
