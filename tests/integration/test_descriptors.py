"""Few descriptors and clients who take connections without a key or a word: jobs must not notice."""
import http.client
import pathlib
import resource
import shutil
import socket
import subprocess
import tempfile
import threading
import time
import unittest

from harness import BIN, HANG_SECONDS, Daemon, make_fixtures, wait_until

LIMIT = 256
CLIENTS = 1000
JOBS = 12
OWN_LIMIT = 2 * CLIENTS + 200  # of this process


class Crowd:
    """Clients that connect, say little and stay; those that are closed come back."""

    def __init__(self, port, path):
        self.port = port
        # Nothing; half a head; a head without its small body; a download that is not taken.
        self.words = (b"", b"GET / HTTP/1.1\r\nHost: loc", b"POST /v1/assets HTTP/1.1\r\nHost: localhost\r\n"
                      b"Content-Length: 100\r\n\r\n", f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        self.ended = threading.Event()
        self.clients = {}
        self.refused = 0
        for number in range(CLIENTS):
            self.connect(number)
        self.thread = threading.Thread(target=self.come_back)
        self.thread.start()

    def connect(self, number):
        client = socket.socket()
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16384)
        client.settimeout(5)
        try:
            client.connect(("127.0.0.1", self.port))
            client.sendall(self.words[number % len(self.words)])
            client.setblocking(False)
            self.clients[number] = client
        except OSError:
            self.refused += 1
            client.close()
            self.clients.pop(number, None)

    def is_closed(self, client):
        try:
            return client.recv(1, socket.MSG_PEEK) == b""
        except BlockingIOError:
            return False
        except OSError:
            return True

    def come_back(self):
        while not self.ended.wait(0.2):
            for number in range(CLIENTS):
                client = self.clients.get(number)
                if client is None or self.is_closed(client):
                    if client is not None:
                        client.close()
                        self.refused += 1
                    self.connect(number)

    def close(self):
        self.ended.set()
        self.thread.join()
        for client in self.clients.values():
            client.close()


class FewDescriptors(unittest.TestCase):
    def setUp(self):
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        if hard != resource.RLIM_INFINITY and hard < OWN_LIMIT:
            self.skipTest(f"the clients need {OWN_LIMIT} open files, and this user may have {hard} (ulimit -Hn)")
        resource.setrlimit(resource.RLIMIT_NOFILE, (OWN_LIMIT, hard))
        self.addCleanup(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
        self.fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        self.addCleanup(shutil.rmtree, self.fixtures)
        make_fixtures(self.fixtures)
        program = ["/bin/sh", "-c", f'ulimit -n {LIMIT} && exec "$0" "$@"', BIN / "voxeld"]
        self.daemon = type("Limited", (Daemon,), {"program": program})(
            device="cpu", arguments=("--drain-seconds", "1"))
        self.addCleanup(self.daemon.stop)

    def asked(self, ask):
        """The result of ask(), once the daemon accepts a connection of this client."""
        deadline = time.monotonic() + HANG_SECONDS
        while True:
            try:
                return ask()
            except (OSError, http.client.HTTPException):
                self.assertLess(time.monotonic(), deadline, self.daemon.log_tail())
                time.sleep(0.05)

    def test_jobs_are_done_beside_a_crowd_that_takes_all_connections(self):
        daemon = self.daemon
        asset = daemon.upload(self.fixtures / "worm.md5.zip")
        large = daemon.wait(daemon.submit(kind="voxelize", asset=asset,
                                          options={"dims": [200] * 3, "format": "npy"}))
        crowd = Crowd(daemon.port, f"/v1/jobs/{large['id']}/result")
        self.addCleanup(crowd.close)
        wait_until(lambda: crowd.refused > CLIENTS // 2, "the crowd takes all connections")
        jobs = [self.asked(lambda n=n: daemon.submit(
            kind="voxelize", asset=asset,
            options={"size": 20 + n, "animation": "walk", "frames": "0..5", "cache": "no", "format": "npz"}))
            for n in range(JOBS)]
        states = {}
        deadline = time.monotonic() + 300
        while len(states) < JOBS:
            for job in jobs:
                status = self.asked(lambda job=job: daemon.get(f"/v1/jobs/{job}").json())
                if status["state"] in ("done", "failed"):
                    states[job] = (status["state"], status["attempt"], status.get("error", {}).get("detail"))
            self.assertLess(time.monotonic(), deadline, states)
        self.assertEqual(set(states.values()), {("done", 1, None)})
        for job in jobs:
            self.assertEqual(self.asked(lambda job=job: daemon.get(f"/v1/jobs/{job}/result")).status, 200)
        with open(daemon.log.name, "rb") as log:
            text = log.read().decode(errors="replace")
        for sign in ("Too many open files", "errno=24", "unable to open database", "state=failed", "status=500"):
            self.assertNotIn(sign, text)
        self.assertRegex(text, r"limit on open files is too low .*limit=256 connections=\d\d ")

    def test_so_few_that_nothing_would_work_are_refused_at_the_start(self):
        refused = subprocess.run(["/bin/sh", "-c", 'ulimit -n 100 && exec "$0" "$@"', BIN / "voxeld", "serve",
                                  "--listen", "127.0.0.1:0", "--admin-listen", "127.0.0.1:0", "--device", "cpu",
                                  "--data", self.fixtures / "data"], capture_output=True, text=True,
                                 timeout=HANG_SECONDS)
        self.assertEqual(refused.returncode, 1)
        self.assertIn("limit on open files (ulimit -n): expected at least", refused.stderr)


if __name__ == "__main__":
    unittest.main()
