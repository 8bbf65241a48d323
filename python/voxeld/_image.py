"""Images as bytes that a notebook shows."""
from __future__ import annotations

import base64
import os
import pathlib


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
        """Writes the bytes as they are."""
        pathlib.Path(path).write_bytes(self)

    def _repr_png_(self) -> bytes | None:
        return bytes(self) if self.media_type in ("image/png", "image/apng") else None

    def _repr_html_(self) -> str | None:
        if self.media_type == "image/png":
            return None
        return f'<img src="data:{self.media_type};base64,{base64.b64encode(self).decode()}" alt="voxels">'

    def __repr__(self) -> str:
        return f"<voxeld.Image {self.media_type}, {len(self)} bytes>"

    __str__ = __repr__
