"""Draws into an image what is seen in it: the markers, the gates and what is wrong."""

from __future__ import annotations

import math
import textwrap

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.perception.sight import Place, Sight

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_WHITE: Colour = (255, 255, 255)
_GREEN: Colour = (90, 220, 90)
_YELLOW: Colour = (255, 200, 60)
_RED: Colour = (255, 95, 80)


def place_text(place: Place) -> str:
    """A place in words, such as "2.98 m, 13.1 deg left"."""
    degrees = math.degrees(place.bearing)
    side = "ahead" if abs(degrees) < 0.05 else f"{abs(degrees):.1f} deg {'left' if degrees > 0 else 'right'}"
    return f"{place.distance:.2f} m, {side}"


def annotated(image: Image, sight: Sight) -> Image:
    """Draw what is seen into a copy of an image.

    Args:
        image: (h, w, 3) RGB, uint8.
        sight: what it shows.
    """
    drawn = image.copy()
    labels = _Labels(drawn)
    if sight.problems:
        letters = max(int(image.shape[1] / (11.5 * labels.size)), 20)
        problems = [line for problem in sight.problems for line in textwrap.wrap(problem, letters)]
        labels.write(problems, (image.shape[1] / 2, 0.0), _RED)
    _draw_outlines(drawn, sight, labels.size)
    for marker in sight.markers:
        lines = [str(marker.id), marker.meaning, *([place_text(marker.place)] if marker.place else [])]
        low = float(marker.corners[:, 0].mean()), float(marker.corners[:, 1].max()) + 14 * labels.size
        labels.write(lines, low, _WHITE)
    for gate in sight.gates:
        lines = [f"gate {gate.number}{': left for right' if gate.swapped else ''}"]
        lines += [place_text(gate.place)] if gate.place else []
        corners = np.concatenate([gate.left.corners, gate.right.corners])
        high = float(corners[:, 0].mean()), float(corners[:, 1].min()) - 24 * labels.size
        labels.write(lines, high, _RED if gate.swapped else _GREEN, up=True)
    return drawn


def _draw_outlines(image: Image, sight: Sight, size: float) -> None:
    """Draw a line through each gate, and each marker with a dot at its upper left corner, as printed."""
    for gate in sight.gates:
        ends = [tuple(int(v) for v in np.rint(post.corners.mean(axis=0))) for post in (gate.left, gate.right)]
        colour = _RED if gate.swapped else _GREEN
        cv2.line(image, ends[0], ends[1], colour, max(round(2 * size), 1), cv2.LINE_AA)
    for marker in sight.markers:
        corners = np.rint(marker.corners).astype(np.int32)
        cv2.polylines(image, [corners], True, _GREEN, max(round(3 * size), 1), cv2.LINE_AA)
        dot = int(corners[0, 0]), int(corners[0, 1])
        cv2.circle(image, dot, max(round(6 * size), 2), _YELLOW, cv2.FILLED, cv2.LINE_AA)


class _Labels:
    """Texts on a dark ground in an image, none over another as long as there is room."""

    def __init__(self, image: Image) -> None:
        self._image = image
        self.size = max(image.shape[1] / 1000, 0.45)
        """1 in an image 1000 px wide."""
        self._taken: list[tuple[int, int, int, int]] = []

    def write(self, lines: list[str], at: tuple[float, float], colour: Colour, *, up: bool = False) -> None:
        """Write lines, centred below a place or, with `up`, above it."""
        scale, high, edge = 0.62 * self.size, round(26 * self.size), round(8 * self.size)
        width = max(cv2.getTextSize(line, _FONT, scale, 1)[0][0] for line in lines) + 2 * edge
        height = high * len(lines) + edge
        left = int(np.clip(at[0] - width / 2, 0, max(self._image.shape[1] - width, 0)))
        top = self._free(left, int(at[1]) - (height if up else 0), width, height, up=up)
        part = self._image[top : top + height, left : left + width]
        part[:] = (part * 0.25).astype(np.uint8)
        weight = max(round(1.4 * self.size), 1)
        for row, line in enumerate(lines):
            place = left + edge, top + high * (row + 1) - edge // 2
            cv2.putText(self._image, line, place, _FONT, scale, colour, weight, cv2.LINE_AA)

    def _free(self, left: int, top: int, width: int, height: int, *, up: bool) -> int:
        """Upper edge of a free place from `top` on downwards or upwards; at the image's edge it may not be free."""
        for _ in range(len(self._taken) + 1):
            for x, y, w, h in self._taken:
                if x < left + width and left < x + w and y < top + height and top < y + h:
                    top = y - height - 2 if up else y + h + 2
        top = int(np.clip(top, 0, max(self._image.shape[0] - height, 0)))
        self._taken.append((left, top, width, height))
        return top
