"""OpenGL without a screen: which backend MuJoCo shall use, and what to do where there is none."""

from __future__ import annotations

import importlib
import os
import sys

from tral_env.errors import RenderError

BACKENDS = {"linux": ("egl", "osmesa", "glfw"), "darwin": ("cgl", "glfw"), "win32": ("wgl", "glfw")}
"""Values of MUJOCO_GL worth trying, the best first."""

REMEDY = (
    "install OpenGL without a screen (Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri) and set MUJOCO_GL=egl; "
    "`tral doctor` tries every backend; `--camera projected --no-video` needs none"
)


def backends() -> tuple[str, ...]:
    """Values of MUJOCO_GL worth trying on this system."""
    return BACKENDS.get(sys.platform, BACKENDS["linux"])


def choose_backend() -> None:
    """Choose EGL on a Linux machine without a screen, if MUJOCO_GL says nothing. Before MuJoCo is imported.

    MuJoCo itself would choose GLFW, which needs a screen.
    """
    screen = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform == "linux" and not screen:
        os.environ.setdefault("MUJOCO_GL", "egl")


def require() -> None:
    """Choose a backend and load it.

    Raises:
        RenderError: it cannot be loaded.
    """
    choose_backend()
    try:
        importlib.import_module("mujoco")
    # PyOpenGL fails with any of these where a library is missing.
    except (ImportError, AttributeError, OSError, RuntimeError) as error:
        backend = os.environ.get("MUJOCO_GL", "")
        raise RenderError(f"OpenGL backend MUJOCO_GL='{backend}' does not load ({error}): {REMEDY}") from error
