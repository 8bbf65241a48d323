"""Nothing grows with what the daemon has done: the short form of tests/bench/soak.py."""
import unittest

from soak_load import Soak, differences

ROUNDS = 3
SECONDS = 8
# malloc keeps what it has had; a request that left 1 KB would show as more in the long form.
GATEWAY_GROWTH_KB_MAX = 16 * 1024


class SoakTest(unittest.TestCase):
    def test_memory_descriptors_and_threads_are_flat(self):
        with Soak() as soak:
            facts = [soak.run_round(number, SECONDS) for number in range(ROUNDS)]
            print(*facts, soak.responses, sep="\n")
            self.assertEqual(soak.wrong[:10], [])
            self.assertGreater(soak.responses[200], 100)
            # The first round opens what stays: the database's readers, threads of the pool.
            before, after = facts[-2], facts[-1]
            self.assertEqual(differences(before, after), [])
            self.assertLess(after["gateway"]["rss_kb"] - before["gateway"]["rss_kb"],
                            GATEWAY_GROWTH_KB_MAX)


if __name__ == "__main__":
    unittest.main()
