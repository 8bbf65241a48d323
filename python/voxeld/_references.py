"""The files that a mesh file names, as the command line `voxel` sends them.

A mesh file may come from anyone, and the files that it names are sent away. Therefore no name and no symbolic link may
lead out of the folder of the mesh.
"""
from __future__ import annotations

import json
import os
import pathlib
import posixpath
import re
import unicodedata
import urllib.parse
from collections.abc import Iterator

IMAGES = {".tga", ".png", ".jpg", ".jpeg", ".dds", ".bmp"}
# Files that are listed below the folder of a mesh, to find one under another name.
LISTED_MAX = 20_000
HEADER_MAX = 1 << 20
UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
UTF8_MARK = b"\xef\xbb\xbf"
BLANKS_MAX = 100  # before the first word of a line
NO_UTF8 = re.compile("[\udc80-\udcff]")
NAME_BYTES_MAX = 255
ENCODINGS = ("gbk", "cp932", "cp950", "cp949", "cp1252", "cp850", "cp437", "cp1250", "cp852", "cp1251", "cp866")


def _encodings(text: str) -> tuple[str | None, ...]:
    """Those to read a text in; all of them read UTF-8 alike."""
    return ENCODINGS if NO_UTF8.search(text) else (None,)


def _read_as(name: str, encoding: str | None) -> str | None:
    """A name in an encoding, if its bytes are not UTF-8 (surrogates stand for them). None if it is not valid there."""
    if encoding is None or not NO_UTF8.search(name):
        return name
    try:
        return name.encode("utf-8", "surrogateescape").decode(encoding)
    except UnicodeError:
        return None


def bundle_name(path: str) -> str | None:
    """The path as the daemon takes it; None if nothing that a manifest may hold is left of it. The daemon reads
    references in each legacy encoding, also in one that has a letter for every byte: a path that is not UTF-8 matches
    those with the same bytes when read in that one."""
    name = (_read_as(path, "cp437") or "").replace("\\", "/")
    if not name or name.startswith("/"):
        return None
    data = posixpath.normpath(name).encode()
    is_plain = data not in (b".", b"..") and not data.startswith(b"../") and data[1:2] != b":" and min(data) >= 0x20
    return data.decode() if is_plain and len(data) <= NAME_BYTES_MAX else None


def _folded(text: str) -> str:
    """With composed letters, and without regard to case. macOS decomposes letters in names of files."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFD", text).casefold())


def _find(names: list[str], reference: str) -> int | None:
    """The only name that the last parts of a path mean, as many as fit; in another case if none is in the same."""
    parts: list[str] = []
    for part in reversed(re.split(r"[/\\]", reference)):
        if part == ".." or part.endswith(":"):
            break
        if part not in ("", "."):
            parts.insert(0, part)
    for start in range(len(parts)):
        end = "/".join(parts[start:])
        for beside in (True, False):
            fits = [i for i, name in enumerate(names) if name.lower() == end.lower()
                    or not beside and name.lower().endswith("/" + end.lower())]
            exact = [i for i in fits if names[i].endswith(end)]
            if len(exact or fits) == 1:
                return (exact or fits)[0]
    return None


class _Names:
    """Distinct names of existing files inside the folder of the mesh."""

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder = folder
        self.list: list[str] = []
        self.files: list[str] | None = None  # all below the folder
        self.read: dict[str | None, list[str]] = {}
        self.found: dict[str, str] = {}  # readings of paths that are not UTF-8, by which references mean them

    def add(self, name: str) -> bool:
        """Adds a file by its name."""
        return self._add(posixpath.normpath(name.replace("\\", "/")) if name else "")

    def add_similar(self, reference: str) -> bool:
        """Adds the file that the daemon will take for the reference: in another case, in a folder below, with another
        Unicode form of letters, or in a legacy encoding."""
        if self.files is None:
            self.files = self._list_files()
        found = _find(self.readings(None), urllib.parse.unquote(reference))
        if found is None:
            others: dict[int, str] = {}
            for names in map(self.readings, _encodings("".join(self.files))):
                for path in (_read_as(reference, encoding) for encoding in _encodings(reference)):
                    index = None if path is None else _find([_folded(name) for name in names], _folded(path))
                    if index is not None:
                        others.setdefault(index, names[index])
            if len(others) != 1:
                return False
            found, reading = others.popitem()
            if NO_UTF8.search(self.files[found]):
                self.found.setdefault(self.files[found], reading)
        return self._add(self.files[found])

    def take(self) -> dict[str, str]:
        """The name in the bundle of each path."""
        names = {path: bundle_name(self.found.get(path, path)) for path in self.list}
        return {path: name for path, name in names.items() if name is not None}

    def readings(self, encoding: str | None) -> list[str]:
        """All files as an encoding reads their names; none if it cannot."""
        if encoding not in self.read:
            names = [_read_as(name, encoding) for name in self.files or []]
            self.read[encoding] = [] if None in names else [(name or "").replace("\\", "/") for name in names]
        return self.read[encoding]

    def _add(self, path: str) -> bool:
        if not path or path == ".." or path.startswith(("/", "../")) or not self.is_file_inside(path):
            return False
        if path not in self.list:
            self.list.append(path)
        return True

    def _list_files(self) -> list[str]:
        """By breadth. Hidden folders and links to folders are not entered."""
        files: list[str] = []
        folders = [""]
        for folder in folders:
            if len(files) >= LISTED_MAX:
                break
            try:
                entries = sorted(os.scandir(self.folder / folder), key=lambda entry: entry.name)[:LISTED_MAX]
            except OSError:
                continue
            for entry in entries:
                if not entry.is_dir(follow_symlinks=False):
                    files.append(folder + entry.name)
                elif not entry.name.startswith("."):
                    folders.append(f"{folder}{entry.name}/")
        return files

    def is_file_inside(self, name: str) -> bool:
        """Whether it is a file that can be read and has bytes. The daemon takes no empty file."""
        try:
            real = pathlib.Path(os.path.realpath(self.folder / name, strict=True))
            return (real.is_file() and real.stat().st_size > 0 and os.access(real, os.R_OK)
                    and real.is_relative_to(self.folder.resolve()))
        except (OSError, ValueError):
            return False


def referenced_files(mesh: pathlib.Path) -> dict[str, str]:
    """Paths relative to the folder of the mesh, and their names in the bundle. Files that are missing, empty or cannot
    be read are left out: the daemon warns of them."""
    find = {".obj": _of_obj, ".ply": _of_ply, ".gltf": _of_gltf, ".glb": _of_gltf,
            ".md5mesh": _of_md5}.get(mesh.suffix.lower())
    if find is None:
        return {}
    names = _Names(mesh.parent)
    find(mesh, names)
    return names.take()


def _read(path: pathlib.Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""


def _text_lines(data: bytes) -> list[str]:
    encoding, errors = ("utf-16", "replace") if data[:2] in UTF16_MARKS else ("utf-8-sig", "surrogateescape")
    return data.decode(encoding, errors).splitlines()


def _lines(path: pathlib.Path) -> list[str]:
    return _text_lines(_read(path))


def _statements(lines: list[str]) -> Iterator[tuple[str, str]]:
    """(key, rest) of each line that is no comment."""
    for line in lines:
        key, _, rest = line.strip().replace("\t", " ").partition(" ")
        if key and not key.startswith("#"):
            yield key, rest.strip()


def _with_and_without_comment(rest: str) -> list[str]:
    """A name may contain '#'."""
    return [rest, re.split(r" #", rest, maxsplit=1)[0].rstrip()]


def _of_obj(mesh: pathlib.Path, names: _Names) -> None:
    data = _read(mesh)
    if data[:2] not in UTF16_MARKS:
        data = b"\n".join(_library_lines(data))
    for key, rest in _statements(_text_lines(data)):
        for name in _library_names(rest) if key == "mtllib" else ():
            if not (names.add(name) or names.add_similar(name)):
                for word in _with_and_without_comment(name)[1].split():
                    _ = names.add(word) or names.add_similar(word)
    for library in list(names.list):
        for key, rest in _statements(_lines(mesh.parent / library)):
            if key.lower().startswith("map_"):
                _add_texture(rest, names)


def _library_lines(data: bytes) -> Iterator[bytes]:
    """The lines of an OBJ that count. A scan has millions of others."""
    for found in re.finditer(rb"mtllib[^\r\n]*", data):
        before = data[max(found.start() - BLANKS_MAX, 0):found.start()].rstrip(b" \t")
        if before in (b"", UTF8_MARK) or before.endswith((b"\n", b"\r")):
            yield found[0]


def _library_names(line: str) -> list[str]:
    """Names that may contain blanks, each up to ".mtl" or the end of the line. A comment may follow."""
    names = [name.strip() for name in re.findall(r"\S.*?\.mtl(?=\s|$)|\S.*$", line, re.IGNORECASE)]
    comment = next((i for i, name in enumerate(names) if i > 0 and name.startswith("#")), len(names))
    return names[:comment]


def _add_texture(line: str, names: _Names) -> None:
    """Options, some with an unknown number of values, then a name that may contain blanks: the longest end of the line
    that is a file."""
    for add in (names.add, names.add_similar):
        for rest in _with_and_without_comment(line):
            if any(add(rest[match.start():]) for match in re.finditer(r"\S+", rest)):
                return


def _of_ply(mesh: pathlib.Path, names: _Names) -> None:
    """Textures of "comment TextureFile NAME", where <this> is the stem of the mesh's own name."""
    try:
        with open(mesh, "rb") as file:
            header = file.read(HEADER_MAX).partition(b"end_header")[0].decode("utf-8", "surrogateescape")
    except OSError:
        return
    for line in re.split(r"[\r\n]+", header):
        if found := re.match(r"\s*comment\s+(?i:TextureFile)\s+(\S.*)", line):
            name = re.sub("(?i)<this>", lambda _: mesh.stem, found[1].rstrip())
            _ = names.add(name) or names.add_similar(name)


def _of_gltf(mesh: pathlib.Path, names: _Names) -> None:
    try:
        with mesh.open("rb") as file:
            head = file.read(20)  # of a GLB: a header of 12 bytes, length and type of the first chunk, which is JSON
            is_glb = head.startswith(b"glTF")
            document = json.loads(file.read(int.from_bytes(head[12:16], "little")) if is_glb else head + file.read())
    except (OSError, ValueError, RecursionError):
        return  # sent as it is: the daemon reports the error
    for key in ("buffers", "images"):
        items = document.get(key) if isinstance(document, dict) else None
        for item in items if isinstance(items, list) else []:
            uri = item.get("uri") if isinstance(item, dict) else None
            if isinstance(uri, str) and not uri.strip().startswith("data:"):
                uri = uri.strip()
                _ = names.add(urllib.parse.unquote(uri)) or names.add(uri) or names.add_similar(uri)


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
    for key, rest in _statements(_lines(mesh)):
        if key == "shader":
            stem = _stem(rest.strip('"'))
            wanted |= {stem, stem + "_d"}
    try:
        files = sorted(path for path in mesh.parent.iterdir() if names.is_file_inside(path.name))
    except OSError:  # the mesh itself can be read
        return
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
