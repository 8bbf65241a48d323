"""tools/install-packages and its lists, with programs of a made-up release in place of dpkg and apt; tools/install-npm
with a made-up npm; docker/test-bare where its root cannot be made; the health check of the image."""
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest
import unittest.mock

import npm_packages
from harness import ROOT

LISTS = ROOT / "tools/packages"
ENTRY = re.compile(r"[a-z0-9][a-z0-9.+-]+( \| [a-z0-9][a-z0-9.+-]+)*")


def entries(path):
    lines = path.read_text().splitlines()
    return [line for line in lines if line and not line.startswith("#")]


class PackageLists(unittest.TestCase):
    def setUp(self):
        self.directory = tempfile.TemporaryDirectory()
        self.dir = pathlib.Path(self.directory.name)
        (self.dir / "packages").mkdir()
        shutil.copy(ROOT / "tools/install-packages", self.dir)
        self.release(installed="", available="")

    def tearDown(self):
        self.directory.cleanup()

    def release(self, installed, available):
        """Programs that know these lines of dpkg-query and these names of apt-cache."""
        programs = {
            "dpkg-query": f"cat <<'TEXT'\n{installed}TEXT\n",
            "apt-cache": "version='(none)'\n"
                         f"for each in {available}; do [[ $each != $2 ]] || version=1.0; done\n"
                         'echo "  Candidate: $version"\n'
                         # More than a pipe holds: a reader that leaves early fails the program.
                         "head -c 100000 /dev/zero | tr '\\0' x\n",
            "apt-get": f'echo "$@" >>{self.dir}/calls\n',
            "id": "echo 0\n",
        }
        (self.dir / "bin").mkdir(exist_ok=True)
        for name, text in programs.items():
            (self.dir / "bin" / name).write_text("#!/bin/bash\n" + text)
            (self.dir / "bin" / name).chmod(0o755)

    def install(self, *names):
        (self.dir / "calls").write_text("")
        env = {**os.environ, "PATH": f"{self.dir}/bin:{os.environ['PATH']}"}
        done = subprocess.run([self.dir / "install-packages", *names], capture_output=True,
                              text=True, env=env)
        return done, (self.dir / "calls").read_text().splitlines()

    def list(self, name, text):
        (self.dir / "packages" / f"{name}.txt").write_text(text)

    def test_first_name_that_the_release_has_is_installed(self):
        self.list("test", "# for tests\nnginx-tiny | nginx-light | nginx\n\ncurl\n")
        self.release(installed="", available="nginx nginx-light curl")
        done, calls = self.install("test")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(calls, ["update -q",
                                 "install -y -q --no-install-recommends nginx-light curl"])

    def test_nothing_runs_when_all_is_installed(self):
        self.list("build", "g++\nnpm | pnpm\nnginx-light | nginx\n")
        self.release(installed="hi  g++ \nii  nodejs nodejs-legacy, npm (= 20.1)\nii  nginx \n",
                     available="")
        done, calls = self.install("build")
        self.assertEqual((done.returncode, done.stdout, calls), (0, "", []), done.stderr)

    def test_a_removed_package_is_installed_again(self):
        self.list("build", "g++\n")
        self.release(installed="rc  g++ \n", available="g++")
        self.assertEqual(self.install("build")[1][1:],
                         ["install -y -q --no-install-recommends g++"])

    def test_only_the_named_lists_count_and_without_names_all(self):
        self.list("build", "g++\n")
        self.list("test", "clang\n")
        self.release(installed="", available="g++ clang")
        self.assertEqual(self.install("build")[1][1:],
                         ["install -y -q --no-install-recommends g++"])
        self.assertEqual(self.install()[1][-1],
                         "install -y -q --no-install-recommends g++ clang")

    def test_errors_say_what_is_missing(self):
        self.list("build", "gone-dev | gone2-dev\n")
        done, calls = self.install("build")
        self.assertEqual((done.returncode, done.stderr, calls),
                         (1, "error: apt finds no package 'gone-dev | gone2-dev' (tools/packages): its mirror "
                             "cannot be reached, or this is another release than Debian 12 and 13\n",
                          ["update -q"]))
        done, calls = self.install("biuld")
        self.assertEqual((done.returncode, done.stderr, calls),
                         (2, "error: no package list 'biuld'; there are: build\n", []))

    def test_lists_are_sorted_and_name_each_package_once(self):
        seen = {}
        for path in sorted(LISTS.glob("*.txt")):
            for block in path.read_text().split("\n\n"):
                names = [line for line in block.splitlines() if not line.startswith("#")]
                self.assertEqual(names, sorted(names), path.name)
            for entry in entries(path):
                self.assertRegex(entry, f"^{ENTRY.pattern}$", path.name)
                self.assertNotIn(entry, seen, path.name)
                seen[entry] = path.name
        self.assertIn("g++", seen)
        self.assertEqual(seen["clang"], "test.txt")


class NpmPackages(unittest.TestCase):
    """Two folders of tests, and an npm that notes where it ran and ends with a status."""

    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.dir = pathlib.Path(directory.name)
        (self.dir / "tools").mkdir()
        shutil.copy(ROOT / "tools/install-npm", self.dir / "tools")
        for name in ("a", "b"):
            (self.dir / "tests" / name).mkdir(parents=True)
            for file in npm_packages.FILES:
                (self.dir / "tests" / name / file).write_text(f"{file} of {name}\n")
        (self.dir / "bin").mkdir()

    def install(self, *names, status=0):
        """The process, and the folders in which npm ran."""
        programs = {"npm": f'basename "$PWD" >>{self.dir}/calls\nmkdir -p node_modules\necho words\nexit {status}\n',
                    "sleep": ""}
        for name, text in programs.items():
            (self.dir / "bin" / name).write_text("#!/bin/bash\n" + text)
            (self.dir / "bin" / name).chmod(0o755)
        (self.dir / "calls").write_text("")
        done = subprocess.run([self.dir / "tools/install-npm", *names], capture_output=True, text=True,
                              env={**os.environ, "PATH": f"{self.dir}/bin:{os.environ['PATH']}"})
        return done, (self.dir / "calls").read_text().split()

    def prepare(self, name):
        with unittest.mock.patch.object(npm_packages, "ROOT", self.dir):
            npm_packages.prepare(self.dir / "tests" / name, self.dir / "work")

    def test_packages_are_fetched_once_and_again_when_the_lock_file_differs(self):
        done, calls = self.install()
        self.assertEqual((done.returncode, sorted(calls)), (0, ["a", "b"]), done.stderr)
        self.assertEqual(sorted(done.stdout.splitlines()),
                         ["npm packages of tests/a: fetched", "npm packages of tests/b: fetched"])
        self.prepare("a")
        self.prepare("a")
        self.assertTrue((self.dir / "work/node_modules").samefile(self.dir / "build/npm/a/node_modules"))
        self.assertEqual(self.install()[1], [])
        (self.dir / "tests/b/package-lock.json").write_text("another\n")
        with self.assertRaises(unittest.SkipTest):
            self.prepare("b")
        self.assertEqual(self.install("a")[1], [])
        self.assertEqual(self.install()[1], ["b"])
        self.prepare("b")

    def test_without_a_registry_the_step_passes_and_tests_are_skipped(self):
        done, calls = self.install(status=1)
        self.assertEqual((done.returncode, sorted(calls)), (0, [*"aaabbb"]), done.stderr)
        self.assertEqual(sorted(done.stdout.splitlines()), [
            *(f"npm packages of tests/{name}: NOT FETCHED; tests that need them are skipped" for name in "ab"),
            "words", "words"])
        with self.assertRaisesRegex(unittest.SkipTest, "the npm packages of tests/a are not in build/npm/a: run "
                                                       "tools/install-npm a where npm's registry can be reached"):
            self.prepare("a")

    def test_a_folder_without_packages_is_an_error(self):
        done, _ = self.install("c")
        self.assertEqual((done.returncode, done.stderr), (2, "error: there is no tests/c/package-lock.json\n"))


class BareRoots(unittest.TestCase):
    def test_a_root_that_cannot_be_made_ends_the_test_with_the_reason(self):
        with tempfile.TemporaryDirectory() as directory:
            programs = {"id": "echo 0\n", "debootstrap": "", "git": "echo cloned\n",
                        "unshare": 'echo "E: No such script: ${*: -2:1}"\nexit 1\n'}
            for name, text in programs.items():
                program = pathlib.Path(directory) / name
                program.write_text("#!/bin/bash\n" + text)
                program.chmod(0o755)
            done = subprocess.run([ROOT / "docker/test-bare", "sarge"], capture_output=True, text=True,
                                  env={**os.environ, "PATH": f"{directory}:{os.environ['PATH']}"})
        self.assertEqual((done.returncode, done.stdout, done.stderr), (1, "", "E: No such script: sarge\n"))


class ImageHealth(unittest.TestCase):
    def asked(self, admin_listen):
        """The arguments of curl, by the image's command with a made-up curl."""
        text = (ROOT / "docker/Dockerfile").read_text()
        lines = [line for line in text.partition("\nHEALTHCHECK")[2].partition("\nENTRYPOINT")[0].splitlines()
                 if not line.lstrip().startswith("#")]
        command = "\n".join(lines).replace("\\\n", "").partition(" CMD ")[2]
        with tempfile.TemporaryDirectory() as directory:
            curl = pathlib.Path(directory) / "curl"
            curl.write_text('#!/bin/sh\necho "$@" >&2\n')
            curl.chmod(0o755)
            done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True,
                                  env={"PATH": f"{directory}:{os.environ['PATH']}", "VOXELD_LISTEN": "0.0.0.0:8080",
                                       "VOXELD_ADMIN_LISTEN": admin_listen})
        return done.stderr

    def test_it_asks_the_admin_port_or_where_there_is_none_the_api(self):
        self.assertEqual(self.asked("127.0.0.1:8081"), "-fsS --noproxy * http://127.0.0.1:8081/livez\n")
        self.assertEqual(self.asked("none"), "-sS --noproxy * http://0.0.0.0:8080/\n")


if __name__ == "__main__":
    unittest.main()
