"""Times that a client waits: one-shot requests and previews on one kept connection.

Rows as in measures.py; ms is measured at the client, from the request's first byte to the response's last.
"""
import http.client
import pathlib
import socket
import statistics
import time

from .measures import skipped
from .programs import Daemon

ONE_SHOT = "one-shot"
SAMPLES = {1: "preview, samples=1", 2: "preview, samples=2"}
PREVIEW = "width=512&height=512&azimuth=40"
RUNS_MIN = 15  # they are short, and the first ones warm up


class Client:
    def __init__(self, url):
        self.connection = http.client.HTTPConnection(url.removeprefix("http://"), timeout=600)
        self.connection.connect()
        self.connection.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def request(self, method, path, body=None):
        """Milliseconds, headers and body. Raises RuntimeError with the daemon's words."""
        begin = time.perf_counter()
        self.connection.request(method, path, body)
        response = self.connection.getresponse()
        content = response.read()
        elapsed = (time.perf_counter() - begin) * 1e3
        if response.status != 200:
            raise RuntimeError(f"{path}: {response.status}: {content[:300]!r}")
        return elapsed, response.headers, content

    def median(self, runs, method, path_of, body=None):
        """Of `runs` requests after three that warm up; path_of(i) differs where a cache would answer."""
        return statistics.median(self.request(method, path_of(i), body)[0] for i in range(runs + 3)[3:])


def latency_table(context, scenes, sizes):
    rows = []
    runs = max(context.runs, RUNS_MIN)
    with Daemon(context.programs, "cpu") as daemon:
        client = Client(daemon.url)
        for scene in scenes:
            for size in sizes:
                rows += _of_scene(client, scene, size, runs)
    return rows


def _of_scene(client, scene, size, runs):
    everyone = [ONE_SHOT, *SAMPLES.values()]
    if scene.skipped:
        return [skipped(scene, size, who, scene.skipped) for who in everyone]

    def row(who, ms, **more):
        return {"scene": scene.key, "size": size, "who": who, "ms": ms, **more}

    body = pathlib.Path(scene.file).read_bytes()
    path = f"/v1/voxelize?size={size}&cache=no&filename={pathlib.Path(scene.file).name}"
    try:
        ms = client.median(runs, "POST", lambda _: path, body)
        grid = client.request("POST", path, body)[1]["X-Voxeld-Grid"]
        rows = [row(ONE_SHOT, ms, upload_bytes=len(body))]
        for samples, who in SAMPLES.items():
            image = f"/v1/grids/{grid}/render.png?{PREVIEW}&samples={samples}&cache=no"
            rows.append(row(who, client.median(runs, "GET", lambda _: image)))
    except (RuntimeError, OSError) as reason:
        return [skipped(scene, size, who, str(reason)[:300]) for who in everyone]
    return rows
