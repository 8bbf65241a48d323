"""The daemon that a client talks to, found as the command line `voxel` finds it."""
from __future__ import annotations

import contextlib
import http.client
import json
import os
import pathlib
import shutil
import stat
import subprocess
import time
import tomllib
import urllib.parse
from typing import TYPE_CHECKING, NamedTuple, Protocol

from ._errors import Unreachable, error

if TYPE_CHECKING:
    from ._call import Call

DEFAULT_URL = "http://127.0.0.1:8080"
ASK_SECONDS = 2.0  # limit of the request that asks whether a voxeld serves at DEFAULT_URL
PRIVATE_ASK_SECONDS = 10.0
START_SECONDS = 90.0  # voxel itself gives up after 60
START_LOOK_SECONDS = 0.02


class Server(Protocol):
    @property
    def name(self) -> str:
        """Its URL, for errors and paths."""

    @property
    def key(self) -> str:
        """API key, or empty."""

    def connect_url(self, call: Call) -> str:
        """The URL for a new connection."""


class NamedServer:
    """A server of a fixed URL."""

    def __init__(self, url: str, key: str) -> None:
        if not all(" " < each < "\x7f" for each in key):
            raise error("invalid-option", "the API key holds characters that no key has")
        self.name = url.rstrip("/")
        self.key = key

    def connect_url(self, call: Call) -> str:
        return self.name


class _Address(NamedTuple):
    url: str
    key: str


class PrivateServer:
    """The user's private daemon (docs/voxel.md), which ends when idle and is started again when needed.

    `voxel` starts it. A new connection is made only while the daemon holds the lock on its address file: another user
    who took its port after a crash would otherwise get the key.
    """

    def __init__(self) -> None:
        self.folder = _cache_folder() / "voxeld"
        self._address = _Address("http://127.0.0.1", "")

    @property
    def name(self) -> str:
        return self._address.url

    @property
    def key(self) -> str:
        return self._address.key

    def connect_url(self, call: Call) -> str:
        address = self._serving()
        if address is None:
            self._start(call)
            address = self._serving()
        if address is None:
            raise error("unreachable", f"the private daemon of {self.folder} ended right after its start")
        self._address = address
        return address.url

    def _serving(self) -> _Address | None:
        """None: no daemon serves here, or it ends, or refuses the key."""
        import fcntl  # which systems without private daemons lack
        if not self._is_own_folder():
            return None
        try:
            descriptor = os.open(self.folder / "address", os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
        except OSError:
            return None
        with open(descriptor, encoding="utf-8") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
                return None  # whoever had the lock is gone
            except BlockingIOError:
                pass
            try:
                address = _Address(json.load(file)["url"], self._read_key())
            except (ValueError, KeyError, OSError):
                return None
            if not _accepts(address):
                return None
            # The daemon removes the file before it looks a last time whether a request has come.
            return address if os.fstat(file.fileno()).st_nlink > 0 else None

    def _read_key(self) -> str:
        with open(os.open(self.folder / "key", os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW), encoding="ascii") as file:
            return file.read().strip()

    def _is_own_folder(self) -> bool:
        try:
            info = os.stat(self.folder)
        except OSError:
            return False
        return (stat.S_ISDIR(info.st_mode) and info.st_uid == os.geteuid()
                and not info.st_mode & (stat.S_IWGRP | stat.S_IWOTH))

    def _start(self, call: Call) -> None:
        program = shutil.which("voxel")
        if program is None:
            raise _start_error("no daemon serves here, and there is no program voxel in PATH to start one: install "
                               "voxel and voxeld, or name a server with url= or VOXELD_URL")
        call.report("start", 0, 0, "bytes")
        latest = time.monotonic() + START_SECONDS
        with subprocess.Popen([program, "whoami", "--local", "--quiet", "--json"], stdin=subprocess.DEVNULL,
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as starting:
            try:
                while starting.poll() is None:
                    if time.monotonic() >= latest:
                        raise _start_error(f"{program} did not start the private daemon in {START_SECONDS:g} s")
                    call.pause(START_LOOK_SECONDS)
            finally:
                starting.kill()  # without effect on one that has ended
            errors = starting.communicate()[1]
        if starting.returncode != 0:
            lines = errors.strip().splitlines() or [f"exit status {starting.returncode}"]
            raise _start_error(lines[-1].removeprefix("voxel: "))


def _start_error(detail: str) -> Unreachable:
    failure = Unreachable("unreachable", detail)
    failure.may_pass = False
    return failure


def _accepts(address: _Address) -> bool:
    """Whether the private daemon serves and takes the key."""
    try:
        return _me(address.url, address.key, PRIVATE_ASK_SECONDS)[0] == 200
    except TimeoutError:
        raise error("unreachable", f"the private daemon at {address.url} does not respond") from None
    except (OSError, http.client.HTTPException):
        return False


def _me(url: str, key: str, seconds: float) -> tuple[int, bytes]:
    """Status and body of GET /v1/me."""
    parts = urllib.parse.urlsplit(url)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=seconds)
    with contextlib.closing(connection):
        connection.request("GET", "/v1/me", headers={"Authorization": f"Bearer {key}"} if key else {})
        response = connection.getresponse()
        return response.status, response.read()


def _is_voxeld(url: str) -> bool:
    """Another program may listen there. It does not get the key."""
    try:
        status, body = _me(url, "", ASK_SECONDS)
        value = json.loads(body)
    except (OSError, http.client.HTTPException, ValueError):
        return False
    return isinstance(value, dict) and ({"tenant", "limits"} <= value.keys() if status == 200 else "code" in value)


def _variable_folder(name: str) -> pathlib.Path | None:
    value = os.environ.get(name, "")
    return pathlib.Path(value) if value.startswith("/") else None


def _cache_folder() -> pathlib.Path:
    home = _variable_folder("HOME")
    folder = _variable_folder("XDG_CACHE_HOME") or (home and home / ".cache")
    if folder is None:
        raise error("file", "there is no folder for a private daemon: set HOME or XDG_CACHE_HOME")
    return folder


class _Config(NamedTuple):
    url: str = ""
    key_file: str = ""


def _read_config() -> _Config:
    home = _variable_folder("HOME")
    folder = _variable_folder("XDG_CONFIG_HOME") or (home and home / ".config")
    path = folder and folder / "voxeld" / "config.toml"
    if path is None or not path.exists():
        return _Config()
    try:
        values = tomllib.loads(path.read_text())
    except (OSError, ValueError) as failure:
        raise error("file", f"{path}: {failure}") from failure
    for name, value in values.items():
        if name not in _Config._fields or not isinstance(value, str):
            raise error("invalid-option", str(path), expected='url = "URL" or key_file = "FILE"',
                        got=f"{name} = {value!r}")
    return _Config(**values)


def _api_key(key: str | None, key_file: str) -> str:
    if key is not None:
        return key
    if variable := os.environ.get("VOXELD_KEY"):
        return variable
    for name, path in (("VOXELD_KEY_FILE", os.environ.get("VOXELD_KEY_FILE", "")), ("key_file", key_file)):
        if not path:
            continue
        try:
            text = pathlib.Path(path).expanduser().read_text().strip()
        except (OSError, ValueError) as failure:
            raise error("file", f"{name}: {path}: {getattr(failure, 'strerror', None) or failure}") from failure
        if not text:
            raise error("file", f"{name}: {path} is empty")
        return text
    return ""


def find_server(url: str | None, key: str | None, local: bool | None) -> Server:
    """The first of: `url`, $VOXELD_URL, url of the configuration file, a voxeld at DEFAULT_URL, the private daemon.

    local: True: the private daemon alone; False: never. Raises Error.
    """
    if local:
        if url is not None:
            raise error("invalid-option", "local=True", expected="no url: a private daemon has its own", got=url)
        return PrivateServer()
    named = url or os.environ.get("VOXELD_URL", "")
    if named:
        return NamedServer(named, _api_key(key, ""))
    config = _read_config()
    if config.url:
        return NamedServer(config.url, _api_key(key, config.key_file))
    if local is False or _is_voxeld(DEFAULT_URL):
        return NamedServer(DEFAULT_URL, _api_key(key, config.key_file))
    return PrivateServer()
