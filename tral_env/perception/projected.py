"""The camera without images: marker corners projected through the lens, seen or not as in rendered images.

Batched over rows, in plain numpy, element by element, so that a row has the same bits in any batch. What is seen, and
how wrong it is, was fitted to the detector in rendered images by `benchmarks/detector_fit.py`; see
docs/perception.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array, Flags, Index
from tral_env.config import CameraConfig, CarConfig
from tral_env.course.plan import Plan
from tral_env.perception.detection_model import DETECTION_MODEL, DetectionModel
from tral_env.perception.lens import NEAR, mounting_turn, project_points
from tral_env.se2 import rotate_back, to_outer_n, wrap

NOISE_PLACES = 8
"""So many markers of a row have noise of their own in one image; place i uses the noise of i modulo this."""
NORMALS = 4
"""Each of these places takes so many normal numbers: distance, bearing, heading, flip."""
UNIFORMS = 1
"""Each of these places takes so many uniform numbers: found or not."""
SIDE = np.array([-1.0, 1.0, 1.0, -1.0, 0.0])
"""A marker's corners and centre lie so many half edges to the right, seen from the front."""
UP = np.array([1.0, 1.0, -1.0, -1.0, 0.0])
"""A marker's corners and centre lie so many half edges up."""
MARGIN = 0.01
"""The first test of what hides a marker makes it wider by this on each side, m."""
CLEARANCE = 0.03
"""The line of sight ends this far before the marker, m, so that the post that carries it does not hide it."""


class Scenery:
    """Markers and boxes around each of n cars. Rows are filled one by one, places grow as needed."""

    def __init__(self, n: int) -> None:
        """Begin with nothing around the cars."""
        self.markers = np.zeros((n, 0, 5))
        """(n, M, 5): x, y, z of the face's centre, m, yaw of its normal, rad, edge length, m; edge 0: no marker."""
        self.ids = np.full((n, 0), -1, np.int64)
        """(n, M) ids of the markers; -1: no marker."""
        self.boxes = np.zeros((n, 0, 8))
        """(n, B, 8): x, y, z of the centre, cos and sin of yaw, half lengths, m; half length 0: no box."""
        self.footprints = np.zeros((6, n, 0), np.float32)
        """(6, n, B): x, y, cos and sin of yaw, level half lengths once more, for a first quick test."""

    def place(self, row: int, plan: Plan) -> None:
        """Put a course into a row.

        Args:
            row: the car.
            plan: its course, in the frame of the poses that `project` will get.
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
        """Make room for so many markers and boxes in a row."""
        more = markers - self.ids.shape[1]
        if more > 0:
            self.markers = np.pad(self.markers, ((0, 0), (0, more), (0, 0)))
            self.ids = np.pad(self.ids, ((0, 0), (0, more)), constant_values=-1)
        more = boxes - self.boxes.shape[1]
        if more > 0:
            self.boxes = np.pad(self.boxes, ((0, 0), (0, more), (0, 0)))
            self.footprints = np.pad(self.footprints, ((0, 0), (0, 0), (0, more)))


@dataclass(frozen=True, eq=False)
class ProjectedMarkers:
    """Markers that k cars see, each array (k, M), in the car's frame; meaningless where not valid."""

    ids: Index
    x: Array
    """Position forward, m."""
    y: Array
    """Position left, m."""
    heading: Array
    """Direction into the marker, rad."""
    valid: Flags
    """Whether the marker is seen."""


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Markers that may be seen, each array (c, ...)."""

    row: Index
    """(c,) place of the car among the k cars."""
    place: Index
    """(c,) place of the marker in its row."""
    eye: Array
    """(c, 3) the camera, course frame, m."""
    points: Array
    """(c, 5, 3) four corners and the centre, course frame, m."""
    rays: Array
    """(c, 5, 3) the same points from the camera, in its frame: forward, left, up, m."""
    heading: Array
    """(c,) direction into the marker, in the camera's frame, rad."""


@dataclass(frozen=True, eq=False)
class _Blur:
    """What makes the sight of c markers inexact."""

    extent: Array
    """(c,) root of the area in the image, px."""
    level: Array
    """(c,) level of degradation."""
    noise: Array
    """(c, NORMALS) standard normal numbers."""


def project(
    scenery: Scenery,
    rows: Index,
    pose: Array,
    camera: CameraConfig,
    car: CarConfig,
    *,
    mounting: Array,
    normal: Array,
    uniform: Array,
    degradation: Array | None = None,
    model: DetectionModel = DETECTION_MODEL,
) -> ProjectedMarkers:
    """Tell what the detector would report of images that were not rendered.

    Args:
        scenery: surroundings of all cars.
        rows: (k,) cars whose camera has exposed an image.
        pose: (k, 3) x, y, yaw of these cars, course frame, m and rad.
        camera: the lens.
        car: where the camera sits.
        mounting: (k, 3) roll, pitch, yaw of its mounting error, rad.
        normal: (k, NOISE_PLACES, NORMALS) standard normal numbers.
        uniform: (k, NOISE_PLACES, UNIFORMS) numbers in [0, 1).
        degradation: (k,) level of noise, blur, exposure and glare of the images; None: clean images.
        model: what the detector finds, and how wrong it is.
    """
    shape = len(rows), scenery.ids.shape[1]
    out = ProjectedMarkers(
        scenery.ids[rows], np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape, np.bool_)
    )
    near = _candidates(scenery, rows, pose, car, mounting)
    if not len(near.row):
        return out
    pixels = project_points(near.rays[:, :4], camera)
    size = _shortest_side(pixels)
    level = np.zeros(len(near.row)) if degradation is None else degradation[near.row]
    chance = uniform[near.row, near.place % NOISE_PLACES, 0]
    ids = scenery.ids[rows[near.row], near.place]
    found = chance < model.found(size, ids, level, max(camera.width, camera.height))
    index = np.flatnonzero(_in_image(pixels, camera, model) & found)
    index = index[~_hidden(scenery, rows, near, index)]
    if not len(index):
        return out
    where = near.row[index], near.place[index]
    blur = _Blur(_extent(pixels[index]), level[index], normal[where[0], where[1] % NOISE_PLACES])
    ahead, left = near.rays[index, 4, 0], near.rays[index, 4, 1]
    along, across = _position_error(ahead, left, blur, camera, model)
    out.x[where] = car.camera_x + ahead + along
    out.y[where] = left + across
    out.heading[where] = _seen_heading(near, index, blur, camera, model)
    out.valid[where] = True
    return out


def _candidates(scenery: Scenery, rows: Index, pose: Array, car: CarConfig, mounting: Array) -> _Candidates:
    """Markers ahead of the camera whose face looks towards it."""
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    eye = to_outer_n(pose, np.array([car.camera_x, 0.0]))
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


def _into_camera(vector: Array, cos: Array, sin: Array, turn: Array) -> Array:
    """Turn vectors (..., 3) of the course frame into the camera's frame: ``turn^T Rz(-yaw) v``.

    No matrix product is used, because its last bit may differ with the size of the batch.
    """
    x, y = rotate_back(cos, sin, vector[..., 0], vector[..., 1])
    z = vector[..., 2]
    out = np.empty(vector.shape)
    for axis in range(3):
        out[..., axis] = turn[..., 0, axis] * x + turn[..., 1, axis] * y + turn[..., 2, axis] * z
    return out


def _shortest_side(pixels: Array) -> Array:
    """Shortest side of quadrilaterals (c, 4, 2), px."""
    steps = pixels[:, [1, 2, 3, 0]] - pixels
    squares = steps[..., 0] * steps[..., 0] + steps[..., 1] * steps[..., 1]
    return np.sqrt(np.minimum(np.minimum(squares[:, 0], squares[:, 1]), np.minimum(squares[:, 2], squares[:, 3])))


def _extent(pixels: Array) -> Array:
    """Root of the area of quadrilaterals (c, 4, 2), px; the area is half the cross product of the diagonals."""
    one, other = pixels[:, 2] - pixels[:, 0], pixels[:, 3] - pixels[:, 1]
    return np.sqrt(0.5 * np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]))


def _in_image(pixels: Array, camera: CameraConfig, model: DetectionModel) -> Flags:
    """Whether all corners (c, 4, 2) of a marker lie in the image, away from its edge, (c,)."""
    u, v = pixels[..., 0], pixels[..., 1]
    inside = (u > model.margin_px) & (u < camera.width - 1 - model.margin_px)
    inside &= (v > model.margin_px) & (v < camera.height - 1 - model.margin_px)
    return np.asarray(inside.all(axis=1))


def _position_error(
    ahead: Array, left: Array, blur: _Blur, camera: CameraConfig, model: DetectionModel
) -> tuple[Array, Array]:
    """Errors forward and left, m: a share of the distance along the line of sight, and pixels across it.

    A marker that looks smaller by d of its e pixels looks farther by the share d / e; an error of b pixels across the
    line of sight is one of b / fx of the distance.
    """
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


def _seen_heading(near: _Candidates, index: Index, blur: _Blur, camera: CameraConfig, model: DetectionModel) -> Array:
    """Heading with its error: the width tells the angle to the line of sight, the perspective tells its sign.

    A marker of the edge a at the distance d, seen at the angle b off its normal, is ``w = fx a / d cos b`` wide, so an
    error of the width makes one of the angle of ``error / (fx a / d sin b)``. The perspective helps head-on, where the
    sine is 0; it is the difference of the two upright edges, about ``fx (a / d)^2 sin b``. Where noise exceeds that,
    the angle comes out with the wrong sign.
    """
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


def _hidden(scenery: Scenery, rows: Index, near: _Candidates, index: Index) -> Flags:
    """Whether a box stands between the camera and any of the five points of the markers with these indices, (c,)."""
    eye, points, row = near.eye[index], near.points[index], rows[near.row[index]]
    item, box = np.nonzero(_maybe_between(scenery.footprints[:, row], eye, points))
    hidden = np.zeros(len(index), np.bool_)
    hidden[item[_crosses(eye[item], points[item], scenery.boxes[row[item], box])]] = True
    return hidden


def _maybe_between(footprints: NDArray[np.float32], eye: Array, points: Array) -> Flags:
    """Boxes that overlap the strip from camera to marker, both along it and across it, seen from above, (c, B).

    Single precision and a margin do, because this only saves the exact test for the few boxes that matter.
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
    """Half an edge of each marker, (c,) m."""
    return (points[:, 0, 2] - points[:, 3, 2]) / 2


def _crosses(eye: Array, points: Array, box: Array) -> Flags:
    """Whether one of the lines (p, 5) from the eye to the points enters its box, (p,): the method of slabs.

    In the box's frame a line is ``o + t d``, t from 0 at the eye to 1 at the point. Along each axis it is between the
    two faces, at -h and h, for t between ``(-h - o) / d`` and ``(h - o) / d``. It is in the box where the three
    intervals overlap.
    """
    cos, sin = box[:, 3], box[:, 4]
    dx, dy, dz = (eye[:, i] - box[:, i] for i in range(3))
    start = (*rotate_back(cos, sin, dx, dy), dz)
    step = points - eye[:, None]
    steps = (*rotate_back(cos[:, None], sin[:, None], step[..., 0], step[..., 1]), step[..., 2])
    length = np.sqrt(step[..., 0] ** 2 + step[..., 1] ** 2)
    enter, leave = np.zeros(length.shape), 1.0 - CLEARANCE / length
    for axis in range(3):
        pace = np.where(np.abs(steps[axis]) > 1e-12, steps[axis], 1e-12)
        one = (-box[:, 5 + axis, None] - start[axis][:, None]) / pace
        other = (box[:, 5 + axis, None] - start[axis][:, None]) / pace
        enter = np.maximum(enter, np.minimum(one, other))
        leave = np.minimum(leave, np.maximum(one, other))
    return np.asarray((enter < leave).any(axis=1))
