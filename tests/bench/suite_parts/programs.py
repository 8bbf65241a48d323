"""Starts the programs that are measured, and says why one did not run."""
import http.client
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import tempfile
import threading
import time

START_SECONDS = 60


class Skipped(Exception):
    """Why a cell of a table has no number."""


class Run:
    def __init__(self, milliseconds, peak_mb, output):
        self.milliseconds, self.peak_mb, self.output = milliseconds, peak_mb, output


def last_line(text):
    """The last line that says what is wrong: not where to read more."""
    lines = [line.strip() for line in text.strip().splitlines() if line.strip()]
    telling = [line for line in lines if not line.endswith("--help tells more")]
    return (telling or lines or ["no message"])[-1][:300]


class Programs:
    """The executables of one build, and a folder for what they write."""

    def __init__(self, folder, limit_seconds, names=None):
        """`names`: of folders, that stand for them in reasons."""
        self.folder = pathlib.Path(folder).resolve()
        self.limit_seconds = limit_seconds
        self.scratch = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-suite-"))
        self.names = {str(self.scratch): "SCRATCH", **(names or {})}

    def close(self):
        shutil.rmtree(self.scratch, ignore_errors=True)

    def path(self, name):
        path = self.folder / name
        if not path.exists():
            raise Skipped(f"{name} is not built (target bench_suite, and what it needs installed)")
        return path

    def run(self, name, *arguments, check=True):
        """Wall time from start to end of the process, its peak memory and what it printed."""
        path = shutil.which(name) if "/" in str(name) else self.path(name)
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            begin = time.monotonic()
            process = subprocess.Popen([path, *map(str, arguments)], stdin=subprocess.DEVNULL,
                                       stdout=out, stderr=err, start_new_session=True)
            # Whole groups: rivals_bench measures in children.
            timer = threading.Timer(self.limit_seconds, os.killpg, (process.pid, signal.SIGKILL))
            timer.start()
            try:
                _, status, usage = os.wait4(process.pid, 0)
            except BaseException:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                raise
            finally:
                milliseconds = (time.monotonic() - begin) * 1e3
                late = not timer.is_alive()
                timer.cancel()
            process.returncode = os.waitstatus_to_exitcode(status)
            out.seek(0)
            err.seek(0)
            output = out.read().decode(errors="replace")
            errors = err.read().decode(errors="replace")
        if late:
            raise Skipped(f"more than {self.limit_seconds} s")
        if check and process.returncode != 0:
            raise Skipped(self._reason(errors, process.returncode))
        return Run(milliseconds, usage.ru_maxrss / 1024, output)

    def _reason(self, errors, status):
        reason = last_line(errors or f"exit status {status}")
        for folder, name in self.names.items():
            reason = reason.replace(folder, name)
        return reason

    def json_rows(self, name, *arguments):
        """Rows of a program with --json FILE, and why those that are missing are missing."""
        file = self.scratch / "rows.json"
        file.unlink(missing_ok=True)
        why = ""
        try:
            self.run(name, *arguments, "--json", file)
        except Skipped as reason:
            why = str(reason)
        try:
            return json.loads(file.read_text()), why
        except (FileNotFoundError, ValueError):  # none, or ended while it was written
            return [], why


class Daemon:
    """One voxeld with a data directory of its own."""

    def __init__(self, programs, device):
        self.data = tempfile.mkdtemp(prefix="voxeld-bench-data-")
        self.log = open(self.data + ".log", "w+b")
        try:
            self._start(programs.path("voxeld"), device)
        except BaseException:
            self._clean()
            raise

    def _start(self, program, device):
        self.process = subprocess.Popen(
            [program, "serve", "--listen", "127.0.0.1:0", "--admin-listen", "127.0.0.1:0", "--data",
             self.data, "--device", device],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=self.log, text=True)
        line = self.process.stdout.readline()
        match = re.match(r"ready (http://127\.0\.0\.1:\d+) admin=http://(127\.0\.0\.1:\d+)", line)
        if not match:
            self.process.wait()
            self.log.seek(0)
            raise Skipped("the daemon did not start: "
                          + last_line(self.log.read().decode(errors="replace")))
        self.url, self.admin = match.groups()
        deadline = time.monotonic() + START_SECONDS
        while not self._ready():
            if time.monotonic() > deadline:
                self.stop()
                raise Skipped(f"the daemon on {device} was not ready after {START_SECONDS} s")
            time.sleep(0.05)

    def _ready(self):
        connection = http.client.HTTPConnection(self.admin, timeout=10)
        try:
            connection.request("GET", "/readyz")
            return connection.getresponse().status == 200
        finally:
            connection.close()

    def peak_mb(self):
        """Largest resident memory so far of the daemon and its workers, added up."""
        pids = [self.process.pid]
        for task in pathlib.Path(f"/proc/{self.process.pid}/task").iterdir():
            try:
                pids += map(int, (task / "children").read_text().split())
            except (FileNotFoundError, ProcessLookupError):  # a thread that has ended since
                continue
        total = 0
        for pid in pids:
            match = re.search(r"VmHWM:\s+(\d+)", pathlib.Path(f"/proc/{pid}/status").read_text())
            total += int(match.group(1)) / 1024 if match else 0
        return total

    def stop(self):
        self.process.terminate()
        try:
            self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._clean()

    def _clean(self):
        self.log.close()
        pathlib.Path(self.log.name).unlink(missing_ok=True)
        shutil.rmtree(self.data, ignore_errors=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()
