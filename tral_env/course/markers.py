"""ArUco markers of DICT_4X4_50 as images and as textures of MuJoCo."""

from __future__ import annotations

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from tral_env.geometry import MARKER_MODULES, MARKER_QUIET_MODULES

MARKER_IDS = tuple(range(43))
"""Markers that a course can hold: 0 to 39 on gates, 40 to 42 at crossings."""
PIXELS_PER_MODULE = 8
"""Of the texture. From 0.6 to 7 m the detector reads 4, 8, 16 and 32 alike; mip-mapping smooths them from afar."""


def marker_image(marker: int) -> NDArray[np.uint8]:
    """Marker with its quiet zone, upright, (64, 64) grey values.

    Args:
        marker: id in DICT_4X4_50.
    """
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    code = cv2.aruco.generateImageMarker(dictionary, marker, MARKER_MODULES * PIXELS_PER_MODULE)
    return np.pad(code, MARKER_QUIET_MODULES * PIXELS_PER_MODULE, constant_values=255)


def material_name(marker: int) -> str:
    """Name of the material that shows a marker."""
    return f"marker_{marker:02d}"


def add_materials(spec: mujoco.MjSpec) -> None:
    """Add a texture and a material for each of `MARKER_IDS`, to be shown on the +z face of a flat box."""
    for marker in MARKER_IDS:
        image = np.repeat(marker_image(marker)[..., None], 3, axis=2)
        name = material_name(marker)
        texture = spec.add_texture(
            name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=image.shape[1], height=image.shape[0], nchannel=3
        )
        texture.data = image.tobytes()
        # Matt, or the lamps' reflections would wash the code out.
        material = spec.add_material(name=name, specular=0.0, shininess=0.0)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
