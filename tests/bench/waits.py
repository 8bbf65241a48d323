#!/usr/bin/env python3
"""The cost of a crowd of waiting requests for the gateway and another tenant.

  tests/bench/waits.py [--bin DIR] [--rounds N] [--device D]

Prints a line of JSON for each crowd: milliseconds (p50, p99) of another tenant's small requests before and
during the crowd, the ratio of the p99s, and KiB of gateway memory for each request that waits. Each crowd is
measured beside its own idle phase, since machines are shared."""
import argparse
import json
import os
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/integration/long"), str(ROOT / "tests/integration")]


def summary(times):
    from waits_load import percentile
    return {what: {"p50": round(percentile(values, 0.5), 1), "p99": round(percentile(values, 0.99), 1)}
            for what, values in times.items()}


def measure(name, gather, rounds, device):
    from waits_load import Crowd, resident_kb
    with Crowd(device, ["--queued-jobs-max", "20000"]) as crowd:
        crowd.small_things(5)
        pid = crowd.daemon.process.pid
        idle = summary(crowd.small_things(rounds))
        before = resident_kb(pid)
        count = gather(crowd)
        each = (resident_kb(pid) - before) / max(count, 1)
        during = summary(crowd.small_things(rounds))
        ratio = {what: round(during[what]["p99"] / idle[what]["p99"], 2) for what in idle}
        print(json.dumps({"crowd": name, "waiting": count, "kib_each": round(each, 1), "idle_ms": idle,
                          "crowd_ms": during, "p99_ratio": ratio}), flush=True)


def five_hundred(crowd):
    from waits_load import CROWD
    crowd.one_shots(500, CROWD[:1])
    crowd.await_queued(495)
    return 500


def thousands(crowd):
    crowd.one_shots(5000)
    crowd.streams(2000)
    crowd.await_waiting(6950)
    return 7000


def slow(crowd):
    from waits_load import CROWD
    one = CROWD[:1]
    crowd.one_shots(20, one)
    crowd.await_queued(20)
    crowd.slow_uploads(60, one)
    crowd.polls(60, one)
    crowd.streams(32, one)
    crowd.await_waiting(100)
    return 172


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--bin", default=str(ROOT / "build/dev/bin"))
    parser.add_argument("--rounds", type=int, default=100)
    parser.add_argument("--device", default="cpu")
    arguments = parser.parse_args()
    os.environ["VOXELD_BIN_DIR"] = arguments.bin
    for name, gather in (("500 one-shots", five_hundred), ("60 slow uploads, 60 polls, 32 streams", slow),
                         ("5000 one-shots, 2000 streams", thousands)):
        measure(name, gather, arguments.rounds, arguments.device)


if __name__ == "__main__":
    main()
