"""How this package was installed, and so the command that installs it again or adds one of its extras."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

DISTRIBUTION = "tral-env"
CPU_TORCH = (
    "without a graphics card, first the CPU build of torch, "
    "whose command the page https://pytorch.org/get-started/locally/ gives for Linux, Pip, CPU"
)
"""What to do before a plain installation of torch brings several gigabytes of CUDA."""
_OF_TORCH = "rl"
"""The extra that brings torch."""


@dataclass(frozen=True, kw_only=True)
class Installation:
    """Where the package comes from, and whether an edit there takes effect at once."""

    clone: Path | None
    """Folder that it was installed from; None: not told, or it is there no more."""
    editable: bool
    """Whether the code of that folder runs itself, and no copy of it."""

    def command(self, extra: str = "", options: str = "") -> str:
        """Clause on where to run which command of pip, such as ``in /home/me/tral, run: pip install -e '.[car]'``.

        Args:
            extra: the extra to add; empty: none.
            options: further options of pip.
        """
        place = self.clone or "a clone of the repository"
        words = ["pip install", options, "-e" if self.editable else "", f"'.[{extra}]'" if extra else "."]
        first = f" ({CPU_TORCH})" if extra == _OF_TORCH else ""
        return f"in {place}, run: {' '.join(word for word in words if word)}{first}"


def installed() -> Installation:
    """How this package was installed, as pip wrote it down (PEP 610); without pip, the folder that holds the code."""
    import json
    from importlib import metadata
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    try:
        told = metadata.distribution(DISTRIBUTION).read_text("direct_url.json")
    except metadata.PackageNotFoundError:
        return Installation(clone=_clone(Path(__file__).parents[1]), editable=True)
    origin = json.loads(told or "{}")
    folder = origin.get("dir_info")
    if folder is None:
        return Installation(clone=None, editable=False)
    path = Path(url2pathname(urlsplit(origin["url"]).path))
    return Installation(clone=_clone(path), editable=bool(folder.get("editable")))


def _clone(folder: Path) -> Path | None:
    return folder if (folder / "pyproject.toml").is_file() else None
