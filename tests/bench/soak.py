#!/usr/bin/env python3
"""A mixed load for minutes or days, and whether memory, descriptors, threads and files stay flat.

  tests/bench/soak.py [--bin DIR] [--minutes M] [--rounds N] [--device D] [--seed S] [--no-kills]

Each round is load and then rest, until all that was made has expired; the facts of each rest are
printed as a line of JSON. Ends with 1 where the last rest has more descriptors, threads or files than
the second, or more than 8 MB and 10% more memory in the gateway or the largest worker."""
import argparse
import json
import os
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/integration/long"), str(ROOT / "tests/integration")]

SLACK_KB = 8 * 1024
SLACK_PART = 1.1


def grown(differences, before, after):
    """Texts of the resources that have grown at the second rest."""
    found = differences(before, after)
    for name, was, now in (("gateway", before["gateway"]["rss_kb"], after["gateway"]["rss_kb"]),
                           ("workers", max(before["workers_rss_kb"]), max(after["workers_rss_kb"])),
                           ("files", before["data_bytes"] // 1024, after["data_bytes"] // 1024)):
        if now > was * SLACK_PART + SLACK_KB:
            found.append(f"{name}: {was} KB became {now} KB")
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--bin", default=str(ROOT / "build/dev/bin"))
    parser.add_argument("--minutes", type=float, default=10, help="of load, all rounds together")
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--no-kills", action="store_true", help="let workers live")
    arguments = parser.parse_args()
    os.environ["VOXELD_BIN_DIR"] = arguments.bin
    from soak_load import Soak, differences
    with Soak(arguments.device, arguments.seed, not arguments.no_kills) as soak:
        facts = []
        for number in range(arguments.rounds):
            facts.append(soak.run_round(number, arguments.minutes * 60 / arguments.rounds))
            print(json.dumps(facts[-1]), flush=True)
        print(json.dumps({"responses": soak.responses, "wrong": len(soak.wrong)}))
        for line in soak.wrong[:20]:
            print("WRONG", line)
    found = grown(differences, facts[min(1, len(facts) - 1)], facts[-1])
    print(*(found or ["flat"]), sep="\n")
    return 1 if found or soak.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
