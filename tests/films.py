"""What a video file holds."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np


class Film(NamedTuple):
    """The pictures of a file, RGB, and their rate."""

    pictures: list[np.ndarray]
    fps: float

    @property
    def seconds(self) -> float:
        return len(self.pictures) / self.fps


def film(path: Path) -> Film:
    """Read a file with another decoder than the one that wrote it."""
    capture = cv2.VideoCapture(str(path))
    pictures = []
    while (read := capture.read())[0]:
        pictures.append(read[1][..., ::-1])
    fps = capture.get(cv2.CAP_PROP_FPS)
    capture.release()
    return Film(pictures, fps)
