#!/usr/bin/env python3
"""The cost of worker isolation: one-shots of a small mesh by tenants in turn, under none, tenant and task.

  tests/bench/worker_isolation.py [--bin DIR] [--device D ...] [--rounds N] [--tenants N ...] [--pause SECONDS]

The daemons run beside each other and are asked in turn, so that the machine's noise is the same for all. Prints
the median and the 95th percentile in milliseconds, their difference to `none`, how many workers were replaced,
and the seconds in which a job that was next waited for a fresh worker."""
import argparse
import os
import pathlib
import re
import statistics
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/integration"))

MODES = ("none", "tenant", "task")


def metric(daemon, name):
    text = daemon.daemon.request("GET", "/metrics", port=daemon.daemon.admin_port).body.decode()
    return sum(float(value) for value in re.findall(rf"^{name}\{{[^}}]*\}} (\S+)$", text, re.M))


def percentile(values, part):
    return sorted(values)[min(len(values) - 1, int(len(values) * part))]


def measure(device, tenant_count, rounds, pause):
    from harness import TenantsDaemon
    names = [f"t{i}" for i in range(tenant_count)]
    daemons = {mode: TenantsDaemon({name: 1 for name in names}, device, ["--worker-isolation", mode])
               for mode in MODES}
    times_ms = {mode: [] for mode in MODES}
    try:
        mesh = (daemons["none"].fixtures / "sample.ply").read_bytes()
        time.sleep(3)  # all processes have opened their device
        for number in range(rounds):
            for name in names:
                for mode in MODES:
                    begin = time.monotonic()
                    response = daemons[mode].tenants[name].post(
                        "/v1/voxelize?size=32&cache=no&filename=a.ply", mesh)
                    if response.status != 200:
                        sys.exit(f"{mode}: {response.status} {response.body[:200]}")
                    if number > 0:  # the first round fills caches of files and pages
                        times_ms[mode].append((time.monotonic() - begin) * 1000)
                time.sleep(pause)
        base = statistics.median(times_ms["none"])
        for mode in MODES:
            times = times_ms[mode]
            print(f"{device:9} {tenant_count} tenants, {mode:6} median {statistics.median(times):6.1f} ms "
                  f"(+{statistics.median(times) - base:5.1f})   p95 {percentile(times, 0.95):6.1f} ms   "
                  f"replaced {metric(daemons[mode], 'voxeld_worker_replacements_total'):4.0f} in "
                  f"{rounds * tenant_count}   waited "
                  f"{metric(daemons[mode], 'voxeld_fresh_worker_wait_seconds_total'):5.2f} s", flush=True)
    finally:
        for daemon in daemons.values():
            daemon.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--bin", default=str(ROOT / "build/dev/bin"))
    parser.add_argument("--device", nargs="+", default=["cpu", "llvmpipe"])
    parser.add_argument("--tenants", nargs="+", type=int, default=[2, 6])
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--pause", type=float, default=0.3, help="seconds after a request of each daemon")
    arguments = parser.parse_args()
    os.environ["VOXELD_BIN_DIR"] = arguments.bin
    for device in arguments.device:
        for tenant_count in arguments.tenants:
            measure(device, tenant_count, arguments.rounds, arguments.pause)


if __name__ == "__main__":
    main()
