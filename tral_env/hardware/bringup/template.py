"""The car file to begin with: every option, with its meaning; what is not needed stands behind a ``#``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from tral_env.atomic import write_bytes
from tral_env.checks import one_of
from tral_env.errors import ConfigError
from tral_env.hardware.car_file import NO_SENSORS, parse_car

_HEAD = """\
# The car file of one car. `tral car calibrate {path}` fills in what has to be measured, and `tral car check {path}`
# tells what is missing. Lengths are in metres, times in seconds, pulses in microseconds. A line behind a # has the
# default value.

version = 1
name = "{name}"
"""

_BOARDS: Mapping[str, str] = {
    "pca9685": """\
[board]
# The board that makes the pulses: a PCA9685 on an I2C bus.
driver = "pca9685"
bus = 1                     # 1 is /dev/i2c-1
address = 0x40              # as `i2cdetect -y 1` shows it
period_us = 17430           # time from pulse to pulse
oscillator_hz = 25000000.0  # clock of the board; boards differ by some percent
clock_measured = false      # true once it was measured on this board: until then nothing drives the motor
""",
    "sysfs-pwm": """\
[board]
# The pulses come from the computer's own PWM outputs. The channels of [pulses] are the numbers of the outputs.
driver = "sysfs-pwm"
chip = 0                    # 0 is /sys/class/pwm/pwmchip0
# root = "/sys/class/pwm"
period_us = 17430           # time from pulse to pulse
""",
    "board2016": """\
[board]
# The serial board of 2016. It makes the pulses by itself, from levels.
driver = "board2016"
port = "/dev/ttyUSB0"       # a name in /dev/serial/by-id stays the same
# baud = 115200
# steering_reversed = false # true: each steering is sent with the other sign
# throttle_reversed = false # true: each throttle is sent with the other sign
""",
    "ucboard": """\
[board]
# The later serial board (ucboard). It makes the pulses by itself, and has a dead man's switch of its own.
driver = "ucboard"
port = "/dev/ttyUSB0"       # a name in /dev/serial/by-id stays the same
# baud = 921600             # 115200 at its RS-232 plug
# steering_reversed = false # true: each steering is sent with the other sign
# throttle_reversed = false # true: each throttle is sent with the other sign
""",
    "log": """\
[board]
# No board: a file that takes the pulses, for a dry run of the commands.
driver = "log"
bus = "pulses.log"
""",
}

_PULSES = """
[pulses]
# Pulses of servo and motor controller: those of a file, and below it what was measured on this car.
file = "tt01"               # a packaged calibration, or the path of a .json file

# [pulses.steering]
# right_us = 1810           # full right
# neutral_us = 1530
# left_us = 1240            # full left
# trim_us = 0               # added to neutral, so that the car drives straight
# min_us = 1240             # hard limits: no pulse goes beyond
# max_us = 1810
# slew_per_s = 8.0          # largest change of the command in a second; without this line: no limit
# [pulses.throttle]
# reverse_us = 1860         # full reverse, or brake
# neutral_us = 1530
# forward_us = 1140         # full forward
# dead_zone_us = 50         # the motor rests this near to neutral
# min_us = 1140             # hard limits: no pulse goes beyond
# max_us = 1860
"""

_SENSORS: Mapping[str, str] = {
    "srf08": """
[[sensors]]                 # three ultrasonics SRF08
driver = "srf08"
bus = 1
addresses = {left = 0x70, front = 0x71, right = 0x72}
# firing = "together"       # "in turn" is three times slower, and has no crosstalk
# mode = "us"               # "cm" reaches 3 m
# cadence_s = 0.065         # time that one ranging takes
""",
    "srf02": """
[[sensors]]                 # three ultrasonics SRF02
driver = "srf02"
bus = 1
addresses = {left = 0x70, front = 0x71, right = 0x72}
# firing = "together"       # "in turn" is three times slower, and has no crosstalk
# mode = "us"               # "cm" reaches 3 m
# cadence_s = 0.065         # time that one ranging takes
""",
    "hall": """
[[sensors]]                 # the hall sensor of a wheel, on a pin of the computer
driver = "hall"
line = 17                   # on a Raspberry Pi the number of the GPIO
# chip = "/dev/gpiochip0"   # `gpiodetect` lists the chips
# pull = "up"               # resistor of the computer: up, down, none
# active = "low"            # level of the pin while a magnet is near
# metres_per_tick = 0.02513 # travel of the wheel from magnet to magnet
# debounce_s = 0.001        # an edge counts if the pin was quiet for this long before it
""",
    "board2016": """
[[sensors]]                 # ranges, hall sensor, line and battery of the serial board of 2016
driver = "board2016"
port = "/dev/ttyUSB0"       # that of the board
# baud = 115200
# range_unit_m = 0.01       # range that one unit stands for
# units_per_m = 937.5       # units of the hall sensor for a metre
# battery_unit_v = 0.001    # voltage that one unit stands for
""",
    "ucboard": """
[[sensors]]                 # ranges, hall sensor and battery of the ucboard
driver = "ucboard"
port = "/dev/ttyUSB0"       # that of the board
# baud = 921600
# metres_per_tick = 0.02513 # travel of the wheel from magnet to magnet
""",
}

_CAMERA = """
[camera]
# The camera that looks ahead. It stays off until `lens` names the file that `tral calibrate` wrote.
device = 0                  # 0 is /dev/video0; a path or a URL in quotes
width = 640                 # px; a size that the camera has, and that of the images for `tral calibrate`
height = 480                # px
rate_hz = 30.0
# lens = "camera_info.yaml"
# marker_size = 0.18        # edge of a marker's black square
# forward = 0.2             # the camera stands this far ahead of the rear axle
# latency_s = 0.0           # time from exposure until the computer has the image
"""

_REST = """
[limits]
# When the actuator's process stops the car; docs/safety.md explains each.
max_throttle = 0.4          # raise it when you trust the car; 1 is full throttle
# max_reverse = 1.0
# brake = 0.0               # throttle of a stop after a fault; below 0 brakes
# arming_s = 1.0            # neutral stands this long before the motor is let go
# silence_s = 0.1           # without a command for this long: neutral
# off_s = 0.5               # without a command for this long: no pulses
# max_age_s = 0.05          # an older command is refused
# evidence_s = 1.0          # driving this long while no sensor changes stops the car; "off" for a car without sensors
# bus_s = 0.05              # the board may refuse pulses for this long
# check_s = 0.2             # the board's settings are read back this often
# hang_s = 0.08             # a worker without a sign of life for this long is killed: neutral, then no pulses

[battery]
# Voltage of the drive battery, where a sensor reads it.
# warn_v = 6.6              # tell the driver
# stop_v = 6.0              # stop the car

[faults]
# What else stops the car while it drives; docs/safety.md explains each. "off" switches a law off.
# standstill_s = 2.0        # told to drive for so long without motion
# moving_mps = 0.08         # a car that reads less does not move
# driving_throttle = 0.11   # more throttle than this tells it to drive
# blind_m = 0.6             # should have driven so far without a tick of the hall sensor
# silent_s = 0.5            # an ultrasonic says nothing for this long
# frozen_m = 2.0            # an ultrasonic says the same over this way ...
# frozen_cm_m = 6.0         # ... or this one, if its ranges are whole centimetres ...
# frozen_echoes = 10        # ... and in so many echoes
# image_s = 0.5             # the newest image is so old
# reaction_s = 0.1          # from an echo that is too near to the next pulse
# rolling_share = 0.6       # share of the rolling-out way that counts where nothing brakes
# echoes = 2                # so many echoes have to be too near
# battery_s = 2.0           # the voltage is a mean over this time
# retries = 10              # warn of so many transactions tried again ...
# late_share = 0.2          # ... or of this share of late ticks ...
# window_s = 10.0           # ... within this time

[calibrated]
# The days on which the steps of the calibration were done. `tral car calibrate` writes them; delete a line to repeat.
"""

BOARD_SENSORS: Mapping[str, tuple[str, ...]] = {
    "pca9685": ("srf08", "hall"),
    "sysfs-pwm": ("srf08", "hall"),
    "board2016": ("board2016",),
    "ucboard": ("ucboard",),
    "log": (),
}
"""Board -> the sensors that usually go with it."""


def car_text(
    name: str = "car",
    *,
    board: str = "pca9685",
    sensors: Iterable[str] | None = None,
    camera: bool = True,
    path: str = "car.toml",
) -> str:
    """Text of a car file to begin with.

    Args:
        name: which car this is.
        board: name of its board.
        sensors: names of its sensors, or "none"; None: those that usually go with the board.
        camera: whether it has one.
        path: where the file will stand, for its comments.

    Raises:
        ConfigError: no board or sensor of this package has such a name, a sensor is named twice, or the name of the car
            or its file is empty or no single line.
    """
    one_of("board", board, _BOARDS)
    chosen = BOARD_SENSORS[board] if sensors is None else tuple(sensors)
    for sensor in chosen:
        one_of("sensor", sensor, (*_SENSORS, NO_SENSORS))
    if len(set(chosen)) < len(chosen):
        raise ConfigError(f"sensors {', '.join(chosen)}: one is named twice, and two drivers cannot share a device")
    if NO_SENSORS in chosen:
        if len(chosen) > 1:
            raise ConfigError(f"sensors {', '.join(chosen)}: '{NO_SENSORS}' stands alone")
        chosen = ()
    for what, line in (("name", name), ("path", path)):
        if not line.strip() or not line.isprintable():
            raise ConfigError(f"{what} = {line!r}: expected a line of text that can be read")
    quoted = name.replace("\\", "\\\\").replace('"', '\\"')
    listed = "".join(_SENSORS[sensor] for sensor in chosen) or '\n# No [[sensors]]: every reading is "nothing seen".\n'
    parts = (_HEAD.format(name=quoted, path=path), "\n", _BOARDS[board], _PULSES, listed, _CAMERA if camera else "")
    return "".join(parts) + _REST


def write_car(path: Path, name: str = "car", *, force: bool = False, **options: Any) -> None:
    """Write a car file to begin with.

    Args:
        path: of the file.
        name: which car this is.
        force: whether a file that is there may be replaced.
        **options: see `car_text`.

    Raises:
        ConfigError: the file is there already, cannot be written, or would be no car.
    """
    if path.exists() and not force:
        raise ConfigError(f"{path} is there already: choose another name, or --force")
    text = car_text(name, path=str(path), **options)
    parse_car(text, str(path), path.parent)
    if not path.parent.is_dir():
        raise ConfigError(f"cannot write '{path}': there is no folder '{path.parent}'")
    try:
        write_bytes(path, text.encode())
    except OSError as error:
        raise ConfigError(f"cannot write '{path}': {error}") from error
