#!/usr/bin/env python3
"""A hostile tenant beside three honest ones: how long honest clients wait, and what the gateway holds.

  tests/bench/siege.py [--bin DIR] [--minutes M] [--rounds N] [--attack NAME ...] [--device D] [--seed S]

A calm phase, N rounds of the siege, and a calm phase again; each prints a line of JSON with percentiles in
milliseconds, the gateway's memory and the disk that the data takes. Ends with 1 where an honest client got what it
should not, or the gateway took more than 512 MB."""
import argparse
import json
import os
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/integration/long"), str(ROOT / "tests/integration")]

GATEWAY_KB_MAX = 512 * 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--bin", default=str(ROOT / "build/dev/bin"))
    parser.add_argument("--minutes", type=float, default=10, help="of all phases together")
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--attack", action="append", default=[], help="only these; default: all")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    os.environ["VOXELD_BIN_DIR"] = arguments.bin
    from siege_load import Siege
    attacks = [attack for attack in Siege.ATTACKS
               if not arguments.attack or attack.__name__ in arguments.attack]
    unknown = set(arguments.attack) - {attack.__name__ for attack in attacks}
    if unknown:
        known = ", ".join(attack.__name__ for attack in Siege.ATTACKS)
        parser.error(f"no attack {sorted(unknown)}; there are {known}")
    seconds = arguments.minutes * 60 / (arguments.rounds + 2)
    most_kb = 0
    with Siege(arguments.device, arguments.seed) as siege:
        siege.prepare()
        for number in range(arguments.rounds + 2):
            calm = number in (0, arguments.rounds + 1)
            facts = siege.run_phase("calm" if calm else "siege", seconds, () if calm else attacks)
            most_kb = max(most_kb, facts["gateway_most_kb"])
            print(json.dumps(facts), flush=True)
        for line in siege.wrong[:20]:
            print("WRONG", line)
        wrong = len(siege.wrong)
    print(f"honest clients: {wrong} wrong responses; gateway: at most {most_kb} KB")
    return 1 if wrong or most_kb > GATEWAY_KB_MAX else 0


if __name__ == "__main__":
    sys.exit(main())
