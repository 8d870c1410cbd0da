"""Topics of a recording and the JSON Schemas of their messages. Well-known schemas are those of Foxglove."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tral_env.interface import Layout

Schema = dict[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class Topic:
    """A stream of messages of one kind."""

    name: str
    schema_name: str
    schema: Schema

    @property
    def schema_text(self) -> bytes:
        """The JSON Schema as a file has it."""
        return json.dumps({"title": self.schema_name, **self.schema}).encode()


def _object(description: str, properties: Mapping[str, Schema], required: tuple[str, ...] | None = None) -> Schema:
    return {
        "description": description,
        "type": "object",
        "properties": dict(properties),
        "required": list(properties if required is None else required),
    }


def _number(description: str, unit: str = "") -> Schema:
    return {"type": "number", "description": f"{description} [{unit}]" if unit else description}


def _maybe(description: str, unit: str = "") -> Schema:
    """A number that may be missing."""
    return {**_number(description, unit), "type": ["number", "null"]}


def _text(description: str) -> Schema:
    return {"type": "string", "description": description}


def _bytes(description: str) -> Schema:
    return {**_text(description), "contentEncoding": "base64"}


_STAMP: Schema = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer", "minimum": 0}, "nsec": {"type": "integer", "minimum": 0}},
}
"""Time as Foxglove's schemas have it: `sec` and `nsec` since 1970."""
_TICK: Mapping[str, Schema] = {
    "tick": {"type": "integer", "description": "number of the step since the start, from 0"},
    "time_s": _number("time since the start", "s"),
}
"""Each message of a tick begins so."""


def observation_topic(layout: Layout) -> Topic:
    """Readings and their ages, in the columns of a layout; one that is no number is left out."""
    readings = {field.name: _number(field.meaning, field.unit) for field in layout.fields}
    clock = {"clock_s": _number("time of the same instant on the clock of the drive", "s")}
    schema = _object("What the policy was told", {**_TICK, **clock, **readings}, required=(*_TICK, *clock))
    return Topic(name="/observation", schema_name="tral.Observation", schema=schema)


_COMMAND = {
    "steering": _number("share of full lock, +1 = full left"),
    "throttle": _number("share of full throttle, +1 = full forward"),
}

ACTION = Topic(
    name="/action",
    schema_name="tral.Command",
    schema=_object("What the policy answered", {**_TICK, **_COMMAND}, required=tuple(_TICK)),
)
APPLIED = Topic(
    name="/applied",
    schema_name="tral.Applied",
    schema=_object(
        "The command after all limits, and its pulses",
        {
            **_TICK,
            **_COMMAND,
            "steering_us": _maybe("pulse of the servo; 0: none was sent", "us"),
            "throttle_us": _maybe("pulse of the motor controller; 0: none was sent", "us"),
        },
    ),
)
LOOP = Topic(
    name="/loop",
    schema_name="tral.Loop",
    schema=_object(
        "How the control loop keeps its time",
        {
            **_TICK,
            "late_ticks": {"type": "integer", "description": "number of late steps since the start"},
            "lateness_s": _number("time by which this step came too late; 0: it did not", "s"),
        },
    ),
)
STATE = Topic(
    name="/state",
    schema_name="tral.State",
    schema=_object(
        "What the policy was doing",
        {
            **_TICK,
            "state": _text("name of the state that acted, inner states behind a slash"),
            "wanted_side": _maybe("wall to which a clearance is kept: +1 left, -1 right"),
            "wanted_clearance_m": _maybe("that clearance", "m"),
        },
    ),
)
TRANSITION = Topic(
    name="/transition",
    schema_name="tral.Transition",
    schema=_object(
        "A transition of the policy's state machine",
        {
            **_TICK,
            "machine_time_s": _number("time on the machine's own clock", "s"),
            "path": {"type": "array", "items": {"type": ["string", "integer"]}, "description": "states around it"},
            "source": {"type": ["string", "integer"], "description": "id of the state that was left"},
            "target": {"type": ["string", "integer"], "description": "id of the state that was entered"},
            "transition": {"type": ["string", "integer"], "description": "id of the transition"},
            "why": _text("the compared values"),
        },
    ),
)
TRUTH = "/truth"
"""Name of the topic that `truth_topic` makes."""


def truth_topic(values: Mapping[str, object]) -> Topic:
    """Ground truth by name, with the types of some values."""
    schema = _object(
        "The simulation's info after the step; no car knows it, no policy sees it",
        {**_TICK, **{name: {"type": _type_of(value)} for name, value in values.items()}},
        required=tuple(_TICK),
    )
    return Topic(name=TRUTH, schema_name="tral.Truth", schema=schema)


def _type_of(value: object) -> str:
    return "boolean" if isinstance(value, bool) else "string" if isinstance(value, str) else "number"


POSE = Topic(
    name="/truth/pose",
    schema_name="foxglove.PoseInFrame",
    schema=_object(
        "True pose of the car in the frame of its course",
        {
            "timestamp": _STAMP,
            "frame_id": _text("frame of reference"),
            "pose": _object(
                "Pose",
                {
                    "position": _object("m", {axis: _number(axis, "m") for axis in "xyz"}),
                    "orientation": _object("quaternion", {axis: _number(axis) for axis in "xyzw"}),
                },
            ),
        },
    ),
)
IMAGE = Topic(
    name="/camera",
    schema_name="foxglove.CompressedImage",
    schema=_object(
        "An image of the camera, stamped with the time of its exposure",
        {
            "timestamp": _STAMP,
            "frame_id": _text("frame of reference"),
            "data": _bytes("the image as a file"),
            "format": _text("jpeg"),
        },
    ),
)
FRAME = Topic(
    name="/frame",
    schema_name="tral.Frame",
    schema=_object(
        "Bytes of a sensor as they came",
        {"time_s": _TICK["time_s"], "source": _text("which sensor"), "data": _bytes("the bytes")},
    ),
)
LOG = Topic(
    name="/log",
    schema_name="foxglove.Log",
    schema=_object(
        "A word about the drive or its recording",
        {
            "timestamp": _STAMP,
            "level": {"type": "integer", "description": "2 info, 3 warning, 4 error"},
            "message": _text("the word"),
            "name": _text("who says it"),
            "file": _text("empty"),
            "line": {"type": "integer", "description": "0"},
        },
    ),
)
LEVELS: Mapping[str, int] = {"info": 2, "warning": 3, "error": 4}
"""Levels of `LOG`. Source: foxglove.LogLevel."""
