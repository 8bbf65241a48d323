"""How soon calls of the Python package end that are cancelled or have a timeout."""
import threading
import time
import unittest

import test_python
import test_python_transport
import voxeld
from test_python_transport import DONE, Script, json_response

CANCEL_SECONDS_MAX = 5


class Calls(test_python.CallsTest):
    def test_a_token_ends_a_call_at_once(self):
        self.assertLess(self.cancel_by_token(), 1)

    def test_a_timeout_ends_a_call(self):
        start = time.monotonic()
        self.problem(voxeld.Timeout, "timeout", "longer than 0.6 s", of=lambda: self.client.voxelize(
            self.sample, timeout=0.6, **test_python.LONG))
        self.assertLess(time.monotonic() - start, 0.6 + CANCEL_SECONDS_MAX)


class Async(test_python.AsyncTest):
    def test_a_cancelled_task_ends_at_once(self):
        for cancelled in (self.cancelled_voxelize, self.cancelled_animate):
            state, seconds = cancelled()
            self.assertEqual(state, "cancelled")
            self.assertLess(seconds, CANCEL_SECONDS_MAX)


class Transport(test_python_transport.TransportTest):
    def test_a_timeout_while_it_submits_cancels_the_job_that_it_may_have_made(self):
        script = self.script(json_response({"id": "sha256-a"}, 201), Script.SILENCE,
                             json_response({**DONE, "state": "running"}), json_response({}, 202))
        threading.Timer(4, script.ended.set).start()  # after the timeout, and before the request to cancel has one
        self.raised(voxeld.Timeout, "timeout", lambda: self.client.voxelize(b"solid", timeout=2))
        self.assertEqual(script.lines()[1:], ["POST /v1/jobs", "POST /v1/jobs", "DELETE /v1/jobs/j-1"])
        self.assertEqual(script.header("Idempotency-Key", 1), script.header("Idempotency-Key", 2))


if __name__ == "__main__":
    unittest.main()
