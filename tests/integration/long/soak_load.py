"""A mixed load in rounds, with a rest after each: what test_soak asserts shortly and tests/bench/soak.py for long.

Nothing that a daemon holds may grow with what it has done: after each round it is left alone until it
is at rest, and then its memory, descriptors, threads and files are taken down."""
import contextlib
import json
import os
import pathlib
import random
import signal
import socket
import threading
import time

import yaml

from harness import ROOT, TenantsDaemon, run_for

# Data that lives longer than the shortest round would hide leaks.
ARGUMENTS = ["--store-bytes-max", "48M", "--keep-jobs-days", "0.0002", "--keep-assets-days", "0.0002",
             "--keep-results-days", "0.0002", "--part-seconds", "1", "--log-level", "warn"]
FORMATS = yaml.safe_load((ROOT / "proto/openapi.yaml").read_text())["components"]["parameters"][
    "format"]["schema"]["enum"]
TENANTS = ("ada", "ben", "cleo")
CLIENTS = 9  # threads of run_round()
REFUSALS = {400, 401, 404, 408, 409, 410, 413, 415, 416, 422, 429, 503, 507}


def descriptors(pid):
    """How many of each sort; files by name are one sort."""
    count = {}
    for entry in pathlib.Path(f"/proc/{pid}/fd").iterdir():
        try:
            target = os.readlink(entry)
        except FileNotFoundError:
            continue
        sort = target.split(":")[0] if ":" in target else "file"
        count[sort] = count.get(sort, 0) + 1
    return count


def differences(before, after):
    """Texts of the differences between two rests. Two differences are allowed. A worker connects once more at its
    first time slice. The database holds as many readers, of two files each, as were busy at a time within ten
    seconds: one for each client and worker. A leak per request would be thousands."""
    found = []
    workers = len(after["workers_rss_kb"])
    may_differ = {"socket": workers, "file": 2 * (CLIENTS + workers)}
    for sort in before["descriptors"] | after["descriptors"]:
        was, now = (facts["descriptors"].get(sort, 0) for facts in (before, after))
        if abs(was - now) > may_differ.get(sort, 0):
            found.append(f"descriptors ({sort}): {was} became {now}")
    if max(after["workers_descriptors"]) > max(before["workers_descriptors"]) + 1:
        found.append(f"workers' descriptors: {before['workers_descriptors']} became "
                     f"{after['workers_descriptors']}")
    if len(before["workers_rss_kb"]) != len(after["workers_rss_kb"]):
        found.append(f"workers: {before['workers_rss_kb']} became {after['workers_rss_kb']}")
    if before["gateway"]["threads"] != after["gateway"]["threads"]:
        found.append(f"threads: {before['gateway']} became {after['gateway']}")
    return found


def status_of(pid):
    lines = pathlib.Path(f"/proc/{pid}/status").read_text().splitlines()
    fields = dict(line.split(":", 1) for line in lines if ":" in line)
    return {"rss_kb": int(fields["VmRSS"].split()[0]), "threads": int(fields["Threads"])}


def children(pid):
    found = []
    for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
        try:
            found += map(int, (task / "children").read_text().split())
        except (FileNotFoundError, ProcessLookupError):  # a thread that has ended since
            continue
    return found


def folder_bytes(folder):
    total = 0
    for directory, _, files in os.walk(folder):
        for name in files:
            try:
                total += os.stat(os.path.join(directory, name)).st_size
            except FileNotFoundError:
                pass
    return total


class Soak(TenantsDaemon):
    """A daemon with tenants, and what clients of all sorts do to it."""

    def __init__(self, device="cpu", seed=1, kill_workers=True):
        super().__init__({name: 1 + i for i, name in enumerate(TENANTS)}, device, ARGUMENTS)
        self.seed, self.kill_workers = seed, kill_workers
        self.meshes = [self.fixtures / name for name in
                       ("sample.ply", "sample.glb", "sample.stl", "sample.off", "sample.obj.zip",
                        "concave.obj", "quantized.gltf", "sparse.gltf")]
        self.bad = sorted((self.fixtures / "bad").iterdir())
        self.stop = threading.Event()
        self.lock = threading.Lock()
        self.responses, self.wrong = {}, []

    # --- what clients do; each returns when it has done one thing

    def ask(self, tenant, method, path, expected, body=None, headers=None):
        """The response. Its status must be in `expected`, or it is a refusal with Retry-After."""
        if isinstance(body, (dict, list)):
            body, headers = json.dumps(body), {"Content-Type": "application/json", **(headers or {})}
        response = self.tenants[tenant].request(method, path, body, headers)
        with self.lock:
            self.responses[response.status] = self.responses.get(response.status, 0) + 1
            if response.status not in expected:
                self.wrong.append(f"{method} {path}: {response.status} {response.body[:300]!r}")
        return response

    def upload(self, tenant, chance):
        path = chance.choice(self.meshes)
        response = self.ask(tenant, "POST", "/v1/assets?filename=" + path.name, {200, 201},
                          path.read_bytes())
        return response.json()["id"]

    def convert(self, tenant, chance):
        """Upload, job, wait, result whole and in part, another format, an image."""
        asset = self.upload(tenant, chance)
        options = {"size": chance.randint(8, 96), "format": chance.choice(FORMATS)}
        job = self.ask(tenant, "POST", "/v1/jobs", {200, 202},
                       {"kind": "voxelize", "asset": asset, "options": options}).json()
        status = self.ask(tenant, "GET", f"/v1/jobs/{job['id']}", {200},
                          headers={"Prefer": "wait=30"}).json()
        if status["state"] != "done":
            return
        path = f"/v1/jobs/{job['id']}/result"
        for headers in ({}, {"Range": "bytes=3-40"}, {"Accept-Encoding": "gzip"}):
            self.ask(tenant, "GET", path, {200, 206, 410}, headers=headers)
        self.ask(tenant, "GET", path + "?format=" + chance.choice(FORMATS), {200, 410, 422, 503})
        if grid := status["result"].get("grid"):
            self.ask(tenant, "GET", f"/v1/grids/{grid}/render.png?width=64&height=64", {200, 404, 410})

    def one_shot(self, tenant, chance):
        path = chance.choice(self.meshes)
        query = f"filename={path.name}&size={chance.randint(8, 64)}"
        if chance.random() < 0.5:
            self.ask(tenant, "POST", f"/v1/voxelize?{query}&format={chance.choice(FORMATS)}",
                     {200, 422}, path.read_bytes())
        else:
            self.ask(tenant, "POST", f"/v1/render?{query}&width=80&height=60", {200},
                     path.read_bytes())

    def animate(self, tenant, chance):
        body = (self.fixtures / "worm.md5.zip").read_bytes()
        self.ask(tenant, "POST", f"/v1/voxelize?filename=worm.md5.zip&animation=walk&size="
                 f"{chance.randint(8, 40)}&fps=6&format=native", {200, 422}, body)

    def change_mind(self, tenant, chance):
        # Unique bytes, because the asset is deleted below.
        body = (self.fixtures / "concave.obj").read_bytes() + b"# %d\n" % chance.getrandbits(64)
        asset = self.ask(tenant, "POST", "/v1/assets?filename=own.obj", {201}, body).json()["id"]
        job = self.ask(tenant, "POST", "/v1/jobs", {200, 202},
                       {"kind": "voxelize", "asset": asset,
                        "options": {"size": chance.choice((200, 3000, 8000)), "cache": "no",
                                    "channels": "occupancy"}}).json()
        time.sleep(chance.random() * 0.5)
        self.ask(tenant, "DELETE", f"/v1/jobs/{job['id']}", {200, 202})
        self.ask(tenant, "DELETE", f"/v1/assets/{asset}", {200, 204, 404, 409, 410})

    def send_nonsense(self, tenant, chance):
        path = chance.choice(self.bad)
        self.ask(tenant, "POST", "/v1/voxelize?size=32&filename=" + path.name, REFUSALS,
                 path.read_bytes())
        self.ask(tenant, "GET", "/v1/jobs/" + "%x" % chance.getrandbits(40), {400, 404})

    def be_rude(self, tenant, chance):
        """Closes within a request, or within a response."""
        key = self.tenants[tenant].key
        body = self.meshes[1].read_bytes()
        request = (f"POST /v1/voxelize?size=48&filename=a.glb HTTP/1.1\r\nHost: localhost\r\nAuthorization: "
                   f"Bearer {key}\r\nContent-Length: {len(body)}\r\n\r\n").encode() + body
        with socket.create_connection(("127.0.0.1", self.daemon.port), timeout=10) as client:
            client.sendall(request[:chance.choice((0, 10, 60, 200, 5000, len(request)))])
            if chance.random() < 0.5:
                client.settimeout(0.2)
                try:
                    client.recv(1000)
                except OSError:
                    pass

    def watch(self, tenant, chance):
        jobs = self.ask(tenant, "GET", "/v1/jobs?limit=5", {200}).json()["jobs"]
        for job in jobs:
            with socket.create_connection(("127.0.0.1", self.daemon.port), timeout=10) as client:
                client.sendall(f"GET /v1/jobs/{job['id']}/events HTTP/1.1\r\nHost: localhost\r\nAuthorization:"
                               f" Bearer {self.tenants[tenant].key}\r\n\r\n".encode())
                client.recv(400)
        self.ask(tenant, "GET", "/v1/queue", {200})
        self.ask(tenant, "GET", "/v1/me", {200})

    def operate(self, chance):
        """Events in the life of a daemon: scrapes, new keys, workers that die."""
        self.daemon.request("GET", "/metrics", port=self.daemon.admin_port)
        key_id = self.voxeld_keys("add", "guest", "--expires", "1d")[4:12]
        self.voxeld_keys("revoke", key_id)
        if self.kill_workers:
            workers = children(self.daemon.process.pid)
            if workers:
                with contextlib.suppress(ProcessLookupError):  # the daemon ended it meanwhile
                    os.kill(chance.choice(workers), signal.SIGKILL)
        self.stop.wait(3)

    # --- rounds

    def loop(self, number, action):
        chance = random.Random(f"{self.seed}/{number}/{self.round}")
        while not self.stop.is_set():
            try:
                action(chance)
            except Exception as failure:  # one client's, told in the end
                with self.lock:
                    self.wrong.append(f"{action}: {failure!r}")
                self.stop.wait(0.5)

    def run_round(self, number, seconds):
        """Facts once the daemon is at rest after the round."""
        self.round = number
        self.stop.clear()
        sorts = (self.convert, self.convert, self.one_shot, self.animate, self.change_mind,
                 self.send_nonsense, self.be_rude, self.watch)
        actions = [lambda chance, sort=sort, i=i: sort(TENANTS[i % len(TENANTS)], chance)
                   for i, sort in enumerate(sorts)] + [self.operate]
        assert len(actions) == CLIENTS
        run_for(seconds, self.stop,
                [lambda i=i, action=action: self.loop(i, action) for i, action in enumerate(actions)])
        return self.rest()

    def gauges(self):
        text = self.daemon.request("GET", "/metrics", port=self.daemon.admin_port).body.decode()
        return {name: float(value) for name, value in
                (line.rsplit(" ", 1) for line in text.splitlines() if not line.startswith("#"))}

    def rest(self, seconds=120):
        """Waits until nothing is queued, running, connected or stored; by then everything has expired."""
        deadline = time.monotonic() + seconds
        while True:
            gauges = self.gauges()
            ready = self.daemon.request("GET", "/readyz", port=self.daemon.admin_port).json()
            busy = [worker for worker in ready["workers"] if not worker["connected"] or worker["task"]]
            left = {name: gauges[name] for name in
                    ('voxeld_jobs{state="queued"}', 'voxeld_jobs{state="running"}', "voxeld_store_bytes",
                     'voxeld_http_state{what="connections"}', 'voxeld_http_state{what="running"}')
                    if gauges[name] != 0}
            if not busy and not left:
                break
            assert time.monotonic() < deadline, (left, busy)
            time.sleep(0.2)
        gateway = self.daemon.process.pid
        return {"gateway": status_of(gateway), "descriptors": descriptors(gateway),
                "workers_rss_kb": sorted(status_of(pid)["rss_kb"] for pid in children(gateway)),
                "workers_descriptors": sorted(sum(descriptors(pid).values())
                                              for pid in children(gateway)),
                "data_bytes": folder_bytes(self.data_dir), "requests": sum(self.responses.values())}
