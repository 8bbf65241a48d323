"""HTTP exchanges with one daemon: pooled connections, retries, resumed and verified downloads."""
from __future__ import annotations

import functools
import hashlib
import http.client
import io
import os
import re
import socket
import threading
import urllib.parse
from collections.abc import Callable, Mapping
from typing import Any, BinaryIO

from ._call import Call
from ._errors import Error, error, problem_error
from ._server import Server

CONNECT_SECONDS = 10.0
PAUSE_FIRST_SECONDS = 0.2  # of a pause before another try, which doubles
PAUSE_MAX_SECONDS = 10.0
# Least tries, some 30 s, of a wait for a job: it survives a restart of the daemon, and so does who waits for it.
WAIT_RETRIES = 8
PIECE_BYTES = 1 << 20  # of a body that is read at a time
SENT_BYTES = 1 << 14  # of a body that is sent at a time, a record of TLS; a socket's timeout counts for each
IDLE_CONNECTIONS_MAX = 8
CLOCK_SLACK_SECONDS = 0.05  # by which a socket's timeout may come before the call's deadline
CONTENT_TAG = re.compile(r'"sha256-([0-9a-f]{64})"')

OpenBody = Callable[[], BinaryIO]


class Response:
    """status; headers with names in lower case; body."""

    def __init__(self, status: int, headers: Mapping[str, str], body: bytes | bytearray) -> None:
        self.status = status
        self.headers = headers
        self.body = body


class _Sink:
    """The body of a download, of which `received` bytes have come."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.received = 0


def _limit(connected: socket.socket, call: Call, idle: float | None) -> None:
    """Limits the next step of a socket by the end of the call and by `idle` seconds of silence."""
    call.check()
    limits = [each for each in (call.seconds_left(), idle) if each is not None]
    connected.settimeout(min(limits, default=None))


class _LimitedReader(io.RawIOBase):
    """Calls `limit` before each read of a socket: its timeout counts for one read, and a response takes many."""

    def __init__(self, raw: io.RawIOBase, limit: Callable[[], None]) -> None:
        super().__init__()
        self._raw = raw
        self._limit = limit

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int | None:
        self._limit()
        return self._raw.readinto(buffer)

    def close(self) -> None:
        self._raw.close()
        super().close()


class _LimitedResponse(http.client.HTTPResponse):
    def __init__(self, limit: Callable[[], None], *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.fp = io.BufferedReader(_LimitedReader(self.fp.detach(), limit))


class _Broken(Exception):
    """The connection ended in the middle of an exchange; `head`: of the response that had begun."""

    def __init__(self, cause: Exception, head: Response | None = None) -> None:
        super().__init__(str(cause) or type(cause).__name__)
        self.head = head


def _is_busy(response: Response) -> bool:
    return response.status in (429, 503)


def _is_lost(response: Response) -> bool:
    """Whether a proxy lost the daemon. A 504 of the daemon's own has a code."""
    return (response.status in (502, 504)
            and not response.headers.get("content-type", "").startswith("application/problem+json"))


class Transport:
    """May be used by several threads at a time.

    idle_timeout: seconds without a byte from the daemon until an exchange fails. retries: further tries after 429,
    503, a refused or a broken connection, also of a proxy (502, 504).
    """

    def __init__(self, server: Server, *, idle_timeout: float | None, retries: int) -> None:
        self.server = server
        self.idle_timeout = idle_timeout
        self.retries = retries
        self._lock = threading.Lock()
        self._idle: list[http.client.HTTPConnection] = []
        self._pid = os.getpid()

    def close(self) -> None:
        with self._lock:
            idle, self._idle = self._idle, []
        for connection in idle:
            connection.close()

    def __del__(self) -> None:
        self.close()

    # --- exchanges

    def request(self, call: Call, method: str, path: str, *, body: bytes | None = None,
                open_body: OpenBody | None = None, body_bytes: int = 0, headers: Mapping[str, str] | None = None,
                held: float = 0.0, stage: str = "upload", also_good: tuple[int, ...] = ()) -> Response:
        """A response of 2xx or of `also_good`, after retries. Raises Error.

        body: whole, or `open_body` gives a file of `body_bytes` bytes, anew for each try. held: seconds for which the
        daemon may hold the request.
        """
        opener: OpenBody | None = open_body
        if body is not None:
            whole = body
            opener, body_bytes = (lambda: io.BytesIO(whole)), len(whole)
        retries = max(self.retries, WAIT_RETRIES) if held > 0 and self.retries > 0 else self.retries
        attempt = 0
        while True:
            call.check()
            try:
                response = self._exchange(call, method, path, opener, body_bytes, headers or {}, held, stage)
            except (_Broken, Error) as failure:
                call.check()
                if isinstance(failure, Error) and not getattr(failure, "may_pass", False):
                    raise
                if attempt >= retries:
                    raise self._unreachable(failure) from failure
                call.pause(self._pause_seconds(attempt, None))
                if isinstance(failure, _Broken) and method == "DELETE":
                    also_good = (*also_good, 404, 410)  # it may be done
            else:
                if response.status // 100 == 2 or response.status in also_good:
                    return response
                if not (_is_busy(response) or _is_lost(response)) or attempt >= retries:
                    raise self._problem(response)
                call.pause(self._pause_seconds(attempt, response))
                if _is_lost(response) and method == "DELETE":
                    also_good = (*also_good, 404, 410)
            attempt += 1

    def json(self, call: Call, method: str, path: str, **arguments: Any) -> dict[str, Any]:
        """The JSON object of a response."""
        return parse_object(self.request(call, method, path, **arguments), self.server.name)

    def download(self, call: Call, path: str) -> Response:
        """GET of a body that may be large: a broken connection is resumed where it broke, and the bytes are compared
        with the hash in the ETag."""
        sink = _Sink()
        attempt = resumed_at = 0
        head: Response | None = None
        while True:
            call.check()
            headers: dict[str, str] = {}
            received = sink.received
            if received > resumed_at:  # the tries are for each byte at which it breaks
                resumed_at, attempt = received, 0
            if head is not None and received > 0:
                headers = {"Range": f"bytes={received}-", "If-Range": head.headers.get("etag", "")}
            try:
                response = self._exchange(call, "GET", path, None, 0, headers, 0.0, "download", sink)
                if response.status // 100 == 2:
                    self._check_resumed(response, head, received)
                    head = head or response
                    break
                if not (_is_busy(response) or _is_lost(response)) or attempt >= self.retries:
                    raise self._problem(response)
                pause = self._pause_seconds(attempt, response)
            except _Broken as broken:
                call.check()
                if broken.head is not None and broken.head.status // 100 == 2:
                    self._check_resumed(broken.head, head, received)
                    head = head or broken.head
                is_resumable = sink.received == 0 or (head is not None and "etag" in head.headers)
                if attempt >= self.retries or not is_resumable:
                    raise self._unreachable(broken) from broken
                pause = self._pause_seconds(attempt, None)
            except Error as failure:
                call.check()
                if not getattr(failure, "may_pass", False) or attempt >= self.retries:
                    raise
                pause = self._pause_seconds(attempt, None)
            call.pause(pause)
            attempt += 1
        self._check_content(path, head, sink.data)
        return Response(head.status, head.headers, sink.data)

    def _check_resumed(self, response: Response, head: Response | None, received: int) -> None:
        if head is None or received == 0:
            return
        got_range, got_tag = response.headers.get("content-range", ""), response.headers.get("etag", "")
        is_same = got_tag in ("", head.headers.get("etag"))
        if response.status == 206 and got_range.startswith(f"bytes {received}-") and is_same:
            return
        raise error("bad-response", "the result changed while it was downloaded", status=response.status,
                    expected=f"status 206 with bytes {received}- of {head.headers.get('etag')}",
                    got=f"status {response.status} with {got_range or 'no range'} of {got_tag}")

    def _check_content(self, path: str, head: Response, data: bytearray) -> None:
        tag = CONTENT_TAG.fullmatch(head.headers.get("etag", ""))
        if tag is None:
            return
        digest = hashlib.sha256(data).hexdigest()
        if digest != tag[1]:
            raise error("content-mismatch", f"{path} was damaged on its way, or where it is stored",
                        expected=f"sha256-{tag[1]}", got=f"sha256-{digest}")

    # --- one exchange

    def _exchange(self, call: Call, method: str, path: str, open_body: OpenBody | None, body_bytes: int,
                  headers: Mapping[str, str], held: float, stage: str, sink: _Sink | None = None) -> Response:
        """A response of any status. A body of 2xx goes to the sink, behind what it has received."""
        while True:
            connection, is_reused = self._connection(call)
            try:
                return self._exchange_on(connection, call, method, path, open_body, body_bytes, headers, held, stage,
                                         sink)
            except _Broken as broken:
                # The daemon closes idle connections. Every request here may be sent twice: POST of jobs has an
                # Idempotency-Key, and uploads are named by their hash.
                if not is_reused or broken.head is not None:
                    raise
            except TimeoutError as failure:
                call.check(early=CLOCK_SLACK_SECONDS)
                raise error("timeout", f"{self.server.name} sent nothing for {self.idle_timeout} s") from failure

    def _exchange_on(self, connection: http.client.HTTPConnection, call: Call, method: str, path: str,
                     open_body: OpenBody | None, body_bytes: int, headers: Mapping[str, str], held: float, stage: str,
                     sink: _Sink | None) -> Response:
        own = connection.sock
        is_good = False
        try:
            if call.cancel is not None:
                call.cancel._watch(own)
            limit = functools.partial(_limit, own, call,
                                      None if self.idle_timeout is None else self.idle_timeout + held)
            try:
                self._send(connection, call, limit, method, path, open_body, body_bytes, headers, stage)
                is_sent = True
            except (BrokenPipeError, ConnectionResetError):
                is_sent = False  # a refusal, such as 413, may have come before the whole body was sent
            response = self._receive(connection, call, limit, sink)
            is_good = is_sent
            return response
        except TimeoutError:
            raise
        except (http.client.HTTPException, OSError) as failure:
            raise _Broken(failure) from failure
        finally:
            if call.cancel is not None:
                call.cancel._unwatch(own)
            if is_good and connection.sock is not None:
                self._give_back(connection)
            else:
                connection.close()

    def _send(self, connection: http.client.HTTPConnection, call: Call, limit: Callable[[], None], method: str,
              path: str, open_body: OpenBody | None, body_bytes: int, headers: Mapping[str, str], stage: str) -> None:
        limit()
        connection.putrequest(method, self.server_path(path), skip_accept_encoding=True)
        key = self.server.key
        if key:
            connection.putheader("Authorization", f"Bearer {key}")
        for name, value in headers.items():
            connection.putheader(name, value)
        if open_body is None:
            if method == "POST":
                connection.putheader("Content-Length", "0")
            connection.endheaders()
            return
        connection.putheader("Content-Length", str(body_bytes))
        connection.endheaders()
        sent = 0
        with open_body() as file:
            while piece := file.read(PIECE_BYTES):
                if sent + len(piece) > body_bytes:  # the daemon would take the rest for another request
                    raise _changed(file, body_bytes, "more")
                left = memoryview(piece)
                while left:
                    limit()
                    left = left[connection.sock.send(left[:SENT_BYTES]):]
                sent += len(piece)
                if body_bytes > PIECE_BYTES:
                    call.report(stage, sent, body_bytes, "bytes")
            if sent < body_bytes:
                raise _changed(file, body_bytes, str(sent))

    def _receive(self, connection: http.client.HTTPConnection, call: Call, limit: Callable[[], None],
                 sink: _Sink | None) -> Response:
        settable: Any = connection
        settable.response_class = functools.partial(_LimitedResponse, limit)
        raw = connection.getresponse()
        head = Response(raw.status, {name.lower(): value for name, value in raw.getheaders()}, b"")
        if sink is None or raw.status // 100 != 2:
            head.body = raw.read()
            return head
        try:
            if raw.length is None:  # chunked
                while piece := raw.read(PIECE_BYTES):
                    sink.data[sink.received:] = piece
                    sink.received += len(piece)
            else:
                self._receive_counted(raw, raw.length, call, sink)
        except TimeoutError:
            raise
        except (http.client.HTTPException, OSError) as failure:
            raise _Broken(failure, head) from failure
        return head

    def _receive_counted(self, raw: http.client.HTTPResponse, length: int, call: Call, sink: _Sink) -> None:
        total = sink.received + length
        if sink.received == 0:
            sink.data = bytearray(total)
        elif len(sink.data) != total:
            raise http.client.IncompleteRead(b"", total - len(sink.data))
        with memoryview(sink.data) as view:
            while sink.received < total:
                count = raw.readinto(view[sink.received:sink.received + PIECE_BYTES])
                if count == 0:
                    raise http.client.IncompleteRead(b"", total - sink.received)
                sink.received += count
                if total > PIECE_BYTES:
                    call.report("download", sink.received, total, "bytes")
        raw.read()  # marks the response as read, so that the connection can be used again

    # --- connections

    def _connection(self, call: Call) -> tuple[http.client.HTTPConnection, bool]:
        """A connected one, and whether it was used before."""
        with self._lock:
            if self._pid != os.getpid():  # after a fork, connections belong to the parent
                for each in self._idle:
                    each.close()  # the descriptor of the child alone
                self._idle, self._pid = [], os.getpid()
            if self._idle:
                return self._idle.pop(), True
        address, left = self.server.connect_url(call), call.seconds_left()
        kinds = {"http": http.client.HTTPConnection, "https": http.client.HTTPSConnection}
        try:
            url = urllib.parse.urlsplit(address)
            kind, host = kinds[url.scheme if url.hostname else ""], (url.hostname or "").encode("idna").decode()
            # Without a port, the last group of an IPv6 address would be taken for one.
            port = (443 if url.scheme == "https" else 80) if url.port is None else url.port
            connection = kind(host, port, timeout=min(CONNECT_SECONDS, left or CONNECT_SECONDS))
        except (KeyError, ValueError, http.client.InvalidURL):
            raise error("invalid-option", "url", expected="http://HOST[:PORT] or https://HOST[:PORT]",
                        got=self.server.name) from None
        try:
            connection.connect()
        except OSError as failure:
            connection.close()
            call.check()
            raise error("unreachable", f"{self.server.name}: {failure.strerror or failure}") from failure
        connection.auto_open = 0  # one that was closed does not connect anew by itself
        return connection, False

    def _give_back(self, connection: http.client.HTTPConnection) -> None:
        with self._lock:
            if self._pid == os.getpid() and len(self._idle) < IDLE_CONNECTIONS_MAX:
                self._idle.append(connection)
                return
        connection.close()

    def server_path(self, path: str) -> str:
        """With the path of the URL before it."""
        before = urllib.parse.urlsplit(self.server.name).path.rstrip("/")
        return urllib.parse.quote(before, safe="/%:@!$&'()*+,;=") + path

    # --- failures

    def _pause_seconds(self, attempt: int, response: Response | None) -> float:
        after = "" if response is None else response.headers.get("retry-after", "")
        wanted = float(after) if after.isdigit() else PAUSE_FIRST_SECONDS * 2.0 ** attempt
        return min(wanted, PAUSE_MAX_SECONDS)

    def _problem(self, response: Response) -> Error:
        return problem_error(response.status, bytes(response.body), response.headers.get("x-request-id", ""),
                             self.server.name)

    def _unreachable(self, failure: Exception) -> Error:
        return failure if isinstance(failure, Error) else error("unreachable", f"{self.server.name}: {failure}")


def _changed(file: BinaryIO, expected_bytes: int, got: str) -> Error:
    return error("file", f"{getattr(file, 'name', 'the file')} changed before it was sent",
                 expected=f"{expected_bytes} bytes", got=got)


def parse_object(response: Response, where: str) -> dict[str, Any]:
    import json
    try:
        value = json.loads(response.body)
    except ValueError:
        value = None
    if not isinstance(value, dict):
        raise error("bad-response", f"{where}: is there a voxeld at this URL?", status=response.status,
                    expected="a JSON object", got=f"{len(response.body)} other bytes")
    return value
