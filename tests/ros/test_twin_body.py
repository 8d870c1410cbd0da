"""The twin behind the node `car`: how its drive goes is asked seldom, and told once."""

from __future__ import annotations

import json
from typing import Any

import pytest
from test_car_body import Garage

from tral_env.ros import topics
from tral_env.ros.msg.std import String
from tral_env.twin.settings import TwinSettings
from tral_fsm.programs.ros.twin import TwinBody


class Twin:
    """Stands in for the process of a twin."""

    first_status = {"i2c": "i2c-1", "camera": None}  # noqa: RUF012

    def __init__(self, settings: TwinSettings) -> None:
        self.asked, self.resets, self.ended = 0, [], None  # type: ignore[var-annotated]

    def outcome(self) -> Any:
        self.asked += 1
        return self.ended

    def status(self) -> Any:
        return {"lateness": {}}

    def reset(self, seed: int) -> None:
        self.resets.append(seed)
        self.ended = None

    def close(self) -> None:
        pass


@pytest.fixture
def body(monkeypatch: pytest.MonkeyPatch) -> TwinBody:
    monkeypatch.setattr("tral_fsm.programs.ros.twin.TwinProcess", Twin)
    garage = Garage()
    monkeypatch.setattr(TwinBody, "_open", lambda self: garage())
    monkeypatch.setattr("tral_env.ros.car_body.CONTROL_PERIOD_S", 0.0)
    return TwinBody(TwinSettings(seed=5))


def told(body: TwinBody, ticks: int, how: str) -> list[str]:
    """What is told in some ticks, and why the last one is the last."""
    found: list[str] = []
    for _ in range(ticks):
        tick = body.step(0.0, 0.2) if how == "drives" else body.rest()
        for topic, message in body.extra(0):
            assert topic == topics.RESULT
            assert isinstance(message, String)
            found.append(json.loads(message.data)["ended"])
    return [*found, tick.over]


def test_a_twin_that_waits_for_its_first_drive_is_not_asked(body: TwinBody) -> None:
    twin: Any = body._twin
    twin.ended = {"ended": "time is up"}
    assert told(body, 100, "rests") == [""]
    assert twin.asked == 0


@pytest.mark.parametrize("how", ["drives", "rests"])
def test_a_twin_is_asked_each_twentieth_tick_and_its_end_is_told_once(how: str, body: TwinBody) -> None:
    twin: Any = body._twin
    body.arm()
    assert told(body, 100, how) == [""]
    assert twin.asked == 5
    twin.ended = {"ended": "collision"}
    assert told(body, 100, how) == ["collision", "collision"]
    assert twin.asked == 6
    body.arm()
    assert twin.resets == [5, 5]
    assert told(body, 20, how) == [""]
