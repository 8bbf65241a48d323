"""Packages of npm that a test needs, as its package-lock.json says. tools/install-npm fetches them before the tests,
which ask no registry."""
import json
import shutil
import subprocess
import unittest

from harness import ROOT

FILES = ("package.json", "package-lock.json")


def prepare(here, work):
    """Makes the packages of the folder `here` importable in the folder `work`. Skips the test where they were not
    fetched."""
    fetched = ROOT / "build/npm" / here.name
    stamp = fetched / "installed"
    if not stamp.exists() or stamp.read_text() != "".join((here / name).read_text() for name in FILES):
        raise unittest.SkipTest(f"the npm packages of tests/{here.name} are not in build/npm/{here.name}: run "
                                f"tools/install-npm {here.name} where npm's registry can be reached")
    work.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(here / FILES[0], work / FILES[0])
    modules = work / "node_modules"
    if modules.is_symlink():
        modules.unlink()
    elif modules.exists():
        shutil.rmtree(modules)
    modules.symlink_to(fetched / "node_modules", target_is_directory=True)


class Program:
    """A script of Node that reads lines, each a list of arguments as JSON, and answers each with a line of JSON: its
    libraries take a second to load, once for all tests of a class."""

    def __init__(self, here, work, name):
        """Runs the script of the folder `here` in the folder `work`, with the packages of `here`."""
        prepare(here, work)
        shutil.copyfile(here / name, work / name)
        self.process = subprocess.Popen(["node", name], cwd=work, text=True, stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE)

    def __call__(self, *arguments):
        self.process.stdin.write(json.dumps(arguments) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        assert line, f"{self.process.args} {arguments} ended with status {self.process.wait()}"
        return json.loads(line)

    def end(self):
        self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait()
