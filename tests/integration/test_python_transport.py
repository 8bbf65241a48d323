"""The Python package's HTTP: retries, broken connections, damaged downloads, against servers that follow a script."""
import asyncio
import concurrent.futures
import contextlib
import functools
import hashlib
import http.client
import io
import json
import os
import pathlib
import pickle
import socket
import tempfile
import threading
import types
import unittest
import unittest.mock

import python_package  # noqa: F401: finds voxeld
from harness import HANG_SECONDS, wait_until

import voxeld
from voxeld import _mesh, aio
from voxeld._call import Call

RESULT = bytes(range(256)) * 5000
SLOW = b"slow" * 1000
TAG = f'"sha256-{hashlib.sha256(RESULT).hexdigest()}"'
DONE = {"id": "j-1", "kind": "voxelize", "state": "done", "tiles_done": 1, "tiles_total": 1, "frames_done": 0,
        "frames_total": 0, "stage": "", "result": {"grid": "sha256-a", "meta": {}, "media_type": "image/png"}}


def response(status, body=b"", *headers, length=None):
    lines = [f"HTTP/1.1 {status} Text", f"Content-Length: {len(body) if length is None else length}", *headers]
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body


def json_response(value, status=200, *headers):
    return response(status, json.dumps(value).encode(), "Content-Type: application/json", *headers)


def problem(status, code, *headers):
    body = {"code": code, "status": status, "title": "T", "detail": "D"}
    return response(status, json.dumps(body).encode(), *headers)


class Script:
    """Answers requests one after the other. An answer: bytes; CLOSE after it ends the connection, SILENCE sends
    nothing, REFUSE answers before the body is read. SLOW in it comes byte by byte, in HANG_SECONDS."""
    CLOSE, SILENCE, REFUSE = object(), object(), object()

    def __init__(self, *answers):
        self.answers = list(answers)
        self.heads = []
        self.bodies = []
        self.closed = 0  # connections
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self.serve, daemon=True)
        self.thread.start()

    def serve(self):
        while self.answers:
            try:
                connection = self.listener.accept()[0]
            except OSError:
                return
            with connection, contextlib.suppress(ConnectionError):
                self.serve_one(connection)
            self.closed += 1

    def serve_one(self, connection):
        file = connection.makefile("rb")
        while self.answers:
            head = [line.decode() for line in iter(lambda: file.readline().rstrip(), b"")]
            if not head:
                return
            self.heads.append(head)
            is_refusal = self.answers[0] is self.REFUSE
            if is_refusal:
                self.answers.pop(0)
            else:
                self.bodies.append(file.read(int(self.header("Content-Length") or 0)))
            answer = self.answers.pop(0)
            if answer is self.SILENCE:
                self.ended.wait(HANG_SECONDS)
                return
            self.send(connection, answer)
            if is_refusal:
                file.read(100)
            if self.answers and self.answers[0] is self.CLOSE:
                self.answers.pop(0)
                return

    def send(self, connection, answer):
        before, zeros, after = answer.partition(SLOW)
        connection.sendall(before)
        for each in zeros:
            if self.ended.wait(HANG_SECONDS / len(SLOW)):
                return
            connection.sendall(bytes([each]))
        connection.sendall(after)

    def header(self, name, request=-1):
        return next((line.split(": ", 1)[1] for line in self.heads[request] if line.startswith(name + ": ")), None)

    def lines(self):
        return [head[0].removesuffix(" HTTP/1.1") for head in self.heads]

    def close(self):
        self.ended.set()
        self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        self.thread.join(HANG_SECONDS)


class TransportTest(unittest.TestCase):
    def script(self, *answers, **settings):
        script = Script(*answers)
        self.addCleanup(script.close)
        self.client = voxeld.Client(script.url, settings.pop("key", ""), **settings)
        self.addCleanup(self.client.close)
        return script

    def pauses(self):
        """The seconds of each pause between two tries, in a list that grows."""
        seconds = []
        real = Call.pause

        def pause(call, wanted):
            seconds.append(wanted)
            real(call, wanted)
        patch = unittest.mock.patch.object(Call, "pause", pause)
        patch.start()
        self.addCleanup(patch.stop)
        return seconds

    def get(self, path="/v1/me", call=None):
        return self.client._transport.json(call or Call(), "GET", path)

    def download(self, call=None):
        return self.client._transport.download(call or Call(), "/v1/grids/a").body

    def raised(self, kind, code, work):
        with self.assertRaises(kind) as raised:
            work()
        self.assertEqual(raised.exception.code, code)
        return raised.exception


class Transport(TransportTest):
    def test_busy_servers_are_asked_again_after_the_pause_that_they_name(self):
        script = self.script(problem(503, "queue-full", "Retry-After: 1"), problem(429, "too-many-requests"),
                             json_response({"a": 1}))
        pauses = self.pauses()
        self.assertEqual(self.get(), {"a": 1})
        self.assertEqual(pauses, [1, 0.4])
        self.assertEqual(len(script.heads), 3)

    def test_after_the_last_try_the_problem_is_raised(self):
        self.script(problem(503, "queue-full", "Retry-After: 0", "X-Request-Id: r-7"), problem(503, "queue-full"),
                    retries=1)
        failure = self.raised(voxeld.Error, "queue-full", self.get)
        self.assertEqual((failure.status, failure.title, failure.detail), (503, "T", "D"))

    def test_an_exception_goes_to_another_process_as_it_is(self):
        self.script(problem(422, "malformed-mesh", "X-Request-Id: r-7"))
        told = voxeld.Unreachable("unreachable", "away", expected="a", got="b")
        told.may_pass = False
        for failure in (self.raised(voxeld.BadInput, "malformed-mesh", self.get), told):
            copied = pickle.loads(pickle.dumps(failure))
            self.assertEqual((type(copied), str(copied), vars(copied)), (type(failure), str(failure), vars(failure)))

    def test_a_refused_connection_is_tried_again_and_named(self):
        with socket.create_server(("127.0.0.1", 0)) as taken:
            url = f"http://127.0.0.1:{taken.getsockname()[1]}"
        self.client = voxeld.Client(url, "", retries=1)
        pauses = self.pauses()
        failure = self.raised(voxeld.Unreachable, "unreachable", self.get)
        self.assertEqual(pauses, [0.2])
        self.assertIn(f"{url}: Connection refused", str(failure))
        self.assertIsInstance(failure, ConnectionError)

    def test_an_idle_connection_that_was_closed_is_replaced_without_a_pause(self):
        script = self.script(json_response({"a": 1}), Script.CLOSE, json_response({"a": 2}), retries=0)
        self.assertEqual(self.get(), {"a": 1})
        wait_until(lambda: script.closed == 1, "the connection is closed")
        pauses = self.pauses()
        self.assertEqual(self.get(), {"a": 2})
        self.assertEqual((len(script.heads), pauses), (2, []))

    def test_a_broken_download_continues_where_it_stopped(self):
        half = len(RESULT) // 2
        script = self.script(
            response(200, RESULT[:half], f"ETag: {TAG}", length=len(RESULT)), Script.CLOSE,
            response(206, RESULT[half:], f"ETag: {TAG}",
                     f"Content-Range: bytes {half}-{len(RESULT) - 1}/{len(RESULT)}"))
        self.assertEqual(self.download(), RESULT)
        self.assertEqual((script.header("Range"), script.header("If-Range")), (f"bytes={half}-", TAG))

    def test_a_result_that_changed_meanwhile_is_refused(self):
        half = len(RESULT) // 2
        self.script(response(200, RESULT[:half], f"ETag: {TAG}", length=len(RESULT)), Script.CLOSE,
                    response(200, RESULT, 'ETag: "other"'))
        self.assertIn("the result changed", str(self.raised(voxeld.Error, "bad-response", self.download)))

    def test_a_damaged_download_is_refused(self):
        self.script(response(200, RESULT[:-1] + b"x", f"ETag: {TAG}"))
        failure = self.raised(voxeld.Error, "content-mismatch", self.download)
        self.assertEqual(failure.expected, TAG.strip('"'))

    def test_a_download_that_ends_early_each_time_is_an_error(self):
        self.script(response(200, RESULT[:9], length=20), Script.CLOSE, retries=2)
        self.raised(voxeld.Unreachable, "unreachable", self.download)

    def test_chunked_downloads_are_whole(self):
        head = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n"
        self.script(head + b"3\r\nabc\r\n2\r\nde\r\n0\r\n\r\n", json_response({}))
        self.assertEqual(self.download(), b"abcde")
        self.assertEqual(self.get(), {})

    def test_grids_do_not_wait_for_each_other(self):
        client = voxeld.Client("http://voxeld", "")
        both = threading.Barrier(2)

        def decoded(*_):
            both.wait(HANG_SECONDS)
            return types.SimpleNamespace(coords=lambda: "cells")
        with unittest.mock.patch.object(client, "_decoded", decoded), \
                concurrent.futures.ThreadPoolExecutor(2) as pool:
            cells = list(pool.map(lambda id: client.grid(id).coords, ("a", "b")))
        self.assertEqual(cells, ["cells", "cells"])

    def test_a_signal_handler_may_cancel_a_token_that_its_thread_is_using(self):
        token = voxeld.CancelToken()

        def handle_in_the_midst():
            with token._lock:
                token.cancel()
        thread = threading.Thread(target=handle_in_the_midst, daemon=True)
        thread.start()
        thread.join(HANG_SECONDS)
        self.assertTrue(token.cancelled)

    def test_a_silent_server_is_a_timeout(self):
        self.script(Script.SILENCE, idle_timeout=0.3)
        failure = self.raised(voxeld.Timeout, "timeout", self.get)
        self.assertIn("sent nothing for 0.3 s", str(failure))

    def test_a_call_ends_at_its_timeout_and_when_cancelled(self):
        self.script(Script.SILENCE)
        self.assertIn("longer than 0.3 s", str(self.raised(
            voxeld.Timeout, "timeout", lambda: self.get(call=Call(0.3)))))
        self.script(Script.SILENCE)
        token = voxeld.CancelToken()
        threading.Timer(0.3, token.cancel).start()
        self.raised(voxeld.Cancelled, "interrupted", lambda: self.get(call=Call(cancel=token)))

    def test_a_response_that_comes_slowly_does_not_outlast_the_timeout(self):
        chunked = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n%x\r\n%b\r\n0\r\n\r\n" % (len(SLOW), SLOW)
        for answer, work in ((response(200, SLOW), self.get), (response(200, b"", f"X-A: {SLOW.decode()}"), self.get),
                             (response(200, SLOW), self.download), (chunked, self.download)):
            self.script(answer)
            self.assertIn("longer than 0.5 s", str(self.raised(
                voxeld.Timeout, "timeout", lambda work=work: work(call=Call(0.5)))))

    def test_the_timeout_of_an_asynchronous_call_counts_for_its_arrays_too(self):
        script = self.script(json_response({"id": "sha256-a"}, 201), json_response(DONE), json_response(DONE),
                             Script.SILENCE)
        client = aio.AsyncClient(script.url, "", idle_timeout=10)
        failure = self.raised(voxeld.Timeout, "timeout", lambda: asyncio.run(
            client.voxelize(b"solid", filename="a.stl", timeout=0.5)))
        self.assertIn("longer than 0.5 s", str(failure))

    def test_a_cancelled_task_does_not_wait_for_a_free_thread(self):
        is_free = threading.Event()

        async def work():
            loop = asyncio.get_running_loop()
            loop.set_default_executor(concurrent.futures.ThreadPoolExecutor(1))
            client = aio.AsyncClient("http://voxeld", "")
            await client.client()
            busy = loop.run_in_executor(None, is_free.wait, HANG_SECONDS)
            try:
                task = asyncio.ensure_future(client.upload(b"solid"))
                for _ in range(5):  # until it waits for its thread
                    await asyncio.sleep(0)
                task.cancel()
                with self.assertRaises(asyncio.CancelledError):
                    await task
                self.assertFalse(busy.done())
            finally:
                is_free.set()
                await busy
        asyncio.run(work())

    def test_a_thread_that_becomes_free_after_the_cancellation_does_nothing(self):
        events = []

        class LateExecutor(concurrent.futures.ThreadPoolExecutor):
            """Its thread takes the work in the moment in which the work is cancelled."""

            def submit(self, work):
                def cancel():
                    events.append("taken")
                    with contextlib.suppress(voxeld.Cancelled):
                        work()
                future = concurrent.futures.Future()
                future.cancel = cancel
                return future

        async def cancelled():
            asyncio.get_running_loop().set_default_executor(LateExecutor(1))
            task = asyncio.ensure_future(aio._in_thread(events.append))
            for _ in range(5):  # until it waits for its thread
                await asyncio.sleep(0)
            task.cancel()
            with self.assertRaises(asyncio.CancelledError):
                await task
        asyncio.run(cancelled())
        self.assertEqual(events, ["taken"])

    def test_a_mesh_is_inspected_by_a_job_which_may_wait_in_the_queue(self):
        script = self.script(json_response({"id": "sha256-a"}, 201), json_response({**DONE, "state": "queued"}, 202),
                             json_response({**DONE, "state": "queued"}), json_response(DONE),
                             json_response({"id": "sha256-a", "triangles": 3}))
        self.assertEqual(self.client.info(b"solid", filename="a.stl")["triangles"], 3)
        self.assertEqual(script.lines(), ["POST /v1/assets?filename=a.stl", "POST /v1/jobs", "GET /v1/jobs/j-1",
                                          "GET /v1/jobs/j-1", "GET /v1/assets/sha256-a"])
        self.assertEqual(json.loads(script.bodies[1]), {"kind": "inspect", "asset": "sha256-a", "options": {}})

    def test_an_upload_may_be_slow_if_it_goes_on(self):
        class SlowSocket:
            """Takes 10 kB each time; sendall() has one timeout for all that it sends."""
            taken = b""

            def send(self, data):
                self.taken += data[:10_000]
                return min(len(data), 10_000)

            def sendall(self, data):
                if self.send(data) < len(data):
                    raise TimeoutError

        self.client = voxeld.Client("http://voxeld", "")
        connection = http.client.HTTPConnection("voxeld")
        connection.sock = SlowSocket()
        body = bytes(range(256)) * 5000
        self.client._transport._send(connection, Call(), lambda: None, "POST", "/v1/assets", lambda: io.BytesIO(body),
                                     len(body), {}, "upload")
        self.assertTrue(connection.sock.taken.endswith(b"\r\n\r\n" + body))

    def test_an_exception_of_the_progress_function_is_none_of_the_connection(self):
        def report(progress):
            if progress.stage == "upload":
                try:
                    {}["none"]
                except KeyError as missing:
                    raise BrokenPipeError("of the caller") from missing
        for method in ("upload", "animate", "voxelize_tiles"):
            self.script(problem(404, "not-found"), json_response({}, 201), idle_timeout=None)
            with self.subTest(method):
                with self.assertRaisesRegex(BrokenPipeError, "of the caller") as raised:
                    getattr(self.client, method)(bytes(2 << 20), progress=report)
                self.assertIsInstance(raised.exception.__cause__, KeyError)
                self.assertIsInstance(raised.exception.__context__, KeyError)

    def test_a_file_that_changes_before_it_is_sent_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "a.stl")
            for text, got in (("solids", "a.stl changed before it was sent: expected 5 bytes, got more"),
                              ("sol", "a.stl changed before it was sent: expected 5 bytes, got 3"),
                              (None, "a.stl: No such file or directory")):
                path.write_text("solid")
                file = _mesh.path_file(path, path.name)
                path.unlink() if text is None else path.write_text(text)
                self.script(json_response({"id": "sha256-a"}, 201), retries=0, idle_timeout=1)
                failure = self.raised(voxeld.BadInput, "file", functools.partial(
                    self.client._upload_file, Call(), file, False))
                self.assertIn(got, str(failure))

    def test_a_deletion_whose_first_response_is_lost_may_find_nothing_left(self):
        for again, is_done in ((problem(410, "gone"), True), (problem(404, "not-found"), True),
                               (problem(409, "conflict"), False)):
            self.script(response(200, b"", length=9), Script.CLOSE, again)
            delete = functools.partial(self.client.delete, voxeld.Asset("sha256-a"))
            delete() if is_done else self.raised(voxeld.Error, "conflict", delete)
        self.script(problem(404, "not-found"))
        self.raised(voxeld.Error, "not-found", lambda: self.client.delete(voxeld.Asset("sha256-a")))

    def test_a_file_of_a_bundle_that_is_deleted_after_the_question_is_sent(self):
        known = json_response({"id": "sha256-known", "filename": "b.png"})
        script = self.script(json_response({"id": "sha256-a"}, 201), known, problem(410, "gone"),
                             json_response({"id": "sha256-a"}, 201), json_response({"id": "sha256-b"}, 201),
                             json_response({"id": "sha256-c"}, 201))
        with tempfile.TemporaryDirectory() as folder:
            mesh, image = pathlib.Path(folder, "a.obj"), pathlib.Path(folder, "b.png")
            mesh.write_text("v 0 0 0\n")
            image.write_bytes(bytes(1 << 20))
            self.assertEqual(self.client.upload([mesh, image]).id, "sha256-c")
        self.assertEqual(script.lines()[2:], ["POST /v1/assets", "POST /v1/assets?filename=a.obj",
                                              "POST /v1/assets?filename=b.png", "POST /v1/assets"])
        self.assertEqual(json.loads(script.bodies[5])["files"][1], {"name": "b.png", "asset": "sha256-b"})

    def test_progress_of_a_mesh_of_several_files_is_that_of_all(self):
        self.script(problem(404, "not-found"), json_response({"id": "sha256-a"}, 201),
                    problem(404, "not-found"), json_response({"id": "sha256-b"}, 201),
                    json_response({"id": "sha256-c"}, 201))
        seen = []
        with tempfile.TemporaryDirectory() as folder:
            paths = [pathlib.Path(folder, name) for name in ("a.obj", "b.png")]
            for path in paths:
                path.write_bytes(bytes(3 << 20))
            self.client.upload(paths, progress=seen.append)
        self.assertEqual({one.total for one in seen}, {6 << 20})
        sent = [one.done for one in seen if one.stage == "upload"]
        self.assertEqual((sent, sent[-1]), (sorted(sent), 6 << 20))

    def test_a_proxy_that_has_lost_the_daemon_is_asked_again(self):
        lost = response(502, b"<html>Bad Gateway</html>")
        script = self.script(lost, json_response({"id": "sha256-a"}, 201), lost, problem(404, "not-found"))
        asset = self.client.upload(b"v 0 0 0\n", filename="a.obj")
        self.client.delete(asset)  # the first request may have done it
        self.assertEqual(script.lines(), ["POST /v1/assets?filename=a.obj"] * 2 + ["DELETE /v1/assets/sha256-a"] * 2)

    def test_a_pipe_is_read_once(self):
        script = self.script(json_response({"id": "sha256-a"}, 201))
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "a.obj")
            os.mkfifo(path)
            writer = threading.Thread(target=path.write_text, args=("v 0 0 0\n",), daemon=True)
            writer.start()
            self.client.upload(path)
            writer.join()
        self.assertEqual((script.lines(), script.bodies), (["POST /v1/assets?filename=a.obj"], [b"v 0 0 0\n"]))

    def test_a_refusal_before_the_whole_body_was_sent_is_read(self):
        self.script(Script.REFUSE, problem(413, "payload-too-large", "Connection: close"), Script.CLOSE)
        self.raised(voxeld.Error, "payload-too-large", lambda: self.client._transport.request(
            Call(), "POST", "/v1/assets", body=bytes(30_000_000)))

    def test_another_program_at_the_url_is_named(self):
        for answer in (response(404, b"<html>"), response(200, b"<html>"), response(200, b"[]")):
            script = self.script(answer)
            failure = self.raised(voxeld.Error, "bad-response", self.get)
            self.assertIn(f"{script.url}: is there a voxeld at this URL?", str(failure))

    def test_the_path_of_the_url_and_the_key_are_sent(self):
        for path, sent in (("/voxels/", "/voxels"), ("/vöxels/a b%20c", "/v%C3%B6xels/a%20b%20c")):
            script = self.script(json_response({}))
            self.client = voxeld.Client(script.url + path, "vxk_a")
            self.addCleanup(self.client.close)
            self.get()
            self.assertEqual((script.lines(), script.header("Authorization")), ([f"GET {sent}/v1/me"], "Bearer vxk_a"))
        for key in ("a\nHost: b", "a b", "ä"):
            failure = self.raised(voxeld.BadInput, "invalid-option", lambda key=key: voxeld.Client(script.url, key))
            self.assertNotIn(key, str(failure))
        for url in ("ftp://example.org", "localhost:8080", "http://", "http://[::1", "http://localhost:port",
                    "http://local host", "http://local..host"):
            other = voxeld.Client(url, "")
            self.assertIn("expected http://HOST", str(self.raised(
                voxeld.BadInput, "invalid-option", lambda other=other: other.grid("a").coords)))

    def test_a_job_that_is_submitted_again_has_the_same_idempotency_key(self):
        script = self.script(json_response({"id": "sha256-a"}, 201), problem(503, "queue-full", "Retry-After: 0"),
                             json_response(DONE), json_response(DONE))
        self.assertEqual(self.client.voxelize(b"solid", filename="a.stl", size=8).id, "sha256-a")
        self.assertEqual(script.lines(), ["POST /v1/assets?filename=a.stl", "POST /v1/jobs", "POST /v1/jobs",
                                          "GET /v1/jobs/j-1"])
        self.assertTrue(script.header("Idempotency-Key", 1))
        self.assertEqual(script.header("Idempotency-Key", 1), script.header("Idempotency-Key", 2))
        self.assertEqual(json.loads(script.bodies[1]), {"kind": "voxelize", "asset": "sha256-a", "filename": "a.stl",
                                                        "options": {"size": 8}})

    def test_a_call_that_ends_while_it_submits_cancels_the_job_that_it_may_have_made(self):
        script = self.script(json_response({"id": "sha256-a"}, 201), Script.SILENCE)
        script.answers += [json_response({**DONE, "state": "running"}), json_response({}, 202)]
        token = voxeld.CancelToken()

        def cancel():
            wait_until(lambda: len(script.heads) == 2, "the job is submitted")
            token.cancel()
            script.ended.set()
        canceller = threading.Thread(target=cancel)
        canceller.start()
        self.raised(voxeld.Cancelled, "interrupted", lambda: self.client.voxelize(b"solid", cancel=token))
        canceller.join()
        self.assertEqual(script.lines()[1:], ["POST /v1/jobs", "POST /v1/jobs", "DELETE /v1/jobs/j-1"])
        self.assertEqual(script.header("Idempotency-Key", 1), script.header("Idempotency-Key", 2))

    def test_the_token_of_a_file_of_frames_ends_its_wait_for_them_and_so_does_that_of_their_job(self):
        running = {**DONE, "state": "running"}
        for of_job in (False, True):
            token = voxeld.CancelToken()
            script = self.script(json_response({"id": "sha256-a"}, 201), json_response(running, 202),
                                 *[json_response(running)] * of_job, json_response({}, 202))
            animation = self.client.animate(b"solid", filename="a.stl", cancel=token if of_job else None)
            token.cancel()
            self.raised(voxeld.Cancelled, "interrupted", functools.partial(
                animation.save, "never.vox", cancel=None if of_job else token))
            self.assertEqual(script.lines()[2:], ["GET /v1/jobs/j-1"] * of_job + ["DELETE /v1/jobs/j-1"])

    def test_a_job_that_failed_keeps_its_record_when_its_stream_ends(self):
        failed = {**DONE, "state": "failed"}
        script = self.script(json_response({"id": "sha256-a"}, 201), json_response({**DONE, "state": "queued"}, 202),
                             problem(422, "malformed-mesh"), json_response(failed), json_response(failed))
        stream = self.client.voxelize_tiles(b"solid", filename="a.stl")
        self.raised(voxeld.BadInput, "malformed-mesh", lambda: list(stream))
        stream.cancel()
        self.assertEqual(script.lines()[2:], ["GET /v1/jobs/j-1/tiles?after=0",
                                              *["DELETE /v1/jobs/j-1"] * 2])

    def test_a_name_that_is_no_utf8_is_sent_as_text_that_is(self):
        script = self.script(json_response({"id": "sha256-a"}, 201), json_response(DONE), json_response(DONE))
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(os.fsdecode(os.fsencode(folder) + b"/b\xe4ume.stl"))
            path.write_bytes(b"solid")
            self.client.voxelize(path)
        self.assertEqual(script.lines()[0], "POST /v1/assets?filename=b%EF%BF%BDume.stl")
        self.assertEqual(json.loads(script.bodies[1])["filename"], "b\ufffdume.stl")


if __name__ == "__main__":
    unittest.main()
