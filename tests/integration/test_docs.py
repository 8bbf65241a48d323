"""Runs every command block of README.md as a reader would; long/test_docs_pages.py those of docs/*.md and
docker/README.md.

Pages run in a folder that looks like a clone with a demo (tools/demo), each in one shell. The blocks of sh and python
of a page run in order, so variables carry over; the first one that fails ends the page. In a page,

  <!-- not run: REASON -->   before a block skips it; skips are printed and counted
  ```text                    after a block is what that block prints; … stands for any text

A file that a block writes must be what its extension says, and neither it nor stdout may be a problem+json. Ports of
loopback that a page names are replaced by free ones.
"""
import contextlib
import json
import os
import pathlib
import random
import re
import select
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import unittest

import yaml

from harness import BIN, HANG_SECONDS, ROOT

README_WORDS_MAX = 700
BLOCK_SECONDS = 300
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.M | re.S)
SKIP = re.compile(r"<!-- not run: ((?:(?!-->).)+) -->\s*\Z", re.S)
ENDPOINT = re.compile(r"\b(localhost|127\.0\.0\.1):(\d{4,5})\b")
MAGIC = {".npy": b"\x93NUMPY", ".npz": b"PK\3\4", ".zip": b"PK\3\4", ".vox": b"VOX ", ".voxg": b"VOXGRID\0",
         ".voxs": b"VOXSEQ\0", ".png": b"\x89PNG\r\n\x1a\n", ".apng": b"\x89PNG\r\n\x1a\n", ".gif": b"GIF89a",
         ".glb": b"glTF", ".vti": b"<?xml", ".nrrd": b"NRRD0004", ".mha": b"ObjectType", ".gz": b"\x1f\x8b",
         ".binvox": b"#binvox 1", ".csv": b"x,y,z,px", ".pcd": b"# .PCD", ".qb": b"\1\1\0\0",
         ".schem": b"\x1f\x8b", ".litematic": b"\x1f\x8b", ".nbt": b"\x1f\x8b", ".vdb": b" BDV", ".nvdb": b"NanoVDB0",
         ".bt": b"# Octomap OcTree binary", ".ldr": b"0 ", ".vtu": b"<?xml", ".inp": b"*HEADING", ".ktx2": b"\xabKTX 20"}
INPUTS = {".ply", ".obj", ".stl", ".off", ".gltf", ".md5mesh", ".md5anim"}
TEXTS = {".xyz", ".txt", ".log", ".key"}


class Block:
    def __init__(self, page, text, match):
        self.language, self.text = match.groups()
        self.name = f"{page}:{text.count(chr(10), 0, match.start()) + 1}"
        skip = SKIP.search(text[:match.start()])
        self.skip = skip and " ".join(skip.group(1).split())
        follower = FENCE.match(text[match.end():].lstrip("\n"))
        self.output = follower.group(2) if follower and follower.group(1) == "text" else None


def blocks_of(page, text):
    blocks = [Block(page, text, match) for match in FENCE.finditer(text)]
    return [block for block in blocks if block.language in ("sh", "python")]


def is_problem(text):
    try:
        value = json.loads(text)
    except ValueError:
        return False
    return isinstance(value, dict) and {"title", "status", "code"} <= value.keys()


def wrong_with(path):
    """Why a written file is not what its name says; None if it is."""
    data = path.read_bytes()
    if not data:
        return "is empty"
    if is_problem(data):
        return f"is a problem: {data.decode()}"
    if path.suffix in MAGIC:
        if not data.startswith(MAGIC[path.suffix]):
            return f"does not begin with {MAGIC[path.suffix]}: {data[:16]}"
        if path.suffix == ".apng" and b"acTL" not in data:
            return "is a PNG without an animation"
        return None
    if path.suffix == ".json":
        json.loads(data)
        return None
    if path.suffix in TEXTS:
        data.decode()
        return None
    if path.suffix in INPUTS:
        return None
    return "has an extension that this test does not know"


def output_pattern(text):
    """`…` stands for any text."""
    return re.compile(re.escape(text.rstrip("\n")).replace("…", ".*"), re.S)


def free_port():
    """One below those that the system gives to connections, which could take it before a page uses it."""
    for port in random.sample(range(20000, 32768), 1000):
        with contextlib.suppress(OSError), socket.socket() as holder:
            holder.bind(("127.0.0.1", port))
            return port
    raise AssertionError("no port is free")


class Clone:
    """A folder like a clone of the project, and a shell in it."""

    def __init__(self, has_demo=False):
        self.root = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-docs-"))
        for name in ("docs", "proto", "python", "tools"):
            (self.root / name).symlink_to(ROOT / name)
        self.ports = {}
        self.blocks = self.root / ".blocks"
        self.blocks.mkdir()
        self.environment = {
            "HOME": str(self.root), "LANG": "C.UTF-8", "PATH": "/usr/local/sbin:/usr/sbin:/usr/bin:/sbin:/bin",
            "PYTHONDONTWRITEBYTECODE": "1", "VOXELD_BIN_DIR": str(BIN.resolve()),
            # The quickest to start; other tests run every driver, and docs/operating.md device auto.
            "VOXELD_DEVICE": "cpu",
            "VOXELD_LISTEN": self.with_ports("127.0.0.1:8080"),
            "VOXELD_ADMIN_LISTEN": self.with_ports("127.0.0.1:8081")}
        if has_demo:
            self.demo()
        self.first_files = self.files().keys()
        self.shell = None
        self.open_shell()

    def open_shell(self):
        """A new one, without what the one before started or wrote."""
        if self.shell:
            self.close_shell()
            for path in self.files().keys() - self.first_files:
                path.unlink()
        self.shell = subprocess.Popen(
            ["bash", "--norc", "-euo", "pipefail"], cwd=self.root, env=self.environment, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)

    def with_ports(self, text):
        def replace(match):
            host, port = match.groups()
            return f"{host}:{self.ports.setdefault(port, free_port())}"
        return ENDPOINT.sub(replace, text)

    def demo(self, *arguments):
        # A proxy that does not answer: the demo asks this machine without it.
        env = {**self.environment, "http_proxy": "http://127.0.0.1:9"}
        done = subprocess.run([self.root / "tools/demo", *arguments], env=env, cwd=self.root,
                              capture_output=True, text=True, timeout=BLOCK_SECONDS)
        assert done.returncode == 0, f"tools/demo: {done.returncode}\n{done.stdout}{done.stderr}"
        return done.stdout

    def run(self, language, text):
        """(exit status or None where the shell goes on, stdout, stderr) of a block."""
        script, out, err = (self.blocks / name for name in ("block", "out", "err"))
        if language == "python":
            (self.blocks / "block.py").write_text(text)
            text = f"python3 {self.blocks}/block.py\n"
        script.write_text(text)
        self.shell.stdin.write(f". {script} </dev/null >{out} 2>{err}; echo done\n")
        self.shell.stdin.flush()
        status = self.wait()
        return status, out.read_text(errors="replace"), err.read_text(errors="replace")

    def wait(self):
        ready, _, _ = select.select([self.shell.stdout], [], [], BLOCK_SECONDS)
        if not ready:
            return f"not done after {BLOCK_SECONDS} s"
        if self.shell.stdout.readline() == "done\n":
            return None
        return self.shell.wait(HANG_SECONDS)

    def files(self):
        """path -> time and size of each file that a reader would look at: not what is in a daemon's store."""
        found = {}
        for folder, folders, names in os.walk(self.root):
            folders[:] = [name for name in folders if not name.startswith(".") and
                          not (pathlib.Path(folder) / name / "jobs.sqlite").exists()]
            for name in names:
                path = pathlib.Path(folder) / name
                found[path] = (path.stat().st_mtime_ns, path.stat().st_size)
        return found

    def close_shell(self):
        with contextlib.suppress(BrokenPipeError):
            self.shell.stdin.close()
        with contextlib.suppress(ProcessLookupError):  # all of them have ended
            os.killpg(self.shell.pid, signal.SIGTERM)
            for _ in range(50):
                self.shell.poll()
                os.killpg(self.shell.pid, 0)
                time.sleep(0.01)
            os.killpg(self.shell.pid, signal.SIGKILL)
        self.shell.wait(HANG_SECONDS)
        self.shell.stdout.close()

    def close(self):
        self.close_shell()
        try:
            self.demo("stop")
        finally:
            shutil.rmtree(self.root, ignore_errors=True)


class PagesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.clone = Clone(has_demo=True)
        cls.addClassCleanup(cls.clone.close)

    def run_page(self, page):
        blocks = blocks_of(page.relative_to(ROOT), page.read_text())
        self.assertTrue(blocks, f"{page} has no command")
        to_run = [block for block in blocks if not block.skip]
        for block in blocks:
            if block.skip:
                print(f"{block.name}: not run: {block.skip}", flush=True)
        self.clone.open_shell()
        for block in to_run:
            self.run_block(self.clone, block)
        print(f"{page.relative_to(ROOT)}: {len(to_run)} blocks run, {len(blocks) - len(to_run)} not", flush=True)

    def run_block(self, clone, block):
        before = clone.files()
        status, out, err = clone.run(block.language, clone.with_ports(block.text))
        said = f"{block.name}\n{block.text}--- stdout\n{out}--- stderr\n{err}"
        self.assertIsNone(status, f"exit status {status} of {said}")
        for line in [out, *out.splitlines()]:
            self.assertFalse(is_problem(line), said)
        if block.output is not None:
            self.assertRegex(out.rstrip("\n"), re.compile(
                r"\A" + output_pattern(clone.with_ports(block.output)).pattern + r"\Z", re.S), said)
        for path, state in clone.files().items():
            if before.get(path) == state or path.name in ("env", "ready.txt", "voxeld.pid"):
                continue
            wrong = wrong_with(path)
            self.assertIsNone(wrong, f"{path.relative_to(clone.root)} {wrong}\n{said}")


class Readme(PagesTest):
    def test_readme(self):
        self.run_page(ROOT / "README.md")


class Demo(unittest.TestCase):
    def test_commands_that_the_demo_prints_do_what_they_say(self):
        clone = Clone()
        try:
            text = clone.demo()
            commands = "\n".join(line.strip() for line in text.splitlines()
                                 if re.match(r"  (curl|voxel|\.) ", line))
            self.assertEqual(len(commands.splitlines()), 4, text)
            status, out, err = clone.run("sh", commands)
            self.assertIsNone(status, f"{commands}\n{out}{err}")
            for name in ("rocket.vox", "rocket.png", "spin.gif", *re.findall(r"build/demo/sample\.\w+", text)):
                self.assertIsNone(wrong_with(clone.root / name), name)
        finally:
            clone.close()

    def test_another_program_with_the_number_of_an_ended_daemon_is_left_alone(self):
        clone = Clone()
        self.addCleanup(clone.close)
        other = subprocess.Popen(["sleep", "1000"])
        self.addCleanup(other.wait)
        self.addCleanup(other.kill)
        (clone.root / "build/demo").mkdir(parents=True)
        (clone.root / "build/demo/voxeld.pid").write_text(f"{other.pid}\n")
        self.assertEqual(clone.demo("stop"), "not running\n")


class Checks(unittest.TestCase):
    """Faults that a page may not have."""

    def refused(self, text):
        clone = Clone()
        try:
            with self.assertRaises(AssertionError) as refusal:
                for block in blocks_of("page.md", text):
                    PagesTest().run_block(clone, block)
        finally:
            clone.close()
        return str(refusal.exception)

    def test_a_command_that_fails(self):
        self.assertIn("exit status 1 of page.md:1\nfalse\n", self.refused("```sh\nfalse\ntrue\n```\n"))

    def test_a_failed_part_of_a_pipe(self):
        self.assertIn("exit status 1 of", self.refused("```sh\nfalse | cat\n```\n"))

    def test_python_that_fails(self):
        self.assertIn("KeyError: 'color'", self.refused("```python\n{}['color']\n```\n"))

    def test_variables_carry_over_and_unset_ones_are_refused(self):
        self.assertIn("c: unbound variable", self.refused(
            "```sh\na=1\n```\n```sh\ntest $a = 1\n```\n```sh\necho $c\n```\n"))

    def test_a_problem_on_stdout_or_in_a_file(self):
        problem = json.dumps({"title": "T", "status": 404, "code": "not-found"})
        for target in ("", ">a.vox"):
            self.assertIn("not-found", self.refused(f"```sh\necho '{problem}' {target}\n```\n"))

    def test_a_file_of_another_format_than_its_name(self):
        self.assertIn("a.npy does not begin with", self.refused("```sh\necho VOXGRID >a.npy\n```\n"))

    def test_another_output_than_the_page_shows(self):
        shown = "```text\n12 … voxels\n```\n"
        self.assertIn("12 of 14", self.refused(f"```sh\necho 12 of 14\n```\n\n{shown}"))
        self.assertIn("exit status 7", self.refused(
            f"```sh\necho 12 of 14 voxels\n```\n\n{shown}```sh\nexit 7\n```\n"))

    def test_a_block_is_skipped_only_for_a_reason_right_before_it(self):
        first, second = blocks_of("page.md", "<!-- not run: needs\nroot -->\n```sh\nfalse\n```\n```sh\ntrue\n```\n")
        self.assertEqual((first.skip, second.skip), ("needs root", None))


def anchors_of(text):
    """The anchors that GitHub makes of a page's headings."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", text), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


class Texts(unittest.TestCase):
    def test_readme_fits_a_few_screens(self):
        self.assertLessEqual(len((ROOT / "README.md").read_text().split()), README_WORDS_MAX)

    def test_every_link_leads_to_a_file_and_a_heading(self):
        checked = 0
        for page in sorted(ROOT.rglob("*.md")):
            if not {"build", "node_modules"}.isdisjoint(page.relative_to(ROOT).parts):
                continue
            for link in re.findall(r"\]\(([^)\s]+)\)", FENCE.sub("", page.read_text())):
                if re.match(r"\w+:", link):
                    continue
                path, _, anchor = link.partition("#")
                target = page.parent / path if path else page
                self.assertTrue(target.exists(), f"{page}: {link}")
                if anchor:
                    self.assertIn(anchor, anchors_of(target.read_text()), f"{page}: {link}")
                checked += 1
        self.assertGreater(checked, 50)

    def test_every_page_is_linked_from_the_readme(self):
        readme = (ROOT / "README.md").read_text()
        for page in (ROOT / "docs").glob("*.md"):
            self.assertIn(f"(docs/{page.name})", readme)

    def test_every_place_has_the_version_of_the_project(self):
        version = re.search(r"project\(voxeld VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
        for program in ("voxeld", "voxel"):
            out = subprocess.run([BIN / program, "--version"], check=True, capture_output=True, text=True).stdout
            self.assertEqual(out, f"{program} {version}\n")
        openapi = yaml.safe_load((ROOT / "proto/openapi.yaml").read_text())
        self.assertEqual(openapi["info"]["version"], version)
        self.assertIn(f'\n__version__ = "{version}"\n', (ROOT / "python/voxeld/__init__.py").read_text())
        newest = re.search(r"^## \[?(\d[^\s\]]*)", (ROOT / "CHANGELOG.md").read_text(), re.M).group(1)
        self.assertEqual(newest, version)
        supported = re.findall(r"^\| (\d+\.\d+)\.x \|", (ROOT / "SECURITY.md").read_text(), re.M)
        self.assertEqual(supported, [version.rpartition(".")[0]])


if __name__ == "__main__":
    unittest.main()
