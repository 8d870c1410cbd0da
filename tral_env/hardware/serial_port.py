"""Serial ports of the boards of the original cars: 8 data bits, no parity, 1 stop bit, nothing that waits."""

from __future__ import annotations

import os
from typing import Any

from tral_env.errors import HardwareError, MissingExtraError


def open_port(port: str, baud: int) -> Any:
    """Open a port; two processes may have it open, one that writes and one that reads.

    Args:
        port: path of its device file.
        baud: bits in a second.

    Returns:
        A ``serial.Serial`` whose read gives what waits.

    Raises:
        MissingExtraError: pyserial is not installed.
        HardwareError: the port cannot be opened.
    """
    try:
        import serial
    except ImportError as error:
        raise MissingExtraError("pyserial", "car", "the serial board of the car") from error
    try:
        return serial.Serial(port, baud, timeout=0)
    except (OSError, ValueError) as error:
        raise HardwareError(
            f"cannot open the serial port {port} ({error}). Is the board's plug in? Add the user to the group dialout; "
            "`ls /dev/serial/by-id` lists the boards that are there"
        ) from error


def write_at_once(port: Any, data: bytes) -> None:
    """Write bytes, or fail; never wait.

    pyserial's own write waits for a port that takes nothing, and with a limit fails after a write that was only slow.

    Raises:
        BlockingIOError: the port takes nothing now.
        OSError: the port is lost, or took a part.
    """
    taken = os.write(port.fileno(), data)
    if taken < len(data):
        raise OSError(f"the serial port took {taken} of {len(data)} bytes")
