"""The twin's end of the device files: it starts `device_files` as a process, and answers its questions."""

from __future__ import annotations

import ctypes.util
import errno
import importlib.util
import os
import socket
import stat
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from tral_env.errors import HardwareError
from tral_env.installation import installed
from tral_env.twin.bus import I2cBus, I2cMessage

_MESSAGE, _ERRNO = struct.Struct("<HHH"), struct.Struct("<i")
"""As in `device_files`, which is no module of this process: it loads FUSE."""
_MAX_PACKET = 65536
_START_S, _END_S = 10.0, 3.0


class FileTree(Protocol):
    """Folders and small text files, as sysfs has them. A path is a tuple of names; each error is an OSError."""

    def mode(self, path: tuple[str, ...]) -> int:
        """The mode of stat(2)."""
        ...

    def names(self, path: tuple[str, ...]) -> list[str]:
        """Names in a folder."""
        ...

    def read(self, path: tuple[str, ...]) -> str:
        """Content of a file."""
        ...

    def write(self, path: tuple[str, ...], text: str) -> None:
        """Write a file."""


class EmptyTree:
    """No files at all."""

    def mode(self, path: tuple[str, ...]) -> int:
        """The root alone."""
        if path:
            raise OSError(errno.ENOENT, "no such file")
        return stat.S_IFDIR | 0o755

    def names(self, path: tuple[str, ...]) -> list[str]:
        """Nothing."""
        return []

    def read(self, path: tuple[str, ...]) -> str:
        """Never."""
        raise OSError(errno.ENOENT, "no such file")

    def write(self, path: tuple[str, ...], text: str) -> None:
        """Never."""
        raise OSError(errno.ENOENT, "no such file")


def why_no_files() -> str:
    """Why this computer cannot show device files; empty: it can."""
    if sys.platform != "linux":
        return "device files need Linux"
    if os.geteuid() != 0:
        return "device files need root"
    if not os.access("/dev/fuse", os.R_OK | os.W_OK):
        return "device files need /dev/fuse, which is not here"
    if importlib.util.find_spec("mfusepy") is None:
        return f"device files need the package 'mfusepy': {installed().command('twin')}"
    if not (ctypes.util.find_library("fuse3") or ctypes.util.find_library("fuse")):
        return "device files need the library libfuse3: apt-get install fuse3"
    try:
        importlib.import_module("mfusepy")
    except (ImportError, OSError, AttributeError) as error:
        return f"device files need the package 'mfusepy', which cannot be imported here: {error}"
    return ""


class DeviceFiles:
    """The files of a bus and a tree under a mount, as long as this process lives and `close` was not called."""

    def __init__(
        self,
        mount: Path,
        bus: I2cBus,
        *,
        i2c_name: str = "i2c-1",
        tree: FileTree | None = None,
        link: Path | None = None,
        disk: Path | None = None,
    ) -> None:
        """Mount.

        Args:
            mount: folder that is made, and removed at the end.
            bus: what the file `i2c_name` leads to.
            i2c_name: name of the file.
            tree: files beside it.
            link: a link to the bus's file that is made too, such as /dev/i2c-7.
            disk: folder that becomes a small disk of its own.

        Raises:
            HardwareError: this computer cannot show device files, or the place is taken.
        """
        if reason := why_no_files():
            raise HardwareError(reason)
        self.i2c_path, self._link = mount / i2c_name, link
        if link is not None:
            _make_link(link, self.i2c_path)
        pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(3)]
        (self._i2c, _), (self._tree, _), (self._life, _) = pairs
        theirs = [pair[1] for pair in pairs]
        self._program = [sys.executable, "-P", str(Path(__file__).with_name("device_files.py"))]
        self._places = [str(mount), str(link or ""), str(disk or "")]
        numbers = [str(each.fileno()) for each in theirs]
        self._process = subprocess.Popen(
            [*self._program, i2c_name, *numbers, *self._places],
            pass_fds=[each.fileno() for each in theirs], stdin=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        for each in theirs:
            each.close()
        self._serve(self._i2c, lambda packet: _transfer(bus, packet))
        files = tree or EmptyTree()
        self._serve(self._tree, lambda packet: _file_request(files, packet))
        self._life.settimeout(_START_S)
        try:
            ready = self._life.recv(16)
        except TimeoutError:
            ready = b""
        if not ready:
            self.close()
            raise HardwareError(f"the device files could not be mounted at {mount}")

    @property
    def pid(self) -> int:
        """Process id of the program that shows the files."""
        return self._process.pid

    def close(self) -> None:
        """Take the files away; a second call does nothing."""
        for each in (self._life, self._i2c, self._tree):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.returncode != 0:  # it was killed, and has taken nothing away
            subprocess.run([*self._program, "--take-away", *self._places], check=False)

    def _serve(self, line: socket.socket, answer: Callable[[bytes], bytes]) -> None:
        threading.Thread(target=_answer_all, args=(line, answer), daemon=True).start()


def _make_link(link: Path, target: Path) -> None:
    if link.is_symlink() and not os.path.exists(link):  # noqa: PTH110 (a dead mount fails in Path.exists)
        link.unlink()  # of a twin that died
    try:
        link.symlink_to(target)
    except FileExistsError:
        raise HardwareError(f"{link} is there already: choose another number for the twin's bus") from None


def _answer_all(line: socket.socket, answer: Callable[[bytes], bytes]) -> None:
    """Answer questions until the line ends."""
    while True:
        try:
            packet = line.recv(_MAX_PACKET)
            if not packet:
                return
            line.send(_reply(packet, answer))
        except OSError:
            return
        except BaseException:
            line.close()  # nobody waits for an answer that does not come
            raise


def _reply(packet: bytes, answer: Callable[[bytes], bytes]) -> bytes:
    try:
        return _ERRNO.pack(0) + answer(packet)
    except OSError as error:
        return _ERRNO.pack(error.errno or errno.EIO)


def _transfer(bus: I2cBus, packet: bytes) -> bytes:
    """Do the transaction of a packet."""
    messages, place = [], 0
    while place < len(packet):
        address, reads, length = _MESSAGE.unpack_from(packet, place)
        place += _MESSAGE.size
        if reads:
            messages.append(I2cMessage(address, length=length, reads=True))
        else:
            messages.append(I2cMessage(address, packet[place : place + length]))
            place += length
    return b"".join(bus.transfer(messages))


def _file_request(tree: FileTree, packet: bytes) -> bytes:
    """Answer a question about the tree."""
    kind, rest = packet[:1], packet[1:]
    text, _, data = rest.partition(b"\0")
    path = tuple(part for part in text.decode().split("/") if part)
    if kind == b"S":
        mode = tree.mode(path)
        return struct.pack("<II", mode, 0 if stat.S_ISDIR(mode) else 4096)
    if kind == b"L":
        return "\n".join(tree.names(path)).encode()
    if kind == b"R":
        return tree.read(path).encode()
    tree.write(path, data.decode("utf-8", "replace"))
    return b""
