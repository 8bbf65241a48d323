"""kill -9 of gateway and workers at random moments, while clients work; then the history is checked.

    python3 test_kill9.py --kills 300 [--seed N] [--clients 4] [--disk DIR]

The seed decides when and whom it kills, and what the clients ask; not how the requests and the kills meet.

Each client notes what it sent and what was acknowledged. All that was acknowledged must be there in the
end, exactly once: jobs ended as asked with the right bytes, uploads are there, deleted things are gone."""
import argparse
import collections
import hashlib
import http.client
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "integration"))
from harness import BIN, Daemon  # noqa: E402

LIVE = ("queued", "running")
GATE_KILLS, GATE_SEED = 10, 1
# Legal successors of each state in a job's events; a restart puts a running job back.
LEGAL = {None: {"queued", "done"}, "queued": {"running", "cancelled", "done"},
         "running": {"queued", "done", "failed", "cancelled"}}


def cube(number):
    """A box whose sides depend on the number: a mesh of its own for every upload."""
    corners = [(x * (1 + number % 7), y * (1 + number % 5), z * (1 + number / 1000))
               for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = [(0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 5, 1), (0, 4, 5),
             (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    lines = [f"# {number}"] + ["v %g %g %g" % corner for corner in corners]
    lines += ["f %d %d %d" % tuple(i + 1 for i in face) for face in faces]
    return ("\n".join(lines) + "\n").encode()


def sha256_id(data):
    return "sha256-" + hashlib.sha256(data).hexdigest()


class History:
    """Acknowledgements that clients received. One lock suffices, because writes are rare."""

    def __init__(self):
        self.lock = threading.Lock()
        self.assets = {}  # id -> bytes, acknowledged and not deleted
        self.unsure_assets = set()  # a deletion was sent and got no response
        self.deleted = set()
        self.jobs = {}  # idempotency key -> job id, acknowledged
        self.requests = {}  # key -> what was asked
        self.cancelled = set()  # keys; the cancel was sent
        self.requests_sent = self.lost_responses = 0
        self.problems = []

    def problem(self, text):
        with self.lock:
            self.problems.append(text)


class Client(threading.Thread):
    def __init__(self, number, arena, seed):
        super().__init__(daemon=True)
        self.number, self.arena, self.history = number, arena, arena.history
        self.random = random.Random(seed)
        self.mine = []  # assets of this client
        self.count = 0

    def call(self, method, path, body=None, headers=None):
        """Repeats the request with the same key until there is a response."""
        while not self.arena.ended.is_set():
            with self.history.lock:
                self.history.requests_sent += 1
            try:
                connection = http.client.HTTPConnection(self.arena.host, self.arena.port, timeout=60)
                connection.request(method, path, body=body, headers=headers or {})
                response = connection.getresponse()
                text = response.read()
                connection.close()
                if response.status != 503:
                    return response.status, json.loads(text) if text else {}
            except (OSError, http.client.HTTPException, ValueError):
                with self.history.lock:
                    self.history.lost_responses += 1
            time.sleep(0.02)
        return None, {}

    def upload(self):
        self.count += 1
        data = cube(self.number * 100_000 + self.count)
        status, body = self.call("POST", f"/v1/assets?filename=c{self.count}.obj", data)
        if status is None:
            return
        if status not in (200, 201) or body["id"] != sha256_id(data):
            self.history.problem(f"upload: {status} {body}")
            return
        self.mine.append(body["id"])
        with self.history.lock:
            self.history.assets[body["id"]] = data

    def submit(self):
        asset = self.random.choice(self.mine)
        self.count += 1
        key = f"key-{self.number}-{self.count}"
        size = self.random.choice((8, 16, 24, 200))
        request = {"kind": "voxelize", "asset": asset,
                   "options": {"size": size, "format": "npy", "cache": self.random.choice(("yes", "no"))}}
        with self.history.lock:
            self.history.requests[key] = request
        status, body = self.call("POST", "/v1/jobs", json.dumps(request),
                                   {"Content-Type": "application/json", "Idempotency-Key": key})
        if status is None:
            return
        if status not in (200, 202):
            self.history.problem(f"submit: {status} {body}")
            return
        with self.history.lock:
            self.history.jobs[key] = body["id"]
        if self.random.random() < 0.15:
            with self.history.lock:
                self.history.cancelled.add(key)
            status, body = self.call("DELETE", "/v1/jobs/" + self.history.jobs[key])
            if status not in (None, 200, 202):
                self.history.problem(f"cancel: {status} {body}")

    def delete(self):
        asset = self.mine.pop(self.random.randrange(len(self.mine)))
        with self.history.lock:
            self.history.unsure_assets.add(asset)
        status, body = self.call("DELETE", "/v1/assets/" + asset)
        # Gone: the first try was done, and its response was lost.
        if status is None:
            return
        if status not in (200, 204, 410):
            self.history.problem(f"delete: {status} {body}")
        with self.history.lock:
            self.history.unsure_assets.discard(asset)
            self.history.assets.pop(asset, None)
            self.history.deleted.add(asset)

    def run(self):
        try:
            self.work()
        except Exception as failure:  # of a thread, which would end it without a word
            self.history.problem(f"client {self.number}: {failure!r}")

    def work(self):
        while not self.arena.ended.is_set():
            chance = self.random.random()
            if not self.mine or chance < 0.2:
                self.upload()
            elif chance < 0.25 and len(self.mine) > 3:
                self.delete()
            else:
                self.submit()
            time.sleep(self.random.random() * 0.1)


class Arena:
    def __init__(self, kills, seed, clients, disk=None):
        self.kills, self.seed = kills, seed
        self.random = random.Random(seed)
        self.directory = tempfile.mkdtemp(prefix="voxeld-kill9-", dir=disk)
        # No other daemon listens on this loopback address: while this one is down, its port is nobody's.
        self.host = f"127.{random.randrange(1, 255)}.{random.randrange(256)}.{random.randrange(1, 255)}"
        self.history = History()
        self.ended = threading.Event()
        self.start_seconds = []
        self.killed = collections.Counter()
        self.start(Daemon)
        self.clients = [Client(i, self, seed * 1000 + i) for i in range(clients)]

    def start(self, make=None):
        begin = time.monotonic()
        if make is not None:
            self.daemon = make(device="cpu", data_dir=self.directory, host=self.host,
                               arguments=["--disk-reserve", "0", "--queued-jobs-max", "100000"])
        else:
            self.daemon.start()
        self.start_seconds.append(time.monotonic() - begin)
        self.port = self.daemon.port

    def kill(self):
        time.sleep(self.random.random() ** 2 * 0.8)
        if self.random.random() < 0.4:
            try:
                pid = self.daemon.worker_pid()
                if pid:
                    os.kill(pid, signal.SIGKILL)
                    self.killed["worker"] += 1
                    return
            except (OSError, http.client.HTTPException, ValueError):
                pass
        self.daemon.kill_gateway()
        self.killed["gateway"] += 1
        self.start()

    def run(self):
        for client in self.clients:
            client.start()
        for number in range(self.kills):
            self.kill()
            if (number + 1) % 50 == 0:
                print(f"{number + 1} kills, {len(self.history.jobs)} jobs acknowledged", flush=True)
        self.ended.set()
        for client in self.clients:
            client.join(120)
            if client.is_alive():
                self.history.problem(f"client {client.number} hangs")
        self.settle()
        self.check()
        self.daemon.stop()
        self.check_store()
        shutil.rmtree(self.directory, ignore_errors=True)
        os.unlink(self.directory + ".log")
        return self.history.problems

    def settle(self):
        deadline = time.monotonic() + 300 + self.kills * 5
        while time.monotonic() < deadline:
            live = [job for state in LIVE
                    for job in self.daemon.get(f"/v1/jobs?limit=1&state={state}").json()["jobs"]]
            if not live:
                return
            time.sleep(0.2)
        self.history.problem(f"jobs hang: {live}")

    def check(self):
        history = self.history
        if not history.jobs or not history.assets:
            history.problem("nothing was acknowledged")
        unacknowledged = len(history.requests) - len(history.jobs)
        # A cancel that came after the end of its job removed the record.
        for key in history.cancelled & set(history.jobs):
            if self.daemon.get("/v1/jobs/" + history.jobs[key]).status == 404:
                del history.jobs[key]
        by_key = {}
        for key, job in history.jobs.items():
            self.check_job(key, job)
            if by_key.setdefault(job, key) != key:
                history.problem(f"two keys gave one job: {key} and {by_key[job]}")
        # Every existing job was requested, by one key only. Jobs whose response was lost and not
        # requested again are at most as many as the requests that were not acknowledged.
        total = self.count_jobs()
        if not len(history.jobs) <= total <= len(history.jobs) + unacknowledged:
            history.problem(f"{total} jobs, {len(history.jobs)} acknowledged, {unacknowledged} not")
        for key, job in history.jobs.items():  # a key still means its job
            response = self.daemon.post("/v1/jobs", history.requests[key], headers={"Idempotency-Key": key})
            if response.status not in (200, 202) or response.json()["id"] != job:
                history.problem(f"doubled: {key} gave {job}, then {response.status} {response.body[:200]!r}")
        for asset in history.assets:
            expected = (200, 410) if asset in history.unsure_assets else (200,)
            if self.daemon.get("/v1/assets/" + asset).status not in expected:
                history.problem(f"lost: asset {asset}")
        for asset in history.deleted:
            if self.daemon.get("/v1/assets/" + asset).status != 410:
                history.problem(f"back again: deleted asset {asset}")

    def count_jobs(self):
        import sqlite3
        with sqlite3.connect(f"file:{self.directory}/jobs.sqlite?mode=ro", uri=True) as database:
            return database.execute("SELECT COUNT(*) FROM jobs").fetchone()[0]

    def check_job(self, key, job):
        history = self.history
        response = self.daemon.get("/v1/jobs/" + job)
        if response.status != 200:
            history.problem(f"lost: job {job} of {key}: {response.status}")
            return
        status = response.json()
        allowed = {"done", "cancelled"} if key in history.cancelled else {"done"}
        # A worker may die three times under one job: then that is said, and is no loss.
        crashed = status["state"] == "failed" and status["error"]["code"] == "worker-crashed"
        if status["state"] not in allowed and not crashed:
            history.problem(f"job {job} of {key} ended as {status['state']}: {status.get('error')}")
        self.check_events(job, status["state"])
        if status["state"] != "done":
            return
        result = self.daemon.get(f"/v1/jobs/{job}/result")
        if result.status != 200:
            history.problem(f"lost: result of {job}: {result.status} {result.body[:200]!r}")
            return
        if '"' + sha256_id(result.body) + '"' != result.headers["ETag"]:
            history.problem(f"result of {job} has other bytes")
        request = history.requests[key]
        content = (request["asset"], request["options"]["size"])
        known = self.contents.setdefault(content, result.headers["ETag"])
        if known != result.headers["ETag"]:
            history.problem(f"equal requests gave {known} and {result.headers['ETag']}")

    contents = {}

    def check_events(self, job, end):
        import sqlite3
        with sqlite3.connect(f"file:{self.directory}/jobs.sqlite?mode=ro", uri=True) as database:
            rows = database.execute("SELECT id, json_extract(data_json, '$.state') FROM job_events"
                                    " WHERE job_id = ? ORDER BY id", (job,)).fetchall()
        state = None
        for number, following in rows:
            if following not in LEGAL.get(state, set()):
                self.history.problem(f"job {job}: {following} after {state} in {rows}")
            state = following
        if state != end:
            self.history.problem(f"job {job}: {end}, but {state} in the last of {rows}")

    def check_store(self):
        done = subprocess.run([BIN / "voxeld", "doctor", "--store", "--json", "--data", self.directory],
                              capture_output=True, text=True)
        report = json.loads(done.stdout)
        for found in report["problems"]:
            self.history.problem(f"store: {found}")
        if done.returncode != 0 or report["leftovers"]:
            self.history.problem(f"store: exit {done.returncode}, leftovers {report['leftovers'][:5]}")
        self.report = report


def play(kills, seed, clients=4, disk=None):
    print(f"seed {seed}", flush=True)
    begin = time.monotonic()
    arena = Arena(kills, seed, clients, disk)
    problems = arena.run()
    history = arena.history
    starts = sorted(arena.start_seconds)
    lost = sum(text.startswith("lost") for text in problems)
    doubled = sum(text.startswith(("doubled", "two keys")) for text in problems)
    print(f"kills: {dict(arena.killed)}; {history.requests_sent} requests sent, {history.lost_responses} "
          f"without a response; acknowledged: {len(history.jobs)} jobs ({len(history.cancelled)} "
          f"cancelled), {len(history.assets) + len(history.deleted)} uploads, {len(history.deleted)} "
          f"deletions; lost {lost}, doubled {doubled}, other problems "
          f"{len(problems) - lost - doubled}; start to ready: median {starts[len(starts) // 2]:.2f} s, "
          f"longest {starts[-1]:.2f} s; {time.monotonic() - begin:.0f} s", flush=True)
    for text in problems[:20]:
        print("PROBLEM", text)
    return problems


class Kill9(unittest.TestCase):
    def test_nothing_that_was_acknowledged_is_lost_or_doubled(self):
        self.assertEqual(play(kills=GATE_KILLS, seed=GATE_SEED), [])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 30))
    parser.add_argument("--clients", type=int, default=4)
    parser.add_argument("--disk", help="where the data directory is made")
    chosen = parser.parse_args()
    sys.exit(1 if play(chosen.kills, chosen.seed, chosen.clients, chosen.disk) else 0)
