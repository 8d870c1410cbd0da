"""Where the MJCF files are, in a checkout as in an installed wheel."""

from __future__ import annotations

from pathlib import Path


def asset_path(name: str) -> Path:
    """Path of a file of `assets/`.

    Args:
        name: file name, such as ``car.xml``.

    Raises:
        FileNotFoundError: no such asset.
    """
    here = Path(__file__).resolve().parent
    for folder in (here / "assets", here.parent / "assets"):
        if (folder / name).is_file():
            return folder / name
    raise FileNotFoundError(f"no asset '{name}' in {here / 'assets'} or {here.parent / 'assets'}")
