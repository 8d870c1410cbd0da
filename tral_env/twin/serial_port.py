"""A serial board on a pseudo-terminal: frames come in parts, and the line has the faults that lines have."""

from __future__ import annotations

import errno
import os
import random
import threading
import tty
from contextlib import suppress
from pathlib import Path

from tral_env.twin.serial_boards import BoardReadings, SerialBoard

_GARBAGE_SHARE = 0.05
"""Share of bytes that garbage loses, changes or puts in."""


def spoiled(data: bytes, rng: random.Random, share: float = _GARBAGE_SHARE) -> bytes:
    """Bytes as a bad line delivers them: some are lost, some changed, some put in."""
    found = bytearray()
    for byte in data:
        kind = rng.random() / share
        if kind < 1 / 3:
            continue
        found.append(rng.randrange(256) if kind < 2 / 3 else byte)
        if 2 / 3 <= kind < 1:
            found.append(rng.randrange(256))
    return bytes(found)


def parts(data: bytes, rng: random.Random) -> tuple[bytes, bytes]:
    """What of some bytes is delivered now, and what later: a reader may see half a frame."""
    if len(data) < 2 or rng.random() < 0.5:
        return data, b""
    cut = rng.randrange(1, len(data))
    return data[:cut], data[cut:]


class SerialPort:
    """A pseudo-terminal with a link to it, which pyserial opens."""

    def __init__(self, link: Path, board: SerialBoard, seed: int) -> None:
        """Plug the board in.

        Args:
            link: path of the port; it is replaced.
            board: what is behind it.
            seed: of the parts and the garbage.
        """
        self._link, self.board, self._rng = link, board, random.Random(seed)
        self.garbage = False
        """Whether the line spoils bytes, in both directions."""
        self._lock, self._later = threading.Lock(), b""
        self._master: int | None = None
        self.plug_in()

    @property
    def path(self) -> Path:
        """Path of the port."""
        return self._link

    def plug_in(self) -> None:
        """Show the port, if it is unplugged."""
        with self._lock:
            if self._master is not None:
                return
            self._master, self._slave = os.openpty()
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self._link.unlink(missing_ok=True)
            self._link.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        """Take the port away: a program that reads it gets an error."""
        with self._lock:
            if self._master is None:
                return
            os.close(self._slave)
            os.close(self._master)
            self._master = None
            self._later = b""
            self._link.unlink(missing_ok=True)

    def turn(self, readings: BoardReadings, now_s: float) -> None:
        """Hear what the computer sent, and send what is due."""
        with self._lock:
            if self._master is None:
                return
            heard = self._read(self._master)
            answer = self.board.hear(spoiled(heard, self._rng) if self.garbage else heard, now_s)
            said = answer + self.board.speak(readings, now_s)
            now, later = parts(spoiled(said, self._rng) if self.garbage else said, self._rng)
            self._write(self._master, self._later + now)
            self._later = later

    @staticmethod
    def _read(master: int) -> bytes:
        with suppress(BlockingIOError):
            return os.read(master, 4096)
        return b""

    @staticmethod
    def _write(master: int, data: bytes) -> None:
        """Send; what nobody reads is lost, as in a full buffer of the port."""
        try:
            if data:
                os.write(master, data)
        except OSError as error:
            if error.errno not in (errno.EAGAIN, errno.EIO):
                raise
