"""voxel top: once, as JSON, and live on a terminal of its own."""
import fcntl
import json
import os
import pty
import re
import select
import signal
import struct
import subprocess
import termios
import unittest

from harness import BIN, DaemonTest, wait_until

ESCAPE = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Screen:
    """A program on a pseudo-terminal, and what it has written."""

    def __init__(self, arguments, columns=80, rows=24):
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.execv(arguments[0], [str(one) for one in arguments])
        self.resize(columns, rows)
        self.text = ""

    def resize(self, columns, rows):
        fcntl.ioctl(self.fd, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def read(self):
        """Reads what has been written, if anything. False: the program has ended."""
        if not select.select([self.fd], [], [], 0.1)[0]:
            return True
        try:
            self.text += os.read(self.fd, 65536).decode(errors="replace")
        except OSError:
            return False
        return True

    def read_until(self, wanted):
        """The last whole frame once `wanted` says yes to it."""
        def frame():
            assert self.read(), f"it ended; the end of it is {self.text[-2000:]!r}"
            frames = self.text.split("\x1b[H")[1:]
            whole = [one.split("\x1b[J")[0] for one in frames if "\x1b[J" in one]
            return lines_of(whole[-1]) if whole and wanted(lines_of(whole[-1])) else None
        return wait_until(frame, lambda: f"a frame; the end of it is {self.text[-2000:]!r}")

    def end(self):
        """The exit status; all that is written until then is read."""
        try:
            wait_until(lambda: not self.read(), "it ends")
        except AssertionError:
            os.kill(self.pid, signal.SIGKILL)
            raise
        finally:
            _, status = os.waitpid(self.pid, 0)
            os.close(self.fd)
        return os.waitstatus_to_exitcode(status)


def lines_of(frame):
    return [line.rstrip("\r") for line in ESCAPE.sub("", frame).split("\n")]


class Top(DaemonTest):
    device = "cpu"
    arguments = ("--workers-per-device", "1")

    def setUp(self):
        asset = self.daemon.upload(self.fixtures / "sheets.obj")
        self.jobs = [self.daemon.submit(kind="voxelize", asset=asset,
                                        options={"size": 16384, "channels": "occupancy", "cache": "no"})
                     for _ in range(3)]
        self.daemon.wait_state(self.jobs[0], "running")

    def tearDown(self):
        for job in self.jobs:
            self.daemon.cancel(job)

    def voxel(self, *arguments):
        return subprocess.run([BIN / "voxel", "top", "--url", self.daemon.url, *arguments],
                              capture_output=True, text=True)

    def test_once_prints_devices_and_queue_and_ends(self):
        done = self.voxel("--once")
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = done.stdout.splitlines()
        self.assertRegex(lines[0], r"voxel top  http://127\.0\.0\.1:\d+  .* running 1  queued 2$")
        self.assertNotIn("\x1b", done.stdout)
        self.assertTrue(any(line.startswith("cpu ") and " 1/1 " in line for line in lines), lines)
        running = [line for line in lines if line.startswith("  " + self.jobs[0][:10])]
        self.assertEqual(len(running), 1, lines)
        waiting = [line.split() for line in lines if " queued " in line and "j-" in line]
        self.assertEqual([line[0] for line in waiting], ["1", "2"])
        self.assertEqual(self.voxel().stdout.splitlines()[1:3], lines[1:3])  # no terminal: once, too

    def test_json_is_the_response_of_the_daemon(self):
        done = self.voxel("--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        queue = json.loads(done.stdout)
        self.assertEqual({job["id"] for job in queue["jobs"]}, set(self.jobs))

    def test_live_it_follows_fits_resizes_and_gives_the_terminal_back(self):
        screen = Screen([BIN / "voxel", "top", "--url", self.daemon.url])
        frame = screen.read_until(lambda lines: any("voxelize " in line and "/s" in line
                                                    for line in lines))
        self.assertLessEqual(len(frame), 24)
        self.assertLessEqual(max(map(len, frame)), 80)
        self.assertIn("\x1b[?1049h", screen.text)
        self.assertFalse(termios.tcgetattr(screen.fd)[3] & termios.ECHO)
        self.daemon.request("DELETE", f"/v1/jobs/{self.jobs[2]}")
        screen.read_until(lambda lines: "queued 1" in lines[0])
        screen.resize(40, 8)
        screen.read_until(lambda lines: len(lines) <= 8 and max(map(len, lines)) <= 40)
        os.write(screen.fd, b"xq")
        self.assertEqual(screen.end(), 0)
        self.assertTrue(screen.text.endswith("\x1b[?25h\x1b[?1049l"), screen.text[-100:])

    def test_a_signal_gives_the_terminal_back_too(self):
        screen = Screen([BIN / "voxel", "top", "--url", self.daemon.url])
        screen.read_until(lambda lines: "voxel top" in lines[0])
        os.kill(screen.pid, signal.SIGTERM)
        self.assertEqual(screen.end(), 0)
        self.assertTrue(screen.text.endswith("\x1b[?25h\x1b[?1049l"), screen.text[-100:])

    def test_without_a_daemon_it_says_so(self):
        done = subprocess.run([BIN / "voxel", "top", "--once", "--url", "http://127.0.0.1:1"],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 5, done.stderr)
        self.assertIn("http://127.0.0.1:1", done.stderr)


if __name__ == "__main__":
    unittest.main()
