"""Images as bytes that a notebook shows, and files that are written as a whole."""
from __future__ import annotations

import base64
import os
import pathlib
import uuid

from ._errors import error


class Image(bytes):
    """An encoded image (PNG, GIF or APNG): its bytes, which a notebook shows.

    `media_type`: "image/png", "image/gif" or "image/apng".
    """

    media_type: str

    def __new__(cls, data: bytes | bytearray, media_type: str = "image/png") -> Image:
        made = super().__new__(cls, data)
        made.media_type = media_type
        return made

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the bytes as they are. A file that exists is replaced by the complete one."""
        write(pathlib.Path(path), self)

    def _repr_png_(self) -> bytes | None:
        return bytes(self) if self.media_type in ("image/png", "image/apng") else None

    def _repr_html_(self) -> str | None:
        if self.media_type == "image/png":
            return None
        return f'<img src="data:{self.media_type};base64,{base64.b64encode(self).decode()}" alt="voxels">'

    def __repr__(self) -> str:
        return f"<voxeld.Image {self.media_type}, {len(self)} bytes>"

    __str__ = __repr__


def write(path: pathlib.Path, data: bytes | bytearray) -> None:
    """Replaces the file by a complete one. A link stays a link to the file; a device or a pipe is written to."""
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(data)
            return
        target = path.resolve()
        part = target.with_name(f".{uuid.uuid4().hex}.part")  # threads may write to one path
        try:
            part.write_bytes(data)
            os.replace(part, target)
        finally:
            part.unlink(missing_ok=True)
    except OSError as failure:
        raise error("file", f"{path}: {failure.strerror}") from failure
