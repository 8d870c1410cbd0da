"""What a drive depends on: the versions of the program and its libraries, and the files of a policy."""

from __future__ import annotations

import hashlib
import sys
from importlib import metadata

_PACKAGES = ("tral-env", "mujoco", "gymnasium", "numpy", "opencv-python-headless", "mcap", "smbus2")


def versions() -> dict[str, str]:
    """Versions of Python and of the packages on which a drive depends; one that is not installed is left out."""
    found = {"python": ".".join(str(part) for part in sys.version_info[:3])}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def digest(data: bytes) -> str:
    """SHA-256 of a file, 64 hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()
