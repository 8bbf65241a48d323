"""A hostile tenant harms no other: the short form of tests/bench/siege.py."""
import unittest

from siege_load import Siege

SECONDS = 10
# The gateway takes some 140 MB at rest; the bytes that responses hold are bounded.
GATEWAY_KB_MAX = 512 * 1024


class SiegeTest(unittest.TestCase):
    def test_honest_clients_are_served_and_the_gateway_stays_small(self):
        with Siege() as siege:
            siege.prepare()
            facts = siege.run_phase("siege", SECONDS, Siege.ATTACKS)
            print(facts)
            self.assertEqual(siege.wrong[:10], [])
            for what in ("one-shot", "upload", "list", "look"):
                self.assertGreater(facts["ms"][what]["count"], 0, what)
            # Each attack did something, or this test shows nothing.
            self.assertEqual(set(facts["hostile"]), {attack.__name__ for attack in Siege.ATTACKS})
            mistakes = {"AssertionError", "KeyError", "JSONDecodeError"}  # of the attack itself
            self.assertEqual([attack for attack, seen in facts["hostile"].items() if set(seen) <= mistakes], [])
            self.assertLess(facts["gateway_most_kb"], GATEWAY_KB_MAX)


if __name__ == "__main__":
    unittest.main()
