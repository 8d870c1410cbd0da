"""What the page about recordings says is what the code says; the layout shows what a recording has."""

from __future__ import annotations

import json

from pages import ROOT, read, table

from tral_env.interface import CORE_LAYOUT
from tral_env.recording import topics
from tral_env.recording.read import read as read_recording

TOPICS = {
    topic.name: topic
    for topic in (
        topics.observation_topic(CORE_LAYOUT), topics.ACTION, topics.APPLIED, topics.LOOP, topics.STATE,
        topics.TRANSITION, topics.IMAGE, topics.FRAME, topics.LOG, topics.truth_topic({"speed_mps": 0.0}), topics.POSE,
    )
}  # fmt: skip


def test_the_page_lists_the_topics() -> None:
    shown = {row[0].strip("`"): row[1].strip("`") for row in table(read("docs/recording.md"), "| topic |")}
    assert shown == {name: topic.schema_name for name, topic in TOPICS.items()}


def test_the_layout_shows_fields_that_are_there() -> None:
    layout = json.loads((ROOT / "docs/recordings/foxglove_layout.json").read_text())
    panels = layout["configById"]
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", ())]
    for path in paths:
        topic, name = path.split(".")
        assert name in TOPICS[topic].schema["properties"], path
    assert panels["Image!camera"]["imageMode"]["imageTopic"] in TOPICS
    assert _leaves(layout["layout"]) == set(panels)


def _leaves(place: object) -> set[str]:
    return {place} if isinstance(place, str) else _leaves(place["first"]) | _leaves(place["second"])


def test_the_example_is_a_whole_drive_of_today() -> None:
    example = read_recording(ROOT / "docs/recordings/short.mcap")
    assert not example.damage
    assert example.layout == CORE_LAYOUT
    assert example.truth[-1]["success"]
