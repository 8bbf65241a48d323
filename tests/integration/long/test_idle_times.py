"""Requests keep a daemon of --exit-when-idle up, and comments the connection of a stream without events."""
import http.client
import time
import unittest

import test_private_daemon
from harness import HANG_SECONDS, DaemonTest

IDLE_SECONDS = 5


class Idle(test_private_daemon.IdleDaemonTest):
    def test_it_ends_so_long_after_the_last_request(self):
        self.start(IDLE_SECONDS)
        end = time.monotonic() + 2 * IDLE_SECONDS
        while time.monotonic() < end:
            self.assertEqual(self.request("GET", "/v1/jobs")[0], 200)
            time.sleep(0.5)
        self.assert_ends()


class Silence(DaemonTest):
    device = "cpu"
    arguments = ("--workers-per-device", "1")

    def test_a_stream_without_events_gets_comments(self):
        job = {"kind": "voxelize", "asset": self.daemon.upload(self.fixtures / "sheets.obj"),
               "options": {"size": 16384, "channels": "occupancy", "cache": "no"}}  # minutes
        self.daemon.wait_state(self.daemon.submit(**job), "running")
        connection = http.client.HTTPConnection("127.0.0.1", self.daemon.port, timeout=HANG_SECONDS)
        self.addCleanup(connection.close)
        connection.request("GET", f"/v1/jobs/{self.daemon.submit(**job)}/events")
        stream = connection.getresponse()
        event = [stream.readline() for _ in range(4)]
        self.assertEqual((event[1], event[3]), (b"event: state\n", b"\n"))
        self.assertEqual([stream.readline() for _ in range(3)], [b": ping\n", b"\n", b": ping\n"])


if __name__ == "__main__":
    unittest.main()
