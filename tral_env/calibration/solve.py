"""From views of a board to a lens: the fit, its test on views that it has not seen, and a verdict with advice."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array
from tral_env.calibration.board_hints import BoardHint
from tral_env.calibration.boards import Board
from tral_env.calibration.views import Collection, Rejected, View, coverage
from tral_env.config import CameraConfig
from tral_env.errors import CalibrationError, ConfigError

PARAMETERS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
"""A lens has these numbers, in OpenCV's order."""
FOLDS = 4
"""Each view is held out of one of so many fits."""
MIN_VIEWS = 4
"""A fit needs at least so many views."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a good calibration keeps. Source: choice."""

    views: int = 12
    """It has at least so many views."""
    covered: float = 0.5
    """At least this share of the cells in each ninth of the image holds a corner."""
    held_out_px: float = 0.6
    """The RMS error of views that were not fitted is at most this, px, for an image 640 px wide; in proportion for
    others."""
    overfit: float = 1.5
    """The RMS error of views that were not fitted is at most so many times that of the fit."""
    focal_std: float = 0.005
    """The standard deviation of a focal length is at most this share of it."""
    centre_std: float = 0.005
    """The standard deviation of the principal point is at most this share of the image's width."""
    tilt_deg: float = 15.0
    """At least two views are tilted by this much to each side: without tilt a short lens from near looks like a long
    one from far."""
    distance_ratio: float = 1.4
    """The farthest view is at least so many times as far as the nearest."""
    outlier: float = 3.0
    """The fit leaves out a view whose error is above so many times the median and above `outlier_px`."""
    outlier_px: float = 0.5
    """The fit leaves out no view whose error is at most this, px, for an image 640 px wide, in proportion else."""


LIMITS = Limits()
"""The limits of `tral calibrate`."""


class TooFewViewsError(CalibrationError):
    """Too few images show the board well enough."""

    def __init__(self, told: str, hint: BoardHint | None = None) -> None:
        """Keep the parts of the message.

        Args:
            told: what was got, and what is allowed.
            hint: which other board the images show, if that is known; it ends the message.
        """
        super().__init__(f"{told} Hint: {hint}" if hint else told)
        self.told, self.hint = told, hint


@dataclass(frozen=True, eq=False)
class Calibration:
    """A lens, and how far to trust it."""

    camera: CameraConfig
    deviation: dict[str, float]
    """Standard deviation of each of `PARAMETERS`: px, or none; 0 for what was not fitted."""
    rms_px: float
    """Root of the mean squared distance between corners seen and predicted, over the views of the fit."""
    held_out_px: float
    """The same over views that the fit had not seen (each fourth in turn), whose own pose alone was then fitted."""
    views: tuple[View, ...]
    """The views that were used."""
    errors_px: Array
    """(views,) RMS error of each view."""
    normals: Array
    """(views, 3) direction into the board, in the camera's frame."""
    distances: Array
    """(views,) distance from the camera to the middle of the board, m."""
    rejected: tuple[Rejected, ...]
    """Images that were not used, and why."""
    advice: tuple[str, ...]
    """What is wrong and what to do about it, a sentence each; empty: nothing is wrong."""

    @property
    def good(self) -> bool:
        """Whether there is no advice: the verdict."""
        return not self.advice

    @property
    def coverage(self) -> NDArray[np.int64]:
        """Corners in each cell of the image, see `tral_env.calibration.views.coverage`."""
        return coverage(list(self.views), (self.camera.width, self.camera.height))


@dataclass(frozen=True, eq=False)
class _Fit:
    """A lens and the poses of the views that it was fitted to."""

    matrix: Array
    """(3, 3) camera matrix, px."""
    distortion: Array
    """(5,) k1, k2, p1, p2, k3."""
    turns: Sequence[Array]
    """Rotation vector of each board."""
    shifts: Sequence[Array]
    """Place of each board's origin, m."""
    deviation: Array
    """(9,) standard deviation of each of `PARAMETERS`."""
    rms: float
    """RMS error, px."""
    errors: Array
    """(views,) RMS error of each view, px."""


def calibrate(
    board: Board,
    views: Sequence[View],
    size: tuple[int, int],
    *,
    radial: int = 2,
    rejected: Sequence[Rejected] = (),
    limits: Limits = LIMITS,
) -> Calibration:
    """Fit a lens to views of a board, and leave out views whose error stands out, one by one, the worst first.

    The fit finds the lens and the pose of each board with the least sum of squared distances between the corners seen
    and the corners projected (bundle adjustment, from a closed-form start), with OpenCV's model of five distortion
    numbers. Source: Z. Zhang, "A flexible new technique for camera calibration", IEEE PAMI 22(11), 2000.

    Args:
        board: the board.
        views: places of its corners in each image.
        size: width and height of the images, px.
        radial: terms of radial distortion, 1 to 3. The third is for lenses beyond 100 degrees: on others it only makes
            the rest less certain.
        rejected: images that were rejected before.
        limits: what counts as good.

    Raises:
        ConfigError: `radial` is not 1, 2 or 3.
        TooFewViewsError: there are fewer than 4 views.
        CalibrationError: no lens fits them.
    """
    if radial not in (1, 2, 3):
        raise ConfigError(f"radial = {radial!r}: expected 1, 2 or 3 terms of radial distortion")
    used, outliers = list(views), list[Rejected]()
    _require_enough(used, rejected, limits)
    fit = _fit(board, used, size, radial)
    while (worst := _outlier(fit, size, limits)) is not None and len(used) > MIN_VIEWS:
        view = used.pop(worst)
        detail = f"{fit.errors[worst]:.2f} px, the median is {np.median(fit.errors):.2f}"
        outliers.append(Rejected(view.name, "outlier error", detail))
        fit = _fit(board, used, size, radial)
    middle = np.array([board.size[0] / 2, board.size[1] / 2, 0.0])
    axes = np.array([cv2.Rodrigues(turn)[0] for turn in fit.turns])
    result = Calibration(
        camera=_camera(fit, size),
        deviation=dict(zip(PARAMETERS, (float(value) for value in fit.deviation), strict=True)),
        rms_px=fit.rms,
        held_out_px=_held_out(board, used, size, radial),
        views=tuple(used),
        errors_px=fit.errors,
        normals=axes[:, :, 2],
        distances=np.linalg.norm(axes @ middle + np.array(fit.shifts).reshape(-1, 3), axis=1),
        rejected=(*rejected, *outliers),
        advice=(),
    )
    return replace(result, advice=tuple(_advice(result, limits)))


def calibrate_collection(collection: Collection, *, radial: int = 2, limits: Limits = LIMITS) -> Calibration:
    """Fit a lens to the images of a collection; see `calibrate`."""
    size = collection.size or (1, 1)
    return calibrate(
        collection.board, collection.views, size, radial=radial, rejected=collection.rejected, limits=limits
    )


def _require_enough(views: Sequence[View], rejected: Sequence[Rejected], limits: Limits) -> None:
    """Raise an error that tells why images were rejected, if too few views are left."""
    if len(views) >= MIN_VIEWS:
        return
    reasons = Counter(one.reason for one in rejected)
    why = ", ".join(f"{count} x {reason}" for reason, count in reasons.items()) or "none was rejected"
    told = (
        f"{len(views)} of {len(views) + len(rejected)} images show the board well enough ({why}); a calibration "
        f"needs {MIN_VIEWS}, a good one {limits.views}"
    )
    if reasons["other size"]:
        told += ". A calibration holds for one size of image"
    broken = [one.name for one in rejected if one.reason == "unreadable"]
    if broken:
        told += f". Unreadable: {', '.join(broken[:3])}{', ...' * (len(broken) > 3)}"
    if reasons["no board"]:
        told += ". Is the board the one that was named?"
    raise TooFewViewsError(told, next((one.hint for one in rejected if one.hint), None))


def _fit(board: Board, views: Sequence[View], size: tuple[int, int], radial: int) -> _Fit:
    """Fit a lens and the pose of each view's board, from nothing."""
    places = [np.asarray(board.corners[view.ids], np.float32) for view in views]
    pixels = [np.asarray(view.pixels, np.float32)[:, None] for view in views]
    flags = (cv2.CALIB_FIX_K3 if radial < 3 else 0) | (cv2.CALIB_FIX_K2 if radial < 2 else 0)
    solve: Any = cv2.calibrateCameraExtended  # its stub knows no None, which asks it to begin from nothing
    try:
        found = solve(places, pixels, size, None, None, flags=flags)
    except cv2.error as error:
        raise CalibrationError(f"no lens fits these {len(views)} views: {error.err}") from error
    rms, matrix, distortion, turns, shifts, deviation, _, errors = found
    if not (np.isfinite(matrix).all() and np.isfinite(distortion).all() and matrix[0, 0] > 0 and matrix[1, 1] > 0):
        raise CalibrationError(f"no lens fits these {len(views)} views: is the board flat, and the one that was named?")
    return _Fit(
        matrix,
        np.ravel(distortion)[:5],
        turns,
        shifts,
        np.nan_to_num(np.ravel(deviation)[: len(PARAMETERS)]),
        float(rms),
        np.ravel(errors).astype(np.float64),
    )


def _camera(fit: _Fit, size: tuple[int, int]) -> CameraConfig:
    return CameraConfig(
        width=size[0],
        height=size[1],
        fx=float(fit.matrix[0, 0]),
        fy=float(fit.matrix[1, 1]),
        cx=float(fit.matrix[0, 2]),
        cy=float(fit.matrix[1, 2]),
        distortion=tuple(float(value) for value in fit.distortion),
    )


def _outlier(fit: _Fit, size: tuple[int, int], limits: Limits) -> int | None:
    """Index of the worst view, if it stands out."""
    worst = int(np.argmax(fit.errors))
    limit = max(limits.outlier * float(np.median(fit.errors)), limits.outlier_px * size[0] / 640)
    return worst if fit.errors[worst] > limit else None


def _held_out(board: Board, views: Sequence[View], size: tuple[int, int], radial: int) -> float:
    """RMS error, px, of views that the fit has not seen: cross-validation, in which only their own pose is fitted."""
    folds = min(FOLDS, len(views))
    squares = []
    for fold in range(folds):
        fit = _fit(board, [view for i, view in enumerate(views) if i % folds != fold], size, radial)
        lens = fit.matrix, fit.distortion
        for view in views[fold::folds]:
            places = board.corners[view.ids]
            _, turn, shift = cv2.solvePnP(places, view.pixels, *lens, flags=cv2.SOLVEPNP_ITERATIVE)
            again = np.asarray(cv2.projectPoints(places, turn, shift, *lens)[0], np.float64)[:, 0]
            squares.append(np.sum((again - view.pixels) ** 2, axis=1))
    return float(np.sqrt(np.mean(np.concatenate(squares))))


_NAMES = (("upper left", "upper middle", "upper right"), ("left", "middle", "right"))
_THIRDS = (*_NAMES, ("lower left", "lower middle", "lower right"))
_SIDES = (
    (0, 1, "its right side"),
    (0, -1, "its left side"),
    (1, 1, "its lower side"),
    (1, -1, "its upper side"),
)
"""A board whose direction leans along this axis with this sign has this side nearer to the camera."""


def _advice(result: Calibration, limits: Limits) -> list[str]:
    """Tell what is wrong with a calibration and what to do about it, a sentence each."""
    advice = []
    if len(result.views) < limits.views:
        advice.append(f"{len(result.views)} views were used: take {limits.views} or more")
    bare = uncovered(result.coverage, limits.covered)
    if bare:
        advice.append(f"few corners in these parts of the image: bring the board there: {', '.join(bare)}")
    return [*advice, *_advice_on_poses(result, limits), *_advice_on_errors(result, limits)]


def uncovered(counts: NDArray[np.int64], share: float = LIMITS.covered) -> list[str]:
    """Name the ninths of the image where less than a share of the cells holds a corner; `counts` as in `coverage`."""
    rows, columns = (cells // 3 for cells in counts.shape)
    held = (counts > 0).reshape(3, rows, 3, columns).mean(axis=(1, 3))
    return [_THIRDS[i][j] for i in range(3) for j in range(3) if held[i, j] < share]


def _advice_on_poses(result: Calibration, limits: Limits) -> list[str]:
    advice = []
    angles = np.degrees(np.arctan2(result.normals[:, :2], np.abs(result.normals[:, 2:])))
    flat = [side for axis, sign, side in _SIDES if np.sum(sign * angles[:, axis] > limits.tilt_deg) < 2]
    if flat:
        advice.append(f"tilt the board by {limits.tilt_deg:.0f} to 45 degrees so that comes nearer: {', '.join(flat)}")
    ratio = float(result.distances.max() / result.distances.min())
    if ratio < limits.distance_ratio:
        advice.append(
            f"the farthest view is only {ratio:.1f} times as far as the nearest: go nearer, until the board is larger "
            f"than the image, and farther; {limits.distance_ratio:g} times at least"
        )
    return advice


def _advice_on_errors(result: Calibration, limits: Limits) -> list[str]:
    advice = []
    allowed = limits.held_out_px * result.camera.width / 640
    if result.held_out_px > allowed:
        advice.append(
            f"views that were not fitted are off by {result.held_out_px:.2f} px, allowed {allowed:.2f}: is the board "
            "flat and stiff, the focus fixed, the lens wider than 100 degrees (then 3 radial terms)?"
        )
    if result.held_out_px > limits.overfit * result.rms_px + 0.05:
        advice.append(
            f"views that were not fitted are off by {result.held_out_px:.2f} px, those that were by "
            f"{result.rms_px:.2f}: too few different views; take more"
        )
    camera = result.camera
    focal = {"fx": limits.focal_std * camera.fx, "fy": limits.focal_std * camera.fy}
    centre = dict.fromkeys(("cx", "cy"), limits.centre_std * camera.width)
    for most in (focal, centre):
        vague = [name for name in most if result.deviation[name] > most[name]]
        if vague:
            advice.append(
                f"{' and '.join(vague)} uncertain by {max(result.deviation[name] for name in vague):.1f} px: "
                "take more views, tilted further, larger in the image"
            )
    return advice
