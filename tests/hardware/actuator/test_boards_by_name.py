"""Boards by name: those of this package, and those of other distributions by their entry points."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib import metadata
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest
from rig import SETTINGS, THROTTLE

from tral_env.errors import ConfigError
from tral_env.hardware.actuator.client import library_folders
from tral_env.hardware.actuator.drivers import (
    BOARDS,
    GROUP,
    Pca9685Options,
    board_class,
    board_names,
    open_driver,
    takes_commands,
)
from tral_env.hardware.actuator.laws import command_of, pulse_us
from tral_env.hardware.actuator.options import check_quantities
from tral_env.hardware.actuator.settings import Limits, Settings

OWN = """
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, kw_only=True)
class OwnBoard:
    has_own_clock: ClassVar[bool] = False
    port: str

    @property
    def device(self):
        return self.port

    def open(self, settings):
        return (self.port, settings.driver)
"""


@pytest.fixture
def plugins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """A board "own" of another distribution, and one that cannot be imported."""
    (tmp_path / "own_board.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    entries = [EntryPoint("own", "own_board:OwnBoard", GROUP), EntryPoint("broken", "no_such_module:Board", GROUP)]
    monkeypatch.setattr(metadata, "entry_points", lambda group: entries if group == GROUP else [])
    yield tmp_path
    sys.modules.pop("own_board", None)


@pytest.mark.usefixtures("plugins")
def test_a_board_of_another_distribution_is_opened_with_its_options() -> None:
    assert board_names() == (*BOARDS, "broken", "own")
    settings = replace(SETTINGS, driver="own", options={"port": "/dev/x"})
    assert open_driver(Settings.from_json(settings.to_json())) == ("/dev/x", "own")  # type: ignore[comparison-overlap]


@pytest.mark.usefixtures("plugins")
def test_a_board_that_cannot_be_loaded_is_told_by_name() -> None:
    with pytest.raises(
        ConfigError, match=r"the board 'broken' \(no_such_module:Board\) cannot be loaded: ModuleNotFou"
    ):
        board_class("broken")


@pytest.mark.usefixtures("plugins")
def test_the_nearest_name_is_told() -> None:
    with pytest.raises(ConfigError, match="unknown driver 'pca9658', did you mean 'pca9685'"):
        board_class("pca9658")


def test_the_worker_is_told_where_the_module_of_a_board_is(plugins: Path) -> None:
    assert str(plugins) in library_folders("own")
    assert str(plugins) not in library_folders("pca9685")


def test_a_library_that_is_not_installed_has_no_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert library_folders("pca9685") == []


@pytest.mark.parametrize("name", [name for name in BOARDS if name != "log"])
def test_each_board_names_its_device_and_whether_its_clock_must_be_measured(name: str) -> None:
    given: dict[str, Any] = {"port": "/dev/ttyUSB0"} if name in ("board2016", "ucboard") else {}
    options = BOARDS[name](**given)
    assert options.has_own_clock == (name == "pca9685")
    assert options.device == {"pca9685": 1, "sysfs-pwm": "/sys/class/pwm/pwmchip0"}.get(name, "/dev/ttyUSB0")


def test_the_log_is_a_board_on_a_file() -> None:
    assert BOARDS["log"]().device == "/dev/null"


@pytest.mark.parametrize("value", [True, None, "1", 120, 7.0])
def test_an_address_that_no_device_has_is_refused(value: object) -> None:
    with pytest.raises(ConfigError, match=r"Pca9685Options\.address = .*: expected 8 to 119"):
        Pca9685Options(address=value)  # type: ignore[arg-type]


def test_a_bus_is_a_number_or_a_path_and_a_limit_may_be_left_out() -> None:
    check_quantities(Pca9685Options(bus="/dev/i2c-7"))
    check_quantities(Limits(evidence_s=None))


@pytest.mark.parametrize("command", [-1.0, -0.5, -0.01, 0.0, 0.01, 0.5, 1.0])
@pytest.mark.parametrize("channel", [THROTTLE, THROTTLE._replace(skip_us=40.0), SETTINGS.steering])
def test_a_pulse_turns_back_into_its_command(command: float, channel: Any) -> None:
    assert command_of(pulse_us(command, channel), channel) == pytest.approx(command, abs=1e-12)


@pytest.mark.parametrize(("us", "command"), [(9e9, -1.0), (-9e9, 1.0), (1520.0, 0.0), (1500.0, 0.0)])
def test_a_pulse_beyond_an_end_or_in_the_skipped_zone_counts_as_that(us: float, command: float) -> None:
    assert command_of(us, THROTTLE._replace(skip_us=40.0)) == command


@pytest.mark.usefixtures("plugins")
def test_only_boards_that_say_so_take_commands() -> None:
    """A board of another distribution that says nothing takes pulses."""
    own: Any = board_class("own")
    assert not takes_commands(own(port="/dev/x"))
    assert [name for name, kind in BOARDS.items() if takes_commands(kind)] == ["board2016", "ucboard"]  # type: ignore[arg-type]
