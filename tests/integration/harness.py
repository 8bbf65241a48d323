"""Starts voxeld on ports of its own, talks HTTP to it, and holds every response against openapi.json."""
import contextlib
import copy
import email.utils
import functools
import http.client
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import tempfile
import threading
import time
import unittest

import jsonschema
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(os.environ.get("VOXELD_BIN_DIR", ROOT / "build/dev/bin"))
DATA = os.environ.get("VOXELD_DATA_DIR")
# Time that ends a test which hangs. No test fails because a machine is slow, up to this.
HANG_SECONDS = 300
# How a daemon may end: by itself, or by a signal of a test or of its own watch. Any other end is a crash.
EXIT_STATUSES = (0, -signal.SIGTERM, -signal.SIGINT, -signal.SIGKILL, -signal.SIGALRM)
PIPELINES = ("raster", "compute", "cpu")
# The pipelines of each device that needs no hardware.
DEVICES = {"llvmpipe": PIPELINES, "lavapipe": PIPELINES, "osmesa": PIPELINES, "cpu": ("cpu",)}


def make_fixtures(directory):
    subprocess.run([BIN / "voxeld_make_fixtures", directory], check=True, stdout=subprocess.DEVNULL)
    # Parallel squares: the largest grid of them takes minutes, in many tiles of some milliseconds.
    (pathlib.Path(directory) / "sheets.obj").write_text("".join(
        f"v 0 0 {z}\nv 256 0 {z}\nv 0 256 {z}\nv 256 256 {z}\nf -4 -3 -2\nf -2 -3 -1\n" for z in range(256)))


def oracle(mesh, size, rule="touch"):
    """(dims, occupied, sha256 id of the uint8 zyx occupancy) that the rule must give."""
    out = subprocess.run([BIN / "voxeld_oracle", mesh, str(size), rule], check=True,
                         capture_output=True, text=True).stdout.split()
    return tuple(int(v) for v in out[1:4]), int(out[5]), out[6]


def wait_until(condition, what, seconds=HANG_SECONDS):
    """The first true value of condition(). what: text or object for the failure, or a function that gives it."""
    deadline = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < deadline, f"not within {seconds} s: {what() if callable(what) else what}"
        time.sleep(0.02)
    return value


def until_met(sizes, attempt):
    """The first true value of attempt(size): false where a job ended before the test acted; a larger one lasts longer.
    """
    for size in sizes:
        if value := attempt(size):
            return value
    raise AssertionError(f"none of the sizes {sizes} lasted long enough")


class Response:
    def __init__(self, status, headers, body):
        self.status = status
        self.headers = headers
        self.body = body

    def json(self):
        return json.loads(self.body)


class OpenApi:
    """Checks responses against the specification that the project ships."""

    def __init__(self):
        # As openapi.json has it: statuses are texts.
        text = (ROOT / "proto/openapi.yaml").read_text()
        self.spec = spec = json.loads(json.dumps(yaml.load(text, Loader=yaml.CSafeLoader)))
        # By schema: to make one takes longer than to use it, which one thread at a time may do.
        self.validators = {}
        self.lock = threading.Lock()
        self.routes = []
        for template, operations in spec["paths"].items():
            rest = re.sub(r"\{key\}$", ".+", template)  # all segments
            pattern = re.compile("^" + re.sub(r"\{[^}]+\}", "[^/]+", rest) + "$")
            self.routes.append((template.count("{"), pattern, template, operations))
        self.routes.sort(key=lambda route: (route[0], -len(route[2])))

    def resolve(self, node):
        while isinstance(node, dict) and "$ref" in node:
            target = self.spec
            for part in node["$ref"].lstrip("#/").split("/"):
                target = target[part]
            node = target
        return node

    def check(self, method, path, response):
        path = path.split("?")[0]
        for _, pattern, template, operations in self.routes:
            if not pattern.match(path):
                continue
            if method.lower() not in operations and method == "HEAD":
                method = "GET"
            if method.lower() not in operations:
                assert response.status in (204, 403, 405), f"{method} {template}: {response.status}"
                return
            self.check_operation(f"{method} {template}", operations[method.lower()], response)
            return
        assert response.status in (400, 403, 404, 405), f"{method} {path} is not in openapi: {response.status}"

    def check_operation(self, name, operation, response):
        responses = operation["responses"]
        entry = responses.get(str(response.status)) or responses.get(
            f"{response.status // 100}XX") or responses.get("default")
        assert entry, f"{name}: status {response.status} is not in openapi"
        entry = self.resolve(entry)
        for header, definition in (entry.get("headers") or {}).items():
            if self.resolve(definition).get("required"):
                assert response.headers.get(header) is not None, f"{name} {response.status}: no {header}"
        content = entry.get("content") or {}
        media_type = (response.headers.get("Content-Type") or "").split(";")[0].strip()
        if not response.body:
            return
        assert media_type in content or "*/*" in content, (
            f"{name} {response.status}: {media_type} is not one of {sorted(content)}")
        schema = content.get(media_type, content.get("*/*", {})).get("schema")
        if schema and media_type.endswith("json"):
            with self.lock:
                self.validator(schema).validate(json.loads(response.body))

    def validator(self, schema):
        key = json.dumps(schema)
        if key not in self.validators:
            whole = {"components": self.spec["components"], **schema}
            self.validators[key] = jsonschema.Draft202012Validator(whole)
        return self.validators[key]


@functools.cache  # reading it takes longer than the daemon's start
def open_api():
    return OpenApi()


class Daemon:
    """One voxeld with a data directory of its own."""
    program = [BIN / "voxeld"]

    def __init__(self, device="llvmpipe", data_dir=None, arguments=(), listen=None, host="127.0.0.1"):
        """host is the address that requests go to."""
        self.device = device
        self.host = host
        self.listen = listen or f"{host}:0"
        self.own_data = data_dir is None
        self.data_dir = data_dir or tempfile.mkdtemp(prefix="voxeld-test-")
        self.arguments = list(arguments)
        self.key = None  # API key of every request
        self.openapi = open_api()
        self.start()

    def start(self, until_ready=True):
        self.log = open(self.data_dir.rstrip("/") + ".log", "ab")
        sandbox = [] if "--sandbox" in self.arguments else ["--sandbox", "require"]
        self.process = subprocess.Popen(
            [*self.program, "serve", "--listen", self.listen, "--admin-listen", "127.0.0.1:0",
             "--data", self.data_dir, "--device", self.device, *sandbox, *self.arguments],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=self.log, text=True)
        try:
            line = self.process.stdout.readline()
            match = re.match(r"ready http://(?:[\d.]+|\[[\da-f:]+\]):(\d+) admin=http://127\.0\.0\.1:(\d+)", line)
            if not match:
                self.process.wait(HANG_SECONDS)
                raise AssertionError(f"daemon did not start: {line!r}\n{self.log_tail()}")
            self.port, self.admin_port = int(match.group(1)), int(match.group(2))
            self.url = f"http://{self.host}:{self.port}"
            if until_ready:
                self.wait_ready()
        except BaseException:
            self.process.kill()  # nobody ends a daemon whose test did not begin
            raise

    def wait_ready(self):
        deadline = time.monotonic() + HANG_SECONDS
        while time.monotonic() < deadline:
            response = self.request("GET", "/readyz", port=self.admin_port)
            if response.status == 200:
                return
            time.sleep(0.05)
        raise AssertionError(f"not ready: {response.body!r}\n{self.log_tail()}")

    def log_tail(self, size=4000):
        with open(self.log.name, "rb") as file:
            return file.read()[-size:].decode(errors="replace")

    def holding(self, key):
        """The same daemon as the holder of another key sees it."""
        other = copy.copy(self)
        other.key = key
        return other

    def request(self, method, path, body=None, headers=None, port=None, timeout=HANG_SECONDS):
        host = self.host if port is None else "127.0.0.1"
        connection = http.client.HTTPConnection(host, port or self.port, timeout=timeout)
        headers = dict(headers or {})
        if self.key is not None:
            headers.setdefault("Authorization", "Bearer " + self.key)
        try:
            connection.request(method, path, body=body, headers=headers)
            raw = connection.getresponse()
            response = Response(raw.status, raw.headers, raw.read())
        finally:
            connection.close()
        assert email.utils.parsedate_to_datetime(response.headers["Date"]), response.headers["Date"]
        if port is None:
            self.openapi.check(method, path, response)
        return response

    def get(self, path, **kw):
        return self.request("GET", path, **kw)

    def post(self, path, body=None, **kw):
        if isinstance(body, (dict, list)):
            body = json.dumps(body)
            kw.setdefault("headers", {})["Content-Type"] = "application/json"
        return self.request("POST", path, body=body, **kw)

    def upload(self, path):
        with open(path, "rb") as file:
            response = self.post("/v1/assets?filename=" + os.path.basename(path), file.read())
        assert response.status in (200, 201), response.body
        return response.json()["id"]

    def submit(self, **job):
        response = self.post("/v1/jobs", job)
        assert response.status in (200, 202), response.body
        return response.json()["id"]

    def wait(self, job, seconds=HANG_SECONDS):
        deadline = time.monotonic() + seconds
        while True:
            status = self.get(f"/v1/jobs/{job}", headers={"Prefer": "wait=10"}).json()
            if status["state"] in ("done", "failed", "cancelled"):
                return status
            assert time.monotonic() < deadline, status

    def has_ended(self, job):
        return self.get(f"/v1/jobs/{job}").json()["ended_ms"] > 0

    def cancel(self, job):
        """Cancels a job and returns how it ended, also where that was before."""
        response = self.request("DELETE", f"/v1/jobs/{job}")
        return self.wait(job) if response.status == 202 else response.json()

    def wait_state(self, job, state, seconds=HANG_SECONDS):
        deadline = time.monotonic() + seconds
        while True:
            status = self.get(f"/v1/jobs/{job}").json()
            if status["state"] == state:
                return status
            assert time.monotonic() < deadline and status["state"] in ("queued", "running"), status
            time.sleep(0.005)

    def worker_pid(self):
        workers = self.request("GET", "/readyz", port=self.admin_port).json()["workers"]
        connected = [worker for worker in workers if worker["connected"]]
        busy = [worker for worker in connected if worker["task"]]  # the one that matters
        return (busy or connected)[0]["pid"] if connected else None

    def kill_worker(self):
        pid = self.worker_pid()
        assert pid, "no worker"
        os.kill(pid, signal.SIGKILL)
        return pid

    def kill_gateway(self):
        self.process.kill()
        self.process.wait(HANG_SECONDS)
        self.process.stdout.close()
        self.log.close()

    def stop(self):
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(HANG_SECONDS)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait(HANG_SECONDS)
                raise AssertionError("daemon did not stop on SIGTERM\n" + self.log_tail())
        self.process.stdout.close()
        self.log.close()
        status = self.process.returncode
        said = "" if status in EXIT_STATUSES else self.log_tail()
        if self.own_data:
            shutil.rmtree(self.data_dir, ignore_errors=True)
            os.unlink(self.data_dir.rstrip("/") + ".log")
        assert status in EXIT_STATUSES, f"the daemon ended with {status}\n{said}"


@contextlib.contextmanager
def daemon_with_fixtures(device="cpu", arguments=()):
    """(daemon, folder of fixtures), for programs; both go with the block."""
    with tempfile.TemporaryDirectory(prefix="voxeld-fixtures-", ignore_cleanup_errors=True) as folder:
        fixtures = pathlib.Path(folder)
        make_fixtures(fixtures)
        daemon = Daemon(device=device, arguments=arguments)
        try:
            yield daemon, fixtures
        finally:
            daemon.stop()


def run_for(seconds, stop, calls):
    """Runs the calls, each on a thread; sets the event `stop` after so many seconds, by which they end."""
    threads = [threading.Thread(target=call) for call in calls]
    for thread in threads:
        thread.start()
    stop.wait(seconds)
    stop.set()
    for thread in threads:
        thread.join()


class TenantsDaemon:
    """A daemon with a key for each tenant, for a with statement; weights: name -> weight."""

    def __init__(self, weights, device="cpu", arguments=()):
        self.data_dir = tempfile.mkdtemp(prefix="voxeld-tenants-")
        self.fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        make_fixtures(self.fixtures)
        self.keys = {name: self.voxeld_keys("add", name, "--weight", str(weight))
                     for name, weight in weights.items()}
        self.daemon = Daemon(device=device, data_dir=self.data_dir, arguments=arguments)
        self.connect()

    def connect(self):
        """Anew where the daemon was started again, on another port."""
        self.tenants = {name: self.daemon.holding(key) for name, key in self.keys.items()}

    def voxeld_keys(self, *arguments):
        return subprocess.run([BIN / "voxeld", "keys", *arguments, "--data", self.data_dir],
                              check=True, capture_output=True, text=True).stdout.strip()

    def close(self):
        self.daemon.stop()
        for directory in (self.data_dir, self.fixtures):
            shutil.rmtree(directory, ignore_errors=True)
        pathlib.Path(self.data_dir + ".log").unlink(missing_ok=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class DaemonTest(unittest.TestCase):
    """A test class that shares one daemon and one set of fixtures."""
    device = "llvmpipe"
    arguments = ()

    @classmethod
    def setUpClass(cls):
        cls.fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        make_fixtures(cls.fixtures)
        cls.daemon = Daemon(device=cls.device, arguments=cls.arguments)

    @classmethod
    def tearDownClass(cls):
        cls.daemon.stop()
        shutil.rmtree(cls.fixtures, ignore_errors=True)

    def fixture(self, name):
        return (self.fixtures / name).read_bytes()

    def assert_problem(self, response, status, code, *parts):
        self.assertEqual(response.status, status, response.body)
        self.assertEqual(response.headers["Content-Type"], "application/problem+json")
        problem = response.json()
        self.assertEqual(problem["code"], code, problem)
        text = " ".join(str(problem.get(key, "")) for key in ("detail", "expected", "got"))
        for part in parts:
            self.assertIn(part, text)
        return problem
