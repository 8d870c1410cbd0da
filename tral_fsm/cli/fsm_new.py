"""The machine that `tral fsm new` writes."""

from __future__ import annotations

from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.formats import tral_json

_TEXT = """{
  "root": "follow",
  "states": [
    {"id": "follow", "type": "FollowCorridor", "label": "begins here", "side": "right", "clearance": 0.8,
      "speed": 0.6, "slow_front": 2.0},
    {"id": "turn left", "type": "Turn", "label": "finished when turned", "side": "left", "speed": 0.4},
    {"id": "turn right", "type": "Turn", "label": "finished when turned", "side": "right", "speed": 0.4},
    {"id": "settle", "type": "FollowCorridor", "label": "finds the new walls", "side": "right", "clearance": 0.8,
      "speed": 0.5, "slow_front": 2.0},
    {"id": "blocked", "type": "Stop", "label": "waits"}
  ],
  "transitions": [
    {"id": "right is open", "type": "All", "from": "follow", "to": "turn right", "of": [
      {"type": "ObstacleAhead", "below": 1.3, "heard_above": 1.8}, {"type": "Opening", "side": "right"}]},
    {"id": "left is open", "type": "All", "from": "follow", "to": "turn left", "of": [
      {"type": "ObstacleAhead", "below": 1.3, "heard_above": 1.8}, {"type": "Opening", "side": "left"}]},
    {"id": "no way on", "type": "SensorLevel", "from": "follow", "to": "blocked", "sensor": "front", "below": 0.5,
      "readings": 2},
    {"id": "turned left", "type": "Finished", "from": "turn left", "to": "settle"},
    {"id": "turned right", "type": "Finished", "from": "turn right", "to": "settle"},
    {"id": "settled", "type": "Distance", "from": "settle", "to": "follow", "distance": 1.0},
    {"id": "free again", "type": "SensorLevel", "from": "blocked", "to": "follow", "sensor": "front", "above": 0.8,
      "readings": 3}
  ]
}"""

_DESCRIPTION = (
    "A starting point: follows the right wall, turns where the corridor does, waits before what is in its way.",
    "All is in metres, seconds and degrees; steering is + to the left.",
    "A state drives; try another clearance or speed in 'follow'. A state's label is its name in tables and pictures.",
    "A transition leads from a state to another when its type holds; those of a state are asked in their order.",
    "What else there is: tral fsm states. What is wrong: tral fsm check.",
)


def starting_point(name: str) -> MachineDefinition:
    """The machine under a name; its labels and its description explain its parts."""
    machine = tral_json.loads(_TEXT, "starting point")
    return machine.model_copy(update={"name": name, "description": " ".join(_DESCRIPTION)})
