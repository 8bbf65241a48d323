"""The client for asyncio.

    async with voxeld.aio.AsyncClient() as client:
        g = await client.voxelize("bunny.ply", size=256)
        g.coords                                    # fetched already
        await client.save(g, "bunny.vox")
        async for frame in client.animate("bob.zip", animation=0): ...

Each call runs in a thread. Cancelling its task ends the call at once and cancels its job.
"""
from __future__ import annotations

import asyncio
import functools
import os
import threading
from collections.abc import AsyncGenerator, Callable, Generator
from typing import TYPE_CHECKING, Any, TypeVar

from ._call import Call, CancelToken, ProgressCallback
from ._client import Animation, Client
from ._grid import Frame, Grid
from ._image import Image
from ._mesh import Asset, Mesh
from .options import AnimateOptions, RenderOptions, SaveOptions, VoxelizeOptions

if TYPE_CHECKING:
    from typing import Unpack

T = TypeVar("T")


async def _in_thread(work: Callable[[CancelToken], T], token: CancelToken | None = None) -> T:
    """Runs `work` in a thread. When the task is cancelled, the token is, and the thread is waited for."""
    own = token or CancelToken()
    claim = threading.Lock()  # of the thread or of the cancellation, whichever comes first

    def run() -> T:
        if not claim.acquire(blocking=False):
            own._check()  # raises Cancelled
        return work(own)

    running = asyncio.ensure_future(asyncio.to_thread(run))
    try:
        return await asyncio.shield(running)
    except asyncio.CancelledError:
        own.cancel()
        if claim.acquire(blocking=False):  # no thread is free, and one that takes it now does nothing
            running.cancel()
        await asyncio.wait([running])
        if not running.cancelled():
            running.exception()  # marks it as seen: it is Cancelled
        raise


class AsyncClient:
    """`voxelize`, `animate`, `render`, `save`, `info` and `upload` of `Client` as coroutines; `client()` gives the
    `Client` itself, whose other methods a thread can call (`asyncio.to_thread`). Arguments are those of `Client`; errors
    are those of `Client`."""

    def __init__(self, url: str | None = None, key: str | None = None, *, local: bool | None = None,
                 idle_timeout: float | None = 60.0, retries: int = 3) -> None:
        self._make = functools.partial(Client, url, key, local=local, idle_timeout=idle_timeout, retries=retries)
        self._lock = asyncio.Lock()
        self._client: Client | None = None

    async def __aenter__(self) -> AsyncClient:
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._client is not None:
            self._client.close()

    async def client(self) -> Client:
        """The client whose methods are called; it looks for the server on its first use."""
        async with self._lock:
            if self._client is None:
                self._client = await asyncio.to_thread(self._make)
            return self._client

    async def voxelize(self, mesh: Mesh, *, timeout: float | None = None,
                       progress: bool | ProgressCallback | None = False, **options: Unpack[VoxelizeOptions]) -> Grid:
        """Voxelizes a mesh, and fetches the arrays of the grid. progress: is called in another thread."""
        client = await self.client()

        def work(token: CancelToken) -> Grid:
            with Call(timeout, token, progress) as call:  # of the job and of the arrays
                return client._voxelize(call, mesh, options)._fetch(call)

        return await _in_thread(work)

    async def animate(self, mesh: Mesh, *, timeout: float | None = None,
                      progress: bool | ProgressCallback | None = False,
                      **options: Unpack[AnimateOptions]) -> AsyncGenerator[Frame, None]:
        """The frames of an animation, each fetched, as soon as they are done. Closing the iterator cancels the job."""
        client = await self.client()
        token = CancelToken()
        begun: list[tuple[Animation, Generator[Frame, None, None]]] = []  # also where the task is cancelled meanwhile

        def begin(own: CancelToken) -> None:
            animation = client.animate(mesh, timeout=timeout, cancel=own, progress=progress, **options)
            begun.append((animation, iter(animation)))

        def next_frame(own: CancelToken) -> Frame | None:
            frame = next(begun[0][1], None)
            if frame is not None:
                frame.fetch(timeout=begun[0][0]._call.seconds_left(), cancel=own, progress=False)
            return frame

        def end() -> None:
            for animation, frames in begun:
                frames.close()
                animation.cancel()

        has_ended = False
        try:
            await _in_thread(begin, token)
            while (frame := await _in_thread(next_frame, token)) is not None:
                yield frame
            has_ended = True
        finally:
            if begun and not has_ended:
                await asyncio.to_thread(end)

    async def render(self, mesh: Mesh | Grid, *, timeout: float | None = None,
                     progress: bool | ProgressCallback | None = False, **options: Unpack[RenderOptions]) -> Image:
        """An image of a mesh's voxels, or of a grid (with the options of Grid.render() alone)."""
        if isinstance(mesh, Grid):
            grid = mesh
            image_options: Any = options
            return await _in_thread(lambda token: grid.render(
                timeout=timeout, cancel=token, progress=progress, **image_options))
        client = await self.client()
        return await _in_thread(lambda token: client.render(
            mesh, timeout=timeout, cancel=token, progress=progress, **options))

    async def save(self, grid: Grid, path: str | os.PathLike[str], *, timeout: float | None = None,
                   progress: bool | ProgressCallback | None = False, **options: Unpack[SaveOptions]) -> None:
        """Grid.save()"""
        await _in_thread(lambda token: grid.save(path, timeout=timeout, cancel=token, progress=progress, **options))

    async def info(self, mesh: Mesh, *, filename: str = "", timeout: float | None = None) -> dict[str, Any]:
        """What a mesh holds."""
        client = await self.client()
        return await _in_thread(lambda token: client.info(mesh, filename=filename, timeout=timeout, cancel=token,
                                                          progress=False))

    async def upload(self, mesh: Mesh, *, filename: str = "", timeout: float | None = None,
                     progress: bool | ProgressCallback | None = False) -> Asset:
        """Uploads a mesh if the server does not have it."""
        client = await self.client()
        return await _in_thread(lambda token: client.upload(mesh, filename=filename, timeout=timeout, cancel=token,
                                                            progress=progress))
