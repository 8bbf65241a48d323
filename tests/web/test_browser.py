"""The page's build and the types of its scripts; the page in Debian's Chromium (*.spec.mjs, by Playwright). Packages
are those of package-lock.json; VOXELD_WEB_WORK_DIR is the folder that uses them. No browser is downloaded."""
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "tests/integration"))
sys.path.insert(0, str(ROOT / "client/web"))
import build_page  # noqa: E402
import npm_packages  # noqa: E402
from harness import BIN  # noqa: E402

WORK = pathlib.Path(os.environ.get("VOXELD_WEB_WORK_DIR", ROOT / "build/dev/tests/web/work"))


def node(*arguments, seconds, **environment):
    """The output of a script of Node in WORK. Its status has to be 0."""
    with subprocess.Popen(["node", *arguments], cwd=WORK, env={**os.environ, **environment}, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True) as process:
        try:
            said, _ = process.communicate(timeout=seconds)
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)  # its browsers and daemons too
            raise
    assert process.returncode == 0, said[-6000:]
    return said


class Build(unittest.TestCase):
    def test_the_scripts_have_strict_types(self):
        npm_packages.prepare(HERE, WORK)
        node("node_modules/typescript/bin/tsc", "--project", str(HERE), seconds=600)

    def test_the_shortened_shader_is_valid_in_every_variant(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            build_page.make_shader(folder)
            text = (folder / "raymarch.es.glsl").read_text()
            lines = [line.split()[1:] for line in (ROOT / "shaders/variants.txt").read_text().splitlines()
                     if line.startswith("raymarch.frag")]
            variants = [line for line in lines if not any(word.startswith(build_page.NEVER_DEFINED) for word in line)]
            self.assertGreaterEqual(len(variants), 20)
            for macros in variants:
                defines = "\n".join("#define " + macro.replace("=", " ") for macro in macros)
                (folder / "variant.frag").write_text(text.replace("VARIANT\n", defines + "\n", 1))
                done = subprocess.run(["glslangValidator", folder / "variant.frag"], capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, f"{macros}\n{done.stdout}")

    def test_equal_sources_give_equal_pages(self):
        pages = [build_page.build("esbuild")[0] for _ in range(2)]
        self.assertEqual(*pages)
        self.assertEqual(len(pages[0]), 4)


class Browser(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        npm_packages.prepare(HERE, WORK)
        for path in WORK.glob("*.mjs"):  # of an earlier version, which had other files
            path.unlink()
        for path in HERE.glob("*.mjs"):
            shutil.copyfile(path, WORK / path.name)

    def test_the_page_in_chromium(self):
        self.assertIsNotNone(shutil.which("chromium-headless-shell"),
                             "Chromium missing; Debian: apt-get install chromium-headless-shell")
        # Caches of shaders and fonts are those of this run alone, and what is left goes with the folder. The name is
        # short because paths of sockets have a limit.
        chosen = [] if os.environ.get("VOXELD_LONG") == "1" else ["--grep-invert", "@long"]
        with tempfile.TemporaryDirectory(prefix="web-") as folder:
            print(node("node_modules/@playwright/test/cli.js", "test", *chosen, seconds=7000,
                       VOXELD_BIN_DIR=str(BIN.resolve()), VOXELD_ROOT_DIR=str(ROOT), TMPDIR=folder, HOME=folder,
                       XDG_CACHE_HOME=f"{folder}/cache", XDG_CONFIG_HOME=f"{folder}/config"))


if __name__ == "__main__":
    unittest.main()
