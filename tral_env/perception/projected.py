"""The camera without images: marker corners projected through the lens, seen or not as the rendered detector would.

Batched over rows, in plain numpy, element by element, so that a row has the same bits in any batch. What is seen, and
how wrong it is, was fitted to the rendered detector by `benchmarks/marker_accuracy.py`; see docs/perception.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tral_env.config import CameraConfig, CarConfig
from tral_env.course.plan import Plan
from tral_env.perception.detection_model import DETECTION_MODEL, DetectionModel
from tral_env.se2 import wrap

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

NOISE_PLACES = 8
"""Markers of a row that have noise of their own in one frame; place i uses the noise of i modulo this."""
NORMALS, UNIFORMS = 4, 1
"""Normal numbers (distance, bearing, heading, flip) and uniform ones (found or not) for each of these places."""


class Scenery:
    """Markers and boxes around each of n cars. Rows are filled one by one, places grow as needed."""

    def __init__(self, n: int) -> None:
        """Rows without anything in them."""
        self.markers = np.zeros((n, 0, 5))
        """(n, M, 5): x, y, z of the face's centre, yaw of its normal, edge length; edge 0 = no marker."""
        self.ids = np.full((n, 0), -1, np.int64)
        """(n, M)"""
        self.boxes = np.zeros((n, 0, 8))
        """(n, B, 8): x, y, z of the centre, cos and sin of yaw, half lengths; half length 0 = no box."""
        self.footprints = np.zeros((6, n, 0), np.float32)
        """(6, n, B): x, y, cos and sin of yaw, level half lengths once more, for a first quick test."""

    def place(self, row: int, plan: Plan) -> None:
        """Put a course into a row.

        Args:
            row: which.
            plan: the course, in the frame of the poses that will be asked for.
        """
        markers, boxes = len(plan.marker_id), len(plan.box_yaw)
        self._grow(markers, boxes)
        self.markers[row], self.ids[row] = 0.0, -1
        self.markers[row, :markers, :3] = plan.marker_position
        self.markers[row, :markers, 3] = plan.marker_yaw
        self.markers[row, :markers, 4] = plan.marker_size
        self.ids[row, :markers] = plan.marker_id
        self.boxes[row] = 0.0
        self.boxes[row, :boxes, :3] = plan.box_position
        self.boxes[row, :boxes, 3] = np.cos(plan.box_yaw)
        self.boxes[row, :boxes, 4] = np.sin(plan.box_yaw)
        self.boxes[row, :boxes, 5:] = plan.box_size
        self.footprints[:, row] = self.boxes[row, :, [0, 1, 3, 4, 5, 6]]

    def _grow(self, markers: int, boxes: int) -> None:
        more = markers - self.ids.shape[1]
        if more > 0:
            self.markers = np.pad(self.markers, ((0, 0), (0, more), (0, 0)))
            self.ids = np.pad(self.ids, ((0, 0), (0, more)), constant_values=-1)
        more = boxes - self.boxes.shape[1]
        if more > 0:
            self.boxes = np.pad(self.boxes, ((0, 0), (0, more), (0, 0)))
            self.footprints = np.pad(self.footprints, ((0, 0), (0, 0), (0, more)))


@dataclass(frozen=True)
class Seen:
    """Markers seen by k cars, each array (k, M); meaningless where not valid."""

    ids: Indices
    x: Array
    y: Array
    heading: Array
    valid: Mask


@dataclass(frozen=True)
class _Candidates:
    """Markers that may be seen, each array (c, ...)."""

    row: Indices
    place: Indices
    eye: Array
    """(c, 3) camera, course frame."""
    points: Array
    """(c, 5, 3) four corners and the centre, course frame."""
    rays: Array
    """(c, 5, 3) the same from the camera, in its frame: forward, left, up."""
    heading: Array
    """(c,) into the marker, in the camera's frame."""


@dataclass(frozen=True)
class _Blur:
    """What makes the sight of c markers inexact."""

    extent: Array
    """(c,) root of the area in the image, px."""
    level: Array
    """(c,) level of degradation."""
    noise: Array
    """(c, NORMALS)"""


def project(
    scenery: Scenery,
    rows: Indices,
    pose: Array,
    camera: CameraConfig,
    car: CarConfig,
    *,
    mounting: Array,
    normal: Array,
    uniform: Array,
    degradation: Array | None = None,
    model: DetectionModel = DETECTION_MODEL,
) -> Seen:
    """What the detector would report.

    Args:
        scenery: surroundings of all cars.
        rows: (k,) whose camera has exposed an image.
        pose: (k, 3) x, y, yaw of these cars, course frame.
        camera: the lens.
        car: where the camera sits.
        mounting: (k, 3) roll, pitch, yaw of its mounting error, rad.
        normal: (k, NOISE_PLACES, NORMALS) standard normal numbers.
        uniform: (k, NOISE_PLACES, UNIFORMS) numbers in [0, 1).
        degradation: (k,) level of noise, blur, exposure and glare of the images; none: clean images.
        model: the detector.
    """
    near = _candidates(scenery, rows, pose, car, mounting)
    pixels = project_points(near.rays[:, :4], camera)
    size = _shorter_side(pixels)
    level = np.zeros(len(near.row)) if degradation is None else degradation[near.row]
    chance = uniform[near.row, near.place % NOISE_PLACES, 0]
    ids = scenery.ids[rows[near.row], near.place]
    index = np.flatnonzero(_in_image(pixels, camera, model) & (chance < model.found(size, ids, level)))
    index = index[~_hidden(scenery, rows, near, index)]
    where = near.row[index], near.place[index]
    blur = _Blur(_extent(pixels[index]), level[index], normal[where[0], where[1] % NOISE_PLACES])
    ahead, left = near.rays[index, 4, 0], near.rays[index, 4, 1]
    along, across = _position_error(ahead, left, blur, camera, model)
    shape = len(rows), scenery.ids.shape[1]
    out = Seen(scenery.ids[rows], np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape, np.bool_))
    out.x[where] = car.camera_x + ahead + along
    out.y[where] = left + across
    out.heading[where] = _seen_heading(near, index, blur, camera, model)
    out.valid[where] = True
    return out


def _candidates(scenery: Scenery, rows: Indices, pose: Array, car: CarConfig, mounting: Array) -> _Candidates:
    """Markers ahead of the camera whose face looks towards it."""
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    eye = np.stack([pose[:, 0] + car.camera_x * cos, pose[:, 1] + car.camera_x * sin], axis=1)
    markers = scenery.markers[rows]
    dx, dy = markers[..., 0] - eye[:, 0, None], markers[..., 1] - eye[:, 1, None]
    ahead = dx * cos[:, None] + dy * sin[:, None]
    row, place = np.nonzero((ahead > NEAR) & (markers[..., 4] > 0.0))
    marker = markers[row, place]
    normal_x, normal_y = np.cos(marker[:, 3]), np.sin(marker[:, 3])
    facing = normal_x * dx[row, place] + normal_y * dy[row, place] < 0.0
    row, place, marker = row[facing], place[facing], marker[facing]
    normal_x, normal_y = normal_x[facing], normal_y[facing]
    half = marker[:, 4, None] / 2
    points = np.empty((len(row), 5, 3))
    points[..., 0] = marker[:, 0, None] - normal_y[:, None] * half * SIDE
    points[..., 1] = marker[:, 1, None] + normal_x[:, None] * half * SIDE
    points[..., 2] = marker[:, 2, None] + half * UP
    turn = mounting_turn(mounting)[row]
    eye = np.concatenate([eye[row], np.full((len(row), 1), car.camera_z)], axis=1)
    rays = _into_camera(points - eye[:, None], cos[row, None], sin[row, None], turn[:, None])
    into = np.stack([-normal_x, -normal_y, np.zeros(len(row))], axis=1)
    into = _into_camera(into, cos[row], sin[row], turn)
    return _Candidates(row, place, eye, points, rays, np.arctan2(into[:, 1], into[:, 0]))


NEAR = 0.05
"""Nothing nearer to the camera than this is seen, m."""
SIDE = np.array([-1.0, 1.0, 1.0, -1.0, 0.0])
UP = np.array([1.0, 1.0, -1.0, -1.0, 0.0])


def mounting_turn(mounting: Array) -> Array:
    """Matrices (k, 3, 3) from the frame of a camera to the car's.

    Args:
        mounting: (k, 3) roll about x forward, pitch about y left (+ looks down), yaw about z up, in this order, rad.
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos(mounting).T, np.sin(mounting).T
    entries = (
        *(cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        *(sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        *(-sp, cp * sr, cp * cr),
    )
    return np.stack(entries, axis=1).reshape(-1, 3, 3)


def _into_camera(vector: Array, cos: Array, sin: Array, turn: Array) -> Array:
    """Vectors (..., 3) of the course frame in the camera's frame; no matrix product, which may differ in its last
    bit with the size of the batch."""
    x = vector[..., 0] * cos + vector[..., 1] * sin
    y = vector[..., 1] * cos - vector[..., 0] * sin
    z = vector[..., 2]
    out = np.empty(vector.shape)
    for axis in range(3):
        out[..., axis] = turn[..., 0, axis] * x + turn[..., 1, axis] * y + turn[..., 2, axis] * z
    return out


def project_points(rays: Array, camera: CameraConfig) -> Array:
    """Pixels of points before the camera, OpenCV's model.

    Args:
        rays: (..., 3) forward, left, up from the camera, m.
        camera: the lens.

    Returns:
        (..., 2) u, v in px; NaN for points behind the camera or farther aside than the lens can see.
    """
    ahead = np.where(rays[..., 0] > NEAR, rays[..., 0], np.nan)
    x, y = -rays[..., 1] / ahead, -rays[..., 2] / ahead
    if any(camera.distortion):
        k1, k2, p1, p2, k3 = camera.distortion
        r2 = x * x + y * y
        # Beyond the lens's edge the polynomial turns back and would put points into the image that are not there.
        x = np.where(r2 < _lens_edge(camera), x, np.nan)
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        x, y = (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )
    return np.stack([camera.cx + camera.fx * x, camera.cy + camera.fy * y], axis=-1)


@lru_cache(maxsize=16)
def _lens_edge(camera: CameraConfig) -> float:
    """Square of the largest tangent of a ray that an image corner can show."""
    k1, k2, _, _, k3 = camera.distortion
    far = max(
        np.hypot((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy)
        for u in (-0.5, camera.width - 0.5)
        for v in (-0.5, camera.height - 0.5)
    )
    radius = np.linspace(0.0, 4.0, 4001)
    bent = radius * (1 + k1 * radius**2 + k2 * radius**4 + k3 * radius**6)
    turning = np.flatnonzero(np.diff(bent) <= 0)
    stop = turning[0] if len(turning) else len(radius) - 1
    return float(radius[min(np.searchsorted(bent[: stop + 1], 1.1 * far), stop)] ** 2)


def _shorter_side(pixels: Array) -> Array:
    """Shortest side of quadrilaterals (c, 4, 2), px."""
    steps = pixels[:, [1, 2, 3, 0]] - pixels
    squares = steps[..., 0] * steps[..., 0] + steps[..., 1] * steps[..., 1]
    return np.sqrt(np.minimum(np.minimum(squares[:, 0], squares[:, 1]), np.minimum(squares[:, 2], squares[:, 3])))


def _extent(pixels: Array) -> Array:
    """Root of the area of quadrilaterals (c, 4, 2), px."""
    one, other = pixels[:, 2] - pixels[:, 0], pixels[:, 3] - pixels[:, 1]
    return np.sqrt(0.5 * np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]))


def _in_image(pixels: Array, camera: CameraConfig, model: DetectionModel) -> Mask:
    u, v = pixels[..., 0], pixels[..., 1]
    inside = (u > model.margin_px) & (u < camera.width - 1 - model.margin_px)
    inside &= (v > model.margin_px) & (v < camera.height - 1 - model.margin_px)
    return np.asarray(inside.all(axis=1))


def _position_error(
    ahead: Array, left: Array, blur: _Blur, camera: CameraConfig, model: DetectionModel
) -> tuple[Array, Array]:
    """Errors forward and left: a share of the distance along the line of sight, and pixels across it."""
    noise = blur.noise
    smaller = model.at(model.size_bias_px, blur.level) + noise[:, 0] * model.at(model.size_noise_px, blur.level)
    share = model.softness(blur.extent, model.at(model.size_share, blur.level)) * smaller / blur.extent
    aside = (
        model.softness(blur.extent, model.sharp_share)
        * noise[:, 1]
        * model.at(model.bearing_noise_px, blur.level)
        / camera.fx
    )
    return share * ahead - aside * left, share * left + aside * ahead


def _seen_heading(near: _Candidates, index: Indices, blur: _Blur, camera: CameraConfig, model: DetectionModel) -> Array:
    """Heading with its error: the width tells the angle to the line of sight, the perspective tells its sign."""
    ahead, left = near.rays[index, 4, 0], near.rays[index, 4, 1]
    edge, soft, noise = 2.0 * _half_edge(near.points[index]), model.softness(blur.extent, model.sharp_share), blur.noise
    distance = np.sqrt(ahead * ahead + left * left)
    sight = np.arctan2(left, ahead)
    angle = wrap(near.heading[index] - sight)
    sine, depth = np.abs(np.sin(angle)), edge / distance
    face_on = camera.fx * depth
    flipped = soft * noise[:, 3] * model.at(model.flip_px, blur.level) > face_on * depth * sine
    nearer = model.at(model.perspective_gain, blur.level) * depth
    spread = soft * model.at(model.heading_noise_px, blur.level) / (face_on * np.sqrt(sine * sine + nearer * nearer))
    angle = np.where(flipped, -angle, angle) + noise[:, 2] * np.minimum(spread, 1.0)
    return np.asarray(wrap(sight + angle))


MARGIN = 0.01
"""Added to half a marker's edge in the first test, m."""
CLEARANCE = 0.03
"""Sight ends this far before the marker: the post that carries it does not hide it, m."""


def _hidden(scenery: Scenery, rows: Indices, near: _Candidates, index: Indices) -> Mask:
    """Whether a box stands between the camera and any of five points of the markers with these indices."""
    eye, points, row = near.eye[index], near.points[index], rows[near.row[index]]
    item, box = np.nonzero(_maybe_between(scenery.footprints[:, row], eye, points))
    hidden = np.zeros(len(index), np.bool_)
    hidden[item[_crosses(eye[item], points[item], scenery.boxes[row[item], box])]] = True
    return hidden


def _maybe_between(footprints: NDArray[np.float32], eye: Array, points: Array) -> Mask:
    """(c, B) boxes that overlap the strip from camera to marker, both along it and across it, seen from above.

    Single precision and a margin: this only saves the exact test for the few boxes that matter.
    """
    to_x, to_y = points[:, 4, 0] - eye[:, 0], points[:, 4, 1] - eye[:, 1]
    length = np.sqrt(to_x * to_x + to_y * to_y)
    sight_x, sight_y, length, half, eye_x, eye_y = (
        values[:, None].astype(np.float32)
        for values in (to_x / length, to_y / length, length, _half_edge(points) + MARGIN, eye[:, 0], eye[:, 1])
    )
    x, y, cos, sin, long, wide = footprints
    x, y = x - eye_x, y - eye_y
    parallel, square = np.abs(cos * sight_x + sin * sight_y), np.abs(sin * sight_x - cos * sight_y)
    maybe = np.abs(y * sight_x - x * sight_y) < long * square + wide * parallel + half
    along, extent = x * sight_x + y * sight_y, long * parallel + wide * square
    maybe &= (along < length + extent) & (along > -extent) & (wide > 0.0)
    return np.asarray(maybe)


def _half_edge(points: Array) -> Array:
    """(c,) half an edge of each marker."""
    return (points[:, 0, 2] - points[:, 3, 2]) / 2


def _crosses(eye: Array, points: Array, box: Array) -> Mask:
    """Whether one of the lines (p, 5) from the eye to the points enters the box: slabs in the box's frame."""
    cos, sin = box[:, 3], box[:, 4]
    dx, dy, dz = (eye[:, i] - box[:, i] for i in range(3))
    start = (dx * cos + dy * sin, dy * cos - dx * sin, dz)
    step = points - eye[:, None]
    cos, sin = cos[:, None], sin[:, None]
    steps = (step[..., 0] * cos + step[..., 1] * sin, step[..., 1] * cos - step[..., 0] * sin, step[..., 2])
    length = np.sqrt(step[..., 0] ** 2 + step[..., 1] ** 2)
    enter, leave = np.zeros(length.shape), 1.0 - CLEARANCE / length
    for axis in range(3):
        pace = np.where(np.abs(steps[axis]) > 1e-12, steps[axis], 1e-12)
        one = (-box[:, 5 + axis, None] - start[axis][:, None]) / pace
        other = (box[:, 5 + axis, None] - start[axis][:, None]) / pace
        enter = np.maximum(enter, np.minimum(one, other))
        leave = np.minimum(leave, np.maximum(one, other))
    return np.asarray((enter < leave).any(axis=1))
