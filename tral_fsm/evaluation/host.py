"""The computer and the versions on which a result depends."""

from __future__ import annotations

import os
import platform
import subprocess
from pathlib import Path
from typing import Any

from tral_env.recording.about import versions


def host() -> dict[str, Any]:
    """CPU, cores, system, versions, and commit; None for the commit outside a checkout."""
    return {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "versions": versions(),
        "commit": _commit(),
    }


def _cpu() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown"


def _commit() -> str | None:
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():  # an installed package is not in its own repository
        return None
    done = subprocess.run(
        ["git", "describe", "--always", "--dirty"],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout.strip() or None
