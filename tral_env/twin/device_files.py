"""Device files of the twin, as a program of its own: FUSE on one side, a socket to the twin on the other.

``device_files.py I2C_NAME I2C_SOCKET TREE_SOCKET LIFE_SOCKET MOUNT LINK DISK`` shows them, and ``--take-away MOUNT LINK
DISK`` takes away what a killed one left. It runs by path, without this package, and holds no model: each transaction
goes to the twin. When the twin ends, however it ends, this program takes the mount away. The requests of i2c-dev are
those of the kernel's documentation, Documentation/i2c/dev-interface.rst.
"""

from __future__ import annotations

import ctypes
import errno
import os
import signal
import socket
import stat
import struct
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import mfusepy

MESSAGE = struct.Struct("<HHH")
"""Of each message of a transaction: address, whether it reads, length; behind it the bytes that it writes."""
ERRNO = struct.Struct("<i")
"""An answer begins so; 0: no error."""
MAX_PACKET = 65536
STAT, LIST, READ, WRITE = b"S", b"L", b"R", b"W"
"""Requests about the tree of files, before the path; behind the path of `WRITE` a zero byte and the bytes."""
READY = b"ready"
DISK_SIZE = b"size=64m"
_RETRIES, _TIMEOUT, _SLAVE, _TENBIT, _FUNCS, _SLAVE_FORCE, _RDWR, _PEC, _SMBUS = (
    0x0701, 0x0702, 0x0703, 0x0704, 0x0705, 0x0706, 0x0707, 0x0708, 0x0720,
)  # fmt: skip
_QUICK, _BYTE, _BYTE_DATA, _WORD_DATA, _I2C_BLOCK = 0, 1, 2, 3, 8
_FUNCTIONS = 0x0C7F0001
"""I2C itself, and of SMBus quick, byte, byte data, word data and I2C blocks."""
_MAX_MESSAGES, _MAX_BYTES = 42, 8192
RDWR, MSG = struct.Struct("PI4x"), struct.Struct("HHH2xP")
"""The structures i2c_rdwr_ioctl_data and i2c_msg."""
_MNT_DETACH = 2
_libc = ctypes.CDLL(None, use_errno=True)


class _Span(ctypes.Structure):
    _fields_ = [("base", ctypes.c_void_p), ("length", ctypes.c_size_t)]


def _copy(call: Any, pid: int, address: int, buffer: Any, length: int) -> None:
    here, there = _Span(ctypes.addressof(buffer), length), _Span(address, length)
    if length and call(pid, ctypes.byref(here), 1, ctypes.byref(there), 1, 0) != length:
        raise OSError(ctypes.get_errno() or errno.EFAULT, "the caller's memory")


def peek(pid: int, address: int, length: int) -> bytes:
    """Bytes of another process's memory."""
    buffer = ctypes.create_string_buffer(length)
    _copy(_libc.process_vm_readv, pid, address, buffer, length)
    return buffer.raw


def poke(pid: int, address: int, data: bytes) -> None:
    """Write bytes into another process's memory."""
    _copy(_libc.process_vm_writev, pid, address, ctypes.create_string_buffer(data, len(data)), len(data))


for _name in ("process_vm_readv", "process_vm_writev"):
    _call = getattr(_libc, _name)
    _call.restype = ctypes.c_ssize_t
    _spans = [ctypes.c_void_p, ctypes.c_ulong]
    _call.argtypes = [ctypes.c_int, *_spans, *_spans, ctypes.c_ulong]


class TwinSocket:
    """A socket to the twin: one question and its answer at a time."""

    def __init__(self, number: int) -> None:
        """Take a socket over by its file descriptor."""
        self._socket, self._lock = socket.socket(fileno=number), threading.Lock()

    def ask(self, question: bytes) -> bytes:
        """The answer of the twin.

        Raises:
            OSError: the twin says so, or it is gone.
        """
        with self._lock:
            self._socket.send(question)
            answer = self._socket.recv(MAX_PACKET)
        if not answer:
            raise OSError(errno.ENODEV, "the twin has ended")
        (number,) = ERRNO.unpack_from(answer)
        if number:
            raise OSError(number, os.strerror(number))
        return answer[ERRNO.size :]


class I2cFile:
    """What open, read, write and ioctl do to a bus."""

    def __init__(self, line: TwinSocket) -> None:
        """Ask the twin for each transaction."""
        self._line = line
        self.addresses: dict[int, int] = {}
        """File handle -> address that I2C_SLAVE set."""

    def transfer(self, *messages: tuple[int, bytes | int]) -> list[bytes]:
        """Do a transaction of messages: address, and bytes to write or the number of bytes to read."""
        packed = b"".join(
            MESSAGE.pack(address, 1, part) if isinstance(part, int) else MESSAGE.pack(address, 0, len(part)) + part
            for address, part in messages
        )
        answer, found = self._line.ask(packed), []
        for _, part in messages:
            if isinstance(part, int):
                found.append(answer[:part])
                answer = answer[part:]
        return found

    def read(self, handle: int, length: int) -> bytes:
        """read(2)."""
        return self.transfer((self._address(handle), min(length, _MAX_BYTES)))[0]

    def write(self, handle: int, data: bytes) -> int:
        """write(2)."""
        self.transfer((self._address(handle), data))
        return len(data)

    def ioctl(self, handle: int, command: int, argument: int, pid: int) -> int:
        """ioctl(2), with pointers into the memory of the caller."""
        if command in (_SLAVE, _SLAVE_FORCE):
            self.addresses[handle] = argument
        elif command == _FUNCS:
            poke(pid, argument, struct.pack("Q", _FUNCTIONS))
        elif command == _RDWR:
            return self._rdwr(argument, pid)
        elif command == _SMBUS:
            self._smbus(self._address(handle), argument, pid)
        elif command not in (_RETRIES, _TIMEOUT, _TENBIT, _PEC):
            raise OSError(errno.ENOTTY, "no request of i2c-dev")
        return 0

    def _address(self, handle: int) -> int:
        return self.addresses.get(handle, 0)

    def _rdwr(self, argument: int, pid: int) -> int:
        count: int
        array, count = RDWR.unpack(peek(pid, argument, RDWR.size))
        if count > _MAX_MESSAGES:
            raise OSError(errno.EINVAL, "too many messages")
        messages: list[tuple[int, bytes | int]] = []
        buffers = []
        for k in range(count):
            address, flags, length, buffer = MSG.unpack(peek(pid, array + MSG.size * k, MSG.size))
            if length > _MAX_BYTES:
                raise OSError(errno.EINVAL, "too many bytes")
            messages.append((address, length if flags & 1 else peek(pid, buffer, length)))
            buffers += [buffer] if flags & 1 else []
        for buffer, found in zip(buffers, self.transfer(*messages), strict=True):
            poke(pid, buffer, found)
        return count

    def _smbus(self, address: int, argument: int, pid: int) -> None:
        reads, command, size, data = struct.unpack("BB2xIP", peek(pid, argument, 16))
        register = bytes([command])
        if size == _QUICK:
            self.transfer((address, 0) if reads else (address, b""))
        elif size == _BYTE:
            if reads:
                poke(pid, data, self.transfer((address, 1))[0])
            else:
                self.transfer((address, register))
        elif size in (_BYTE_DATA, _WORD_DATA):
            length = 1 if size == _BYTE_DATA else 2
            if reads:
                poke(pid, data, self.transfer((address, register), (address, length))[0])
            else:
                self.transfer((address, register + peek(pid, data, length)))
        elif size == _I2C_BLOCK:
            length = min(peek(pid, data, 1)[0], 32)
            if reads:
                poke(pid, data, bytes([length]) + self.transfer((address, register), (address, length))[0])
            else:
                self.transfer((address, register + peek(pid, data + 1, length)))
        else:
            raise OSError(errno.EOPNOTSUPP, "no SMBus blocks on this adapter")


class Files(mfusepy.Operations):  # type: ignore[misc]
    """The mount: the bus as a file, beside it the tree of files that the twin tells."""

    use_ns = True

    def __init__(self, i2c_name: str, i2c: I2cFile, tree: TwinSocket, ready: Callable[[], None]) -> None:
        """Show a bus under a name."""
        self._i2c_path, self._i2c, self._tree, self._ready = f"/{i2c_name}", i2c, tree, ready
        self._handle = 0

    def init(self, path: str) -> None:
        """Tell that the mount stands."""
        self._ready()

    def getattr(self, path: str, fh: Any = None) -> dict[str, int]:
        """stat(2)."""
        if path == self._i2c_path:
            mode, size = stat.S_IFREG | 0o660, 0
        else:
            mode, size = struct.unpack("<II", self._tree.ask(STAT + path.encode()))
        times = dict.fromkeys(("st_atime", "st_mtime", "st_ctime"), time.time_ns())
        return {"st_mode": mode, "st_nlink": 1, "st_size": size, **times}

    def readdir(self, path: str, fh: Any) -> list[str]:
        """Names in a folder."""
        names = self._tree.ask(LIST + path.encode()).decode().split("\n")
        return [".", "..", *filter(None, names), *([self._i2c_path[1:]] if path == "/" else [])]

    def open(self, path: str, fi: Any) -> int:
        """open(2): each opening has an address of its own."""
        self._handle += 1
        fi.fh, fi.direct_io = self._handle, 1
        return 0

    def release(self, path: str, fi: Any) -> int:
        """close(2)."""
        self._i2c.addresses.pop(fi.fh, None)
        return 0

    def truncate(self, path: str, length: int, fh: Any = None) -> int:
        """Take the truncation of an open for writing, as sysfs does."""
        return 0

    def read(self, path: str, size: int, offset: int, fi: Any) -> bytes:
        """read(2)."""
        if path == self._i2c_path:
            return self._i2c.read(fi.fh, size)
        return self._tree.ask(READ + path.encode())[offset : offset + size]

    def write(self, path: str, data: bytes, offset: int, fi: Any) -> int:
        """write(2)."""
        if path == self._i2c_path:
            return self._i2c.write(fi.fh, data)
        self._tree.ask(WRITE + path.encode() + b"\0" + data)
        return len(data)

    def ioctl(self, path: str, cmd: int, arg: int, fi: Any, flags: int, data: Any) -> int:
        """ioctl(2) of the bus."""
        if path != self._i2c_path:
            raise OSError(errno.ENOTTY, "no requests here")
        return self._i2c.ioctl(fi.fh, cmd & 0xFFFFFFFF, arg or 0, mfusepy.fuse_get_context()[2])


def take_away(mount: str, link: str, disk: str) -> None:
    """Take the mounts away, also those whose program is dead, with their folders and the link into them."""
    for folder in filter(None, (mount, disk)):
        while _libc.umount2(folder.encode(), _MNT_DETACH) == 0:
            pass
        with suppress(OSError):
            os.rmdir(folder)  # noqa: PTH106 (a dead mount fails in Path.exists)
    if link:
        with suppress(OSError):
            if os.readlink(link).startswith(mount):  # noqa: PTH115
                os.unlink(link)  # noqa: PTH108


def mount_disk(disk: str) -> None:
    """Mount a small disk in memory.

    Raises:
        OSError: the kernel refuses.
    """
    os.makedirs(disk, exist_ok=True)  # noqa: PTH103
    if _libc.mount(b"tral-twin", disk.encode(), b"tmpfs", 0, DISK_SIZE) != 0:
        raise OSError(ctypes.get_errno(), f"no disk at {disk}")


def quietly(begin: Callable[[Callable[[], None]], object], ready: Callable[[], object]) -> None:
    """Run a FUSE loop without what libfuse says at its start: it warns of its own default number of threads."""
    told = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    os.close(nowhere)

    def speak_again() -> None:
        os.dup2(told, 2)
        ready()

    begin(speak_again)


def main(arguments: list[str]) -> None:
    """Show the files until the twin ends."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    if arguments[0] == "--take-away":
        return take_away(*arguments[1:])
    name, *numbers, mount, link, disk = arguments
    i2c, tree = (TwinSocket(int(number)) for number in numbers[:2])
    life = socket.socket(fileno=int(numbers[2]))

    def end_with_the_twin() -> None:
        with suppress(OSError):
            life.recv(1)
        take_away(mount, link, disk)
        os._exit(0)

    take_away(mount, "", disk)  # of a twin that died together with this program
    os.makedirs(mount, exist_ok=True)  # noqa: PTH103
    threading.Thread(target=end_with_the_twin, daemon=True).start()
    try:
        if disk:
            mount_disk(disk)
        quietly(
            lambda ready: mfusepy.FUSE(
                Files(name, I2cFile(i2c), tree, ready), mount,
                foreground=True, raw_fi=True, allow_other=True, fsname="tral-twin",
            ),
            lambda: life.sendall(READY),
        )  # fmt: skip
    finally:
        take_away(mount, link, disk)


if __name__ == "__main__":
    main(sys.argv[1:])
