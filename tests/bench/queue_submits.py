#!/usr/bin/env python3
"""Submits per second over HTTP with an empty and with a full queue.

    tests/bench/queue_submits.py [--full 10000] [--clients 12] [--count 500]

Starts a daemon of its own (VOXELD_BIN_DIR, else build/dev/bin) with one worker, which a long job
keeps busy. Each client has one connection and submits different jobs on one small asset. Prints the
rate over `--count` submits at each depth, and what GET of a queued job takes.
"""
import argparse
import http.client
import json
import pathlib
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "integration"))
from harness import daemon_with_fixtures  # noqa: E402


class Submitter:
    """Submits jobs that differ from each other, by several clients at a time."""

    def __init__(self, port, asset):
        self.port, self.asset, self.next, self.last = port, asset, 0, None
        self.lock = threading.Lock()

    def take(self):
        with self.lock:
            self.next += 1
            return self.next

    def client(self, until):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)
        while (number := self.take()) <= until:
            body = json.dumps({"kind": "voxelize", "asset": self.asset, "priority": -1,
                               "options": {"voxel_size": 1 + number * 1e-6, "cache": "no"}})
            connection.request("POST", "/v1/jobs", body, {"Content-Type": "application/json"})
            response = connection.getresponse()
            text = response.read()
            assert response.status == 202, (response.status, text)
            self.last = json.loads(text)["id"]
        connection.close()

    def submit(self, count, clients):
        """The seconds that `count` more submits take."""
        until = self.next + count
        start = time.monotonic()
        threads = [threading.Thread(target=self.client, args=(until,)) for _ in range(clients)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.next = until
        return time.monotonic() - start


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--full", type=int, default=10_000)
    parser.add_argument("--clients", type=int, default=12)
    parser.add_argument("--count", type=int, default=500)
    arguments = parser.parse_args()
    options = ["--workers-per-device", "1", "--queued-jobs-max", str(arguments.full + 10)]
    with daemon_with_fixtures(arguments=options) as (daemon, fixtures):
        asset = daemon.upload(fixtures / "sample.glb")
        busy = daemon.submit(kind="voxelize", asset=asset, priority=100,
                             options={"size": 16384, "fill": "solid", "cache": "no"})
        daemon.wait_state(busy, "running")
        submitter = Submitter(daemon.port, asset)

        def measure(name):
            seconds = submitter.submit(arguments.count, arguments.clients)
            start = time.monotonic()
            for _ in range(20):
                daemon.get(f"/v1/jobs/{submitter.last}")
            get_ms = (time.monotonic() - start) / 20 * 1000
            print(f"{name}: {arguments.count / seconds:.0f} submits/s, GET of a queued job"
                  f" {get_ms:.1f} ms", flush=True)
        measure("empty queue")
        submitter.submit(arguments.full - 2 * arguments.count, arguments.clients)
        measure(f"{arguments.full} in the queue")
        print("state of the busy job:", daemon.get(f"/v1/jobs/{busy}").json()["state"])
        daemon.request("DELETE", f"/v1/jobs/{busy}")
        daemon.process.kill()


if __name__ == "__main__":
    main()
