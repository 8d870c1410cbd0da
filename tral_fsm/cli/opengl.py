"""OpenGL on this machine: which backends there are, and what to do where none works."""

from __future__ import annotations

import importlib
import os
import platform

from tral_env.errors import RenderError

BACKENDS = {"Linux": ("egl", "osmesa", "glfw"), "Darwin": ("cgl", "glfw"), "Windows": ("wgl", "glfw")}
"""Values of MUJOCO_GL worth trying, the best first."""

NEEDS = {
    "egl": "apt install libegl1 libgl1-mesa-dri (Debian, Ubuntu)",
    "osmesa": "apt install libosmesa6 (Debian, Ubuntu), where it still exists",
    "glfw": "needs a screen: run it on a desktop",
}
"""What a backend that does not work may lack."""

REMEDY = (
    "install OpenGL that needs no screen (Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri), "
    "or do without it: tral drive --camera projected --no-video"
)


def backends() -> tuple[str, ...]:
    """Values of MUJOCO_GL worth trying on this system."""
    return BACKENDS.get(platform.system(), BACKENDS["Linux"])


def backend_in_use() -> str:
    """The backend that the environments will use now."""
    wish = os.environ.get("MUJOCO_GL", "").lower()
    screen = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if platform.system() == "Linux":
        return wish or ("glfw" if screen else "egl")
    return wish or backends()[0]


def require_loadable() -> None:
    """Import MuJoCo, which already fails if MUJOCO_GL names a backend whose library is missing.

    Raises:
        RenderError: it fails.
    """
    try:
        importlib.import_module("mujoco")
    # PyOpenGL fails with any of these where a library is missing.
    except (ImportError, AttributeError, OSError, RuntimeError) as error:
        wish = os.environ.get("MUJOCO_GL", "")
        raise RenderError(
            f"MuJoCo does not load with MUJOCO_GL='{wish}' ({error}): unset MUJOCO_GL or set it to one of "
            f"{', '.join(backends())}; `tral doctor` says which works"
        ) from error
