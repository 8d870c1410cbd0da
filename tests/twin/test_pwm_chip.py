"""The PWM chip's files answer as those of the kernel do."""

import errno
import stat

import pytest

from tral_env.twin.pwm_chip import CHIP, PwmChip

OUTPUT = (*CHIP, "pwm0")


def exported() -> PwmChip:
    chip = PwmChip()
    chip.write((*CHIP, "export"), "0\n")
    return chip


def refusal(chip: PwmChip, *path: str, text: str) -> int | None:
    try:
        chip.write(path, text)
    except OSError as error:
        return error.errno
    return None


def test_an_output_is_there_once_it_is_exported() -> None:
    chip = PwmChip()
    assert chip.names(()) == ["pwm"]
    assert chip.names(("pwm",)) == ["pwmchip0"]
    assert chip.names(CHIP) == ["export", "unexport", "npwm"]
    with pytest.raises(FileNotFoundError):
        chip.mode(OUTPUT)
    chip.write((*CHIP, "export"), "0")
    assert chip.names(CHIP)[-1] == "pwm0"
    assert stat.S_ISDIR(chip.mode(OUTPUT))
    assert chip.names(OUTPUT) == ["period", "duty_cycle", "enable", "polarity"]
    chip.write((*CHIP, "unexport"), "0")
    assert chip.names(CHIP)[-1] == "npwm"


def test_a_pulse_leaves_an_enabled_output() -> None:
    chip, told = exported(), []
    chip.after = lambda: told.append(chip.pulse_us(0))
    for name, text in (("period", "17430000"), ("duty_cycle", "1530000"), ("enable", "1")):
        chip.write((*OUTPUT, name), text)
    assert told == [0.0, 0.0, 1530.0]
    assert chip.read((*OUTPUT, "duty_cycle")) == "1530000\n"
    assert chip.pulse_us(1) == 0.0


def test_an_inversed_output_is_high_for_the_rest_of_the_period() -> None:
    chip = exported()
    for name, text in (("polarity", "inversed"), ("period", "20000"), ("duty_cycle", "15000"), ("enable", "1")):
        chip.write((*OUTPUT, name), text)
    assert chip.pulse_us(0) == 5.0


def test_the_kernel_refuses_what_cannot_be() -> None:
    chip = exported()
    assert refusal(chip, *CHIP, "export", text="0") == errno.EBUSY
    assert refusal(chip, *CHIP, "export", text="4") == errno.ENODEV
    assert refusal(chip, *CHIP, "unexport", text="1") == errno.ENODEV
    assert refusal(chip, *CHIP, "export", text="x") == errno.EINVAL
    assert refusal(chip, *CHIP, "npwm", text="1") == errno.EACCES
    assert refusal(chip, *OUTPUT, "enable", text="1") == errno.EINVAL  # no period
    assert refusal(chip, *OUTPUT, "duty_cycle", text="1") == errno.EINVAL
    assert refusal(chip, *OUTPUT, "polarity", text="upside down") == errno.EINVAL
    chip.write((*OUTPUT, "period"), "1000")
    chip.write((*OUTPUT, "enable"), "1")
    assert refusal(chip, *OUTPUT, "polarity", text="inversed") == errno.EBUSY
    assert refusal(chip, *OUTPUT, "enable", text="2") == errno.EINVAL


def test_files_tell_who_may_do_what() -> None:
    chip = exported()
    assert chip.mode((*CHIP, "export")) & 0o777 == 0o200
    assert chip.mode((*CHIP, "npwm")) & 0o777 == 0o444
    assert chip.mode((*OUTPUT, "period")) & 0o777 == 0o644
    assert chip.read((*CHIP, "npwm")) == "4\n"
    with pytest.raises(PermissionError):
        chip.read((*CHIP, "export"))


@pytest.mark.parametrize("name", ["0", "pwm00", "pwm\N{ARABIC-INDIC DIGIT ZERO}"])
def test_an_output_has_one_name(name: str) -> None:
    with pytest.raises(FileNotFoundError):
        exported().mode((*CHIP, name))
