"""The client library as it is installed: what a project finds that is not part of this build."""
import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from harness import BIN, ROOT, DaemonTest

BUILD = BIN.resolve().parent
PROJECT = pathlib.Path(__file__).resolve().parent / "find_package"
OWN_SYMBOL = re.compile(r"^(typeinfo (name )?for |vtable for |VTT for )?voxeld::client::|^voxeld_(grid|palette)_")


def run(*command, **kw):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True,
                          timeout=600, **kw)
    assert done.returncode == 0, f"{command}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def default_of(usage):
    """x of CLI11's `--name TEXT=x` (2.1) and `--name TEXT [x]` (2.4); ` ...` where several may stand."""
    usage = usage.rstrip().removesuffix(" ...").rstrip()
    found = re.search(r" \[(\S*)\]$", usage) or re.search(r"=([^=\s)]*)$", usage)
    return found[1].strip("[]") if found else ""


class Install(DaemonTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        # Neither where the build tree thinks that it installs, nor a place that is searched.
        cls.prefix = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-install-"))
        for component in ("client", "dev", "cli"):
            run("cmake", "--install", BUILD, "--component", component, "--prefix", cls.prefix)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.prefix, ignore_errors=True)
        super().tearDownClass()

    def setUp(self):
        self.directory = tempfile.TemporaryDirectory()
        self.dir = pathlib.Path(self.directory.name)

    def tearDown(self):
        self.directory.cleanup()

    def installed(self, pattern):
        found = sorted(self.prefix.rglob(pattern))
        self.assertTrue(found, f"{pattern} is not installed")
        return found[0]

    def compile_and_count(self, *flags, library_path=None):
        """Voxels and dims that the small program prints for the sample mesh."""
        program = self.dir / "count_voxels"
        run("c++", "-std=c++20", PROJECT / "main.cpp", "-o", program, *flags)
        return self.count(program, library_path)

    def count(self, program, library_path=None):
        env = dict(os.environ)
        if library_path:
            env["LD_LIBRARY_PATH"] = str(library_path)
        out = run(program, self.daemon.url, self.fixtures / "sample.ply", 48, env=env)
        return [int(word) for word in out.split()]

    def counted_by_the_daemon(self):
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        job = self.daemon.submit(kind="voxelize", asset=asset, filename="sample.ply",
                                 options={"size": 48})
        meta = self.daemon.wait(job)["result"]["meta"]
        return [meta["voxel_count"], *meta["dims"]]

    def install_server(self):
        prefix = self.dir / "server"
        run("cmake", "--install", BUILD, "--component", "server", "--prefix", prefix)
        return prefix

    def test_the_daemon_is_installed_with_its_service(self):
        prefix = self.install_server()
        files = {str(path.relative_to(prefix)) for path in prefix.rglob("*") if path.is_file()}
        self.assertEqual(files, {"bin/voxeld", "lib/systemd/system/voxeld.service", "etc/default/voxeld",
                                 "share/doc/voxeld/copyright"})
        cache = (BUILD / "CMakeCache.txt").read_text()
        configured = re.search(r"^CMAKE_INSTALL_PREFIX:PATH=(.*)$", cache, re.M)[1]
        self.assertNotEqual(configured, "/usr")
        unit = (prefix / "lib/systemd/system/voxeld.service").read_text()
        self.assertIn(f"\nExecStart={configured}/bin/voxeld serve\n", unit)
        self.assertIn(f"\nEnvironmentFile=-{configured}/etc/default/voxeld\n", unit)
        self.assertIn("\nOOMPolicy=continue\n", unit)  # a worker that the kernel kills ends no others
        self.assertNotIn("@", unit.replace("@system-service", "").replace("@privileged", ""))

    def test_the_defaults_file_lists_each_setting_with_its_default(self):
        text = (self.install_server() / "etc/default/voxeld").read_text()
        listed = dict(re.findall(r"^# (VOXELD_[A-Z_]+)=(.*)$", text, re.M))
        self.assertEqual(len(listed), len(re.findall(r"^#? ?VOXELD_\w+=", text, re.M)), "twice, or set")
        help_text = run(BIN / "voxeld", "serve", "--help", env={"HOME": "/nowhere"})
        known = {}
        for usage, name in re.findall(r"^  --(.*) \(Env:(VOXELD_[A-Z_]+)\)", help_text, re.M):
            known[name] = default_of(usage)
        self.assertGreater(len(known), 25)
        known["VOXELD_DATA"] = "/var/lib/voxeld"  # of the unit
        known["VOXELD_ALLOW_REMOTE"] = known["VOXELD_ADMIN_ALLOW_REMOTE"] = "0"  # flags
        known["VOXELD_LOG_LEVEL"] = "info"  # an enumeration, whose default CLI11 does not print
        units = {"G": 1 << 30, "M": 1 << 20}
        for name, value in listed.items():
            if value[-1:] in units:
                listed[name] = str(int(value[:-1]) * units[value[-1]])
        self.assertEqual(listed, known)

    def test_the_cli_is_installed_with_its_manual_and_completions(self):
        for name, first in (("man/man1/voxel.1", ".TH VOXEL 1"),
                            ("bash-completion/completions/voxel", "# Completion of voxel for bash."),
                            ("zsh/vendor-completions/_voxel", "#compdef voxel\n")):
            self.assertTrue((self.prefix / "share" / name).read_text().startswith(first), name)

    def test_programs_do_not_tell_where_they_were_built(self):
        for program in (self.install_server() / "bin/voxeld", self.installed("voxel"),
                        self.installed("libvoxeld_client.so")):
            stripped = self.dir / "stripped"  # of debug information
            run("strip", "-o", stripped, program)
            self.assertFalse(str(ROOT.resolve()).encode() in stripped.read_bytes(), program)

    def test_find_package_gives_a_library_that_voxelizes(self):
        build = self.dir / "build"
        run("cmake", "-G", "Ninja", "-S", PROJECT, "-B", build,
            f"-DCMAKE_PREFIX_PATH={self.prefix}", "-DCMAKE_BUILD_TYPE=Release")
        # Not another one, which some earlier install left behind.
        cache = (build / "CMakeCache.txt").read_text()
        self.assertIn(str(self.prefix), re.search("^voxeld_DIR:.*$", cache, re.M).group(0))
        run("cmake", "--build", build)
        counted = self.count(build / "count_voxels")
        self.assertGreater(counted[0], 0)
        self.assertEqual(counted, self.counted_by_the_daemon())
        # The same project makes a mesh of arrays; the daemon writes its grid.
        printed = run(build / "save_arrays", self.daemon.url, self.dir / "a.vox")
        self.assertRegex(printed, r"^[1-9]\d+ 255 0 0\n$")
        self.assertTrue((self.dir / "a.vox").read_bytes().startswith(b"VOX "))
        failed = subprocess.run([build / "save_arrays", self.daemon.url, self.dir / "a.foo"],
                                capture_output=True, text=True)
        self.assertEqual(failed.returncode, 3)
        self.assertIn("a.foo: expected option format, or one of the extensions .voxg", failed.stderr)

    def test_find_package_refuses_other_versions(self):
        for version in ("0.1", "1.0"):
            project = self.dir / version
            project.mkdir()
            text = (PROJECT / "CMakeLists.txt").read_text()
            (project / "CMakeLists.txt").write_text(
                text.replace("voxeld 0.2 REQUIRED", f"voxeld {version} REQUIRED"))
            for source in PROJECT.glob("*.cpp"):
                shutil.copy(source, project)
            done = subprocess.run(["cmake", "-G", "Ninja", "-S", project, "-B", project / "build",
                                   f"-DCMAKE_PREFIX_PATH={self.prefix}"],
                                  capture_output=True, text=True)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn(f'compatible with requested version "{version}"',
                          " ".join(done.stderr.split()))

    def test_pkg_config_gives_flags_that_build_it(self):
        pc = self.installed("voxeld_client.pc")
        env = {**os.environ, "PKG_CONFIG_PATH": str(pc.parent)}
        flags = run("pkg-config", "--cflags", "--libs", "voxeld_client", env=env).split()
        self.assertIn("-lvoxeld_client", flags)
        paths = [pathlib.Path(flag[2:]).resolve() for flag in flags if flag[:2] in ("-I", "-L")]
        self.assertEqual(len(paths), 2, flags)
        for path in paths:
            self.assertTrue(path.is_relative_to(self.prefix.resolve()), flags)
        self.assertEqual(run("pkg-config", "--modversion", "voxeld_client", env=env).strip(),
                         json.loads(self.daemon.get("/openapi.json").body)["info"]["version"])
        counted = self.compile_and_count(*flags, library_path=paths[1])
        self.assertGreater(counted[0], 0)

    def test_the_header_needs_no_other_library(self):
        header = self.installed("client.h")
        self.assertEqual(header.relative_to(self.prefix), pathlib.Path("include/voxeld/client.h"))
        self.assertEqual(sorted(path.name for path in (self.prefix / "include").rglob("*.h*")),
                         ["client.h", "decode.h", "options.h", "palette.h"])
        for name in ("client.h", "options.h"):
            includes = re.findall(r'#\s*include\s*([<"][^>"]+)', (header.parent / name).read_text())
            self.assertTrue(includes)
            for include in includes:
                self.assertRegex(include, r'^(<[a-z_]+|"options\.h)$', "only headers of the standard library")
        # It stands alone, and takes the warnings that careful projects turn on.
        (self.dir / "alone.cpp").write_text("#include <voxeld/client.h>\n")
        run("c++", "-std=c++20", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion",
            "-Werror", "-fsyntax-only", "-I", self.prefix / "include", self.dir / "alone.cpp")

    def test_the_decoder_and_the_reader_of_palettes_need_only_c(self):
        (self.dir / "alone.c").write_text("#include <voxeld/palette.h>\n#include <voxeld/decode.h>\n")
        run("cc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-fsyntax-only",
            "-I", self.prefix / "include", self.dir / "alone.c")

    def test_the_library_shows_only_its_own_names(self):
        library = self.installed("libvoxeld_client.so")
        names = [line.split(maxsplit=2)[2]
                 for line in run("nm", "-DC", "--defined-only", library).splitlines()]
        foreign = [name for name in names if not OWN_SYMBOL.match(name)]
        self.assertEqual(foreign, [])
        for name in ("voxeld::client::Client::voxelize(", "voxeld::client::Grid::decode(",
                     "voxeld::client::Options::set(", "voxeld::client::wait_any(", "voxeld_grid_decode",
                     "voxeld_palette_read", "typeinfo for voxeld::client::Error"):
            self.assertTrue(any(shown.startswith(name) for shown in names), name)

    def test_the_installed_command_line_finds_its_library(self):
        voxel = self.installed("voxel")
        out = run(voxel, self.fixtures / "sample.ply", "--size", 48, "--json", "-o",
                  self.dir / "a.voxg", env={**os.environ, "VOXELD_URL": self.daemon.url})
        meta = json.loads(out)["meta"]
        self.assertEqual([meta["voxel_count"], *meta["dims"]], self.counted_by_the_daemon())


if __name__ == "__main__":
    unittest.main()
