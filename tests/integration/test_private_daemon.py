"""The private daemon that voxel starts where none serves, and the flags of voxeld that it uses."""
import contextlib
import http.client
import json
import os
import pathlib
import shutil
import signal
import socket
import stat
import subprocess
import tempfile
import time
import unittest

from fairness_load import GIANT
from harness import BIN, HANG_SECONDS, Daemon, make_fixtures, wait_until

DEFAULT_PORT = 8080
LIBRARIES = BIN.parent / "lib"


def has_ended(pid):
    try:
        state = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return True
    return state == "Z"


class PrivateDaemon(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        make_fixtures(cls.fixtures)
        cls.mesh = cls.fixtures / "sample.ply"

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.fixtures, ignore_errors=True)

    def setUp(self):
        self.dir = pathlib.Path(tempfile.mkdtemp(prefix="voxel-private-"))
        self.data = self.dir / "cache" / "voxeld"
        self.environment = {name: value for name, value in os.environ.items()
                            if not name.startswith("VOXELD_")}
        self.environment |= {"HOME": str(self.dir), "XDG_CACHE_HOME": str(self.dir / "cache"),
                             "XDG_CONFIG_HOME": str(self.dir / "config"), "VOXELD_DEVICE": "cpu"}

    def tearDown(self):
        for pid in self.daemons():
            with contextlib.suppress(ProcessLookupError):  # one may end by itself just now
                os.kill(pid, signal.SIGTERM)
            wait_until(lambda pid=pid: has_ended(pid), f"daemon {pid} ends")
        shutil.rmtree(self.dir, ignore_errors=True)

    def daemons(self):
        """Pids of the daemons that have this test's data."""
        found = []
        for path in pathlib.Path("/proc").glob("[0-9]*/cmdline"):
            pid = int(path.parent.name)
            try:
                words = path.read_bytes().split(b"\0")
                leads_session = os.getsid(pid) == pid  # a worker has its parent's words until it calls exec
            except OSError:
                continue
            if b"serve" in words and str(self.data).encode() in words and leads_session:
                found.append(pid)
        return found

    def command(self, *arguments):
        return [str(word) for word in (BIN / "voxel", *arguments)]

    def voxel(self, *arguments, environment=None):
        return subprocess.run(self.command(*arguments), capture_output=True, text=True, timeout=HANG_SECONDS,
                              stdin=subprocess.DEVNULL, env={**self.environment, **(environment or {})})

    def voxelize(self, *arguments, name="a.vox"):
        done = self.voxel(self.mesh, "-o", self.dir / name, "--size", 32, *arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((self.dir / name).read_bytes().startswith(b"VOX "))
        return done

    def address(self):
        return json.loads((self.data / "address").read_text())

    def test_second_call_uses_the_daemon_of_the_first(self):
        self.voxelize("--local")
        first = self.address()
        self.voxelize("--local")
        self.assertEqual(self.address(), first)
        self.assertEqual(self.daemons(), [first["pid"]])
        jobs = json.loads(self.voxel("jobs", "--local", "--json").stdout)["jobs"]
        self.assertEqual(len(jobs), 2)

    def test_other_users_can_neither_read_its_folder_nor_use_its_port(self):
        self.voxelize("--local")
        self.assertEqual(stat.S_IMODE(self.data.stat().st_mode), 0o700)
        for name in ("address", "key", "keys"):
            self.assertEqual(stat.S_IMODE((self.data / name).stat().st_mode), 0o600, name)
        host, port = self.address()["url"].removeprefix("http://").split(":")
        self.assertEqual(host, "127.0.0.1")
        for headers in ({}, {"Authorization": "Bearer vxk_aaaaaaaa_" + "a" * 52}):
            connection = http.client.HTTPConnection(host, int(port), timeout=HANG_SECONDS)
            connection.request("GET", "/v1/jobs", headers=headers)
            self.assertEqual(connection.getresponse().status, 401)
            connection.close()

    def test_killed_daemon_is_replaced(self):
        self.voxelize("--local")
        killed = self.address()["pid"]
        os.kill(killed, signal.SIGKILL)
        wait_until(lambda: has_ended(killed), "the killed daemon is gone")
        self.voxelize("--local")
        self.assertNotEqual(self.address()["pid"], killed)

    def test_daemon_that_ends_is_replaced(self):
        self.voxelize("--local")
        ending = self.address()["pid"]
        os.kill(ending, signal.SIGTERM)

        def others():
            self.voxelize("--local")  # succeeds also with the one that has not handled the signal yet
            return set(self.daemons()) - {ending}
        wait_until(others, f"another daemon than {ending}")

    def test_address_without_its_daemon_is_not_asked(self):
        self.data.mkdir(parents=True, mode=0o700)
        with socket.create_server(("127.0.0.1", 0)) as stranger:
            stranger.settimeout(0)
            url = f"http://127.0.0.1:{stranger.getsockname()[1]}"
            (self.data / "address").write_text(json.dumps({"url": url, "pid": 1}))
            self.voxelize("--local")
            with self.assertRaises(BlockingIOError):
                stranger.accept()

    def test_calls_at_the_same_time_start_one_daemon(self):
        calls = [subprocess.Popen(self.command(self.mesh, "--local", "-o", self.dir / f"{i}.vox", "--size", 16),
                                  env=self.environment, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE)
                 for i in range(4)]
        for call in calls:
            error = call.communicate(timeout=HANG_SECONDS)[1]
            self.assertEqual(call.returncode, 0, error)
        self.assertEqual(self.daemons(), [self.address()["pid"]])

    def test_lost_or_wrong_key_is_replaced(self):
        self.voxelize("--local")
        daemon = self.address()
        (self.data / "key").unlink()
        self.voxelize("--local")
        (self.data / "key").write_text("vxk_aaaaaaaa_" + "a" * 52)
        self.voxelize("--local")
        self.assertEqual(self.address(), daemon)

    def test_folder_that_others_may_write_to_is_refused(self):
        self.data.mkdir(parents=True)
        self.data.chmod(0o777)
        done = self.voxel(self.mesh, "-o", self.dir / "a.vox", "--local")
        self.assertEqual(done.returncode, 1)
        self.assertIn(f"{self.data} holds the data of the private daemon: expected a folder that only its "
                      "user can write to", done.stderr)
        self.assertEqual(self.daemons(), [])

    def test_daemon_that_does_not_start_tells_why(self):
        done = self.voxel(self.mesh, "-o", self.dir / "a.vox", "--local",
                          environment={"VOXELD_DEVICE": "nonsense"})
        self.assertEqual(done.returncode, 5)
        self.assertIn("the private daemon did not start: unknown device: expected egl:N", done.stderr)

    def test_missing_program_is_named(self):
        program = self.dir / "bin" / "voxel"
        program.parent.mkdir()
        shutil.copy(BIN / "voxel", program)
        done = subprocess.run([program, self.mesh, "-o", self.dir / "a.vox", "--local"], capture_output=True,
                              text=True, env={**self.environment, "PATH": str(self.dir),
                                              "LD_LIBRARY_PATH": str(LIBRARIES)})
        self.assertEqual(done.returncode, 5, done.stderr)
        self.assertIn(f"there is no program voxeld in {program.parent} or PATH to start one: install voxeld, "
                      "or name a server with --url or VOXELD_URL", done.stderr)

    def test_without_a_url_the_default_port_is_tried_first(self):
        with socket.socket() as taken:
            if taken.connect_ex(("127.0.0.1", DEFAULT_PORT)) == 0:
                self.skipTest(f"something listens on port {DEFAULT_PORT}")
        refused = self.voxel("jobs", "--no-local")
        self.assertEqual(refused.returncode, 5)
        self.assertIn(f"http://127.0.0.1:{DEFAULT_PORT}", refused.stderr)
        self.assertEqual(self.daemons(), [])
        self.voxelize()
        self.assertEqual(len(self.daemons()), 1)

    def test_named_server_is_used_alone(self):
        for options, environment in ((("--url", "http://127.0.0.1:9"), {}),
                                     ((), {"VOXELD_URL": "http://127.0.0.1:9"})):
            self.assertEqual(self.voxel("jobs", *options, environment=environment).returncode, 5)
        both = self.voxel("jobs", "--local", "--url", "http://127.0.0.1:9")
        self.assertEqual(both.returncode, 2)
        self.assertIn("a private voxeld has a URL of its own", both.stderr)
        self.assertEqual(self.daemons(), [])

    def opened(self, pipe, reader):
        """The pipe, once the process reads it."""
        def descriptor():
            if reader.poll() is not None:
                self.fail(f"it ended with {reader.returncode}: {reader.stderr.read()}")
            with contextlib.suppress(OSError):  # ENXIO: nobody reads it yet
                return os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        writer = open(wait_until(descriptor, "voxel opens the pipe"), "wb")
        os.set_blocking(writer.fileno(), True)
        return writer

    def test_it_is_started_when_the_mesh_of_a_pipe_comes(self):
        pipe = self.dir / "pipe.ply"
        os.mkfifo(pipe)
        process = subprocess.Popen(self.command(pipe, "-o", self.dir / "a.vox", "--size", 16, "--local"),
                                   env=self.environment, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)

        with self.opened(pipe, process) as writer:
            self.assertEqual(self.daemons(), [])
            writer.write(self.mesh.read_bytes())
        self.assertEqual(process.wait(HANG_SECONDS), 0, process.stderr)
        self.assertTrue((self.dir / "a.vox").read_bytes().startswith(b"VOX "))

    def test_a_pipe_whose_writer_is_gone_before_it_is_started_is_read_to_its_end(self):
        pipe = self.dir / "pipe.obj"
        os.mkfifo(pipe)
        for data, status, said in ((b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 0, ""), (b"", 3, "empty")):
            with self.subTest(data), subprocess.Popen(
                    self.command(pipe, "-o", self.dir / "a.vox", "--size", 16, "--local"), env=self.environment,
                    stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
                try:
                    with self.opened(pipe, process) as writer:
                        writer.write(data)
                    _, stderr = process.communicate(timeout=HANG_SECONDS)
                finally:
                    process.kill()
                self.assertEqual(process.returncode, status, stderr)
                self.assertIn(said, stderr)

    def test_local_files_start_nothing(self):
        self.assertEqual(self.voxel("formats").returncode, 0)
        self.voxelize("--local", "--format", "vox")
        self.voxel(self.mesh, "--local", "-o", self.dir / "a.voxg", "--size", 16)
        os.kill(self.address()["pid"], signal.SIGTERM)
        wait_until(lambda: not self.daemons(), "the daemon ends")
        self.assertEqual(self.voxel("info", self.dir / "a.voxg").returncode, 0)
        self.assertEqual(self.daemons(), [])


class IdleDaemonTest(unittest.TestCase):
    """voxeld serve --address-file --exit-when-idle --admin-listen none."""

    def setUp(self):
        self.dir = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-idle-"))
        self.addCleanup(shutil.rmtree, self.dir, ignore_errors=True)
        self.data = self.dir / "data"
        self.file = self.dir / "address"

    def start(self, seconds):
        self.process = subprocess.Popen(
            [BIN / "voxeld", "serve", "--listen", "127.0.0.1:0", "--admin-listen", "none", "--device", "cpu",
             "--data", self.data, "--address-file", self.file, "--exit-when-idle", str(seconds)],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL, text=True)
        self.addCleanup(self.process.communicate)
        self.addCleanup(self.process.kill)
        self.ready = self.process.stdout.readline()
        self.address = json.loads(self.file.read_text())

    def request(self, method, path):
        connection = http.client.HTTPConnection(self.address["url"].removeprefix("http://"), timeout=HANG_SECONDS)
        self.addCleanup(connection.close)
        connection.request(method, path)
        response = connection.getresponse()
        body = response.read()
        connection.close()
        return response.status, body

    def assert_ends(self):
        self.assertEqual(self.process.wait(HANG_SECONDS), 0)
        self.assertFalse(self.file.exists())


class IdleDaemon(IdleDaemonTest):
    def test_address_file_has_url_and_pid_while_it_serves(self):
        self.start(0)
        self.assertEqual(self.address["pid"], self.process.pid)
        self.assertEqual(self.ready, f"ready {self.address['url']} admin=none device=cpu\n")
        self.assertEqual(stat.S_IMODE(self.file.stat().st_mode), 0o600)
        self.assertEqual(self.request("GET", "/v1/jobs")[0], 200)
        self.process.terminate()
        self.assert_ends()

    def test_it_ends_when_idle_and_not_while_there_are_jobs(self):
        make_fixtures(self.dir / "fixtures")
        first = Daemon(device="cpu", data_dir=str(self.data))
        self.addCleanup(first.process.kill)
        asset = first.upload(self.dir / "fixtures/sheets.obj")
        jobs = [first.submit(kind="voxelize", asset=asset, options=GIANT) for _ in range(4)]
        first.wait_state(jobs[0], "running")
        first.kill_gateway()
        self.start(1)  # it has jobs from the start
        time.sleep(3)
        last = json.loads(self.request("GET", f"/v1/jobs/{jobs[-1]}")[1])
        self.assertIn(last["state"], ("queued", "running"))
        for job in jobs:
            self.request("DELETE", f"/v1/jobs/{job}")
        self.assert_ends()


if __name__ == "__main__":
    unittest.main()
