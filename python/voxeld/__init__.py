"""Voxel grids of meshes, from a voxeld.

    import voxeld
    g = voxeld.voxelize("bunny.ply", size=256, channels=["color", "normal"])
    g.occupancy, g.coords, g.colors, g.origin, g.voxel_size, g.meta
    g.save("bunny.vox")
    g.render(azimuth=30)

The functions use a voxeld that they find as the command line `voxel` does, and start a private one if there is none.
`Client` names another server. `voxeld.aio` has them for asyncio. docs/python.md tells more.
"""
from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from . import _decode
from ._call import CancelToken, Progress, ProgressCallback
from ._client import Animation, Client, TileStream
from ._errors import BadInput, Cancelled, Error, NotFound, Timeout, Unreachable
from ._grid import Frame, Grid, Tiles, Voxels
from ._image import Image
from ._mesh import Asset, Mesh
from .options import AnimateOptions, RenderOptions, VoxelizeOptions

if TYPE_CHECKING:
    from typing import Unpack

__version__ = "0.2.0"
__all__ = ["Animation", "Asset", "BadInput", "CancelToken", "Cancelled", "Client", "Error", "Frame", "Grid", "Image",
           "Mesh", "NotFound", "Progress", "TileStream", "Tiles", "Timeout", "Unreachable", "Voxels", "animate",
           "default_client", "has_decoder", "info", "render", "voxelize", "voxelize_tiles"]

for _each in (Animation, Asset, BadInput, CancelToken, Cancelled, Client, Error, Frame, Grid, Image, NotFound, Progress,
              TileStream, Tiles, Timeout, Unreachable, Voxels):
    _each.__module__ = __name__  # where users find it

_lock = threading.Lock()
_default: Client | None = None


def default_client() -> Client:
    """The client of the functions of this module, made on its first use."""
    global _default
    with _lock:
        if _default is None:
            _default = Client()
        return _default


def voxelize(mesh: Mesh, *, timeout: float | None = None, cancel: CancelToken | None = None,
             progress: bool | ProgressCallback | None = None, **options: Unpack[VoxelizeOptions]) -> Grid:
    """Client.voxelize() of the default client."""
    return default_client().voxelize(mesh, timeout=timeout, cancel=cancel, progress=progress, **options)


def voxelize_tiles(mesh: Mesh, *, timeout: float | None = None, cancel: CancelToken | None = None,
                   progress: bool | ProgressCallback | None = None, **options: Unpack[VoxelizeOptions]) -> TileStream:
    """Client.voxelize_tiles() of the default client."""
    return default_client().voxelize_tiles(mesh, timeout=timeout, cancel=cancel, progress=progress, **options)


def animate(mesh: Mesh, *, timeout: float | None = None, cancel: CancelToken | None = None,
            progress: bool | ProgressCallback | None = None, **options: Unpack[AnimateOptions]) -> Animation:
    """Client.animate() of the default client."""
    return default_client().animate(mesh, timeout=timeout, cancel=cancel, progress=progress, **options)


def render(mesh: Mesh, *, timeout: float | None = None, cancel: CancelToken | None = None,
           progress: bool | ProgressCallback | None = None, **options: Unpack[RenderOptions]) -> Image:
    """Client.render() of the default client."""
    return default_client().render(mesh, timeout=timeout, cancel=cancel, progress=progress, **options)


def info(mesh: Mesh, *, filename: str = "", timeout: float | None = None, cancel: CancelToken | None = None,
         progress: bool | ProgressCallback | None = None) -> dict[str, Any]:
    """Client.info() of the default client."""
    return default_client().info(mesh, filename=filename, timeout=timeout, cancel=cancel, progress=progress)


def has_decoder() -> bool:
    """Whether grids are decoded by the C library; without it the server sends them as .npz, which is slower."""
    return _decode.library() is not None
