"""The files that a mesh file names, as the command line `voxel` sends them.

A mesh file may come from anyone, and the files that it names are sent away. Therefore no name and no symbolic link may
lead out of the folder of the mesh.
"""
from __future__ import annotations

import json
import pathlib
import posixpath
import re
import urllib.parse
from collections.abc import Iterator

IMAGES = {".tga", ".png", ".jpg", ".jpeg", ".dds", ".bmp"}


class _Names:
    """Distinct names of existing files inside the folder of the mesh."""

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder = folder
        self.list: list[str] = []

    def add(self, name: str) -> bool:
        path = posixpath.normpath(name.replace("\\", "/")) if name else ""
        if not path or path == ".." or path.startswith(("/", "../")) or not self.is_file_inside(path):
            return False
        if path not in self.list:
            self.list.append(path)
        return True

    def is_file_inside(self, name: str) -> bool:
        try:
            real = (self.folder / name).resolve(strict=True)
            return real.is_file() and real.is_relative_to(self.folder.resolve())
        except (OSError, ValueError):
            return False


def referenced_files(mesh: pathlib.Path) -> list[str]:
    """Names relative to the folder of the mesh. Missing files are left out: the daemon warns of them."""
    find = {".obj": _of_obj, ".gltf": _of_gltf, ".md5mesh": _of_md5}.get(mesh.suffix.lower())
    if find is None:
        return []
    names = _Names(mesh.parent)
    find(mesh, names)
    return names.list


def _lines(path: pathlib.Path) -> Iterator[str]:
    try:
        data = path.read_bytes()
    except OSError:
        return
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    yield from data.decode(encoding, errors="surrogateescape").splitlines()


def _statements(path: pathlib.Path) -> Iterator[tuple[str, str]]:
    """(key, rest) of each line that is no comment."""
    for line in _lines(path):
        key, _, rest = line.strip().replace("\t", " ").partition(" ")
        if key and not key.startswith("#"):
            yield key, rest.strip()


def _with_and_without_comment(rest: str) -> list[str]:
    """A name may contain '#'."""
    return [rest, re.split(r" #", rest, maxsplit=1)[0].rstrip()]


def _of_obj(mesh: pathlib.Path, names: _Names) -> None:
    data = mesh.read_bytes() if mesh.is_file() else b""
    if b"mtllib" not in data and data[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        return  # a scan of millions of vertices
    for key, rest in _statements(mesh):
        if key == "mtllib" and not any(names.add(name) for name in _with_and_without_comment(rest)):
            for word in _with_and_without_comment(rest)[1].split():
                names.add(word)
    for library in list(names.list):
        for key, rest in _statements(mesh.parent / library):
            if key.lower().startswith("map_"):
                _add_texture(rest, names)


def _add_texture(line: str, names: _Names) -> None:
    """Options, some with an unknown number of values, then a name that may contain blanks: the longest end of the line
    that is a file."""
    for rest in _with_and_without_comment(line):
        for start in (match.start() for match in re.finditer(r"\S+", rest)):
            if names.add(rest[start:]):
                return


def _of_gltf(mesh: pathlib.Path, names: _Names) -> None:
    try:
        document = json.loads(mesh.read_bytes())
    except (OSError, ValueError):
        return  # sent as it is: the daemon reports the error
    for key in ("buffers", "images"):
        items = document.get(key) if isinstance(document, dict) else None
        for item in items if isinstance(items, list) else []:
            uri = item.get("uri") if isinstance(item, dict) else None
            if isinstance(uri, str) and not uri.strip().startswith("data:"):
                names.add(urllib.parse.unquote(uri.strip())) or names.add(uri.strip())


def _stem(name: str) -> str:
    return posixpath.splitext(posixpath.basename(name.replace("\\", "/")))[0].lower()


def _md5_joints(path: pathlib.Path, block: str) -> set[str]:
    """The first quoted text of each line in the block."""
    joints: set[str] = set()
    is_inside = False
    for line in (each.strip() for each in _lines(path)):
        if not is_inside:
            is_inside = line.startswith(block)
        elif line.startswith("}"):
            break
        elif found := re.search(r'"([^"]*)"', line):
            joints.add(found[1])
    return joints


def _of_md5(mesh: pathlib.Path, names: _Names) -> None:
    """Material files, images named like a shader or a material, and animations with the joints of the mesh."""
    wanted: set[str] = set()
    for key, rest in _statements(mesh):
        if key == "shader":
            stem = _stem(rest.strip('"'))
            wanted |= {stem, stem + "_d"}
    files = sorted(path for path in mesh.parent.iterdir() if names.is_file_inside(path.name))
    for path in files:
        if path.suffix.lower() == ".mtr":
            names.add(path.name)
            wanted |= {_stem(word) for line in _lines(path) for word in line.split()}
    for path in files:
        if path.suffix.lower() in IMAGES and _stem(path.name) in wanted:
            names.add(path.name)
    joints: set[str] = set()
    for path in files:
        if path.suffix.lower() == ".md5anim":
            joints = joints or _md5_joints(mesh, "joints")
            if _md5_joints(path, "hierarchy") == joints:
                names.add(path.name)
