"""Which OpenGL MuJoCo uses on this machine, by MUJOCO_GL and the screen, and what to do where none works."""

from __future__ import annotations

import importlib
import os
import platform

from tral_env.errors import RenderError

VARIABLE = "MUJOCO_GL"
"""The user chooses by this environment variable."""

_APT_EGL = "apt install libegl1 libgl1-mesa-dri"
_APT_OSMESA = "apt install libosmesa6"

BACKENDS = {"Linux": ("egl", "osmesa", "glfw"), "Darwin": ("cgl", "glfw"), "Windows": ("wgl", "glfw")}
"""MUJOCO_GL may have these values, the best first."""

NEEDS = {
    "egl": f"{_APT_EGL} (Debian, Ubuntu)",
    "osmesa": f"{_APT_OSMESA} (Debian, Ubuntu), where it still exists",
    "glfw": "needs a screen: run it on a desktop",
}
"""A backend that does not work may lack this."""

REMEDY = (
    f"Set {VARIABLE}=egl (Debian, Ubuntu: {_APT_EGL}) or {VARIABLE}=osmesa ({_APT_OSMESA}) "
    'before Python starts, or do without OpenGL: camera="projected", render_mode=None'
)
"""A program without an OpenGL context tells its user so."""


def backends() -> tuple[str, ...]:
    """Values of MUJOCO_GL worth trying on this system."""
    return BACKENDS.get(platform.system(), BACKENDS["Linux"])


def chosen() -> str:
    """The value of MUJOCO_GL; empty: it is not set."""
    return os.environ.get(VARIABLE, "")


def backend_in_use() -> str:
    """The backend that the environments will use now."""
    if backend := chosen().lower():
        return backend
    if platform.system() == "Linux":
        return "glfw" if _screen() else "egl"
    return backends()[0]


def chooses_egl() -> bool:
    """Whether this program has to choose EGL: without choice and screen MuJoCo takes GLFW, which fails on Linux."""
    return not chosen() and backend_in_use() == "egl"


def works_in_threads() -> bool:
    """Whether a thread beside the main one can open OpenGL: a window, which GLFW needs, belongs to the main thread."""
    return backend_in_use() in ("egl", "osmesa", "cgl")


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
            f"MuJoCo does not load with MUJOCO_GL='{chosen()}' ({error}): unset MUJOCO_GL or set it to one of "
            f"{', '.join(backends())}; `tral doctor` says which works"
        ) from error
