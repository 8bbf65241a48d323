"""The Python package as users get it: which daemon it finds, its types, its wheel, its notebooks."""
import contextlib
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import typing
import unittest
import unittest.mock

import yaml

import python_package
from harness import BIN, ROOT, DaemonTest, make_fixtures, wait_until
from test_private_daemon import DEFAULT_PORT, has_ended

import voxeld
from voxeld import _server, options

TRY = """
import sys, voxeld
g = voxeld.voxelize(sys.argv[1], size=24)
print(len(g.coords), voxeld.default_client().url)
"""
MYPY = shutil.which("mypy", path="/usr/bin")


class Servers(unittest.TestCase):
    """Which daemon the functions of the module use."""

    @classmethod
    def setUpClass(cls):
        cls.fixtures = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-fixtures-"))
        make_fixtures(cls.fixtures)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.fixtures, ignore_errors=True)

    def setUp(self):
        self.dir = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-python-"))
        self.data = self.dir / "cache" / "voxeld"
        self.environment = {name: value for name, value in os.environ.items() if not name.startswith("VOXELD_")}
        self.environment |= {
            **python_package.ENVIRONMENT, "HOME": str(self.dir), "XDG_CACHE_HOME": str(self.dir / "cache"),
            "XDG_CONFIG_HOME": str(self.dir / "config"), "VOXELD_DEVICE": "cpu",
            "PATH": f"{BIN.resolve()}:/usr/bin:/bin"}

    def tearDown(self):
        for pid in self.daemons():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGTERM)
            wait_until(lambda pid=pid: has_ended(pid), f"daemon {pid} ends")
        shutil.rmtree(self.dir, ignore_errors=True)

    def daemons(self):
        """Pids of the daemons that have this test's data."""
        found = []
        for path in pathlib.Path("/proc").glob("[0-9]*/cmdline"):
            pid = int(path.parent.name)
            with contextlib.suppress(OSError):
                words = path.read_bytes().split(b"\0")
                leads_session = os.getsid(pid) == pid  # a worker has its parent's words until it calls exec
                if b"serve" in words and str(self.data).encode() in words and leads_session:
                    found.append(pid)
        return found

    def python(self, script, **environment):
        return subprocess.run([sys.executable, "-c", script, self.fixtures / "sample.ply"], capture_output=True,
                              text=True, timeout=120, env={**self.environment, **environment})

    def local(self, script):
        """The script with the private daemon, also where something serves at the default port."""
        return self.python("import voxeld\nvoxeld._default = voxeld.Client(local=True)\n" + script)

    def test_a_private_daemon_is_started_and_shared_with_voxel(self):
        first = self.local(TRY)
        self.assertEqual(first.returncode, 0, first.stderr)
        address = json.loads((self.data / "address").read_text())
        self.assertEqual(first.stdout.split()[1], address["url"])
        self.assertEqual(self.local(TRY).stdout, first.stdout)
        self.assertEqual(self.daemons(), [address["pid"]])
        listed = subprocess.run([BIN / "voxel", "jobs", "--local", "--json"], capture_output=True, text=True,
                                env=self.environment, check=True).stdout
        self.assertEqual(len(json.loads(listed)["jobs"]), 2)

    def test_the_url_of_a_client_is_that_of_a_daemon_that_serves(self):
        shown = self.python("import voxeld\nprint(voxeld.Client(local=True).url)")
        self.assertEqual(shown.returncode, 0, shown.stderr)
        self.assertEqual(shown.stdout.strip(), json.loads((self.data / "address").read_text())["url"])

    def test_a_daemon_that_has_ended_is_started_again_within_a_session(self):
        done = self.local(TRY + """
import json, os, pathlib, signal, time
address = pathlib.Path(os.environ["XDG_CACHE_HOME"], "voxeld", "address")
pid = json.loads(address.read_text())["pid"]
os.kill(pid, signal.SIGKILL)
while "Z" not in pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] if os.path.exists(
        f"/proc/{pid}") else False:
    time.sleep(0.01)
print(len(g.render(width=16, height=16)) > 0, json.loads(address.read_text())["pid"] != pid)
""")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.splitlines()[-1], "True True")

    def test_without_a_url_the_default_port_is_tried_before_the_private_daemon(self):
        import socket
        with socket.socket() as taken:
            if taken.connect_ex(("127.0.0.1", DEFAULT_PORT)) == 0:
                self.skipTest(f"something listens on port {DEFAULT_PORT}")
        refused = self.python("import voxeld\nvoxeld.Client(local=False, retries=0).grid('a').coords")
        self.assertIn(f"Unreachable: http://127.0.0.1:{DEFAULT_PORT}", refused.stderr)
        self.assertEqual(self.daemons(), [])
        done = self.python(TRY)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(len(self.daemons()), 1)

    def test_a_lost_key_is_replaced(self):
        self.assertEqual(self.local(TRY).returncode, 0)
        (self.data / "key").unlink()
        again = self.local(TRY)
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertEqual(len(self.daemons()), 1)

    def test_a_folder_that_others_may_write_to_is_refused(self):
        self.data.mkdir(parents=True)
        self.data.chmod(0o777)
        refused = self.local(TRY)
        self.assertIn(f"{self.data} holds the data of the private daemon: expected a folder that only its user can "
                      "write to", refused.stderr)
        self.assertEqual(self.daemons(), [])

    def test_a_missing_program_is_named(self):
        refused = self.python("import voxeld\nvoxeld.Client(local=True).grid('a').coords", PATH="/usr/bin:/bin")
        self.assertIn("there is no program voxel in PATH to start one: install voxel and voxeld, or name a server with "
                      "url= or VOXELD_URL", refused.stderr)

    def test_a_start_that_failed_is_not_tried_again(self):
        failure = _server._start_error("broken")
        with unittest.mock.patch.dict(os.environ, {"XDG_CACHE_HOME": str(self.dir)}), unittest.mock.patch.object(
                _server.PrivateServer, "_start", side_effect=failure) as start:
            with self.assertRaises(voxeld.Unreachable):
                voxeld.Client(local=True).grid("a").coords
        self.assertEqual(start.call_count, 1)

    def test_a_token_ends_the_wait_for_the_start(self):
        program = self.dir / "voxel"
        program.write_text("#!/bin/sh\ntouch \"$0.started\"\nexec sleep 1000\n")
        program.chmod(0o755)
        done = self.python("""
import os, pathlib, threading, time, voxeld
from voxeld import _server
_server.START_SECONDS = 1000
token = voxeld.CancelToken()
def cancel():
    while not pathlib.Path(os.environ["HOME"], "voxel.started").exists():
        time.sleep(0.01)
    token.cancel()
threading.Thread(target=cancel).start()
try:
    voxeld.Client(local=True).grid("a").fetch(cancel=token)
except voxeld.Cancelled as error:
    print(error)
""", PATH=f"{self.dir}:/usr/bin:/bin")
        self.assertEqual(done.stdout, "cancelled by the caller (interrupted)\n", done.stderr)

    def test_why_the_daemon_does_not_start_is_told(self):
        refused = self.python("import voxeld\nvoxeld.Client(local=True).grid('a').coords", VOXELD_DEVICE="nonsense")
        self.assertIn("the private daemon did not start: unknown device: expected egl:N", refused.stderr)

    def test_servers_and_keys_are_those_of_the_variables_and_the_configuration_file(self):
        show = "import voxeld\ns = voxeld.Client()._transport.server\nprint(s.name, s.key)"
        config = self.dir / "config/voxeld/config.toml"
        config.parent.mkdir(parents=True)
        (self.dir / "key").write_text("vxk_file\n")
        config.write_text('url = "http://127.0.0.1:9"\nkey_file = "~/key"\n')
        self.assertEqual(self.python(show).stdout, "http://127.0.0.1:9 vxk_file\n")
        self.assertEqual(self.python(show, VOXELD_KEY="vxk_b").stdout, "http://127.0.0.1:9 vxk_b\n")
        # The key of the file is that of its URL alone.
        self.assertEqual(self.python(show, VOXELD_URL="http://127.0.0.1:7/").stdout, "http://127.0.0.1:7 \n")
        named = self.python(show, VOXELD_URL="http://127.0.0.1:7", VOXELD_KEY_FILE=str(self.dir / "key"))
        self.assertEqual(named.stdout, "http://127.0.0.1:7 vxk_file\n")
        (self.dir / "key").write_text("\n")
        self.assertIn("key_file: ~/key is empty", self.python(show).stderr)
        for text, error in (("url = 3", "expected url = \"URL\""), ("uri = 'a'", "got uri = 'a'"),
                            ("url", "config.toml: ")):
            config.write_text(text)
            self.assertIn(error, self.python(show).stderr)
        both = self.python("import voxeld\nvoxeld.Client('a', local=True)")
        self.assertIn("local=True: expected no url", both.stderr)


class Types(unittest.TestCase):
    def openapi_options(self):
        """name -> schema of each option."""
        spec = yaml.safe_load((ROOT / "proto/openapi.yaml").read_text())["components"]["schemas"]
        return {kind: {name: spec[entry["$ref"].rsplit("/", 1)[1]] for name, entry in spec[kind]["properties"].items()}
                for kind in ("VoxelizeOptions", "RenderOptions", "ExportOptions")}

    def test_options_are_those_of_the_api(self):
        schemas = self.openapi_options()
        of_job = {"priority", "deadline_ms"}
        sequence = {"frames", "fps", "times"}
        output = {"format", "codec", "layout", "axes", "dtype", "palette", "mesh", "channel", "compress",
                  "blocks", "dither", "schem_version", "zarr_version"}
        made_of = typing.get_type_hints
        voxelize = set(schemas["VoxelizeOptions"])
        self.assertEqual(set(made_of(options.AnimateOptions)) - of_job, voxelize - output - {"time"})
        self.assertEqual(set(made_of(options.EstimateOptions)) - of_job, voxelize - output)
        self.assertEqual(set(made_of(options.VoxelizeOptions)) - of_job, voxelize - output - sequence)
        self.assertEqual(set(made_of(options.RenderOptions)) - of_job, set(schemas["RenderOptions"]))
        self.assertEqual(set(made_of(options.OutputOptions)), set(schemas["ExportOptions"]) - {"frames", "filename"})
        grid_image = set(schemas["RenderOptions"]) - set(schemas["VoxelizeOptions"]) - {"frame"}
        self.assertEqual(set(made_of(options.GridImageOptions)),
                         grid_image | {"level", "level_rule", "alpha", "region", "cache"})

    def test_options_by_which_a_result_differs_from_its_stored_grid_are_those_of_the_document(self):
        table = (ROOT / "docs/options.md").read_text().split("\n**Selection**", 1)[1].split("\n**", 1)[0]
        self.assertEqual(set(re.findall(r"^\| `(\w+)`", table, re.MULTILINE)), options.PlaceOptions.__optional_keys__)

    def test_literals_are_the_values_of_the_api(self):
        schemas = self.openapi_options()
        checked = 0
        hints = {**typing.get_type_hints(options.RenderOptions), **typing.get_type_hints(options.OutputOptions)}
        for name, schema in {**schemas["RenderOptions"], **schemas["ExportOptions"]}.items():
            values = schema.get("enum") or next((each["items"]["enum"] for each in schema.get("anyOf", [])
                                                 if "enum" in each.get("items", {})), None)
            if values is None:
                continue
            own = [value for kind in (hints[name], *typing.get_args(hints[name]))
                   if typing.get_origin(kind) is typing.Literal for value in typing.get_args(kind)]
            self.assertEqual(own, values, name)
            checked += 1
        self.assertGreater(checked, 15)

    def test_mypy_accepts_the_package_and_refuses_wrong_options(self):
        if MYPY is None:
            self.skipTest("mypy is not installed")
        with tempfile.TemporaryDirectory() as cache:
            command = [MYPY, "--config-file", python_package.PACKAGE / "pyproject.toml", "--cache-dir", cache]
            done = subprocess.run([*command, "-p", "voxeld"], cwd=python_package.PACKAGE, capture_output=True,
                                  text=True)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            script = pathlib.Path(cache) / "user.py"
            script.write_text("import voxeld\n"
                              "g: voxeld.Grid = voxeld.voxelize('a.ply', size=3, channels=['color'], fill='solid')\n"
                              "n: int = g.coords.shape[0]\n"
                              "for frame in voxeld.animate('a.zip', frames=range(3)):\n    t: float = frame.time\n"
                              "g.save('a.gif', turntable=8, width=128)\n"
                              "voxeld.voxelize('a.ply', sise=3)\n"
                              "voxeld.voxelize('a.ply', fill='solids')\n")
            done = subprocess.run([*command, script], env={**os.environ, "MYPYPATH": str(python_package.PACKAGE)},
                                  capture_output=True, text=True)
            self.assertEqual(re.findall(r"user\.py:(\d+): error", done.stdout), ["7", "8"], done.stdout)

    def test_importing_it_imports_no_other_library_than_numpy(self):
        script = ("import sys, numpy\nbefore = set(sys.modules)\nimport voxeld\n"
                  "print(*{name.partition('.')[0] for name in set(sys.modules) - before"
                  " if name.partition('.')[0] not in sys.stdlib_module_names})")
        out = subprocess.run([sys.executable, "-c", script], env={**os.environ, **python_package.ENVIRONMENT},
                             check=True, capture_output=True, text=True).stdout
        self.assertEqual(set(out.split()), {"numpy", "voxeld"})

    def test_every_public_name_has_a_docstring(self):
        for name in voxeld.__all__:
            thing = getattr(voxeld, name)
            if not callable(thing) or getattr(thing, "__module__", "") == "typing":
                continue
            self.assertTrue(thing.__doc__, name)
            for member, value in vars(thing).items() if isinstance(thing, type) else ():
                if callable(value) and not member.startswith("_"):
                    self.assertTrue(value.__doc__, f"{name}.{member}")


class Wheel(DaemonTest):
    device = "cpu"

    def test_the_wheel_is_pure_and_works_alone(self):
        """Without the decoder, the arrays come from the daemon."""
        with tempfile.TemporaryDirectory() as folder:
            before = sorted(python_package.PACKAGE.rglob("*"))
            done = subprocess.run([ROOT / "python/build-wheel", folder], capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            (wheel,) = pathlib.Path(folder).glob("*.whl")
            self.assertEqual(wheel.name, f"voxeld-{voxeld.__version__}-py3-none-any.whl")
            self.assertEqual(sorted(python_package.PACKAGE.rglob("*")), before, "files were left in the source tree")
            shutil.unpack_archive(wheel, f"{folder}/site", "zip")
            self.assertTrue(pathlib.Path(folder, "site/voxeld/py.typed").exists())
            own = {path.name for path in (python_package.PACKAGE / "voxeld").glob("*.py")}
            self.assertEqual({path.name for path in pathlib.Path(folder, "site/voxeld").glob("*.py")}, own)
            out = subprocess.run([sys.executable, "-c", TRY, self.fixtures / "sample.ply"], check=True, text=True,
                                 stdout=subprocess.PIPE,
                                 env={"PYTHONPATH": f"{folder}/site", "VOXELD_URL": self.daemon.url,
                                      "VOXELD_CLIENT_LIBRARY": ""}).stdout
            self.assertEqual(out.split()[1], self.daemon.url)
            self.assertGreater(int(out.split()[0]), 100)


if __name__ == "__main__":
    unittest.main()
