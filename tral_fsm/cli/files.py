"""Files that commands write."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from tral_env.errors import ConfigError, nearest


def suffix_of(out: Path, allowed: Collection[str]) -> str:
    """Suffix of a file in small letters, so that a.PNG is a PNG file.

    Args:
        out: value of the option --out.
        allowed: suffixes in small letters.

    Raises:
        ConfigError: the suffix is not allowed.
    """
    suffix = out.suffix.lower()
    if suffix not in allowed:
        raise ConfigError(f"--out {out}: got suffix '{out.suffix}': {nearest(suffix, allowed)}")
    return suffix
