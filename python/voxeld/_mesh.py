"""What can be voxelized: files, bytes, arrays, and meshes of other libraries."""
from __future__ import annotations

import hashlib
import io
import os
import pathlib
import stat
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO, Union

import numpy as np
import numpy.typing as npt

from ._errors import error
from ._references import bundle_name, referenced_files

HASH_PIECE_BYTES = 1 << 20
VERTICES_MAX = 1 << 31  # PLY's indices are int32


@dataclass(frozen=True)
class Asset:
    """A mesh that the server stores: pass it to voxelize() or render() in place of the mesh.

    `id` names its bytes, `filename` decides their format.
    """
    id: str
    filename: str = ""


Path = Union[str, "os.PathLike[str]"]
Arrays = Union[tuple[npt.ArrayLike, npt.ArrayLike], tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike]]
# Any: a mesh of another library (trimesh.Trimesh, Scene, open3d TriangleMesh), or an object with vertices and faces.
Mesh = Union[Path, Sequence[Path], bytes, BinaryIO, Arrays, Asset, Any]


@dataclass(frozen=True)
class File:
    """A file to send. `open` gives it from its beginning, as often as needed."""
    name: str
    bytes: int
    open: Callable[[], BinaryIO]

    def digest(self, report: Callable[[int], None]) -> str:
        """SHA-256 as 64 hex digits. report: called with the number of bytes that are done."""
        digest = hashlib.sha256()
        done = 0
        with self.open() as file:
            while piece := file.read(HASH_PIECE_BYTES):
                digest.update(piece)
                done += len(piece)
                report(done)
        return digest.hexdigest()


def path_file(path: pathlib.Path, name: str) -> File:
    with _opened(path) as file:
        info = os.fstat(file.fileno())
        if stat.S_ISFIFO(info.st_mode):  # what it gave is gone
            return memory_file(file.read(), name)
    return File(name, info.st_size, lambda: _opened(path))


def _opened(path: pathlib.Path) -> BinaryIO:
    try:
        return open(path, "rb")
    except OSError as failure:
        raise error("file", f"{path}: {failure.strerror}") from failure


def memory_file(data: bytes, name: str) -> File:
    return File(name, len(data), lambda: io.BytesIO(data))


def files_of(mesh: Mesh, filename: str) -> list[File]:
    """The mesh's file first, then those that it names or that were given with it."""
    if isinstance(mesh, (str, os.PathLike)):
        return _path_files([mesh], filename)
    if isinstance(mesh, (bytes, bytearray, memoryview)):
        return [memory_file(bytes(mesh), filename)]
    read: Any = getattr(mesh, "read", None)
    if read is not None:
        name, data = os.path.basename(str(getattr(mesh, "name", ""))), read()
        if not isinstance(data, (bytes, bytearray, memoryview)):
            raise error("file", name or "a mesh", expected="a file that is open in binary mode",
                        got=f"{type(data).__name__} from its read()")
        return [memory_file(bytes(data), filename or name)]
    if isinstance(mesh, (list, tuple)) and mesh and all(isinstance(each, (str, os.PathLike)) for each in mesh):
        return _path_files(mesh, filename)
    return [memory_file(*_library_mesh(mesh))]


def _path_files(paths: Sequence[Path], filename: str) -> list[File]:
    mesh, *beside = (pathlib.Path(each) for each in paths)
    # The suffix of a mesh tells its format.
    name_of_mesh = bundle_name(filename or mesh.name) or "mesh" + _utf8(pathlib.PurePath(filename or mesh.name).suffix)
    given = {bundle_name(path.name) or "": path for path in beside}
    if "" in given:
        raise error("file", f"{given['']}: no file of a bundle may have this name")
    if len(given) < len(beside) or name_of_mesh in given:
        raise error("file", f"{[str(path) for path in beside]}: files that are sent together need different names")
    names = {name_of_mesh: mesh}
    for path, name in referenced_files(mesh).items() if mesh.is_file() else ():
        if path != mesh.name and name not in given:
            names.setdefault(name, mesh.parent / path)
    names |= given
    if len(names) == 1:
        return [path_file(mesh, filename or _utf8(mesh.name))]
    files = [path_file(path, name) for name, path in names.items()]
    for file in files:
        if file.bytes == 0 and file.name in given:
            raise error("file", f"{given[file.name]}: is empty")
    return files


def _utf8(name: str) -> str:
    """A name as URLs and JSON can hold it: in the file system it may be any bytes."""
    return os.fsencode(name).decode(errors="replace")


def _library_mesh(mesh: Any) -> tuple[bytes, str]:
    """(bytes, file name) of arrays or of an object of another library."""
    if isinstance(mesh, tuple) and len(mesh) in (2, 3):
        return ply_bytes(*mesh), "mesh.ply"
    visual: Any = getattr(mesh, "visual", None)
    if hasattr(mesh, "geometry") or getattr(visual, "kind", None) == "texture":
        return bytes(mesh.export(file_type="glb")), "mesh.glb"  # trimesh: a scene, or a mesh with a texture
    faces = getattr(mesh, "faces", None)
    if faces is None:
        faces = getattr(mesh, "triangles", None)  # open3d
    vertices = getattr(mesh, "vertices", None)
    if vertices is None or faces is None:
        raise error("file", f"a mesh of type {type(mesh).__name__}",
                    expected="a path, bytes, a file, (vertices, faces[, colors]), an Asset, or a mesh of trimesh or "
                             "open3d", got=repr(mesh)[:80])
    colors: Any = None
    if getattr(visual, "kind", None) == "vertex":
        colors = visual.vertex_colors
    elif getattr(visual, "kind", None) == "face":  # PLY's colours are those of vertices
        corners = np.asarray(faces)
        vertices, faces = np.asarray(vertices)[corners].reshape(-1, 3), np.arange(corners.size).reshape(corners.shape)
        colors = np.repeat(visual.face_colors, corners.shape[1], axis=0)
    elif getattr(mesh, "vertex_colors", None) is not None and len(mesh.vertex_colors):
        colors = mesh.vertex_colors
    return ply_bytes(vertices, faces, colors), "mesh.ply"


def ply_bytes(vertices: npt.ArrayLike, faces: npt.ArrayLike, colors: npt.ArrayLike | None = None) -> bytes:
    """A binary PLY.

    Args:
        vertices: (N, 3) positions; float32 stays float32, other types are written as float64.
        faces: (M, 3) or (M, 4) indices of vertices, from 0.
        colors: (N, 3) or (N, 4) sRGB with alpha, of the vertices: integers 0 to 255, or floats 0 to 1.
    """
    points, cells = np.asarray(vertices), np.asarray(faces)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points) or points.dtype.kind not in "fiu":
        raise error("file", "vertices", expected="numbers of shape (N, 3)", got=_described(points))
    if cells.ndim != 2 or cells.shape[1] not in (3, 4) or not len(cells) or cells.dtype.kind not in "iu":
        raise error("file", "faces", expected="integers of shape (M, 3) or (M, 4)", got=_described(cells))
    lowest, highest = int(cells.min()), int(cells.max())
    if lowest < 0 or highest >= len(points):
        raise error("file", "faces", expected=f"indices 0 to {len(points) - 1}", got=f"{lowest} to {highest}")
    if len(points) > VERTICES_MAX:
        raise error("file", "vertices", expected=f"at most {VERTICES_MAX}", got=str(len(points)))
    real = "f4" if points.dtype in (np.float32, np.float16) else "f8"
    fields: list[Any] = [("position", f"<{real}", 3)]
    shades = None if colors is None else _byte_colors(colors, len(points))
    if shades is not None:
        fields.append(("color", "u1", shades.shape[1]))
    rows = np.empty(len(points), fields)
    rows["position"] = points
    lists = np.empty(len(cells), [("count", "u1"), ("indices", "<i4", cells.shape[1])])
    lists["count"], lists["indices"] = cells.shape[1], cells
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    header += [f"property {'float' if real == 'f4' else 'double'} {axis}" for axis in "xyz"]
    if shades is not None:
        rows["color"] = shades
        header += [f"property uchar {name}" for name in ("red", "green", "blue", "alpha")[:shades.shape[1]]]
    header += [f"element face {len(cells)}", "property list uchar int vertex_indices", "end_header\n"]
    return "\n".join(header).encode() + rows.tobytes() + lists.tobytes()


def _described(values: npt.NDArray[Any]) -> str:
    return f"{values.dtype} of shape {values.shape}"


def _byte_colors(colors: npt.ArrayLike, vertices: int) -> npt.NDArray[np.uint8]:
    values = np.asarray(colors)
    if values.shape not in ((vertices, 3), (vertices, 4)) or values.dtype.kind not in "fiu":
        raise error("file", "colors", expected=f"numbers of shape ({vertices}, 3) or ({vertices}, 4)",
                    got=_described(values))
    limit = 1 if values.dtype.kind == "f" else 255
    if not (values.min() >= 0 and values.max() <= limit):
        raise error("file", f"colors of {values.dtype}", expected=f"0 to {limit}",
                    got=f"{values.min()} to {values.max()}")
    if values.dtype.kind == "f":
        values = np.rint(values * 255)
    return values.astype(np.uint8)
