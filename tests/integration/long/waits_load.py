"""Requests that wait, by the thousand: what test_waits asserts and tests/bench/waits.py measures.

A crowd of tenants opens connections whose responses wait: one-shots, long polls, event streams, slow
uploads. Another tenant does small things all the time and notes how long each took."""
import contextlib
import resource
import select
import socket
import threading
import time

from harness import TenantsDaemon

# Three may have three quarters of the places, where one may have half.
CROWD = ("crowd-1", "crowd-2", "crowd-3")
OTHER = "other"
# Work of seconds each, so that a crowd of such jobs waits for as long as a test needs.
LARGE = "size=6000&channels=occupancy&cache=no&format=native"
SMALL = "size=32&color=none&cache=no"
SLOW_UPLOAD_BYTES = 1_000_000
SLOW_UPLOAD_STEP = b"x" * 1100  # each second: just over the least rate of a body


def resident_kb(pid):
    with open(f"/proc/{pid}/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmRSS:"))


def percentile(values, part):
    return sorted(values)[min(len(values) - 1, int(len(values) * part))]


def raise_descriptors():
    """Raises the limit on open files, of this process and of daemons that it starts; returns it."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    return hard


class Crowd(TenantsDaemon):
    def __init__(self, device="cpu", arguments=()):
        raise_descriptors()
        super().__init__({name: 1 for name in (*CROWD, OTHER)}, device,
                         ["--workers-per-device", "2", "--log-level", "error", *arguments])
        self.mesh = (self.fixtures / "sample.ply").read_bytes()
        # The same bytes have the same id for each tenant.
        self.asset, = {self.tenants[name].upload(self.fixtures / "sample.ply") for name in CROWD}
        self.jobs = {}  # tenant -> a job that waits behind all others
        self.held = []
        self.drips = []
        self.dripping = threading.Event()

    def close(self):
        self.release()
        super().close()

    # --- the crowd

    def send(self, tenant, method, path, headers="", body=b""):
        client = socket.create_connection(("127.0.0.1", self.daemon.port), timeout=60)
        client.sendall(f"{method} {path} HTTP/1.1\r\nHost: localhost\r\n"
                       f"Authorization: Bearer {self.keys[tenant]}\r\n{headers}\r\n".encode() + body)
        self.held.append(client)
        return client

    def one_shot(self, tenant, query):
        return self.send(tenant, "POST", f"/v1/voxelize?asset={self.asset}&{query}", "Content-Length: 0\r\n")

    def one_shots(self, count, tenants=CROWD):
        return [self.one_shot(tenants[i % len(tenants)], LARGE) for i in range(count)]

    def waiting_job(self, tenant):
        if tenant not in self.jobs:
            self.jobs[tenant] = self.tenants[tenant].submit(
                kind="voxelize", asset=self.asset, priority=-100,
                options={"size": 6000, "channels": "occupancy", "cache": "no"})
        return self.jobs[tenant]

    def watch(self, count, path, headers="", tenants=CROWD):
        """Requests for a job that waits; `{}` of the path is its id."""
        clients = []
        for i in range(count):
            tenant = tenants[i % len(tenants)]
            clients.append(self.send(tenant, "GET", path.format(self.waiting_job(tenant)), headers))
        return clients

    def polls(self, count, tenants=CROWD):
        return self.watch(count, "/v1/jobs/{}", "Prefer: wait=60\r\n", tenants)

    def streams(self, count, tenants=CROWD):
        return self.watch(count, "/v1/jobs/{}/events", "", tenants)

    def slow_uploads(self, count, tenants=CROWD):
        clients = [self.send(tenants[i % len(tenants)], "POST", "/v1/assets",
                             f"Content-Length: {SLOW_UPLOAD_BYTES}\r\n", b"ply\n") for i in range(count)]
        drip = threading.Thread(target=self.drip, args=(clients,))
        drip.start()
        self.drips.append(drip)
        return clients

    def drip(self, clients):
        while not self.dripping.wait(1):
            for client in clients:
                with contextlib.suppress(OSError):
                    client.sendall(SLOW_UPLOAD_STEP)

    def release(self):
        """Every client of the crowd leaves."""
        self.dripping.set()
        for drip in self.drips:
            drip.join()
        for client in self.held:
            client.close()
        self.held, self.drips, self.dripping = [], [], threading.Event()

    # --- what the daemon says

    def queue(self):
        return self.tenants[CROWD[0]].get("/v1/queue?limit=1").json()

    def gauge(self, what):
        text = self.daemon.request("GET", "/metrics", port=self.daemon.admin_port).body.decode()
        line = next((line for line in text.splitlines() if f'voxeld_http_state{{what="{what}"}}' in line), None)
        return int(float(line.split()[-1])) if line else 0

    def await_waiting(self, count, seconds=300):
        deadline = time.monotonic() + seconds
        while self.gauge("waiting") < count:
            assert time.monotonic() < deadline, f"{self.gauge('waiting')} of {count} wait"
            time.sleep(0.1)

    def await_crowd(self, streams, one_shots, seconds=300):
        """Until so many streams and all one-shots wait, but those whose jobs have ended meanwhile; their number."""
        deadline = time.monotonic() + seconds
        while True:
            ended = len(readable(one_shots, 0))
            waiting = self.gauge("waiting")
            if waiting + ended >= streams + len(one_shots):
                return ended
            assert time.monotonic() < deadline, f"{waiting} wait and {ended} have ended"
            time.sleep(0.1)

    def await_queued(self, count, seconds=300):
        deadline = time.monotonic() + seconds
        while True:
            queue = self.queue()
            if queue["queued"] + queue["running"] >= count:
                return
            assert time.monotonic() < deadline, f"{queue['queued']} of {count} jobs are queued"
            time.sleep(0.1)

    # --- the other tenant

    def timed(self, method, path, body=None, port=None):
        begin = time.monotonic()
        who = self.tenants[OTHER] if port is None else self.daemon
        response = who.request(method, path, body, {"Content-Length": "0"} if method == "POST" and not body else None,
                               port=port, timeout=120)
        return response, (time.monotonic() - begin) * 1000

    def small_things(self, rounds):
        """{what: milliseconds of each} of small requests of the other tenant; all must succeed."""
        asset = self.tenants[OTHER].upload(self.fixtures / "sample.ply")
        times = {"one-shot": [], "upload": [], "poll": [], "livez": []}
        for _ in range(rounds):
            steps = (("one-shot", "POST", f"/v1/voxelize?asset={asset}&{SMALL}", None, None),
                     ("upload", "POST", "/v1/assets?filename=a.ply", self.mesh, None),
                     ("poll", "GET", "/v1/jobs?limit=1", None, None),
                     ("livez", "GET", "/livez", None, self.daemon.admin_port))
            for what, method, path, body, port in steps:
                response, ms = self.timed(method, path, body, port)
                assert response.status in (200, 201), (what, response.status, response.body[:300])
                times[what].append(ms)
        return times


def readable(clients, seconds):
    """The clients that have data to read, or whose connection has ended."""
    poll = select.poll()
    by_fd = {client.fileno(): client for client in clients}
    for fd in by_fd:
        poll.register(fd, select.POLLIN)
    return [by_fd[fd] for fd, _ in poll.poll(seconds * 1000)]


def await_readable(clients, seconds=300):
    """Until each client has data to read, or its connection has ended."""
    deadline = time.monotonic() + seconds
    while (count := len(readable(clients, 0))) < len(clients):
        assert time.monotonic() < deadline, f"{count} of {len(clients)} are readable"
        time.sleep(0.1)
