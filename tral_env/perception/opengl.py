"""Which OpenGL MuJoCo uses on this machine, by MUJOCO_GL and the screen, and what to do where none works."""

from __future__ import annotations

import importlib
import os
import platform

from tral_env.errors import RenderError

VARIABLE = "MUJOCO_GL"
"""The user chooses by this environment variable."""

BACKENDS = {"Linux": ("egl", "osmesa", "glfw"), "Darwin": ("cgl", "glfw"), "Windows": ("wgl", "glfw")}
"""MUJOCO_GL may have these values, the best first."""

NEEDS = {
    "egl": "apt install libegl1 libgl1-mesa-dri (Debian, Ubuntu)",
    "osmesa": "apt install libosmesa6 (Debian, Ubuntu), where it still exists",
    "glfw": "needs a screen: run it on a desktop",
}
"""A backend that does not work may lack this."""

REMEDY = (
    f"Set {VARIABLE}=egl (Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri) or {VARIABLE}=osmesa (apt install "
    'libosmesa6) before Python starts, or do without OpenGL: camera="projected", render_mode=None'
)
"""A program without an OpenGL context tells its user so."""


def backends() -> tuple[str, ...]:
    """Values of MUJOCO_GL worth trying on this system."""
    return BACKENDS.get(platform.system(), BACKENDS["Linux"])


def wish() -> str:
    """The value of MUJOCO_GL; empty: it is not set."""
    return os.environ.get(VARIABLE, "")


def backend_in_use() -> str:
    """The backend that the environments will use now."""
    if wanted := wish().lower():
        return wanted
    if platform.system() == "Linux":
        return "glfw" if _screen() else "egl"
    return backends()[0]


def chooses_egl() -> bool:
    """Whether this program has to choose EGL: without a wish and a screen MuJoCo chooses GLFW, which fails on Linux."""
    return not wish() and backend_in_use() == "egl"


def _screen() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def require_loadable() -> None:
    """Import MuJoCo, which already fails if MUJOCO_GL names a backend whose library is missing.

    Raises:
        RenderError: the import fails.
    """
    try:
        importlib.import_module("mujoco")
    # PyOpenGL fails with any of these where a library is missing.
    except (ImportError, AttributeError, OSError, RuntimeError) as error:
        raise RenderError(
            f"MuJoCo does not load with MUJOCO_GL='{wish()}' ({error}): unset MUJOCO_GL or set it to one of "
            f"{', '.join(backends())}; `tral doctor` says which works"
        ) from error
