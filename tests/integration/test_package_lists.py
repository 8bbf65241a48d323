"""tools/install-packages and its lists, with programs of a made-up release in place of dpkg and apt."""
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

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
        self.release(installed="ii  g++ \nii  nodejs nodejs-legacy, npm (= 20.1)\nii  nginx \n",
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
                         (1, "error: this release has no package 'gone-dev | gone2-dev' "
                             "(tools/packages); supported: Debian 12 and 13\n", ["update -q"]))
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


if __name__ == "__main__":
    unittest.main()
