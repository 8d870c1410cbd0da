"""`render_mode="human"`: the page shows what a program steps, in real time, and changes nothing of it."""

from __future__ import annotations

from importlib.metadata import EntryPoint

import numpy as np
import pytest
from browser import Browser

from tral_env import human
from tral_env.env import TralCorridorEnv
from tral_env.errors import ConfigError
from tral_env.interface import CONTROL_PERIOD_S
from tral_fsm.live.human import HumanPage
from tral_fsm.live.pace import Clock


class Hand:
    """Time that passes by sleeping alone."""

    def __init__(self) -> None:
        self.s = 0.0
        self.clock = Clock(lambda: self.s, self._sleep)

    def _sleep(self, seconds: float) -> None:
        self.s += seconds


HAND = Hand()


def view() -> HumanPage:
    return HumanPage(0, HAND.clock)


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = EntryPoint("live", f"{__name__}:view", human.GROUP)
    monkeypatch.setattr(human, "entry_points", lambda group: (entry,))


@pytest.mark.usefixtures("installed")
def test_the_page_shows_the_drive_and_the_drive_stays_the_same() -> None:
    shown, plain = TralCorridorEnv(scenario="gates", render_mode="human"), TralCorridorEnv(scenario="gates")
    first, _ = shown.reset(seed=2)
    assert np.array_equal(first, plain.reset(seed=2)[0])
    begun, action = HAND.s, np.array([0.1, 0.3], np.float32)
    for _ in range(80):
        assert np.array_equal(shown.step(action)[0], plain.step(action)[0])
    assert HAND.s - begun == pytest.approx(80 * CONTROL_PERIOD_S)
    assert shown.render() is None
    page = shown._human.page  # type: ignore[union-attr]
    with Browser(page.url) as browser:
        browser.until(lambda: "/course/boxes" in browser.scene and "1.0 s" in browser.words)
        assert "Pause" not in browser.labels
        assert browser.errors == []
    shown.close()


def test_without_a_package_that_shows_it_the_error_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(human, "entry_points", lambda group: ())
    with pytest.raises(ConfigError, match="rgb_array"):
        TralCorridorEnv(scenario="straight", render_mode="human")
