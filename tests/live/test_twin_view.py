"""A running twin in the page: it is watched, and nothing of it can be changed."""

from __future__ import annotations

from pathlib import Path

import pytest
from browser import Browser

from tral_env.errors import HardwareError
from tral_env.twin.running import TwinProcess
from tral_env.twin.settings import TwinSettings
from tral_fsm.live.page import Page
from tral_fsm.live.twin import TwinView


def settings(folder: Path) -> TwinSettings:
    return TwinSettings(scenario="gates", seed=3, bus=None, files=False, serial=False, folder=str(folder))


def test_the_page_shows_the_car_of_a_twin_until_it_ends(tmp_path: Path) -> None:
    folder = tmp_path / "twin"
    with TwinProcess(settings(folder)) as twin:
        view = TwinView(folder)
        page = Page(view, port=0)
        with Browser(page.url) as browser:
            browser.until(lambda: "/course/boxes" in browser.scene and "/car_0/car" in browser.scene)
            browser.until(lambda: "twin, seed 3" in browser.words)
            assert not {"Pause", "Take over now", "friction"} & set(browser.labels)
            first = view.frame
            twin.reset(5)
            view.look()
            assert view.frame.plan is not first.plan
            twin.fault("sonar-silent")
            view.look()
            assert "sonar-silent" in view.frame.notice
            browser.until(lambda: "seed 5" in browser.words)
            assert browser.errors == []
        page.close()
    view.run()  # it ends, since the twin has
    view.close()


def test_no_twin(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match="tral twin up"):
        TwinView(tmp_path)
