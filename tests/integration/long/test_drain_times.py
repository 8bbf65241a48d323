"""The daemon ends in time whatever hangs in it, and cuts a client that reads nothing."""
import contextlib
import fcntl
import os
import pathlib
import shutil
import signal
import socket
import sqlite3
import subprocess
import tempfile
import threading
import time
import unittest

from harness import BIN, Daemon, DaemonTest, make_fixtures, wait_until
from test_drain import SIDE, DrainTest, SlowDownload, assert_no_process


class Bounded(DrainTest):
    def test_the_time_to_drain_is_bounded(self):
        daemon, _, path = self.start("--drain-seconds", "1")
        download = self.slow_download(daemon, path)
        daemon.process.send_signal(signal.SIGTERM)
        self.assert_gone(daemon, 0)
        self.assertLess(len(download.read()), download.bytes)
        self.assertIn("the time to drain is over", daemon.log_tail())


class Stuck(unittest.TestCase):
    """The daemon ends in --drain-seconds and two more, whatever handlers, clients, workers and files do."""
    DRAIN_SECONDS, CLOSE_SECONDS_MAX = 1, 2
    SLACK_SECONDS = 2  # of a machine that does other things, too
    MESH = b"v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n"
    LONG = {"size": 9000, "cache": "no", "channels": "occupancy,color,normal"}

    def setUp(self):
        self.fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        self.addCleanup(shutil.rmtree, self.fixtures)
        make_fixtures(self.fixtures)
        self.daemon = Daemon(device="cpu", arguments=("--drain-seconds", str(self.DRAIN_SECONDS)))
        self.addCleanup(self.daemon.stop)
        self.addCleanup(self.daemon.process.kill)

    def send(self, head, body=b""):
        client = socket.create_connection(("127.0.0.1", self.daemon.port), timeout=60)
        self.addCleanup(client.close)
        client.sendall(f"{head}\r\nHost: localhost\r\n".encode() +
                       (b"Content-Length: %d\r\n\r\n" % len(body) if body else b"\r\n") + body)
        return client

    def begin_long_work(self):
        query = "&".join(f"{name}={value}" for name, value in self.LONG.items())
        client = self.send(f"POST /v1/voxelize?filename=a.glb&{query} HTTP/1.1",
                           (self.fixtures / "sample.glb").read_bytes())
        busy = wait_until(lambda: [w["pid"] for w in self.workers() if w["task"]], "a worker has the task")
        return client, busy[0]

    def workers(self):
        return self.daemon.request("GET", "/readyz", port=self.daemon.admin_port).json()["workers"]

    def assert_ends(self, *told):
        workers = [worker["pid"] for worker in self.workers()]
        start = time.monotonic()
        self.daemon.process.send_signal(signal.SIGTERM)
        status = self.daemon.process.wait(90)
        seconds = time.monotonic() - start
        log = self.daemon.log_tail(1 << 20)
        self.assertLess(seconds, self.DRAIN_SECONDS + self.CLOSE_SECONDS_MAX + self.SLACK_SECONDS, log)
        self.assertEqual(status, 0, log)
        for text in told:
            self.assertIn(text, log)
        self.assertIn(" stopping ", log)
        self.assertNotIn("worker started", log.partition(" stopping ")[2])
        for pid in workers:
            assert_no_process(pid)

    def test_a_handler_that_waits_for_a_job_whose_client_has_sent_more(self):
        client, _ = self.begin_long_work()
        client.sendall(b"GET /")  # the daemon does not read this during the request
        self.assert_ends("the time to drain is over")

    def test_a_handler_that_minds_nothing(self):
        """A disk that does not respond: opening a pipe blocks in the same way."""
        response = self.daemon.post("/v1/voxelize?size=8&filename=a.obj", self.MESH)
        grid = response.headers["X-Voxeld-Grid"]
        name = grid.removeprefix("sha256-")
        blob = next(path for path in pathlib.Path(self.daemon.data_dir, "blobs").rglob("*")
                    if path.is_file() and str(path).replace("/", "").endswith(name))
        blob.unlink()
        os.mkfifo(blob)
        self.send(f"GET /v1/grids/{grid} HTTP/1.1")
        time.sleep(0.5)
        self.assert_ends("a request did not end", f"GET /v1/grids/{grid}")

    def test_an_upload_that_never_ends(self):
        client = self.send("POST /v1/assets?filename=a.obj HTTP/1.1\r\nTransfer-Encoding: chunked")
        ended = threading.Event()

        def dribble():
            try:
                while not ended.wait(0.1):
                    client.sendall(b"400\r\n" + b"#" * 1024 + b"\r\n")
            except OSError:
                pass
        thread = threading.Thread(target=dribble)
        thread.start()
        self.addCleanup(thread.join)
        self.addCleanup(ended.set)
        time.sleep(0.5)  # the daemon has the head
        self.assert_ends("the time to drain is over")

    def test_a_worker_that_does_not_respond_is_killed(self):
        _, worker = self.begin_long_work()
        os.kill(worker, signal.SIGSTOP)
        self.assert_ends("worker had to be killed")

    def test_a_database_that_another_program_holds(self):
        database = sqlite3.connect(f"{self.daemon.data_dir}/jobs.sqlite", isolation_level=None)
        self.addCleanup(database.close)
        self.begin_long_work()
        database.execute("BEGIN IMMEDIATE")
        for i in range(4):
            self.send(f"POST /v1/assets?filename={i}.obj HTTP/1.1", self.MESH + b"# %d" % i)
        time.sleep(0.3)
        self.assert_ends("the time to drain is over")
        database.execute("ROLLBACK")
        self.assertEqual(database.execute("PRAGMA integrity_check").fetchone(), ("ok",))

    def test_a_log_that_nobody_reads(self):
        """The pipe is full: whoever logs stands still."""
        process = subprocess.Popen(
            [BIN / "voxeld", "serve", "--listen", "127.0.0.1:0", "--admin-listen", "127.0.0.1:0", "--data",
             self.fixtures / "data", "--device", "cpu", "--drain-seconds", str(self.DRAIN_SECONDS)],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        self.addCleanup(process.stderr.close)
        self.addCleanup(process.stdout.close)
        self.assertTrue(process.stdout.readline().startswith(b"ready "))
        fcntl.fcntl(process.stderr, fcntl.F_SETPIPE_SZ, 4096)
        with open(f"/proc/{process.pid}/fd/2", "wb", buffering=0) as pipe:
            os.set_blocking(pipe.fileno(), False)
            with contextlib.suppress(BlockingIOError):
                while pipe.write(b"#" * 512):
                    pass
        start = time.monotonic()
        process.send_signal(signal.SIGTERM)
        self.assertIn(process.wait(90), (0, -signal.SIGALRM))
        self.assertLess(time.monotonic() - start,
                        self.DRAIN_SECONDS + self.CLOSE_SECONDS_MAX + self.SLACK_SECONDS)


class Readers(DaemonTest):
    device = "cpu"

    def test_a_client_that_reads_nothing_of_a_response_is_cut_after_half_a_minute(self):
        asset = self.daemon.upload(self.fixtures / "sample.glb")
        job = self.daemon.submit(kind="voxelize", asset=asset,
                                 options={"dims": [SIDE] * 3, "format": "npy"})
        self.assertEqual(self.daemon.wait(job)["state"], "done")
        start = time.monotonic()
        download = SlowDownload(self.daemon.port, f"/v1/jobs/{job}/result")
        self.addCleanup(download.close)
        while b'what="connections"} 1\n' in self.metrics():
            self.assertLess(time.monotonic() - start, 60)
            time.sleep(0.5)
        self.assertGreater(time.monotonic() - start, 25)
        self.assertLess(len(download.read()), download.bytes)

    def metrics(self):
        return self.daemon.request("GET", "/metrics", port=self.daemon.admin_port).body


if __name__ == "__main__":
    unittest.main()
