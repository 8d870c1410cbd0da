"""What a recorder is given, as messages: topic and JSON. It runs in the recorder's thread."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.interface import Layout
from tral_env.recording import topics
from tral_env.recording.topics import Topic

Message = tuple[Topic, bytes]
NS = 1_000_000_000
MAX_STAMP_NS = 2**63
"""Stamps of a recording are below this, ns since 1970; so are the times of NumPy and of Foxglove."""
JPEG_QUALITY = 85
"""Quality of images that come as pixels. Source: choice; the edges of markers stay clean."""


class RecordedTick(NamedTuple):
    """One step of a drive, as `Recorder.tick` takes it."""

    number: int
    time_s: float
    clock_s: float
    observation: bytes
    """The columns of the layout."""
    observation_type: np.dtype[Any]
    """What those bytes are."""
    action: bytes
    """Steering, throttle."""
    action_type: np.dtype[Any]
    """What those bytes are."""
    applied: tuple[float, float] | None
    pulses_us: tuple[float, float] | None
    late_ticks: int
    lateness_s: float
    state: str
    wanted: tuple[float, float] | None
    transitions: tuple[Any, ...]
    """Each with the attributes of `tral_fsm.runtime.machine.Transit`."""
    truth: Mapping[str, Any] | None


class ImageItem(NamedTuple):
    """An image of a camera, as `Recorder.image` takes it."""

    time_s: float
    pixels: NDArray[np.uint8] | bytes
    camera: str


class SensorFrame(NamedTuple):
    """Bytes of a sensor, as `Recorder.frame` takes them."""

    time_s: float
    """Since the start, s."""
    source: str
    data: bytes


class Word(NamedTuple):
    """A line of text, as `Recorder.say` takes it."""

    time_s: float
    text: str
    level: str


Item = RecordedTick | ImageItem | SensorFrame | Word


class Encoder:
    """Makes messages of what was recorded."""

    def __init__(self, layout: Layout, start_ns: int) -> None:
        """Fix the layout of the observations and the calendar time of the start, ns since 1970."""
        self._start_ns = start_ns
        self._observation, self._names = topics.observation_topic(layout), layout.names
        # Nine digits tell each float32 from all others; repr() of the same number in float64 takes twice as many.
        names = "".join(f', "{name}": %.9g' for name in layout.names)
        self._row = f'{{"tick": %d, "time_s": %r, "clock_s": %r{names}}}'
        self._truth: Topic | None = None

    def log_ns(self, time_s: float) -> int:
        """Stamp of a time since the start: it never goes back, although the calendar clock may.

        Raises:
            ValueError: no stamp can tell this time.
        """
        stamp_ns = self._start_ns + round(time_s * NS)
        if not 0 <= stamp_ns < MAX_STAMP_NS:
            raise ValueError(f"{time_s:g} s is no time of a drive")
        return stamp_ns

    def messages(self, item: Item) -> Iterator[Message]:
        """The messages of what was recorded."""
        if isinstance(item, RecordedTick):
            yield from self._tick(item)
        elif isinstance(item, ImageItem):
            yield topics.IMAGE, self._image(item)
        elif isinstance(item, SensorFrame):
            content = {"time_s": item.time_s, "source": item.source, "data": _base64(item.data)}
            yield topics.FRAME, _json(content)
        else:
            yield topics.LOG, self._word(item)

    def _tick(self, tick: RecordedTick) -> Iterator[Message]:
        head = {"tick": tick.number, "time_s": tick.time_s}
        row = np.frombuffer(tick.observation, tick.observation_type).astype(np.float32).tolist()
        if all(map(math.isfinite, row)):
            yield self._observation, (self._row % (tick.number, tick.time_s, tick.clock_s, *row)).encode()
        else:
            seen = _numbers(dict(zip(self._names, row, strict=True)))
            yield self._observation, _json({**head, "clock_s": tick.clock_s, **seen})
        yield topics.ACTION, _json({**head, **_named(np.frombuffer(tick.action, tick.action_type))})
        if tick.applied is not None:
            steering_us, throttle_us = tick.pulses_us or (None, None)
            pulses = {"steering_us": steering_us, "throttle_us": throttle_us}
            yield topics.APPLIED, _json({**head, **_named(tick.applied), **pulses})
        loop = {"late_ticks": tick.late_ticks, "lateness_s": tick.lateness_s}
        yield topics.LOOP, _json({**head, **loop})
        if tick.state or tick.wanted is not None:
            side, clearance = tick.wanted or (None, None)
            wanted = {"wanted_side": _known(side), "wanted_clearance_m": _known(clearance)}
            yield topics.STATE, _json({**head, "state": tick.state, **wanted})
        for fired in tick.transitions:
            yield topics.TRANSITION, _json({**head, **_transition(fired)})
        if tick.truth is not None:
            yield from self._true(head, tick)

    def _true(self, head: Mapping[str, float], tick: RecordedTick) -> Iterator[Message]:
        values = flat_truth(tick.truth or {})
        if self._truth is None:
            self._truth = topics.truth_topic(values)
        yield self._truth, _json({**head, **values})
        if "yaw_rad" in values:
            yield topics.POSE, _json(self._pose(tick.time_s, values))

    def _pose(self, time_s: float, values: Mapping[str, Any]) -> dict[str, Any]:
        half = values["yaw_rad"] / 2
        return {
            "timestamp": self._stamp(time_s),
            "frame_id": "course",
            "pose": {
                "position": {"x": values["x_m"], "y": values["y_m"], "z": 0.0},
                "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
            },
        }

    def _image(self, image: ImageItem) -> bytes:
        data = image.pixels if isinstance(image.pixels, bytes) else jpeg(image.pixels)
        content = {"frame_id": image.camera, "data": _base64(data), "format": "jpeg"}
        return _json({"timestamp": self._stamp(image.time_s), **content})

    def _word(self, word: Word) -> bytes:
        content = {"level": topics.LEVELS[word.level], "message": word.text, "name": "tral", "file": "", "line": 0}
        return _json({"timestamp": self._stamp(word.time_s), **content})

    def _stamp(self, time_s: float) -> dict[str, int]:
        sec, nsec = divmod(self.log_ns(time_s), NS)
        return {"sec": sec, "nsec": nsec}


def jpeg(pixels: NDArray[np.uint8]) -> bytes:
    """An image as a JPEG file.

    Args:
        pixels: (height, width, 3) RGB, or (height, width) grey.
    """
    ready = cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR) if pixels.ndim == 3 else pixels
    _, data = cv2.imencode(".jpg", ready, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return data.tobytes()


def flat_truth(info: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers, truths and texts of an info by name; the pose becomes `x_m`, `y_m` and `yaw_rad`."""
    values: dict[str, Any] = {}
    for name, value in info.items():
        if name == "pose":
            values["x_m"], values["y_m"], values["yaw_rad"] = (float(part) for part in value)
        elif isinstance(value, np.generic):
            values[name] = _known(value.item())
        elif isinstance(value, bool | int | float | str):
            values[name] = _known(value)
    return {name: value for name, value in values.items() if value is not None}


def _named(command: Iterable[float]) -> dict[str, float]:
    steering, throttle = command
    return _numbers({"steering": float(steering), "throttle": float(throttle)})


def _numbers(values: Mapping[str, float]) -> dict[str, float]:
    """Those of the values that are numbers: JSON has no NaN."""
    return {name: value for name, value in values.items() if math.isfinite(value)}


def _transition(fired: Any) -> dict[str, Any]:
    return {
        "machine_time_s": fired.time,
        "path": list(fired.path),
        "source": fired.source,
        "target": fired.target,
        "transition": fired.transition,
        "why": fired.why,
    }


def _known(value: Any) -> Any:
    """A value; None for a number that is none, which JSON does not have."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode()


def _json(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, allow_nan=False).encode()
