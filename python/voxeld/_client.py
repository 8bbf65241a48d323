"""The client: uploads, jobs and results."""
from __future__ import annotations

import contextlib
import json
import os
import pathlib
import urllib.parse
import uuid
from collections.abc import Generator, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from . import _decode
from ._call import Call, CancelToken, ProgressCallback
from ._errors import Error, NotFound, Unreachable, error
from ._grid import IMAGES, SEQUENCE_FORMATS, Frame, Grid, Tiles, check_image, save_options
from ._image import Image, write
from ._mesh import Asset, File, Mesh, files_of
from ._server import find_server
from ._transport import Response, Transport, parse_object
from .options import (AnimateOptions, EstimateOptions, PlaceOptions, RenderOptions, SequenceImageOptions,
                      SequenceSaveOptions, VoxelizeOptions, json_options)

if TYPE_CHECKING:
    from typing import Unpack

POLL_SECONDS = 2  # of one look at a job, so that progress is reported at least this often
ASKED_BYTES_MIN = 64 * 1024  # a smaller file is sent without asking whether the server has it
CANCEL_SECONDS = 5.0  # limit of the request that cancels a job
SEQUENCE_OPTIONS = ("animation", "frames", "fps", "times")
BUNDLE_TYPE = "application/vnd.voxeld.bundle+json"


class Client:
    """A client of one voxeld, which several threads may use.

    Args:
        url: of the server. None: $VOXELD_URL, else `url` of the configuration file, else a voxeld at
            http://127.0.0.1:8080, else the user's private voxeld, which is started if it does not run.
        key: API key. None: $VOXELD_KEY, the file $VOXELD_KEY_FILE, or `key_file` of the configuration file.
        local: True: the private voxeld, also if another serves. False: never start one.
        idle_timeout: seconds without a byte from the server until a request fails; None: no limit.
        retries: further tries after 429, 503 and broken connections, after Retry-After or a pause that doubles,
            at most 10 s.

    The options of its methods are those of docs/options.md. Each method also takes

        timeout: seconds until the call fails with `Timeout` and its job is cancelled; None: no limit.
        cancel: a CancelToken that ends the call from another thread, with `Cancelled`. Ctrl-C does so, too.
        progress: True: a bar (needs tqdm). None: a bar on a terminal and in a notebook if tqdm is installed. Or a
            function that is called with each `Progress`.
    """

    def __init__(self, url: str | None = None, key: str | None = None, *, local: bool | None = None,
                 idle_timeout: float | None = 60.0, retries: int = 3) -> None:
        self._transport = Transport(find_server(url, key, local), idle_timeout=idle_timeout, retries=retries)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes idle connections. The client can be used again."""
        self._transport.close()

    @property
    def url(self) -> str:
        """URL of the server; a private one is started if it does not run."""
        return self._transport.server.connect_url(Call())

    # --- meshes

    def voxelize(self, mesh: Mesh, *, timeout: float | None = None, cancel: CancelToken | None = None,
                 progress: bool | ProgressCallback | None = None, **options: Unpack[VoxelizeOptions]) -> Grid:
        """Voxelizes a mesh.

        Args:
            mesh: path of an OBJ, PLY, STL, OFF, glTF, GLB, MD5 mesh, 3MF, zip or file of voxels (.voxg, .vox, .binvox,
                .npy, .nrrd); a list of paths, of which the first is the mesh; bytes or a binary file, with `filename=`
                if the bytes do not tell their format;
                (vertices (N, 3), faces (M, 3) or (M, 4)[, colors (N, 3) or (N, 4)]); a mesh of trimesh or open3d; an
                Asset. Files that a mesh names are sent from its folder. A file that the server has is not sent again.
            options: size=256, channels=["color", "normal"], fill="solid", … of docs/options.md.
        """
        with Call(timeout, cancel, progress) as call:
            return self._voxelize(call, mesh, options)

    def voxelize_tiles(self, mesh: Mesh, *, timeout: float | None = None, cancel: CancelToken | None = None,
                       progress: bool | ProgressCallback | None = None,
                       **options: Unpack[VoxelizeOptions]) -> TileStream:
        """Voxelizes a mesh: iterate over the result for its finished tiles, while the server makes others.

        The tiles of a large surface come every few seconds; those of other grids at the end. Needs the decoder
        (`has_decoder()`).

        Args:
            mesh, options: as of voxelize().
        """
        named: Mapping[str, Any] = options
        _check_one_grid("voxelize_tiles()", named)
        with Call(timeout, cancel, progress) as call:
            return TileStream(self, call, self._submit_mesh(call, "voxelize", mesh, named))

    def animate(self, mesh: Mesh, *, timeout: float | None = None, cancel: CancelToken | None = None,
                progress: bool | ProgressCallback | None = None, **options: Unpack[AnimateOptions]) -> Animation:
        """Voxelizes an animation: iterate over the result for its frames, each as soon as it is done.

        Args:
            mesh: as of voxelize().
            options: animation=0 (the default) or its name, fps, frames or times; size, … of docs/options.md.
        """
        named: dict[str, Any] = dict(options)
        if named.get("time") is not None:
            raise error("invalid-option", "animate() makes several frames", expected="times=, or voxelize()",
                        got="time")
        if all(named.get(name) is None for name in SEQUENCE_OPTIONS):
            named["animation"] = 0
        with Call(timeout, cancel, progress) as call:
            status = self._submit_mesh(call, "voxelize", mesh, named)
            # The frames are stored without them.
            selection = {name: named[name] for name in PlaceOptions.__optional_keys__ if named.get(name) is not None}
            return Animation(self, call, status, selection)

    def render(self, mesh: Mesh, *, timeout: float | None = None, cancel: CancelToken | None = None,
               progress: bool | ProgressCallback | None = None, **options: Unpack[RenderOptions]) -> Image:
        """An image of a mesh's voxels: PNG bytes, or image="gif", "apng" or "sheet". mesh: as of voxelize()."""
        with Call(timeout, cancel, progress) as call:
            return self._image_of(call, self._run_mesh(call, "render", mesh, options))

    def info(self, mesh: Mesh, *, filename: str = "", timeout: float | None = None, cancel: CancelToken | None = None,
             progress: bool | ProgressCallback | None = None) -> dict[str, Any]:
        """What a mesh holds: triangles, vertices, bounds, materials, animations, missing files, warnings."""
        with Call(timeout, cancel, progress) as call:
            asset = self._upload(call, mesh, filename)[0]
            # As a job it may wait in the queue for longer than a response may be silent.
            self._finish(call, self._submit(call, _job_body("inspect", {"asset": asset.id}, {})))
            return self._transport.json(call, "GET", f"/v1/assets/{_quoted(asset.id)}")

    def upload(self, mesh: Mesh, *, filename: str = "", timeout: float | None = None,
               cancel: CancelToken | None = None, progress: bool | ProgressCallback | None = None) -> Asset:
        """Uploads a mesh, with the files that it names, if the server does not have it."""
        with Call(timeout, cancel, progress) as call:
            return self._upload(call, mesh, filename)[0]

    def estimate(self, mesh: Mesh, *, timeout: float | None = None, cancel: CancelToken | None = None,
                 progress: bool | ProgressCallback | None = None, **options: Unpack[EstimateOptions]) -> dict[str, Any]:
        """The expected cost of voxelize() or animate(), without a job: seconds, device_seconds, result_bytes,
        host_bytes, …"""
        with Call(timeout, cancel, progress) as call:
            asset, _ = self._upload(call, mesh, str(options.get("filename") or ""))
            body = _job_body("voxelize", {"asset": asset.id}, options, asset.filename)
            answer = self._transport.json(call, "POST", "/v1/jobs?dry_run=1", body=json.dumps(body).encode(),
                                          headers={"Content-Type": "application/json"})
            return dict(answer["estimate"])

    # --- stored data

    def grid(self, id: str) -> Grid:
        """A grid that the server stores, by `Grid.id`. It is looked for on its first use."""
        return Grid(self, id)

    def delete(self, item: Grid | Animation | Asset) -> None:
        """Deletes a grid with the result of its job, an animation, or an asset. A frame or a part alone cannot be
        deleted."""
        if isinstance(item, Grid) and item._selection and not isinstance(item, Frame):
            raise error("invalid-option", "delete()", expected="a whole grid", got="a part of one")
        with Call() as call:
            if isinstance(item, Asset):
                path = f"/v1/assets/{_quoted(item.id)}"
            elif isinstance(item, Animation) or (item.job and not isinstance(item, Frame)):
                path = f"/v1/jobs/{item.job}/result"
            else:  # the result of a frame's job has the other frames, too
                path = f"/v1/grids/{_quoted(item.id)}"
            self._transport.request(call, "DELETE", path)

    # --- steps

    def _upload(self, call: Call, mesh: Mesh, filename: str) -> tuple[Asset, File | None]:
        """The asset, and its file if the server had it before."""
        if isinstance(mesh, Asset):
            return Asset(mesh.id, filename or mesh.filename), None
        files = files_of(mesh, filename)
        if len(files) == 1:
            asset, was_known = self._upload_file(call, files[0], True)
            return asset, files[0] if was_known else None
        sent = self._upload_files(call, files, True)
        try:
            return self._bundle(call, files, sent), None
        except NotFound:  # one was deleted since the server was asked
            sent = self._upload_files(call, files, False)
        return self._bundle(call, files, sent), None

    def _upload_files(self, call: Call, files: list[File], may_ask: bool) -> list[Asset]:
        sent = []
        call.files_bytes, call.files_done = sum(file.bytes for file in files), 0
        for file in files:
            sent.append(self._upload_file(call, file, may_ask)[0])
            call.files_done += file.bytes
        call.files_bytes = 0
        return sent

    def _bundle(self, call: Call, files: list[File], sent: list[Asset]) -> Asset:
        manifest = {"files": [{"name": file.name, "asset": asset.id} for file, asset in zip(files, sent)]}
        answer = self._transport.json(call, "POST", "/v1/assets", body=json.dumps(manifest).encode(),
                                      headers={"Content-Type": BUNDLE_TYPE})
        return Asset(str(answer["id"]))

    def _upload_file(self, call: Call, file: File, may_ask: bool) -> tuple[Asset, bool]:
        """The asset, and whether the server had it before."""
        if may_ask and file.bytes >= ASKED_BYTES_MIN and (known := self._known_asset(call, file)) is not None:
            return known, True
        path = "/v1/assets" + (f"?filename={urllib.parse.quote(file.name, safe='')}" if file.name else "")
        answer = self._transport.json(call, "POST", path, open_body=file.open, body_bytes=file.bytes,
                                      headers={"Content-Type": "application/octet-stream"})
        return Asset(str(answer["id"]), file.name), False

    def _known_asset(self, call: Call, file: File) -> Asset | None:
        """The asset with these bytes and this extension, which decides how they are read."""
        def report(done: int) -> None:
            call.check()
            call.report("hash", done, file.bytes, "bytes")

        id = "sha256-" + file.digest(report)
        response = self._transport.request(call, "GET", f"/v1/assets/{id}?brief=1", also_good=(404, 410))
        if response.status != 200:
            return None
        asset = parse_object(response, self._transport.server.name)
        is_same = _extension(str(asset.get("filename", ""))) == _extension(file.name)
        return Asset(str(asset["id"]), file.name) if is_same else None

    def _submit_mesh(self, call: Call, kind: str, mesh: Mesh, options: Mapping[str, Any]) -> dict[str, Any]:
        asset, known = self._upload(call, mesh, str(options.get("filename") or ""))
        body = _job_body(kind, {"asset": asset.id}, options, asset.filename)
        try:
            return self._submit(call, body)
        except NotFound:
            if known is None:
                raise
            asset, _ = self._upload_file(call, known, False)  # it was deleted since the server was asked
        return self._submit(call, {**body, "asset": asset.id})

    def _submit(self, call: Call, body: Mapping[str, Any]) -> dict[str, Any]:
        """Submits a job and returns its status. Without a response the job is cancelled, if there is one."""
        data = json.dumps(body).encode()
        headers = {"Content-Type": "application/json", "Idempotency-Key": uuid.uuid4().hex}
        try:
            return self._transport.json(call, "POST", "/v1/jobs", body=data, headers=headers)
        except Error as failure:
            if failure.code not in ("interrupted", "timeout"):
                raise
            self._cancel_submitted(data, headers)
            raise
        except BaseException:
            self._cancel_submitted(data, headers)
            raise

    def _cancel_submitted(self, data: bytes, headers: Mapping[str, str]) -> None:
        """The same request with the same key gets the job that it made before."""
        with contextlib.suppress(Error):
            status = self._transport.json(Call(CANCEL_SECONDS), "POST", "/v1/jobs", body=data, headers=headers)
            self._cancel(str(status["id"]))

    def _cancel(self, job: str) -> None:
        """Cancels a job, unless it has ended."""
        with contextlib.suppress(Error):
            self._transport.request(Call(CANCEL_SECONDS), "DELETE", f"/v1/jobs/{job}")

    def _look(self, call: Call, job: str, etag: str, waits: bool) -> Response:
        """The status at the end of the job, or with an ETag after its next change; waits: at most POLL_SECONDS. 304 and
        no body: nothing changed."""
        headers = {"Prefer": f"wait={POLL_SECONDS}"} if waits else {}
        if etag:
            headers["If-None-Match"] = etag
        return self._transport.request(call, "GET", f"/v1/jobs/{job}", headers=headers, held=float(POLL_SECONDS),
                                       also_good=(304,))

    def _watch(self, call: Call, job: str, is_eager: bool) -> Generator[dict[str, Any], None, None]:
        """The statuses of a job until it has ended; raises its error. Cancels it when the iteration is left.

        is_eager: also the first one at once, and then each change.
        """
        etag, status = "", dict[str, Any]()
        has_ended = False
        try:
            while not has_ended:
                response = self._look(call, job, etag, waits=bool(etag) or not is_eager)
                if response.status != 304:
                    etag = response.headers.get("etag", "")
                    status = parse_object(response, self._transport.server.name)
                has_ended = _has_ended(status)
                _report(call, status)
                if has_ended and status["state"] != "done":
                    raise self._job_error(call, status)
                yield status
        except Unreachable:
            has_ended = True  # as far as can be known; nobody would receive the request
            raise
        finally:
            if not has_ended:
                self._cancel(job)

    def _job_error(self, call: Call, status: Mapping[str, Any]) -> Error:
        """The problem that the result of a failed or cancelled job is."""
        failure = error(str(status["state"]), f"the job was {status['state']}")
        try:
            self._transport.request(call, "GET", f"/v1/jobs/{status['id']}/result")
        except Error as problem:
            failure = problem
        failure.job = str(status["id"])
        return failure

    def _finish(self, call: Call, status: dict[str, Any]) -> dict[str, Any]:
        """The status of a job at its end."""
        with contextlib.closing(self._watch(
                call, str(status["id"]), call.progress is not None)) as statuses:
            for status in statuses:
                pass
        return status

    def _voxelize(self, call: Call, mesh: Mesh, options: Mapping[str, Any]) -> Grid:
        _check_one_grid("voxelize()", options)
        return self._grid_of(self._run_mesh(call, "voxelize", mesh, options))

    def _run_mesh(self, call: Call, kind: str, mesh: Mesh, options: Mapping[str, Any]) -> dict[str, Any]:
        return self._finish(call, self._submit_mesh(call, kind, mesh, options))

    def _grid_of(self, status: Mapping[str, Any]) -> Grid:
        """The grid of a job that is done."""
        result = status["result"]
        return Grid(self, result["grid"], job=status["id"], meta=result.get("meta"), warnings=_warnings(result))

    def _result(self, call: Call, status: Mapping[str, Any]) -> bytearray:
        data = self._transport.download(call, f"/v1/jobs/{status['id']}/result").body
        return data if isinstance(data, bytearray) else bytearray(data)

    def _export(self, call: Call, source: Mapping[str, str], options: Mapping[str, Any]) -> bytes | bytearray:
        """A grid or sequence in a format."""
        if set(options) == {"format"} and options["format"] == "native":  # as it is stored
            (kind, id), = source.items()
            return self._transport.download(call, f"/v1/{kind}s/{_quoted(id)}").body
        return self._result(call, self._finish(call, self._submit(call, _job_body("export", source, options))))

    def _image(self, call: Call, source: Mapping[str, str], options: Mapping[str, Any]) -> Image:
        return self._image_of(call, self._finish(call, self._submit(call, _job_body("render", source, options))))

    def _image_of(self, call: Call, status: Mapping[str, Any]) -> Image:
        return Image(self._result(call, status), str(status["result"]["media_type"]))

    def _decoded(self, call: Call, grid: str, selection: Mapping[str, Any]) -> _decode.Decoded:
        """The arrays of a grid: of its container, or of an .npz without the decoder."""
        if _decode.library() is not None:
            return _decode.decode(self._export(call, {"grid": grid}, {**selection, "format": "native"}))
        return _decode.SparseArrays(
            self._export(call, {"grid": grid}, {**selection, "format": "npz", "layout": "sparse"}))


class _JobStream:
    """What a job makes piece by piece, and the call that waits for it."""

    def __init__(self, client: Client, call: Call, status: Mapping[str, Any]) -> None:
        self._client = client
        self._call = call
        self._status = dict(status)
        self.job = str(status["id"])

    def __repr__(self) -> str:
        return f"<voxeld.{type(self).__name__} {self.job}: {self._status['state']}>"

    def cancel(self) -> None:
        """Cancels the job. One that has ended stays, and so do frames that are finished."""
        self._client._cancel(self.job)


class Animation(_JobStream):
    """The frames of an animation, which the server makes one after the other.

    Iteration gives each `Frame` as soon as it is done. Leaving a loop early cancels the job.

    Attributes:
        job: id of the job.
    """

    def __init__(self, client: Client, call: Call, status: Mapping[str, Any], selection: Mapping[str, Any]) -> None:
        super().__init__(client, call, status)
        self._selection = dict(selection)

    def __iter__(self) -> Generator[Frame, None, None]:
        """Raises the error of the job behind the last frame that was finished."""
        if json_options(self._selection).get("crop") == "yes":
            raise error("invalid-option", "crop", expected="save() or render(), once the box of all frames is known",
                        got="iteration over frames as they come")
        seen = -1
        with self._call, contextlib.closing(self._client._watch(self._call, self.job, True)) as statuses:
            try:
                for status in statuses:
                    self._status = status
                    for frame in self._frames_after(seen):
                        seen = frame.index
                        yield frame
            except Error as failure:
                if failure.job:  # not the connection, but the job
                    yield from self._frames_after(seen)
                raise

    def _frames_after(self, index: int) -> Iterator[Frame]:
        """Those that are finished."""
        query = f"?after={index}" if index >= 0 else ""
        while True:
            page = self._client._transport.json(self._call, "GET", f"/v1/jobs/{self.job}/frames{query}")
            for listed in page["frames"]:
                yield Frame(self._client, listed, self.job, self._selection)
            if "next" not in page:
                return
            query = "?after=" + _quoted(str(page["next"]))

    def wait(self) -> Animation:
        """Waits until all frames are done; raises the error of the job."""
        with self._call:
            self._done(self._call)
        return self

    @property
    def meta(self) -> dict[str, Any]:
        """What the server says of the sequence: dims, origin, voxel_size, frames, fps, …; waits for its end."""
        return dict(self.wait()._status["result"]["meta"])

    @property
    def warnings(self) -> list[str]:
        """Of the job; waits for its end."""
        return _warnings(self.wait()._status["result"])

    @property
    def id(self) -> str:
        """Of the stored sequence; waits for its end."""
        return str(self.wait()._status["result"]["sequence"])

    def _done(self, call: Call) -> dict[str, str]:
        """The sequence. `call` waits for it, as long as the call of animate() has not ended."""
        if self._status["state"] != "done":
            is_eager = call.progress is not None
            with contextlib.closing(self._client._watch(call, self.job, is_eager)) as statuses:
                for self._status in statuses:
                    if not _has_ended(self._status):
                        self._call.check()
        return {"sequence": str(self._status["result"]["sequence"])}

    def save(self, path: str | os.PathLike[str], *, timeout: float | None = None, cancel: CancelToken | None = None,
             progress: bool | ProgressCallback | None = None, **options: Unpack[SequenceSaveOptions]) -> None:
        """Writes all frames to a file whose extension chooses the format: .voxs, .npy, .npz, .vox, .zarr.zip, .zip (a
        file for each frame: points, or `format=`), .gif or .apng. Waits for the end of the job."""
        target = pathlib.Path(path)
        if target.suffix.lower() in IMAGES and "format" not in options:
            image: Any = {"image": IMAGES[target.suffix.lower()], **options}
            write(target, self.render(timeout=timeout, cancel=cancel, progress=progress, **image))
            return
        body = save_options(target, SEQUENCE_FORMATS, {**self._selection, **options})
        with Call(timeout, cancel, progress) as call:
            write(target, self._client._export(call, self._done(call), body))

    def render(self, *, timeout: float | None = None, cancel: CancelToken | None = None,
               progress: bool | ProgressCallback | None = None, **options: Unpack[SequenceImageOptions]) -> Image:
        """An animated image of all frames: a GIF, which a notebook shows, or image="apng", "sheet" or "png" with
        frame=N. Waits for the end of the job."""
        check_image({**self._selection, "crop": None})
        with Call(timeout, cancel, progress) as call:
            # The image shows the frames' common box, with crop and without.
            selection = {name: value for name, value in self._selection.items() if name != "crop"}
            body: dict[str, Any] = {"image": "gif", **selection, **options}
            return self._client._image(call, self._done(call), body)


class TileStream(_JobStream):
    """The tiles of a grid, which the server makes one after the other.

    Iteration gives `Tiles` as soon as they are finished; all of them together are the grid. Leaving a loop early
    cancels the job.

    Attributes:
        job: id of the job.
    """

    def __iter__(self) -> Generator[Tiles, None, None]:
        """Raises the error of the job."""
        after, has_ended = 0, False
        try:
            with self._call:
                while (response := self._look(after)).status != 204:
                    if response.status == 202:
                        self._status = parse_object(response, self._client._transport.server.name)
                        _report(self._call, self._status)
                        continue
                    yield Tiles(_decode.decode(response.body))
                    after = int(response.headers["x-voxeld-next"])
                has_ended = True
        except Unreachable:
            has_ended = True  # as far as can be known; nobody would receive the request
            raise
        finally:
            if not has_ended:
                self.cancel()

    def _look(self, after: int) -> Response:
        """The tiles behind the first `after`, or the status of the job after at most POLL_SECONDS."""
        return self._client._transport.request(
            self._call, "GET", f"/v1/jobs/{self.job}/tiles?after={after}",
            headers={"Prefer": f"wait={POLL_SECONDS}"}, held=float(POLL_SECONDS))

    def grid(self) -> Grid:
        """The whole grid; waits for the end of the job and raises its error."""
        with self._call:
            self._status = self._client._finish(self._call, self._status)
        return self._client._grid_of(self._status)


def _check_one_grid(name: str, options: Mapping[str, Any]) -> None:
    """Refuses the options of several frames."""
    if options.get("time") is None and any(options.get(each) is not None for each in SEQUENCE_OPTIONS):
        raise error("invalid-option", f"{name} makes one grid", expected="time= beside animation=, or animate()",
                    got=", ".join(each for each in SEQUENCE_OPTIONS if each in options))


def _job_body(kind: str, source: Mapping[str, str], options: Mapping[str, Any], filename: str = "") -> dict[str, Any]:
    """The JSON of a job. Priority, deadline and file name are members of the job, not options."""
    values = json_options(options)
    body: dict[str, Any] = {"kind": kind, **source}
    for name in ("priority", "deadline_ms", "filename"):
        if name in values:
            body[name] = values.pop(name)
    if filename:
        body["filename"] = filename
    return {**body, "options": values}


def _has_ended(status: Mapping[str, Any]) -> bool:
    return status["state"] in ("done", "failed", "cancelled")


def _report(call: Call, status: Mapping[str, Any]) -> None:
    stage = "queued" if status["state"] == "queued" else str(status.get("stage") or status["state"])
    unit = "frames" if status["frames_total"] else "tiles"
    call.report(stage, int(status[unit + "_done"]), int(status[unit + "_total"]), unit)


def _warnings(result: Mapping[str, Any]) -> list[str]:
    return [f"{warning['code']}: {warning['detail']}" for warning in result.get("warnings", [])]


def _extension(filename: str) -> str:
    return pathlib.PurePosixPath(filename).suffix.lower()


def _quoted(id: str) -> str:
    return urllib.parse.quote(id, safe="")

