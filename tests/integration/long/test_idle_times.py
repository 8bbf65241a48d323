"""Requests keep a daemon of --exit-when-idle up."""
import time
import unittest

import test_private_daemon

IDLE_SECONDS = 5


class Idle(test_private_daemon.IdleDaemonTest):
    def test_it_ends_so_long_after_the_last_request(self):
        self.start(IDLE_SECONDS)
        end = time.monotonic() + 2 * IDLE_SECONDS
        while time.monotonic() < end:
            self.assertEqual(self.request("GET", "/v1/jobs")[0], 200)
            time.sleep(0.5)
        self.assert_ends()


if __name__ == "__main__":
    unittest.main()
