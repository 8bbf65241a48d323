"""The page in Debian's Firefox, on a screen in memory and driven by its own protocol, Marionette
(firefox-source-docs.mozilla.org/testing/marionette/Protocol.html): a mesh is dropped, drawn and saved."""
import base64
import io
import json
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import time
import unittest

from PIL import Image

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "tests/integration"))
from harness import BIN, DaemonTest  # noqa: E402  (needs the path above)

HANG_SECONDS = 120
# Requests to other hosts than this one fail at once: a proxy that is not there.
PREFERENCES = {"marionette.port": 0, "network.proxy.type": 1, "network.proxy.http": "127.0.0.1",
               "network.proxy.http_port": 9, "network.proxy.ssl": "127.0.0.1", "network.proxy.ssl_port": 9,
               "webgl.force-enabled": True, "browser.download.folderList": 2}
DROP = """
const transfer = new DataTransfer();
const bytes = Uint8Array.from(atob(arguments[1]), c => c.charCodeAt(0));
transfer.items.add(new File([bytes], arguments[0]));
document.getElementById("view").dispatchEvent(new DragEvent("drop", {dataTransfer: transfer, bubbles: true}));
"""


def comes(what, seconds=HANG_SECONDS):
    """The first value of what() that is true."""
    deadline = time.monotonic() + seconds
    while not (value := what()):
        assert time.monotonic() < deadline, "it does not come"
        time.sleep(0.1)
    return value


class Firefox:
    def __init__(self, folder):
        self.downloads = folder / "downloads"
        profile = folder / "profile"
        profile.mkdir()
        self.downloads.mkdir()
        preferences = {**PREFERENCES, "browser.download.dir": str(self.downloads)}
        (profile / "user.js").write_text("".join(f"user_pref({json.dumps(name)}, {json.dumps(value)});\n"
                                                 for name, value in preferences.items()))
        self.screen = subprocess.Popen(["Xvfb", "-displayfd", "1", "-nolisten", "tcp"], text=True,
                                       stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        display = ":" + self.screen.stdout.readline().strip()
        self.log = open(folder / "firefox.log", "w")
        self.process = subprocess.Popen(
            ["firefox-esr", "--no-remote", "--marionette", "--profile", profile], stdout=self.log,
            stderr=self.log, env={**os.environ, "HOME": str(folder), "DISPLAY": display})
        port = comes(lambda: (profile / "MarionetteActivePort").exists()
                     and (profile / "MarionetteActivePort").read_text())
        self.connection = socket.create_connection(("127.0.0.1", int(port)), timeout=HANG_SECONDS)
        self.messages = self.connection.makefile("rb")
        self.count = 0
        self.message()  # who it is
        self.call("WebDriver:NewSession", capabilities={})

    def message(self):
        """A message is LENGTH:JSON."""
        digits = b""
        while (byte := self.messages.read(1)) != b":":
            digits += byte
        return json.loads(self.messages.read(int(digits)))

    def call(self, command, **parameters):
        self.count += 1
        text = json.dumps([0, self.count, command, parameters]).encode()
        self.connection.sendall(b"%d:%s" % (len(text), text))
        _, number, error, result = self.message()
        assert number == self.count and not error, error
        return result.get("value", result) if isinstance(result, dict) else result

    def run(self, script, *arguments):
        return self.call("WebDriver:ExecuteScript", script=script, args=arguments)

    def close(self):
        self.connection.close()
        self.process.terminate()
        self.process.wait(HANG_SECONDS)
        self.screen.terminate()
        self.screen.wait(HANG_SECONDS)
        self.screen.stdout.close()
        self.log.close()


class DropInFirefox(DaemonTest):
    device = "cpu"

    def test_a_dropped_mesh_is_drawn_and_saved_with_the_bytes_of_the_cli(self):
        with tempfile.TemporaryDirectory(prefix="firefox-", ignore_cleanup_errors=True) as name:
            firefox = Firefox(pathlib.Path(name))
            try:
                self.drop_and_save(firefox, pathlib.Path(name))
            finally:
                firefox.close()

    def drop_and_save(self, firefox, folder):
        mesh = self.fixtures / "sample.ply"
        firefox.call("WebDriver:Navigate", url=self.daemon.url)
        firefox.run(DROP, mesh.name, base64.b64encode(mesh.read_bytes()).decode())
        facts = "const facts = document.getElementById('facts'); return !facts.hidden && facts.textContent"
        comes(lambda: "× 256" in str(firefox.run(facts)))
        self.assertFalse(firefox.run("return document.getElementById('canvas').hidden"), "no WebGL 2")

        def colors():
            shot = Image.open(io.BytesIO(base64.b64decode(firefox.call("WebDriver:TakeScreenshot", full=False))))
            view = firefox.run("const box = document.getElementById('canvas').getBoundingClientRect();"
                               "return [box.left, box.top, box.right, box.bottom]")
            return shot.convert("RGB").crop(view).quantize(64).convert("RGB").getcolors()

        def saturated():
            return sum(count for count, color in colors() if max(color) - min(color) > 100)
        comes(lambda: saturated() > 20_000)  # pixels of the knot, whose colours are vivid
        firefox.run("const format = document.getElementById('format'); format.value = 'npz';"
                    "format.dispatchEvent(new Event('change'));"
                    "document.querySelector('#card-take button.primary').click()")
        saved, own = firefox.downloads / "sample.npz", folder / "own.npz"
        comes(lambda: saved.exists() and saved.stat().st_size > 0 and not list(firefox.downloads.glob("*.part")))
        subprocess.run([BIN / "voxel", "--url", self.daemon.url, mesh, "--size", "256", "-o", own], check=True,
                       stdout=subprocess.DEVNULL)
        self.assertEqual(saved.read_bytes(), own.read_bytes())
        self.assertEqual(firefox.run("return document.getElementById('banner').hidden"), True)


if __name__ == "__main__":
    unittest.main()
