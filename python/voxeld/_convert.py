"""Grids as the types of other libraries, each imported on use."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._errors import error

if TYPE_CHECKING:
    from ._grid import Grid


def to_open3d(grid: Grid, kind: str) -> Any:
    import open3d
    points = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(grid.points))
    if grid.colors is not None:
        points.colors = open3d.utility.Vector3dVector(grid.colors[:, :3] / 255.0)
    if kind == "points":
        if grid.normals is not None:
            points.normals = open3d.utility.Vector3dVector(grid.normals.astype(np.float64))
        return points
    if kind != "voxels":
        raise error("invalid-option", "kind", expected="voxels or points", got=kind)
    size = grid.voxel_size
    if not np.allclose(size, size[0]):
        raise error("invalid-option", "open3d.geometry.VoxelGrid", expected="voxels that are cubes", got=str(size))
    return open3d.geometry.VoxelGrid.create_from_point_cloud_within_bounds(
        points, float(size[0]), grid.origin, grid.origin + size * grid.dims)


def to_trimesh(grid: Grid) -> Any:
    import trimesh
    transform = np.diag([*grid.voxel_size, 1.0])
    transform[:3, 3] = grid.origin + 0.5 * grid.voxel_size  # of the centre of cell 0, 0, 0
    encoding = trimesh.voxel.encoding.SparseBinaryEncoding(grid.coords, shape=grid.dims)
    return trimesh.voxel.VoxelGrid(encoding, transform=transform)


def to_pyvista(grid: Grid) -> Any:
    import pyvista
    kind = getattr(pyvista, "ImageData", None) or pyvista.UniformGrid  # the name before 0.40
    image = kind(dimensions=np.array(grid.dims) + 1, spacing=tuple(grid.voxel_size), origin=tuple(grid.origin))
    image.cell_data["occupancy"] = grid.occupancy.astype(np.uint8).ravel()
    for channel in grid.channels:
        cells = grid.dense(channel)
        image.cell_data[channel] = cells.reshape(-1, *cells.shape[3:])
    return image


def to_torch_sparse(grid: Grid, channel: str | None) -> Any:
    import torch
    rows: npt.NDArray[Any] | None = np.ones(grid.voxel_count, np.float32)
    if channel is not None:
        rows = grid.rows(channel)
    if rows is None:
        raise error("invalid-option", "channel", expected=f"one of {', '.join(grid.channels) or 'none'}",
                    got=str(channel))
    values = rows.astype(np.float32)
    if channel in ("color", "coverage", "normal"):
        values /= np.float32(127 if channel == "normal" else 255)
    cells = torch.from_numpy(np.ascontiguousarray(grid.coords[:, ::-1].T.astype(np.int64)))
    return torch.sparse_coo_tensor(cells, torch.from_numpy(values), (*grid.shape, *values.shape[1:])).coalesce()
