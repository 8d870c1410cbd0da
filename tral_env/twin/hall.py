"""The hall sensor's pin: edges as the kernel tells them, over a socket, and a reader that speaks like a gpiod request.

A kernel with gpio-sim could show a real chip; a socket works everywhere. It sends what a line of a GPIO chip sends to
who reads it: structures gpio_v2_line_event of the kernel, whose time stamps are those of CLOCK_MONOTONIC.
"""

from __future__ import annotations

import errno
import select
import socket
import struct
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tral_env.errors import HardwareError
from tral_env.hardware.physical import Physical
from tral_env.hardware.sensors import HallCounter

HALL_SOCKET = "hall"
"""Name of the socket in the twin's folder."""
_EVENT = struct.Struct("=QIIII24x")
"""Of struct gpio_v2_line_event: timestamp_ns, id, offset, seqno, line_seqno."""
NEAR, AWAY = 1, 2
"""Identities of events, those of a rising and a falling edge: a pin that is active while a magnet is near."""
NEAR_S = 0.0005
"""A magnet is near for so long, s. Source: choice; the shortest that a magnet of 3 mm takes is 1.2 ms."""
_NS = 1_000_000_000


@dataclass(frozen=True)
class EdgeEvent:
    """An edge, with the names of gpiod."""

    timestamp_ns: int
    """Time of the edge on CLOCK_MONOTONIC, ns."""
    event_type: object
    """`NEAR` or `AWAY`, or what the reader calls them."""
    line_offset: int
    global_seqno: int
    line_seqno: int
    """Counts all edges: a gap tells that some were lost."""

    @classmethod
    def unpack(cls, data: bytes, kinds: Callable[[int], object] = int) -> EdgeEvent:
        """An event from the kernel's structure; `kinds` makes an identity what the reader calls it."""
        timestamp_ns, kind, *numbers = _EVENT.unpack(data)
        return cls(timestamp_ns, kinds(kind), *numbers)


class HallPin:
    """The twin's end: a program that connects to the socket hears each edge from then on."""

    def __init__(self, path: Path, offset: int = 17) -> None:
        """Listen.

        Args:
            path: of the socket.
            offset: number of the line, as the events tell it.
        """
        self._path, self._offset = path, offset
        self._readers: list[socket.socket] = []
        self._lock, self._count = threading.Lock(), 0
        path.unlink(missing_ok=True)
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listener.bind(str(path))
        self._listener.listen()
        threading.Thread(target=self._accept, daemon=True).start()

    def send(self, edges_s: Sequence[float]) -> None:
        """Tell when magnets came near, s; a slow reader loses edges, as with a full FIFO of the kernel."""
        events = sorted((edge_s + late_s, kind) for edge_s in edges_s for late_s, kind in ((0.0, NEAR), (NEAR_S, AWAY)))
        with self._lock:
            for when_s, kind in events:
                self._count += 1
                event = _EVENT.pack(round(when_s * _NS), kind, self._offset, self._count, self._count)
                self._readers = [reader for reader in self._readers if _send(reader, event)]

    def close(self) -> None:
        """End all connections, and remove the socket."""
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        with self._lock:
            for reader in self._readers:
                reader.close()
        self._path.unlink(missing_ok=True)

    def _accept(self) -> None:
        while True:
            try:
                reader, _ = self._listener.accept()
            except OSError:
                return
            reader.setblocking(False)
            with self._lock:
                self._readers.append(reader)


def _send(reader: socket.socket, event: bytes) -> bool:
    """Whether the reader is still there."""
    try:
        reader.send(event)
    except BlockingIOError:
        return True
    except OSError:
        reader.close()
        return False
    return True


class LineRequest(Physical):
    """The reader's end: the part of ``gpiod.LineRequest`` that a reader of edges uses."""

    def __init__(self, path: Path, kinds: Callable[[int], object] = int) -> None:
        """Connect to the pin of a twin.

        Args:
            path: of the pin's socket.
            kinds: makes an event's number what the reader compares it with, such as ``gpiod.EdgeEvent.Type``.

        Raises:
            HardwareError: no twin is there.
        """
        self._socket, self._kinds = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET), kinds
        try:
            self._socket.connect(str(path))
        except OSError as error:
            self._socket.close()
            raise HardwareError(f"no hall sensor at {path} ({error.strerror}): is the twin up?") from error
        self.fd = self._socket.fileno()

    def wait_edge_events(self, timeout: float | None = None) -> bool:
        """Whether an edge waits, or comes within a time, s; None: wait for ever."""
        return bool(select.select([self._socket], [], [], timeout)[0])

    def read_edge_events(self, max_events: int = 64) -> list[EdgeEvent]:
        """The edges that wait; at least one, and it waits for that.

        Raises:
            OSError: the twin is gone.
        """
        events = [self._read()]
        while len(events) < max_events and self.wait_edge_events(0.0):
            events.append(self._read())
        return events

    def release(self) -> None:
        """Let go of the line."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _read(self) -> EdgeEvent:
        data = self._socket.recv(_EVENT.size)
        if not data:
            raise OSError(errno.ENODEV, "the hall sensor's pin is gone")
        return EdgeEvent.unpack(data, self._kinds)


@dataclass(frozen=True, kw_only=True)
class TwinHallOptions:
    """The pin of a twin as a sensor of a car file."""

    path: str
    """Path of the pin's socket, as `tral twin up` tells it."""

    def open(self, clock: Callable[[], float], sleep: Callable[[float], None]) -> TwinHall:
        """Connect; see `TwinHall`."""
        return TwinHall(Path(self.path))


class TwinHall(HallCounter):
    """`HallCounter` at the pin of a twin: it counts each magnet, with the time of its edge."""

    def __init__(self, path: Path) -> None:
        """Connect; a thread hears the edges.

        Raises:
            HardwareError: no twin is there.
        """
        self._edge_s = 0.0
        super().__init__(clock=lambda: self._edge_s)
        self._request = LineRequest(path)
        threading.Thread(target=self._hear, daemon=True).start()

    def stop(self) -> None:
        """Let go of the pin."""
        self._request.release()

    def _hear(self) -> None:
        while True:
            try:
                events = self._request.read_edge_events()
            except (OSError, ValueError):  # released, or the twin is gone
                return
            for event in events:
                if event.event_type == NEAR:
                    self._edge_s = event.timestamp_ns / _NS
                    self.edge()
