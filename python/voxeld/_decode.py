"""Grids as arrays: decoded by the C library (client/include/voxeld/decode.h), or from the daemon's .npz. The colours of
palette files, read by the C library (client/include/voxeld/palette.h)."""
from __future__ import annotations

import ctypes
import functools
import io
import json
import os
import pathlib
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from ._errors import error

LIBRARY = "libvoxeld_client.so.0"
ERROR_BYTES = 1000
PALETTE_COLORS = 256
PALETTE_BYTES_MAX = 4 << 20


class ChannelType(NamedTuple):
    number: int  # in decode.h
    dtype: type[np.generic]
    components: int


CHANNELS = {
    "color": ChannelType(0, np.uint8, 4),
    "normal": ChannelType(1, np.int8, 3),
    "material": ChannelType(2, np.uint16, 1),
    "label": ChannelType(3, np.uint16, 1),
    "distance": ChannelType(4, np.float32, 1),
    "coverage": ChannelType(5, np.uint8, 1),
}


class Decoded(Protocol):
    """The arrays of a grid: rows of voxels in Morton order. Cells are in the order x, y, z."""
    dims: tuple[int, int, int]
    origin: npt.NDArray[np.float64]
    voxel_size: npt.NDArray[np.float64]
    voxel_count: int
    channels: tuple[str, ...]
    meta: dict[str, Any]

    def coords(self) -> npt.NDArray[np.int32]:
        """(N, 3)"""

    def rows(self, channel: str) -> npt.NDArray[Any]:
        """(N, components), or (N,) of a channel with one component."""

    def occupancy(self) -> npt.NDArray[np.bool_]:
        """(nz, ny, nx)"""


class _Info(ctypes.Structure):
    _fields_ = [("origin", ctypes.c_double * 3), ("voxel_size", ctypes.c_double * 3), ("voxel_count", ctypes.c_uint64),
                ("meta_json", ctypes.c_char_p), ("dims", ctypes.c_int32 * 3), ("channels", ctypes.c_uint32)]


@functools.cache
def library() -> ctypes.CDLL | None:
    """The decoder: $VOXELD_CLIENT_LIBRARY, else the file beside this one, else the installed library. None: there is
    none, or one without the decoder. An empty variable turns it off."""
    named = os.environ.get("VOXELD_CLIENT_LIBRARY")
    beside = pathlib.Path(__file__).parent / LIBRARY
    if named == "":
        return None
    try:
        loaded = ctypes.CDLL(named or (str(beside) if beside.exists() else LIBRARY))
        decode = loaded.voxeld_grid_decode
    except (OSError, AttributeError) as failure:
        if named:
            raise error("file", f"VOXELD_CLIENT_LIBRARY: {failure}") from failure
        return None
    decode.restype = ctypes.c_void_p
    decode.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p, ctypes.c_size_t]
    signatures: tuple[tuple[str, Any, list[Any]], ...] = (
        ("free", None, []),
        ("get_info", None, [ctypes.POINTER(_Info)]),
        ("get_coords", None, [ctypes.c_void_p]),
        ("get_channel", ctypes.c_int, [ctypes.c_int, ctypes.c_void_p]),
        ("mark_occupied", None, [ctypes.c_void_p]))
    for name, result, arguments in signatures:
        function = getattr(loaded, "voxeld_grid_" + name)
        function.restype, function.argtypes = result, [ctypes.c_void_p, *arguments]
    loaded.voxeld_palette_read.restype = ctypes.c_int
    loaded.voxeld_palette_read.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_char_p, ctypes.c_char_p,
                                           ctypes.c_char_p, ctypes.c_size_t]
    return loaded


class NativeGrid:
    """A native container (.voxg), decoded by the C library."""

    def __init__(self, loaded: ctypes.CDLL, container: bytes | bytearray) -> None:
        self._library = loaded
        self._grid: int | None = None
        view = np.frombuffer(container, np.uint8)
        text = ctypes.create_string_buffer(ERROR_BYTES)
        self._grid = loaded.voxeld_grid_decode(view.ctypes.data, view.size, text, ERROR_BYTES)
        if self._grid is None:
            raise error("bad-response", text.value.decode(errors="replace"))
        info = _Info()
        loaded.voxeld_grid_get_info(self._grid, ctypes.byref(info))
        self.dims: tuple[int, int, int] = (info.dims[0], info.dims[1], info.dims[2])
        self.origin = np.array(info.origin)
        self.voxel_size = np.array(info.voxel_size)
        self.voxel_count = int(info.voxel_count)
        self.channels = tuple(name for name, channel in CHANNELS.items() if info.channels >> channel.number & 1)
        self.meta: dict[str, Any] = json.loads(info.meta_json)

    def __del__(self) -> None:
        if self._grid is not None:
            self._library.voxeld_grid_free(self._grid)

    def coords(self) -> npt.NDArray[np.int32]:
        out = np.empty((self.voxel_count, 3), np.int32)
        self._library.voxeld_grid_get_coords(self._grid, out.ctypes.data)
        return out

    def rows(self, channel: str) -> npt.NDArray[Any]:
        kind = CHANNELS[channel]
        out = np.empty((self.voxel_count, kind.components) if kind.components > 1 else self.voxel_count, kind.dtype)
        if self._library.voxeld_grid_get_channel(self._grid, kind.number, out.ctypes.data) == 0:
            raise KeyError(channel)
        return out

    def occupancy(self) -> npt.NDArray[np.bool_]:
        out = np.zeros(self.dims[::-1], np.bool_)
        self._library.voxeld_grid_mark_occupied(self._grid, out.ctypes.data)
        return out


class SparseArrays:
    """An .npz of layout sparse."""

    def __init__(self, archive: bytes | bytearray) -> None:
        with np.load(io.BytesIO(archive), allow_pickle=False) as arrays:
            self._arrays: dict[str, npt.NDArray[Any]] = {name: arrays[name] for name in arrays.files}
        nx, ny, nz = (int(count) for count in self._arrays["dims"])
        self.dims: tuple[int, int, int] = (nx, ny, nz)
        self.origin: npt.NDArray[np.float64] = self._arrays["origin"]
        self.voxel_size: npt.NDArray[np.float64] = self._arrays["voxel_size"]
        self.voxel_count = len(self._arrays["coords"])
        self.channels = tuple(name for name in CHANNELS if name in self._arrays)
        self.meta: dict[str, Any] = json.loads(self._arrays["meta"].tobytes())

    def coords(self) -> npt.NDArray[np.int32]:
        coords: npt.NDArray[np.int32] = self._arrays["coords"].astype(np.int32, copy=False)
        return coords

    def rows(self, channel: str) -> npt.NDArray[Any]:
        return self._arrays[channel]

    def occupancy(self) -> npt.NDArray[np.bool_]:
        out = np.zeros(self.dims[::-1], np.bool_)
        x, y, z = self.coords().T
        out[z, y, x] = True
        return out


def decode(container: bytes | bytearray) -> Decoded:
    """Decodes a native container (.voxg). Needs the C library."""
    loaded = library()
    if loaded is None:
        raise error("file", f"no decoder of native containers: install {LIBRARY} (package libvoxeld-client0)")
    return NativeGrid(loaded, container)


def read_palette(path: str | os.PathLike[str]) -> list[str]:
    """The colours of a palette file (.gpl .pal .act .aco .ase .hex .png) as "#rrggbb", in its order, each once. Needs
    the C library."""
    loaded = library()
    if loaded is None:
        raise error("file", f"no reader of palettes: install {LIBRARY} (package libvoxeld-client0)")
    file = pathlib.Path(path)
    try:
        with file.open("rb") as opened:
            content = opened.read(PALETTE_BYTES_MAX + 1)  # the library refuses more
    except OSError as failure:
        raise error("file", f"{path}: {failure.strerror}") from failure
    colors = ctypes.create_string_buffer(3 * PALETTE_COLORS)
    text = ctypes.create_string_buffer(ERROR_BYTES)
    count = loaded.voxeld_palette_read(content, len(content), os.fsencode(file.name), colors, text, ERROR_BYTES)
    if count == 0:
        raise error("invalid-option", text.value.decode(errors="replace"))
    return [f"#{colors.raw[3 * i:3 * i + 3].hex()}" for i in range(count)]
