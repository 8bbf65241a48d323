"""A hostile tenant beside three honest ones: what test_siege asserts shortly and tests/bench/siege.py for long.

Honest clients do small things all the time and note how long each took. Attackers hold one key, and keep
within nothing but what the daemon refuses."""
import json
import pathlib
import random
import socket
import statistics
import threading
import time

from harness import TenantsDaemon, run_for
from test_cancel import lattice, textured_mesh

HONEST = ("ada", "ben", "cleo")
HOSTILE = "mallory"
# A tenant that may not be refused would fill any disk: the operator of a shared machine sets quotas.
HOSTILE_LIMITS = ["--bytes", "200M", "--queued-jobs", "500"]
HOLD_SECONDS = 3  # that an attacker keeps what it has opened
LONG_JOB_SECONDS = 20  # that a job of minutes runs before its tenant cancels it
HELD_CONNECTIONS = 50
UNREAD_RESPONSES = 200


def memory_kb(pid):
    """(resident now, resident at most) of a process."""
    lines = pathlib.Path(f"/proc/{pid}/status").read_text().splitlines()
    fields = dict(line.split(":", 1) for line in lines if ":" in line)
    return int(fields["VmRSS"].split()[0]), int(fields["VmHWM"].split()[0])


def disk_kb(folder):
    """What the files of a folder take on the disk."""
    blocks = 0
    for path in pathlib.Path(folder).rglob("*"):
        try:
            blocks += path.lstat().st_blocks
        except OSError:  # deleted meanwhile
            pass
    return blocks // 2


def percentile(values, part):
    return sorted(values)[min(len(values) - 1, int(len(values) * part))] if values else None


class Siege(TenantsDaemon):
    def __init__(self, device="cpu", seed=1, arguments=()):
        super().__init__({name: 1 for name in HONEST}, device,
                         ["--workers-per-device", "3", "--log-level", "error", *arguments])
        self.keys[HOSTILE] = self.voxeld_keys("add", HOSTILE, *HOSTILE_LIMITS)
        self.connect()
        self.chance = random.Random(seed)
        self.mesh = (self.fixtures / "sample.ply").read_bytes()
        self.worm = (self.fixtures / "worm.md5.zip").read_bytes()
        self.bad = sorted((self.fixtures / "bad").iterdir())
        self.stop = threading.Event()
        self.lock = threading.Lock()
        self.times_ms = {}  # what an honest client asked for -> milliseconds of each
        self.wrong = []     # what an honest client should not have got
        self.hostile = {}   # attack -> {status: count}

    # --- honest clients

    def timed(self, tenant, what, method, path, body=None, headers=None):
        begin = time.monotonic()
        try:
            response = self.tenants[tenant].request(method, path, body, headers, timeout=60)
            status, text = response.status, response.body[:200]
        except Exception as failure:  # also a response that is not in openapi.yaml
            status, text = 0, repr(failure)
        with self.lock:
            self.times_ms.setdefault(what, []).append((time.monotonic() - begin) * 1000)
            if status not in (200, 201, 202):
                self.wrong.append(f"{tenant} {method} {path}: {status} {text!r}")

    def be_honest(self, tenant):
        chance = random.Random(f"{tenant}")
        while not self.stop.is_set():
            self.timed(tenant, "one-shot", "POST", "/v1/voxelize?filename=a.ply&size=32&cache=no&format=npz",
                       self.mesh)
            self.timed(tenant, "upload", "POST", "/v1/assets?filename=b.ply",
                       self.mesh + b"\n" * chance.randint(1, 1000))
            self.timed(tenant, "list", "GET", "/v1/jobs?limit=5")
            self.timed(tenant, "look", "GET", "/v1/me")
            self.stop.wait(0.05)

    # --- attacks: each does its worst once and returns

    def count(self, attack, status):
        with self.lock:
            counts = self.hostile.setdefault(attack, {})
            counts[status] = counts.get(status, 0) + 1

    def ask(self, attack, method, path, body=None, headers=None):
        if isinstance(body, (dict, list)):
            body, headers = json.dumps(body), {"Content-Type": "application/json", **(headers or {})}
        connection = self.tenants[HOSTILE]
        # Not checked against openapi.yaml: no client of ours would send these requests.
        response = connection.request(method, path, body, headers, port=self.daemon.port, timeout=60)
        self.count(attack, response.status)
        return response

    def head_of(self, method, path, extra=""):
        return (f"{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer "
                f"{self.keys[HOSTILE]}\r\n{extra}\r\n").encode()

    def hold(self, attack, requests, meanwhile=lambda: None):
        """Sends each on a connection of its own, reads nothing, and leaves after a while."""
        clients = []
        for request in requests:
            try:
                client = socket.create_connection(("127.0.0.1", self.daemon.port), timeout=5)
                client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                client.sendall(request)
                clients.append(client)
            except OSError:
                self.count(attack, "closed")
        meanwhile()
        self.stop.wait(HOLD_SECONDS)
        for client in clients:
            client.close()
        self.count(attack, "held")

    def read_no_responses(self):
        paths = ["/v1/jobs?limit=1000", "/v1/assets?limit=1000", "/v1/queue", "/openapi.json"]
        if self.grid:
            paths.append(f"/v1/grids/{self.grid}/tiles")
        self.hold("read_no_responses", [self.head_of("GET", paths[i % len(paths)])
                                      for i in range(UNREAD_RESPONSES)])

    def send_half_bodies(self):
        self.hold("send_half_bodies",
                  [self.head_of("POST", "/v1/voxelize?size=16", "Content-Length: 1000000\r\n") + b"ply\n"
                   for _ in range(HELD_CONNECTIONS)])

    def send_half_heads(self):
        self.hold("send_half_heads", [self.head_of("GET", "/v1/jobs")[:-2] for _ in range(HELD_CONNECTIONS)])

    def watch_events(self):
        self.hold("watch_events", [self.head_of("GET", f"/v1/jobs/{self.own_job}/events")
                                   for _ in range(HELD_CONNECTIONS)])

    def wait_for_jobs(self):
        self.hold("wait_for_jobs", [self.head_of("GET", f"/v1/jobs/{self.own_job}", "Prefer: wait=60\r\n")
                                    for _ in range(HELD_CONNECTIONS)])

    def fill_the_queue(self):
        for _ in range(50):
            self.ask("fill_the_queue", "POST", "/v1/jobs",
                     {"kind": "voxelize", "asset": self.own_asset,
                      "options": {"size": self.chance.randint(1000, 6000), "cache": "no",
                                  "channels": "occupancy"}})

    def cancel_all(self):
        response = self.ask("cancel_all", "GET", "/v1/jobs?limit=100&state=queued")
        for job in response.json().get("jobs", []) if response.status == 200 else []:
            self.ask("cancel_all", "DELETE", f"/v1/jobs/{job['id']}")
        self.stop.wait(1)

    def send_long_strings(self):
        long = "x" * 900_000
        self.ask("send_long_strings", "POST", "/v1/jobs",
                 {"kind": "voxelize", "asset": self.own_asset, "options": {"size": 8, "filename": long}})
        self.ask("send_long_strings", "POST", "/v1/jobs",
                 {"kind": "voxelize", "asset": self.own_asset, "options": {"size": 8}},
                 {"Idempotency-Key": "k" * 20_000})
        self.ask("send_long_strings", "POST", "/v1/jobs",
                 {"kind": "voxelize", "asset": self.worm_asset,
                  "options": {"size": 8, "times": [i / 1000 for i in range(4096)]}})

    def send_nonsense(self):
        path = self.chance.choice(self.bad)
        self.ask("send_nonsense", "POST", "/v1/voxelize?size=32&filename=" + path.name, path.read_bytes())
        self.ask("send_nonsense", "POST", "/v1/jobs", b"[" * 60_000,
                 {"Content-Type": "application/json"})

    def fill_the_disk(self):
        body = self.mesh + self.chance.randbytes(64) + b"\0" * 4_000_000
        response = self.ask("fill_the_disk", "POST", "/v1/assets?filename=c.ply", body)
        if response.status not in (200, 201):
            listed = self.ask("fill_the_disk", "GET", "/v1/assets?limit=100").json()
            for asset in listed.get("assets", []):
                if asset["id"] not in (self.own_asset, self.worm_asset, self.lattice_asset, self.textures_asset):
                    self.ask("fill_the_disk", "DELETE", f"/v1/assets/{asset['id']}")

    def run_for_long(self, attack, count, **job):
        """Starts jobs of minutes, and cancels them after a while."""
        answers = [self.ask(attack, "POST", "/v1/jobs", job) for _ in range(count)]
        self.stop.wait(LONG_JOB_SECONDS)
        for answer in answers:
            if answer.status in (200, 202):
                self.ask(attack, "DELETE", f"/v1/jobs/{answer.json()['id']}")

    def fill_open_triangles(self):
        self.run_for_long("fill_open_triangles", 3, kind="voxelize", asset=self.lattice_asset,
                          options={"size": 512, "fill": "solid", "sign": "winding", "cache": "no"})

    def decode_textures(self):
        self.run_for_long("decode_textures", 1, kind="voxelize", asset=self.textures_asset,
                          options={"size": 8, "color": "average", "cache": "no"})

    def draw_turntables(self):
        self.run_for_long("draw_turntables", 6, kind="render", asset=self.own_asset,
                          options={"size": 256, "image": "gif", "turntable": 360, "width": 2048, "height": 2048,
                                   "samples": 4, "cache": "no"})

    def fill_with_records(self):
        """Jobs on a small asset with names, keys and times as long as they may be."""
        made = []
        for number in range(50):
            key = f"{self.chance.random()}{number}".ljust(200, "k")
            answer = self.ask("fill_with_records", "POST", "/v1/jobs",
                              {"kind": "voxelize", "asset": self.worm_asset, "filename": "n" * 200,
                               "options": {"size": 8, "times": [i / 1000 for i in range(1000)], "cache": "no"}},
                              {"Idempotency-Key": key})
            if answer.status == 507:
                break
            if answer.status in (200, 202):
                made.append(answer.json()["id"])
        for job in made:  # not those of the attacks beside this one
            self.ask("fill_with_records", "DELETE", f"/v1/jobs/{job}?ended=remove")

    def hold_deleted_files(self):
        """Results of 10 MB that are deleted while connections that read nothing hold them."""
        own, jobs = self.tenants[HOSTILE], []
        for _ in range(3):
            answer = self.ask("hold_deleted_files", "POST", "/v1/jobs",
                              {"kind": "voxelize", "asset": self.own_asset,
                               "options": {"size": 220, "format": "npy", "cache": "no"}})
            if answer.status in (200, 202):
                jobs.append(answer.json()["id"])
        jobs = [job for job in jobs if own.wait(job, seconds=300)["state"] == "done"]
        self.hold("hold_deleted_files",
                  [self.head_of("GET", f"/v1/jobs/{job}/result") for job in jobs for _ in range(10)],
                  lambda: [self.ask("hold_deleted_files", "DELETE", f"/v1/jobs/{job}/result") for job in jobs])

    ATTACKS = (read_no_responses, send_half_bodies, send_half_heads, watch_events, wait_for_jobs, fill_the_queue,
               cancel_all, send_long_strings, send_nonsense, fill_the_disk, fill_open_triangles, decode_textures,
               draw_turntables, fill_with_records, hold_deleted_files)

    def prepare(self):
        """Creates the attackers' resources: assets, a grid of many tiles, a long job."""
        own = self.tenants[HOSTILE]
        self.own_asset = own.post("/v1/assets?filename=own.ply", self.mesh).json()["id"]
        self.worm_asset = own.post("/v1/assets?filename=worm.md5.zip", self.worm).json()["id"]
        self.lattice_asset = own.post("/v1/assets?filename=lattice.ply", lattice(28)).json()["id"]
        self.textures_asset = own.post("/v1/assets?filename=textures.zip", textured_mesh(4, 5000)).json()["id"]
        job = own.submit(kind="voxelize", asset=self.own_asset,
                         options={"size": 4096, "channels": "occupancy", "format": "native"})
        status = own.wait(job)
        self.grid = (status.get("result") or {}).get("grid")
        self.own_job = own.submit(kind="voxelize", asset=self.own_asset,
                                  options={"size": 16384, "channels": "occupancy", "cache": "no"})

    def be_hostile(self, attack):
        while not self.stop.is_set():
            try:
                attack(self)
            except (OSError, ValueError, KeyError, AssertionError) as failure:
                self.count(attack.__name__, type(failure).__name__)
                self.stop.wait(0.2)

    # --- phases

    def run_phase(self, name, seconds, attacks=()):
        """Facts of a phase: percentiles of honest clients in milliseconds, and the gateway's memory."""
        self.stop.clear()
        self.times_ms, self.hostile, wrong_before = {}, {}, len(self.wrong)
        run_for(seconds, self.stop, [lambda tenant=tenant: self.be_honest(tenant) for tenant in HONEST] +
                [lambda attack=attack: self.be_hostile(attack) for attack in attacks])
        now_kb, most_kb = memory_kb(self.daemon.process.pid)
        return {"phase": name, "wrong": len(self.wrong) - wrong_before,
                "gateway_kb": now_kb, "gateway_most_kb": most_kb, "disk_kb": disk_kb(self.data_dir),
                "ms": {what: {"count": len(times), "p50": round(statistics.median(times), 1),
                              "p99": round(percentile(times, 0.99), 1), "max": round(max(times), 1)}
                       for what, times in self.times_ms.items()},
                "hostile": self.hostile}
