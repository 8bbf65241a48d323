"""The options of voxelization, animation and rendering, as docs/options.md describes them.

Values have the types of the API. A yes or no may be a bool, a list an array of numpy, `frames` a range.
"""
from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, TypedDict, Union

import numpy as np
import numpy.typing as npt

from ._decode import read_palette
from ._errors import error

Numbers = Union[Sequence[float], npt.NDArray[Any]]
Channel = Literal["occupancy", "color", "normal", "material", "label", "distance", "coverage"]
Axis = Literal["x", "y", "z"]
YesNo = Union[bool, Literal["yes", "no"]]


class JobOptions(TypedDict, total=False):
    """Of the job and of the mesh."""
    priority: int
    deadline_ms: int
    cache: YesNo
    filename: str


class GridOptions(TypedDict, total=False):
    """Placement and voxelization."""
    size: int
    dims: Sequence[int]
    voxel_size: float | Sequence[float]
    padding: int
    bounds: Numbers
    up: Literal["y", "z"]
    units: Literal["m", "cm", "mm", "in", "ft"]
    transform: Numbers
    rule: Literal["touch", "thin", "center", "none"]
    fill: Literal["surface", "solid", "shell", "band"]
    sign: Literal["auto", "parity", "nonzero", "majority", "flood", "winding"]
    thickness: float
    interior: Literal["none", "nearest"]
    color: Literal["average", "nearest", "dominant", "shaded", "axis", "none"]
    channels: Channel | Sequence[Channel]
    labels: Literal["mesh", "node", "material", "group"]
    distance: Literal["voxels", "world"]
    variant: str | int
    threshold: float
    pipeline: Literal["auto", "raster", "compute", "cpu"]


class AnimationOptions(TypedDict, total=False):
    """Of an animation."""
    animation: str | int
    root_motion: Literal["keep", "strip"]


class PoseOptions(AnimationOptions, total=False):
    """One moment of an animation."""
    time: float


class SequenceOptions(AnimationOptions, total=False):
    """The frames of an animation."""
    frames: str | int | range
    fps: float
    times: Numbers


class SelectionOptions(TypedDict, total=False):
    """A part of a grid, or a coarser one."""
    level: int
    level_rule: Literal["any", "majority"]
    alpha: Literal["auto", "keep", "cut"]
    region: Sequence[int]


class PlaceOptions(SelectionOptions, total=False):
    """A part of a grid, and the places of its cells."""
    keep: int | Literal["largest"]
    dilate: int
    erode: int
    hollow: int
    neighbors: Literal[6, 18, 26]
    remap: str | Mapping[int, int]
    crop: YesNo
    mirror: Axis | Sequence[Axis]


class OutputOptions(PlaceOptions, total=False):
    """Of a file that is saved. `palette` is a count, a name, colours, or the path of a palette file."""
    format: Literal["native", "npy", "npz", "vox", "xyz", "glb", "ply", "obj", "vti", "nrrd", "mha", "nii", "binvox",
                    "csv", "pcd", "qb", "schem", "litematic", "nbt", "zarr", "vdb", "nvdb", "bt",
                    "ldr", "vtu", "inp", "ktx2", "raw", "slices"]
    codec: Literal["fast", "small"]
    layout: Literal["dense", "sparse", "atlas"]
    axes: Literal["zyx", "xyz"]
    dtype: Literal["uint8", "bool", "float32"]
    palette: int | str | Sequence[str] | os.PathLike[str]
    mesh: Literal["faces", "greedy", "smooth", "instances"]
    channel: Channel
    compress: Literal["none", "meshopt"]
    blocks: str | Sequence[str]
    dither: Literal["none", "bayer", "error"]
    schem_version: int
    zarr_version: int
    cache: YesNo


class ImageOptions(TypedDict, total=False):
    """Of an image."""
    width: int
    height: int
    style: Literal["voxel", "smooth", "clay", "iso", "blueprint"]
    projection: Literal["perspective", "orthographic"]
    azimuth: float
    elevation: float
    zoom: float
    matrix: Numbers
    background: str
    occlusion: YesNo
    shadow: YesNo
    ground: YesNo
    exposure: float
    samples: Literal["auto", "1", "2", "3", "4"] | int
    renderer: Literal["auto", "gl", "cpu"]
    section: Numbers
    image: Literal["png", "gif", "apng", "sheet"]
    turntable: int
    rate: float
    columns: int


class GridImageOptions(ImageOptions, SelectionOptions, total=False):
    """Of an image of a stored grid."""
    cache: YesNo


class SequenceImageOptions(GridImageOptions, total=False):
    """Of an image of a stored sequence."""
    frames: str | int | range
    frame: int


class SaveOptions(OutputOptions, ImageOptions, total=False):
    """Of a file of a grid, which may be an image."""


class SequenceSaveOptions(SaveOptions, total=False):
    """Of a file of an animation, which may be an image."""
    frames: str | int | range
    frame: int


class VoxelizeOptions(GridOptions, PoseOptions, PlaceOptions, JobOptions, total=False):
    """Of voxelize(): one grid."""


class AnimateOptions(GridOptions, SequenceOptions, PlaceOptions, JobOptions, total=False):
    """Of animate(): a sequence of grids."""


class EstimateOptions(AnimateOptions, total=False):
    """Of estimate(): of voxelize() or animate()."""
    time: float


class RenderOptions(GridOptions, SequenceOptions, SelectionOptions, ImageOptions, JobOptions, total=False):
    """Of render(): an image of a mesh."""
    time: float
    frame: int


def json_value(name: str, value: Any) -> Any:
    """An option as JSON."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, range):
        if value.step != 1 or not len(value):
            raise error("invalid-option", name, expected="a range of step 1 that is not empty", got=str(value))
        return f"{value.start}..{value.stop - 1}"
    if isinstance(value, np.ndarray):
        return value.ravel().tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (str, int, float)):
        return value
    if isinstance(value, Iterable):
        return [json_value(name, each) for each in value]
    raise error("invalid-option", name, expected="a text, a number, a bool or a list of them",
                got=f"{type(value).__name__} {value!r}"[:80])


def json_options(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a job, without those that are None. `samples` is a text in the API."""
    palette = options.get("palette")
    if isinstance(palette, os.PathLike):
        palette = read_palette(palette)
    if palette is not None and not isinstance(palette, (str, int, np.integer)):
        palette = ",".join(palette)
    remap = options.get("remap")
    if isinstance(remap, Mapping):
        remap = ",".join(f"{old}:{new}" for old, new in remap.items())
    changed = {**options, "palette": palette, "remap": remap}
    values = {name: json_value(name, value) for name, value in changed.items() if value is not None}
    if "samples" in values:
        values["samples"] = str(values["samples"])
    if isinstance(values.get("channels"), str):
        values["channels"] = values["channels"].split(",")
    for name in ("keep", "neighbors"):
        if name in values:
            values[name] = str(values[name])
    if isinstance(values.get("mirror"), str):
        values["mirror"] = values["mirror"].split(",")
    return values
