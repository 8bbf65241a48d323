"""One call of the user: its deadline, its cancellation and its progress."""
from __future__ import annotations

import socket
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from ._errors import error


class Progress(NamedTuple):
    """State of a call. `total` 0: unknown. `unit`: "bytes", "tiles" or "frames"."""
    stage: str
    done: int
    total: int
    unit: str


BAR_SECONDS = 0.5  # shorter calls show no bar
ProgressCallback = Callable[[Progress], Any]


class CancelToken:
    """Cancels calls from another thread or a signal handler: pass it as `cancel=` and call `cancel()`.

    The call ends at once with `Cancelled`, and its job is cancelled.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()  # cancel() of a signal handler may interrupt the thread that has it
        self._cancelled = False
        self._sockets: set[socket.socket] = set()

    @property
    def cancelled(self) -> bool:
        """Whether `cancel` was called."""
        return self._cancelled

    def cancel(self) -> None:
        """Ends the calls that have this token, and those that are made with it later."""
        with self._lock:
            self._cancelled = True
            for each in self._sockets:
                try:
                    each.shutdown(socket.SHUT_RDWR)  # wakes the thread that reads from it
                except OSError:
                    pass

    def _watch(self, connection: socket.socket) -> None:
        with self._lock:
            self._sockets.add(connection)
        self._check()

    def _unwatch(self, connection: socket.socket) -> None:
        with self._lock:
            self._sockets.discard(connection)

    def _check(self) -> None:
        if self._cancelled:
            raise error("interrupted", "cancelled by the caller")


class ProgressBar:
    """A bar of tqdm on stderr for calls that take longer than BAR_SECONDS."""

    def __init__(self) -> None:
        from tqdm import tqdm
        self._tqdm: Any = tqdm
        self._bar: Any = None
        self._stage = ""
        self._begin = time.monotonic()

    def __call__(self, progress: Progress) -> None:
        if progress.stage == "done":
            self.close()
        elif time.monotonic() >= self._begin + BAR_SECONDS:
            self._show(progress)

    def _show(self, progress: Progress) -> None:
        if self._bar is None or self._stage != progress.stage:
            self.close()
            self._stage = progress.stage
            is_bytes = progress.unit == "bytes"
            self._bar = self._tqdm(total=progress.total or None, desc=progress.stage, leave=False,
                                   unit="B" if is_bytes else progress.unit.rstrip("s"), unit_scale=is_bytes)
        self._bar.total = progress.total or None
        self._bar.n = progress.done
        self._bar.refresh()

    def close(self) -> None:
        """Removes the bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def _is_interactive() -> bool:
    return "ipykernel" in sys.modules or bool(sys.stderr and sys.stderr.isatty())


def progress_callback(progress: bool | ProgressCallback | None) -> ProgressCallback | None:
    """None: a bar on a terminal and in a notebook, if tqdm is installed. True: a bar anywhere."""
    if callable(progress):
        return progress
    if progress is False or (progress is None and not _is_interactive()):
        return None
    try:
        return ProgressBar()
    except ImportError:
        if progress:
            raise
        return None


class _CallbackError(Exception):
    """An exception of the caller's function, which must not pass for one of the connection."""

    def __init__(self, cause: Exception) -> None:
        super().__init__(str(cause))
        self.cause = cause


class Call:
    """timeout: seconds until the call fails with Timeout; None: no limit."""

    def __init__(self, timeout: float | None = None, cancel: CancelToken | None = None,
                 progress: bool | ProgressCallback | None = False) -> None:
        self.timeout = timeout
        self.deadline = None if timeout is None else time.monotonic() + timeout
        self.cancel = cancel
        self.progress = progress_callback(progress)
        self.files_bytes = 0  # of all files of a mesh that are sent one by one,
        self.files_done = 0  # and of those before the one that is being sent

    def __enter__(self) -> Call:
        return self

    def __exit__(self, kind: object, failure: BaseException | None, trace: object) -> None:
        if isinstance(self.progress, ProgressBar):
            self.progress.close()
        if isinstance(failure, _CallbackError):
            context = failure.cause.__context__
            try:
                raise failure.cause
            finally:
                failure.cause.__context__ = context  # `raise` has replaced it by the failure

    def check(self, early: float = 0.0) -> None:
        """Raises Cancelled, or Timeout from `early` seconds before the deadline on."""
        if self.cancel is not None:
            self.cancel._check()
        if self.deadline is not None and time.monotonic() >= self.deadline - early:
            raise error("timeout", f"the call took longer than {self.timeout:g} s")

    def seconds_left(self) -> float | None:
        """At least a millisecond: 0 would make a socket non-blocking."""
        return None if self.deadline is None else max(self.deadline - time.monotonic(), 0.001)

    def report(self, stage: str, done: int, total: int, unit: str) -> None:
        if self.progress is None:
            return
        if self.files_bytes > 0:
            done, total = self.files_done + done, self.files_bytes
        try:
            self.progress(Progress(stage, done, total, unit))
        except Exception as failure:
            raise _CallbackError(failure) from failure

    def pause(self, seconds: float) -> None:
        """Sleeps, and wakes at once when cancelled."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.check()
            time.sleep(min(left, 0.02))
        self.check()
