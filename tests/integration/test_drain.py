"""SIGTERM and what clients get until the daemon has ended. Its times are those of long/test_drain_times.py."""
import http.client
import json
import signal
import socket
import unittest

from harness import HANG_SECONDS, Daemon, wait_until

# More than the buffers of both sockets take: 256^3 cells of one byte.
SIDE = 256
RECEIVE_BUFFER_BYTES = 16384
# A daemon that ends within a test has not waited for this.
DRAIN_FOREVER = ("--drain-seconds", "3600")


def has_ended(pid):
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rsplit(")", 1)[1].split()[0] == "Z"  # nobody has asked how it ended yet
    except (FileNotFoundError, ProcessLookupError):
        return True


def assert_no_process(pid):
    wait_until(lambda: has_ended(pid), f"worker {pid} outlives the daemon")


class SlowDownload:
    """A GET of which nothing is read at first but the head."""

    def __init__(self, port, path):
        self.socket = socket.socket()
        # Before the connection: later the system has promised more already.
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self.socket.settimeout(HANG_SECONDS)
        self.socket.connect(("127.0.0.1", port))
        self.socket.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        self.response = http.client.HTTPResponse(self.socket)
        self.response.begin()
        assert self.response.status == 200, self.response.status
        self.bytes = int(self.response.headers["Content-Length"])
        self.begun = b""

    def read_some(self):
        """So much that the daemon, which ends a download that stands still, sends more."""
        self.begun += self.response.read(1 << 20)

    def read(self):
        """All of it, or what came before the connection ended."""
        try:
            return self.begun + self.response.read()
        except http.client.IncompleteRead as cut:
            return self.begun + cut.partial
        except ConnectionResetError:
            return self.begun

    def close(self):
        self.response.close()
        self.socket.close()


class DrainTest(unittest.TestCase):
    def start(self, *arguments):
        daemon = Daemon(device="cpu", arguments=arguments)
        self.addCleanup(daemon.stop)
        self.addCleanup(daemon.process.kill)  # a failed test does not wait for the drain
        job = daemon.submit(kind="voxelize", asset=self.upload(daemon),
                            options={"dims": [SIDE] * 3, "format": "npy"})
        self.assertEqual(daemon.wait(job)["state"], "done")
        return daemon, job, f"/v1/jobs/{job}/result"

    def upload(self, daemon):
        response = daemon.post("/v1/assets?filename=one.obj",
                               b"v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n")
        self.assertIn(response.status, (200, 201), response.body)
        return response.json()["id"]

    def slow_download(self, daemon, path):
        download = SlowDownload(daemon.port, path)
        self.addCleanup(download.close)
        self.assertGreater(download.bytes, SIDE ** 3)
        return download

    def assert_gone(self, daemon, status):
        self.assertEqual(daemon.process.wait(HANG_SECONDS), status, daemon.log_tail())


class Drain(DrainTest):
    def wait_draining(self, daemon):
        wait_until(lambda: daemon.request("GET", "/readyz", port=daemon.admin_port).status == 503, "draining")

    def assert_refused(self, response):
        self.assertEqual(response.status, 503, response.body)
        self.assertEqual(response.headers["Content-Type"], "application/problem+json")
        self.assertEqual(response.json()["code"], "shutting-down")
        self.assertGreater(int(response.headers["Retry-After"]), 0)
        self.assertEqual(response.headers["Connection"], "close")

    def test_new_work_is_refused_and_a_download_that_runs_is_whole(self):
        daemon, job, path = self.start(*DRAIN_FOREVER)
        whole = daemon.get(path).body
        download = self.slow_download(daemon, path)
        persistent = http.client.HTTPConnection("127.0.0.1", daemon.port, timeout=HANG_SECONDS)
        self.addCleanup(persistent.close)
        persistent.request("GET", f"/v1/jobs/{job}")
        self.assertEqual(json.loads(persistent.getresponse().read())["state"], "done")
        daemon.process.send_signal(signal.SIGTERM)
        self.wait_draining(daemon)
        download.read_some()

        work = {"kind": "voxelize", "asset": "sha256-" + "0" * 64}
        self.assert_refused(daemon.post("/v1/jobs", work))
        self.assert_refused(daemon.post("/v1/assets?filename=a.obj", b"v 0 0 0\n" * 100_000))
        persistent.request("POST", "/v1/jobs", json.dumps(work), {"Content-Type": "application/json"})
        raw = persistent.getresponse()
        self.assertEqual((raw.status, raw.headers["Connection"]), (503, "close"))
        raw.read()
        download.read_some()
        # An image would be work; what is there already is not.
        status = daemon.get(f"/v1/jobs/{job}")
        self.assertEqual((status.status, status.headers["Connection"]), (200, "close"))
        grid = status.json()["result"]["grid"]
        self.assert_refused(daemon.get(f"/v1/grids/{grid}/render.png?width=64&height=64"))
        self.assertEqual(daemon.get(path).body, whole)
        download.read_some()
        self.assertEqual(daemon.request("DELETE", f"/v1/jobs/{job}").status, 200)
        admin = {name: daemon.request("GET", name, port=daemon.admin_port)
                 for name in ("/livez", "/readyz", "/metrics")}

        def metrics():
            return daemon.request("GET", "/metrics", port=daemon.admin_port).body
        self.assertEqual({name: response.status for name, response in admin.items()},
                         {"/livez": 200, "/readyz": 503, "/metrics": 200})
        self.assertIn("shutting down", admin["/readyz"].json()["reason"])
        wait_until(lambda: b'status="503"' in metrics(), metrics)  # responses come before they are counted

        self.assertIsNone(daemon.process.poll(), "it waits for the download")
        self.assertEqual(download.read(), whole)
        self.assert_gone(daemon, 0)
        self.assertNotIn("the time to drain is over", daemon.log_tail())

    def test_a_second_signal_ends_it_at_once(self):
        for second in (signal.SIGTERM, signal.SIGINT):
            with self.subTest(second.name):
                daemon, job, path = self.start(*DRAIN_FOREVER)
                download = self.slow_download(daemon, path)
                workers = daemon.request("GET", "/readyz", port=daemon.admin_port).json()["workers"]
                self.assertTrue(workers)
                daemon.process.send_signal(signal.SIGTERM)
                self.wait_draining(daemon)
                download.read_some()
                self.assertEqual(daemon.get(f"/v1/jobs/{job}").status, 200, "it waits for the download")
                daemon.process.send_signal(second)
                self.assert_gone(daemon, -second)
                self.assertLess(len(download.read()), download.bytes)
                for worker in workers:
                    assert_no_process(worker["pid"])

    def test_without_anything_in_flight_it_ends_at_once(self):
        daemon, _, _ = self.start(*DRAIN_FOREVER)
        idle = socket.create_connection(("127.0.0.1", daemon.port))
        self.addCleanup(idle.close)
        daemon.process.send_signal(signal.SIGTERM)
        self.assert_gone(daemon, 0)


if __name__ == "__main__":
    unittest.main()
