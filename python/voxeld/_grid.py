"""Grids, frames and tiles: arrays on first use, files, images, and the types of other libraries."""
from __future__ import annotations

import functools
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from . import _convert, _decode
from ._call import Call, CancelToken, ProgressCallback
from ._errors import error
from ._image import Image, write
from .options import GridImageOptions, SaveOptions

if TYPE_CHECKING:
    from functools import cached_property
    from typing import Unpack

    from ._client import Client
else:
    class cached_property(functools.cached_property):
        """In Python 3.11, that of functools lets one grid of all compute at a time, and so download."""

        def __get__(self, instance, owner=None):
            if instance is None:
                return self
            value = instance.__dict__[self.attrname] = self.func(instance)
            return value

# Extension of a file -> format, or image.
# Extension -> formats that have it, the default first.
GRID_FORMATS = {".voxg": ["native"], ".npy": ["npy"], ".npz": ["npz"], ".vox": ["vox"], ".xyz": ["xyz"],
                ".glb": ["glb"], ".ply": ["ply"], ".obj": ["obj"], ".vti": ["vti"], ".nrrd": ["nrrd"], ".mha": ["mha"],
                ".nii.gz": ["nii"], ".binvox": ["binvox"], ".csv": ["csv"], ".pcd": ["pcd"], ".qb": ["qb"],
                ".schem": ["schem"], ".litematic": ["litematic"], ".nbt": ["nbt"], ".zarr.zip": ["zarr"],
                ".vdb": ["vdb"], ".nvdb": ["nvdb"], ".bt": ["bt"], ".ldr": ["ldr"], ".vtu": ["vtu"],
                ".inp": ["inp"], ".ktx2": ["ktx2"], ".raw.zip": ["raw"], ".slices.zip": ["slices"]}
SEQUENCE_FORMATS = {".voxs": ["native"], ".npy": ["npy"], ".npz": ["npz"], ".vox": ["vox"],
                    ".zarr.zip": ["zarr"],
                    ".zip": ["xyz", "glb", "ply", "obj", "vti", "nrrd", "mha", "nii", "binvox", "csv", "pcd", "qb",
                             "schem", "litematic", "nbt", "vdb", "nvdb", "bt", "ldr", "vtu", "inp", "ktx2", "raw",
                             "slices"]}
IMAGES = {".png": "png", ".gif": "gif", ".apng": "apng"}
# Changes that the server makes after it has taken a part, and that it draws in no image.
CHANGES = ("keep", "dilate", "erode", "hollow", "crop", "mirror")


class Voxels:
    """Voxels with their place, as arrays.

    Cell (x, y, z) covers the box from `origin + voxel_size * (x, y, z)` to `origin + voxel_size * (x + 1, y + 1,
    z + 1)` in world units. Arrays of voxels have a row for each of the N voxels, by ascending Morton code of the cell.
    """

    def __init__(self, meta: Mapping[str, Any] | None, voxel_count: int | None) -> None:
        self._meta = dict(meta) if meta is not None else None
        self._voxel_count = voxel_count

    def __repr__(self) -> str:
        cells = " x ".join(map(str, self.dims))
        channels = f": {', '.join(self.channels)}" if self.channels else ""
        return f"<voxeld.{type(self).__name__} of {cells} cells, {self.voxel_count} voxels{channels}>"

    # --- facts

    @property
    def meta(self) -> dict[str, Any]:
        """What the server says of the grid: options, mesh, pipeline, labels, …"""
        return self._decoded.meta if self._meta is None else self._meta

    @property
    def dims(self) -> tuple[int, int, int]:
        """Cells in x, y and z."""
        if self._meta is not None and "dims" in self._meta:
            x, y, z = self._meta["dims"]
            return x, y, z
        return self._decoded.dims

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of dense arrays: cells in z, y and x."""
        return self.dims[::-1]

    @property
    def origin(self) -> npt.NDArray[np.float64]:
        """(3,) min corner of cell 0, 0, 0 in world units."""
        if self._meta is not None and "origin" in self._meta:
            return np.array(self._meta["origin"], np.float64)
        return self._decoded.origin

    @property
    def voxel_size(self) -> npt.NDArray[np.float64]:
        """(3,) edges of a voxel in world units."""
        if self._meta is not None and "voxel_size" in self._meta:
            return np.array(self._meta["voxel_size"], np.float64)
        return self._decoded.voxel_size

    @property
    def voxel_count(self) -> int:
        """The number of voxels N."""
        if self._voxel_count is not None:
            return self._voxel_count
        if self._meta is not None and "voxel_count" in self._meta:
            return int(self._meta["voxel_count"])
        return self._decoded.voxel_count

    def __len__(self) -> int:
        return self.voxel_count

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of the grid beside its occupancy."""
        if self._meta is not None and "channels" in self._meta:
            return tuple(name for name in self._meta["channels"] if name != "occupancy")
        return self._decoded.channels

    # --- arrays

    @cached_property
    def _decoded(self) -> _decode.Decoded:
        raise NotImplementedError

    @cached_property
    def coords(self) -> npt.NDArray[np.int32]:
        """(N, 3) x, y, z of each voxel's cell."""
        return self._decoded.coords()

    @cached_property
    def occupancy(self) -> npt.NDArray[np.bool_]:
        """(nz, ny, nx) whether a cell is occupied."""
        return self._decoded.occupancy()

    @property
    def points(self) -> npt.NDArray[np.float64]:
        """(N, 3) centres of the voxels in world units."""
        return self.origin + (self.coords + 0.5) * self.voxel_size

    def rows(self, channel: str) -> npt.NDArray[Any] | None:
        """The samples of a channel as they are stored, a row for each voxel; None if the grid lacks it.

        channel: "color" uint8 (N, 4), "normal" int8 (N, 3), "material" and "label" uint16 (N,), "distance" float32
        (N,), "coverage" uint8 (N,).
        """
        if channel not in _decode.CHANNELS:
            raise error("invalid-option", "channel", expected=", ".join(_decode.CHANNELS), got=channel)
        name = "_rows_" + channel
        if name not in self.__dict__:
            self.__dict__[name] = self._decoded.rows(channel) if channel in self._decoded.channels else None
        rows: npt.NDArray[Any] | None = self.__dict__[name]
        return rows

    @property
    def colors(self) -> npt.NDArray[np.uint8] | None:
        """(N, 4) sRGB and linear alpha, 0 to 255; 0 inside a solid. None without colours."""
        return self.rows("color")

    @cached_property
    def normals(self) -> npt.NDArray[np.float32] | None:
        """(N, 3) unit normals, 0 inside a solid. None without normals."""
        rows = self.rows("normal")
        return None if rows is None else rows.astype(np.float32) / np.float32(127)

    @property
    def materials(self) -> npt.NDArray[np.uint16] | None:
        """(N,) ids of materials from 1 on; 0: none. None without materials."""
        return self.rows("material")

    @property
    def labels(self) -> npt.NDArray[np.uint16] | None:
        """(N,) ids of labels from 1 on, which `meta` names; 0: none. None without labels."""
        return self.rows("label")

    @property
    def distances(self) -> npt.NDArray[np.float32] | None:
        """(N,) distances to the mesh in voxels, with `distance="world"` in its own unit, negative inside. None without
        distances."""
        return self.rows("distance")

    @property
    def coverages(self) -> npt.NDArray[np.uint8] | None:
        """(N,) 255: the mesh covers the area of a cell's face, in a solid the whole cell. None without coverages."""
        return self.rows("coverage")

    def dense(self, channel: str, empty: float = 0) -> npt.NDArray[Any]:
        """(nz, ny, nx) or (nz, ny, nx, components) samples of a channel; cells without a voxel have `empty`."""
        rows = self.rows(channel)
        if rows is None:
            raise error("invalid-option", "channel", expected=f"one of {', '.join(self.channels) or 'none'}",
                        got=channel)
        cells = np.full((*self.shape, *rows.shape[1:]), empty, rows.dtype)
        x, y, z = self.coords.T
        cells[z, y, x] = rows
        return cells


class Tiles(Voxels):
    """Finished tiles of a grid that the server makes, decoded already. A tile has 256 cells on each side.

    Attributes:
        first_tile: number of the grid's tiles before these, in Morton order.
    """

    def __init__(self, decoded: _decode.Decoded) -> None:
        super().__init__(None, None)
        self.__dict__["_decoded"] = decoded
        self.first_tile = int(decoded.meta["first_tile"])


class Grid(Voxels):
    """A sparse voxel grid that the server stores. The arrays are downloaded and decoded on their first use and then
    kept.

    Attributes:
        id: of the stored grid; `Client.grid(id)` finds it again.
        job: id of the job that made it, or empty.
        warnings: of the job, such as "missing-texture: skin.png".
    """

    def __init__(self, client: Client, id: str, *, job: str = "", meta: Mapping[str, Any] | None = None,
                 warnings: Sequence[str] = (), voxel_count: int | None = None,
                 selection: Mapping[str, Any] | None = None) -> None:
        super().__init__(meta, voxel_count)
        self._client = client
        self.id = id
        self.job = job
        self.warnings = list(warnings)
        self._selection = dict(selection or {})

    def __repr__(self) -> str:
        if self._meta is None and "_decoded" not in self.__dict__:
            return f"<voxeld.{type(self).__name__} {self.id[:19]}…>"
        return super().__repr__()

    @cached_property
    def _decoded(self) -> _decode.Decoded:
        with Call() as call:
            return self._client._decoded(call, self.id, self._selection)

    def fetch(self, *, timeout: float | None = None, cancel: CancelToken | None = None,
              progress: bool | ProgressCallback | None = None) -> Grid:
        """Downloads and decodes now what the arrays need. Returns the grid."""
        with Call(timeout, cancel, progress) as call:
            return self._fetch(call)

    def _fetch(self, call: Call) -> Grid:
        if "_decoded" not in self.__dict__:
            self.__dict__["_decoded"] = self._client._decoded(call, self.id, self._selection)
        return self

    # --- parts

    def level(self, level: int, rule: Literal["any", "majority"] = "any") -> Grid:
        """A coarser grid, made by the server: one voxel for 2^level cells on each side.

        rule: occupied cells that a voxel needs: any, or at least half of them.
        """
        return self._part(level=level, level_rule=rule)

    def region(self, first: Sequence[int], end: Sequence[int]) -> Grid:
        """The cells from `first` to `end`, which is not included: x, y, z each. A level is taken of a region."""
        return self._part(region=[*map(int, first), *map(int, end)])

    def _part(self, **selection: Any) -> Grid:
        twice = selection.keys() & self._selection.keys()
        if twice:
            raise error("invalid-option", "a part of a grid", expected="one level and one region",
                        got=f"a second {sorted(twice)[0]}")
        late = given_changes(self._selection, *(("level",) if "region" in selection else ()))
        if late:
            raise error("invalid-option", "a part of a grid", expected="a region, then a level, of a stored grid",
                        got=f"one with {late[0]}")
        return Grid(self._client, self.id, job=self.job, selection={**self._selection, **selection})

    # --- files and images

    def save(self, path: str | os.PathLike[str], *, timeout: float | None = None, cancel: CancelToken | None = None,
             progress: bool | ProgressCallback | None = None, **options: Unpack[SaveOptions]) -> None:
        """Writes a file whose extension chooses the format: .voxg, .npy, .npz, .vox, .xyz, .glb, .ply, .obj, .vti,
        .nrrd, .mha, .nii.gz, .binvox, .csv, .pcd, .qb, .schem, .litematic, .nbt,
        .zarr.zip, .vdb, .nvdb, .bt, .ldr, .vtu, .inp, .ktx2, .raw.zip, .slices.zip, .png or .gif.

        The server converts the grid. options: of the format, such as layout="sparse", palette=16, mesh="smooth",
        channel="color" or blocks=["concrete", "wool"]. palette=pathlib.Path("my.gpl") reads the colours of a file.
        """
        target = pathlib.Path(path)
        if target.suffix.lower() in IMAGES and "format" not in options:
            image: Any = {"image": IMAGES[target.suffix.lower()], **options}
            write(target, self.render(timeout=timeout, cancel=cancel, progress=progress, **image))
            return
        body = save_options(target, GRID_FORMATS, {**self._selection, **options})
        with Call(timeout, cancel, progress) as call:
            write(target, self._client._export(call, {"grid": self.id}, body))

    def render(self, *, timeout: float | None = None, cancel: CancelToken | None = None,
               progress: bool | ProgressCallback | None = None, **options: Unpack[GridImageOptions]) -> Image:
        """An image of the grid: PNG bytes, which a notebook shows.

        options: width, height (pixels), azimuth, elevation (degrees), style, … of docs/options.md; image="gif" with
        turntable=N for views from all around.
        """
        check_image(self._selection)
        with Call(timeout, cancel, progress) as call:
            return self._client._image(call, {"grid": self.id}, {**self._selection, **options})

    def _repr_png_(self) -> bytes | None:
        return None if given_changes(self._selection, "remap") else bytes(self.render())

    # --- types of other libraries, which are imported by these methods alone

    def to_open3d(self, kind: Literal["voxels", "points"] = "voxels") -> Any:
        """An open3d.geometry.VoxelGrid with colours, or a PointCloud of the voxels' centres, also with normals."""
        return _convert.to_open3d(self, kind)

    def to_trimesh(self) -> Any:
        """A trimesh.voxel.VoxelGrid in world units, with axes x, y, z."""
        return _convert.to_trimesh(self)

    def to_pyvista(self) -> Any:
        """A pyvista.ImageData with the occupancy and each channel as cell data; cells without a voxel have 0."""
        return _convert.to_pyvista(self)

    def to_torch_sparse(self, channel: str | None = None) -> Any:
        """A coalesced torch.sparse_coo tensor of the shape of `occupancy`, with float32 values.

        channel: None: 1 in each voxel; else its samples, colours, normals and coverages from 0 or -1 to 1, with a
        dense last dimension if it has several components.
        """
        return _convert.to_torch_sparse(self, channel)


class Frame(Grid):
    """A grid of an animation's frame. All frames have one placement.

    Attributes:
        index: number of the frame, from 0.
        time: seconds into the animation.
    """

    def __init__(self, client: Client, listed: Mapping[str, Any], job: str, selection: Mapping[str, Any]) -> None:
        count = None if selection else int(listed["voxel_count"])  # of the whole frame
        super().__init__(client, str(listed["grid"]), job=job, voxel_count=count, selection=selection)
        self.index = int(listed["index"])
        self.time = float(listed["time_s"])


def given_changes(selection: Mapping[str, Any], *others: str) -> list[str]:
    """The changes of voxels, and of the others, that a selection has."""
    return [name for name in (*CHANGES, *others) if selection.get(name) not in (None, False, "no", 0)]


def check_image(selection: Mapping[str, Any]) -> None:
    """Refuses what no image has."""
    changes = given_changes(selection, "remap")
    if changes:
        raise error("invalid-option", "an image of an animation or of its frame",
                    expected="one without changes of voxels, or save() to a format of voxels", got=changes[0])


def save_options(path: pathlib.Path, formats: Mapping[str, list[str]], options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with the format of the file's extension."""
    name = path.name.lower()
    known: list[str] = next((of for extension, of in formats.items() if name.endswith(extension)), [])
    given = options.get("format")
    if not known and given is None:
        raise error("file", str(path), expected=f"one of the extensions {' '.join([*formats, *IMAGES])}, or format=",
                    got=repr(path.suffix))
    if known and given is not None and given not in known:
        raise error("file", str(path), expected=f"format={' or '.join(known)} by its extension", got=f"format={given}")
    return {**options, "format": given or known[0]}
