"""The exceptions of the package."""
from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from typing import Any


class Error(Exception):
    """A failure of the service, of the connection to it, or of a local file.

    Attributes:
        code: stable name of the failure: one of the API ("invalid-option", "grid-too-large", …), or "unreachable",
            "timeout", "interrupted" (cancelled by the caller), "bad-response" (no voxeld), "content-mismatch"
            (a damaged download), "file" (a local file or array).
        status: HTTP status; 0 without a response.
        title, type: short sentence and URI of the problem+json.
        detail: cause and place. `expected` and `got` complete it, or are empty.
        request_id: the request in the daemon's log.
        problem: the whole problem+json.
        job: id of the failed job, or empty.
    """

    def __init__(self, code: str, detail: str, *, status: int = 0, expected: str = "", got: str = "",
                 title: str = "", type: str = "about:blank", request_id: str = "", job: str = "",
                 problem: Mapping[str, Any] | None = None) -> None:
        self.code = code
        self.detail = detail
        self.status = status
        self.expected = expected
        self.got = got
        self.title = title
        self.type = type
        self.request_id = request_id
        self.job = job
        self.problem: dict[str, Any] = dict(problem or {})
        text = detail or title or code
        if expected:
            text += f": expected {expected}"
        if got:
            text += f"{', ' if expected else ': '}got {got}"
        super().__init__(f"{text} ({code})")

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process, such as a pool's parent, makes it anew from these."""
        make = functools.partial(type(self), self.code, self.detail, expected=self.expected, got=self.got,
                                 title=self.title)
        return make, (), self.__dict__


class Unreachable(Error, ConnectionError):
    """No daemon responds, or the connection broke."""

    may_pass = True  # False: another try at once would fail, too


class Timeout(Error, TimeoutError):
    """The call took longer than its timeout, or the daemon sent nothing for too long."""


class Cancelled(Error):
    """The caller cancelled the call, or the job was cancelled."""


class BadInput(Error, ValueError):
    """A mesh, an option or an array that cannot be used."""


class NotFound(Error, LookupError):
    """A resource that never existed or was deleted."""


_CLASSES: dict[str, type[Error]] = {
    "unreachable": Unreachable, "timeout": Timeout, "deadline-exceeded": Timeout, "interrupted": Cancelled,
    "cancelled": Cancelled, "not-found": NotFound, "gone": NotFound, "unknown-option": BadInput,
    "bad-request": BadInput, "invalid-option": BadInput, "malformed-mesh": BadInput, "empty-mesh": BadInput,
    "unsupported-feature": BadInput, "malformed-image": BadInput, "malformed-bundle": BadInput,
    "unsupported-media-type": BadInput, "grid-too-large": BadInput, "file": BadInput,
}


def error(code: str, detail: str, **members: Any) -> Error:
    """The exception of a code."""
    return _CLASSES.get(code, Error)(code, detail, **members)


def problem_error(status: int, body: bytes, request_id: str, url: str) -> Error:
    """The exception of an HTTP response that is no success."""
    try:
        problem = json.loads(body)
    except ValueError:
        problem = None
    if not isinstance(problem, dict) or not isinstance(problem.get("code"), str):
        return error("bad-response", f"{url}: is there a voxeld at this URL?", status=status,
                     expected="application/problem+json", got=f"status {status}", request_id=request_id)
    return error(problem["code"], str(problem.get("detail", "")), status=status,
                 expected=str(problem.get("expected") or ""), got=str(problem.get("got") or ""),
                 title=str(problem.get("title", "")), type=str(problem.get("type", "about:blank")),
                 request_id=request_id, problem=problem)
