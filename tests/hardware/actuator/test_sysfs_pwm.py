"""The computer's own PWM outputs, on files that behave like those of the kernel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rig import SETTINGS, STEERING, THROTTLE

from tral_env.errors import ConfigError, HardwareError
from tral_env.hardware.actuator.drivers import open_driver
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.actuator.sysfs_pwm import SysfsPwm, SysfsPwmOptions

FILES = {"period": "0\n", "duty_cycle": "0\n", "enable": "0\n", "polarity": "normal\n"}


@pytest.fixture
def chip(tmp_path: Path) -> Path:
    folder = tmp_path / "pwmchip2"
    for output in ("pwm0", "pwm1"):
        (folder / output).mkdir(parents=True)
        for name, text in FILES.items():
            (folder / output / name).write_text(text)
    return folder


class Kernel:
    """Refuses what the kernel refuses, takes each write as a whole, and notes it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.writes: list[tuple[str, str, str]] = []
        self.dead = "none"
        """Outputs whose names begin so refuse every write."""

        def write(file: int, data: bytes, offset: int) -> int:
            path, text = Path(f"/proc/self/fd/{file}").readlink(), data.decode().strip()
            assert offset == 0
            if path.parent.name.startswith(self.dead):
                raise OSError(19, f"No such device {path.parent.name}")
            state = {name: (path.parent / name).read_text().strip() for name in FILES} | {path.name: text}
            period, duty = int(state["period"]), int(state["duty_cycle"])
            if not period or duty > period or (path.name == "polarity" and state["enable"] == "1"):
                raise OSError(22, "Invalid argument")
            self.writes.append((path.parent.name, path.name, text))
            return path.write_bytes(data)

        monkeypatch.setattr("os.pwrite", write)


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch, chip: Path) -> Kernel:
    assert chip.is_dir()
    return Kernel(monkeypatch)


def opened(chip: Path, **changes: Any) -> Any:
    options = {"chip": 2, "root": str(chip.parent)}
    settings = replace(SETTINGS, driver="sysfs-pwm", bus=str(chip), options=options, **changes)
    return open_driver(Settings.from_json(settings.to_json()))


def state(chip: Path, output: int) -> tuple[str, ...]:
    return tuple((chip / f"pwm{output}" / name).read_text().strip() for name in FILES)


def test_a_new_output_gets_its_period_before_a_pulse(chip: Path, kernel: Kernel) -> None:
    opened(chip).start()
    assert kernel.writes == [
        ("pwm1", "period", "17430000"),
        ("pwm1", "duty_cycle", "1500000"),
        ("pwm1", "enable", "1"),
        ("pwm0", "period", "17430000"),
        ("pwm0", "duty_cycle", "1530000"),
        ("pwm0", "enable", "1"),
    ]


def test_a_pulse_of_an_output_that_is_on_is_one_write(chip: Path, kernel: Kernel) -> None:
    board = opened(chip)
    board.start()
    kernel.writes.clear()
    board.set_pulses(1400.0, 1450.0)
    assert kernel.writes == [("pwm1", "duty_cycle", "1450000"), ("pwm0", "duty_cycle", "1400000")]


def test_pulses_after_the_end_switch_the_outputs_on_again(chip: Path, kernel: Kernel) -> None:
    board = opened(chip)
    board.start()
    board.off()
    assert board.check() == ""
    kernel.writes.clear()
    board.set_pulses(1530.0, 1500.0)
    assert [name for _, name, _ in kernel.writes] == ["duty_cycle", "enable"] * 2
    assert board.check() == ""


def test_pulses_after_a_start_that_failed_switch_the_outputs_on(chip: Path, kernel: Kernel) -> None:
    board = opened(chip)
    board.start()
    kernel.dead = "pwm0"
    with pytest.raises(OSError, match="No such device"):
        board.start()
    kernel.dead = "none"
    kernel.writes.clear()
    board.set_pulses(1530.0, 1500.0)
    assert [name for _, name, _ in kernel.writes] == ["duty_cycle", "enable"] * 2


def test_an_output_that_ran_with_another_period_stops_before_it_takes_ours(chip: Path, kernel: Kernel) -> None:
    for name, text in {"period": "30000000", "duty_cycle": "29000000", "enable": "1"}.items():
        (chip / "pwm0" / name).write_bytes(text.encode())
    (chip / "pwm1" / "polarity").write_bytes(b"inversed\n")
    opened(chip).start()
    assert kernel.writes[-5:-2] == [
        ("pwm0", "duty_cycle", "0"),
        ("pwm0", "enable", "0"),
        ("pwm0", "period", "17430000"),
    ]
    assert state(chip, 0) == ("17430000", "1530000", "1", "normal")
    assert state(chip, 1) == ("17430000", "1500000", "1", "normal")


@pytest.mark.parametrize(("dead", "lives"), [("pwm0", 1), ("pwm1", 0)])
def test_an_output_that_fails_keeps_the_other_one_from_nothing(
    chip: Path, kernel: Kernel, dead: str, lives: int
) -> None:
    """A servo's output that is dead must not leave the throttle standing."""
    board = opened(chip)
    board.start()
    board.set_pulses(1400.0, 1400.0)
    kernel.dead = dead
    duties = []
    for method, pulses in ((board.set_pulses, (1530.0, 1500.0)), (board.off, ()), (board.start, ())):
        with pytest.raises(OSError, match="No such device"):
            method(*pulses)
        duties.append(state(chip, lives)[1:3])
    neutral = ("1530000", "1500000")[lives]
    assert duties == [(neutral, "1"), ("0", "0"), (neutral, "1")]


def test_of_two_outputs_that_fail_the_throttle_is_told(chip: Path, kernel: Kernel) -> None:
    board = opened(chip)
    board.start()
    kernel.dead = "pwm"
    with pytest.raises(OSError, match="pwm1"):
        board.set_pulses(1530.0, 1500.0)


@pytest.mark.usefixtures("kernel")
def test_pulses_stay_within_the_limits_of_their_channels(chip: Path) -> None:
    board = opened(chip)
    board.start()
    board.set_pulses(0.0, 9999.0)
    assert (state(chip, 0)[1], state(chip, 1)[1]) == ("1240000", "1900000")


@pytest.mark.usefixtures("kernel")
def test_the_channels_of_the_calibration_are_the_outputs(chip: Path) -> None:
    board = opened(chip, steering=STEERING._replace(output=1), throttle=THROTTLE._replace(output=0))
    board.start()
    assert (state(chip, 1)[1], state(chip, 0)[1]) == ("1530000", "1500000")


def test_off_ends_the_pulses_of_the_throttle_first(chip: Path, kernel: Kernel) -> None:
    board = opened(chip)
    board.start()
    kernel.writes.clear()
    board.off()
    assert kernel.writes == [
        ("pwm1", "duty_cycle", "0"),
        ("pwm1", "enable", "0"),
        ("pwm0", "duty_cycle", "0"),
        ("pwm0", "enable", "0"),
    ]


@pytest.mark.usefixtures("kernel")
@pytest.mark.parametrize(("name", "value"), [("period", "20000000"), ("polarity", "inversed"), ("enable", "0")])
def test_a_setting_that_somebody_changed_is_found(chip: Path, name: str, value: str) -> None:
    board = opened(chip)
    board.start()
    assert board.check() == ""
    (chip / "pwm1" / name).write_bytes(value.encode())
    assert value in board.check()


def test_an_output_is_asked_for_and_its_rights_are_awaited(chip: Path, tmp_path: Path) -> None:
    late = chip / "pwm1"
    late.rename(tmp_path / "hidden")
    naps = []

    def udev(seconds: float) -> None:
        naps.append(seconds)
        if len(naps) == 3:
            (tmp_path / "hidden").rename(late)

    SysfsPwm(chip, SETTINGS, udev)
    assert (chip / "export").read_text() == "1"
    assert naps == [0.05] * 3


@pytest.mark.parametrize("nap", [lambda seconds: None])
def test_an_output_that_never_comes_is_told_with_what_to_do(chip: Path, nap: Callable[[float], None]) -> None:
    with pytest.raises(HardwareError, match=r"cannot use the PWM outputs of .* dtoverlay=pwm-2chan"):
        SysfsPwm(
            chip, replace(SETTINGS, throttle=THROTTLE._replace(output=2), steering=STEERING._replace(output=1)), nap
        )


def test_a_chip_that_no_computer_has_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"SysfsPwmOptions\.chip = 64"):
        SysfsPwmOptions(chip=64)
