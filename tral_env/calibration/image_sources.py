"""Images from files, folders, patterns, videos and cameras, one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from glob import glob
from pathlib import Path

import cv2
import numpy as np

from tral_env.arrays import Image
from tral_env.errors import ConfigError, HardwareError

IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp")
"""A file with one of these suffixes is an image."""
VIDEOS = (".mp4", ".avi", ".mkv", ".mov", ".webm", ".m4v")
"""A file with one of these suffixes is a video."""
DEVICE = "/dev/video"
"""A source that begins so is a camera; it gives images until the caller stops asking."""


def find_sources(sources: Sequence[str]) -> list[str]:
    """Replace folders and patterns by the files that are in them, sorted by name.

    Args:
        sources: images, videos, folders, patterns such as "shots/*.png", or a camera such as "/dev/video0".

    Raises:
        ConfigError: a source is not there, holds no image or video, or is neither.
    """
    return [found for source in sources for found in _expand(source)]


def _expand(source: str) -> list[str]:
    path = Path(source)
    if source.startswith(DEVICE):
        return [source]
    if path.is_dir():
        found = sorted(str(file) for file in path.iterdir() if file.suffix.lower() in IMAGES + VIDEOS)
        if not found:
            raise ConfigError(f"{source}: no image or video in this folder. Allowed: {', '.join(IMAGES + VIDEOS)}")
        return found
    found = [source] if path.is_file() else sorted(glob(source))  # noqa: PTH207 (the pattern may be absolute)
    if not found:
        camera = f"; camera {source} is {DEVICE}{source}" if source.isdecimal() else ""
        raise ConfigError(f"{source}: no such file or folder, and no pattern that fits a file{camera}")
    for name in found:
        if Path(name).suffix.lower() not in IMAGES + VIDEOS:
            raise ConfigError(f"{name}: neither image nor video. Allowed: {', '.join(IMAGES + VIDEOS)}")
    return found


def frame_count(source: str) -> int:
    """Number of frames that a video says it has; 0 for an image, a camera, or a video that does not say."""
    if Path(source).suffix.lower() not in VIDEOS:
        return 0
    capture = cv2.VideoCapture(source)
    try:
        return max(int(capture.get(cv2.CAP_PROP_FRAME_COUNT)), 0) if capture.isOpened() else 0
    finally:
        capture.release()


def read_images(sources: Sequence[str], every: int = 1) -> Iterator[tuple[str, Image | None]]:
    """Read images one after the other: name and (h, w, 3) BGR; None for an image or video that cannot be read.

    Args:
        sources: what `find_sources` gave.
        every: one in so many frames of a video or a camera counts.

    Raises:
        HardwareError: a camera cannot be opened, or stops.
    """
    for source in sources:
        if Path(source).suffix.lower() in IMAGES:
            yield source, _still(source)
        else:
            yield from _moving(source, every)


def _still(source: str) -> Image | None:
    try:
        image = cv2.imread(source, cv2.IMREAD_COLOR)
    except cv2.error:  # a damaged header can claim an image larger than OpenCV takes
        return None
    return None if image is None else np.asarray(image, np.uint8)


def _moving(source: str, every: int) -> Iterator[tuple[str, Image | None]]:
    device = source.startswith(DEVICE)
    capture = cv2.VideoCapture(source)
    try:
        if not capture.isOpened():
            if device:
                raise HardwareError(f"{source}: no camera, or another program uses it")
            yield source, None
            return
        index = 0
        while capture.grab():
            if index % every == 0:
                whole, image = capture.retrieve()
                if whole:
                    yield f"{source}:{index}", np.asarray(image, np.uint8)
            index += 1
        if device:
            raise HardwareError(f"{source}: the camera stopped after {index} frames")
        if index == 0:
            yield source, None
    finally:
        capture.release()
