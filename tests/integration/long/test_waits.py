"""Requests that wait hold no thread, little memory and no other tenant, however many there are."""
import time
import unittest

from waits_load import CROWD, LARGE, OTHER, SMALL, Crowd, await_readable, raise_descriptors, readable, resident_kb

STREAMS, ONE_SHOTS = 2000, 5000
KB_PER_REQUEST_MAX = 32
# More jobs than the queue takes by default, of which one tenant may have half.
ARGUMENTS = ["--queued-jobs-max", "20000"]


class Waits(unittest.TestCase):
    def test_thousands_of_streams_and_one_shots_wait_in_little_memory(self):
        # Two descriptors for each connection, of which three tenants may have three quarters.
        if raise_descriptors() < 2 * (STREAMS + ONE_SHOTS) * 4 / 3 + 1000:
            self.skipTest("the hard limit on open files is too low for thousands of connections")
        with Crowd(arguments=ARGUMENTS) as crowd:
            crowd.small_things(3)
            pid = crowd.daemon.process.pid
            before = resident_kb(pid)
            one_shots = crowd.one_shots(ONE_SHOTS)
            crowd.streams(STREAMS)
            ended = crowd.await_crowd(STREAMS, one_shots)
            self.assertLess(ended, ONE_SHOTS // 2, "the crowd still waits")
            each = (resident_kb(pid) - before) / (STREAMS + ONE_SHOTS - ended)
            print(f"{each:.1f} KiB for each request that waits")
            self.assertLess(each, KB_PER_REQUEST_MAX)
            crowd.small_things(3)
            self.assertLessEqual({client.recv(12) for client in readable(one_shots, 0)}, {b"HTTP/1.1 200"})
            crowd.release()
            # Jobs of one-shots end with their clients.
            deadline = time.monotonic() + 120
            while crowd.queue()["queued"] > len(CROWD):
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.2)

    def test_another_tenants_one_shot_is_not_behind_hundreds_that_wait(self):
        with Crowd(arguments=ARGUMENTS) as crowd:
            crowd.small_things(2)
            clients = crowd.one_shots(500, CROWD[:1])
            crowd.await_queued(490)
            crowd.small_things(5)
            self.assertGreater(500 - len(readable(clients, 0)), 400, "the crowd still waits")

    def test_slow_uploads_polls_and_streams_of_one_tenant_delay_no_other(self):
        with Crowd(arguments=["--request-threads", "8"]) as crowd:
            crowd.small_things(2)
            blocker = crowd.one_shots(20)
            crowd.await_queued(20)
            one = CROWD[:1]
            crowd.slow_uploads(60, one)
            polls = crowd.polls(60, one)
            streams = crowd.streams(32, one)
            crowd.await_waiting(100)
            crowd.small_things(5)
            self.assertEqual(readable(polls, 0), [], "polls wait")
            await_readable(streams)  # they have begun
            self.assertGreater(len(blocker) - len(readable(blocker, 0)), 0)

    def test_deadlines_count_from_the_body_on(self):
        with Crowd() as crowd:
            crowd.one_shots(100, CROWD[:1])
            crowd.await_queued(90)
            late = crowd.one_shot(CROWD[0], f"{SMALL}&priority=-100&deadline_ms=1500")
            begin = time.monotonic()
            self.assertEqual(readable([late], 60), [late])
            self.assertGreater(time.monotonic() - begin, 1)
            text = late.recv(65536)
            self.assertTrue(text.startswith(b"HTTP/1.1 504 "), text[:200])
            self.assertIn(b"deadline-exceeded", text)

    def test_a_tenant_over_its_share_of_waits_gets_429(self):
        with Crowd(arguments=["--connections-max", "200"]) as crowd:
            crowd.one_shots(100, CROWD[:1])
            crowd.await_waiting(90)
            over = [crowd.one_shot(CROWD[0], LARGE) for _ in range(20)]
            self.assertIn(b"HTTP/1.1 429", {client.recv(12) for client in readable(over, 60)})
            response = crowd.tenants[OTHER].post(f"/v1/voxelize?{SMALL}", crowd.mesh)
            self.assertEqual(response.status, 200)


if __name__ == "__main__":
    unittest.main()
