#!/usr/bin/env python3
"""How tenants share one device: their shares by weight, and small jobs beside another's giant ones.

  VOXELD_BIN_DIR=build/dev/bin /usr/bin/python3 tests/bench/fairness.py [--device cpu] [--seconds 60]
                                                [--giant-size 6144] [--only shares|waits|many]

Shares: three tenants of weights 1, 2 and 4 with a giant job each, for so many seconds; the exit status
is 1 where one's share is more than 5 % off its weight's. Waits: one tenant has three giant jobs queued,
another submits a small one every quarter of a second; time from acceptance to its end, by --scheduler
fair and fifo of the same build. Many: six tenants with a giant job each on three workers, without and with
small jobs of a seventh one beside them; 25 % off is a failure there, as a worker's time between two
preemptions is a twentieth of a minute's contention, and two thirds of what the smallest tenant is due.
"""
import argparse
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "integration"))
from fairness_load import GIANT, LONG, many_tenants, percentile, shares, waits  # noqa: E402

OFF_MAX = 0.05
OFF_MANY_MAX = 0.25


def measure_shares(seconds, device):
    weights = {"one": 1, "two": 2, "four": 4}
    had = shares(weights, seconds, LONG, device)
    total, all_weights = sum(had.values()), sum(weights.values())
    print(f"\nShares of {device} over {seconds:g} s\n")
    print(f"{'tenant':8}{'weight':>8}{'device s':>12}{'share':>10}{'of weight':>12}{'off':>9}")
    worst = 0.0
    for name, weight in weights.items():
        share, due = had[name] / total, weight / all_weights
        worst = max(worst, abs(share / due - 1))
        print(f"{name:8}{weight:8}{had[name] / 1000:12.2f}{share:10.2%}{due:12.2%}{share / due - 1:9.2%}")
    return worst <= OFF_MAX


def measure_many(seconds, device):
    weights = {"one-a": 1, "one-b": 1, "two-a": 2, "two-b": 2, "four-a": 4, "four-b": 4}
    print(f"\nSix tenants with giant jobs on three workers of {device}, {seconds:g} s\n")
    print(f"{'tenant':8}{'weight':>8}{'device s':>12}{'share':>10}{'of weight':>12}{'off':>9}{'preempted':>8}")
    had, preempted, _ = many_tenants(weights, seconds, GIANT, small_every_s=seconds, device=device)
    total, worst = sum(had.values()), 0.0
    for name, weight in weights.items():
        share, due = had[name] / total, weight / sum(weights.values())
        worst = max(worst, abs(share / due - 1))
        print(f"{name:8}{weight:8}{had[name] / 1000:12.2f}{share:10.2%}{due:12.2%}{share / due - 1:9.2%}"
              f"{preempted[name]:8}", flush=True)
    had, preempted, ended = many_tenants(weights, seconds / 2, GIANT, device=device)
    print(f"\nSmall jobs of a seventh tenant meanwhile: {len(ended)}, p50 {percentile(ended, 0.5):.3f} s, "
          f"p99 {percentile(ended, 0.99):.3f} s, longest {ended[-1]:.3f} s; "
          f"giants preempted {sum(preempted.values())} times")
    return worst <= OFF_MANY_MAX


def measure_waits(seconds, device, size):
    print(f"\nSmall jobs beside three giant ones ({size} voxels to a side) of another tenant\n")
    print(f"{'scheduler':10}{'jobs':>6}{'p50 s':>10}{'p99 s':>10}{'max s':>10}{'giants s':>10}")
    for scheduler in ("fair", "fifo"):
        ended, giants = waits(scheduler, seconds, {**GIANT, "size": size}, device=device)
        print(f"{scheduler:10}{len(ended):6}{percentile(ended, 0.5):10.3f}"
              f"{percentile(ended, 0.99):10.3f}{ended[-1]:10.3f}{giants:10.1f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--giant-size", type=int, default=6144)
    parser.add_argument("--only", choices=("shares", "waits", "many"))
    args = parser.parse_args()
    good = True
    if args.only in (None, "shares"):
        good = measure_shares(args.seconds, args.device)
    if args.only in (None, "many"):
        good = measure_many(args.seconds, args.device) and good
    if args.only in (None, "waits"):
        measure_waits(args.seconds / 4, args.device, args.giant_size)
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
