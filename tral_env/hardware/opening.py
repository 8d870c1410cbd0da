"""What the environment of the real car opens: the board first, then the sensors."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from tral_env.errors import ConfigError, nearest
from tral_env.hardware.actuator.client import ActuatorProcess
from tral_env.hardware.actuator.settings import Limits
from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.car_file import CarFile, load_car
from tral_env.hardware.commands import Actuator, PulseActuator, actuator_settings
from tral_env.hardware.faults import FaultLimits, FaultWatch
from tral_env.hardware.i2c import BusName, Smbus, named
from tral_env.hardware.physical import Physical
from tral_env.hardware.pulses import CarCalibration
from tral_env.hardware.pwm import Pca9685, PulseOutput, Recorder
from tral_env.hardware.sensor_drivers import SensorOptions, readings_of
from tral_env.hardware.sensors import SensorGroup, Sensors, provided_by
from tral_env.hardware.sonar import SonarArray
from tral_env.interface import OPTIONAL_GROUPS

OUTPUTS = ("recorder", "pca9685")
"""`TralCarEnv` opens these outputs by name."""
SENSORS = ("srf08", "none")
"""`TralCarEnv` opens these sensors by name."""
_UNMEASURED = (
    "the calibration '{}' does not say that the board's clock was measured (clock_measured): boards differ by up to "
    "8 %, and then neutral is a throttle of up to 29 %. Take the motor's plug off, measure the period at a pin, and "
    "set oscillator_hz; docs/real_car.md says how"
)


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What the arguments of `TralCarEnv` ask for; None: not given."""

    config: str | Path | CarFile | None
    calibration: str | Path | CarCalibration | None
    output: str | PulseOutput | ActuatorProcess | None
    sensors: str | Sensors | None
    bus: BusName | Smbus | None
    limits: Limits | None
    faults: FaultLimits | None
    groups: Sequence[str]
    clock: Callable[[], float]
    sleep: Callable[[float], None]


class Parts(NamedTuple):
    """What was opened."""

    calibration: CarCalibration
    output: PulseOutput | ActuatorProcess
    actuator: Actuator
    sensors: Sensors | None
    watch: FaultWatch | None
    """Notices faults; None: nothing drives, so nothing could be missed."""


def open_parts(wanted: Wanted) -> Parts:
    """Open the output, which sends neutral, then the sensors.

    Raises:
        CalibrationError: the calibration cannot be used.
        ConfigError: an option is not allowed, or the car file cannot be used.
        MissingExtraError: a library is not installed.
        HardwareError: a device does not answer.
    """
    car = None if wanted.config is None else load_car(wanted.config)
    if car is None:
        _refuse_ultrasonics_in_a_dry_run(wanted)
        calibration = load_calibration("tt01" if wanted.calibration is None else wanted.calibration)
    else:
        _refuse_beside_a_car_file(wanted)
        calibration = car.calibration
    bus = named(1 if wanted.bus is None else wanted.bus)
    # The board first: until it is set up it answers to the address of the first ultrasonic too.
    output = _named_output(wanted, calibration, bus) if car is None else _output_of(car, wanted)
    sensors: Sensors | None = None
    try:
        sensors = _sensors(wanted, car, bus)
        _check_provided(wanted.groups, sensors)
    except BaseException:
        if sensors is not None and sensors is not wanted.sensors:
            sensors.stop()
        output.close()
        raise
    actuator = output if isinstance(output, ActuatorProcess) else PulseActuator(output, calibration)
    return Parts(calibration, output, actuator, sensors, _watch(wanted, car, output, sensors))


def _watch(
    wanted: Wanted, car: CarFile | None, output: PulseOutput | ActuatorProcess, sensors: Sensors | None
) -> FaultWatch | None:
    """What watches over the drive: with given limits, or where a process drives a board."""
    has_process = isinstance(output, ActuatorProcess)
    if wanted.faults is None and not has_process:
        return None
    limits = (wanted.faults or FaultLimits()) if car is None else car.fault_limits(wanted.faults)
    told = wanted.limits or (Limits() if car is None else car.limits)
    return FaultWatch(provided_by(sensors) or frozenset(), limits, told.brake if has_process else 0.0)


def _refuse_beside_a_car_file(wanted: Wanted) -> None:
    """Refuse an argument that the car file answers."""
    for name in ("calibration", "bus"):
        if getattr(wanted, name) is not None:
            raise ConfigError(f"{name}= beside config=: the car file says it, so leave {name}= out")
    if isinstance(wanted.output, str) and wanted.output != "recorder":
        raise ConfigError(
            f"output='{wanted.output}' beside config=: the car file names the board, so leave output= out; "
            "'recorder' is a dry run"
        )


def _refuse_ultrasonics_in_a_dry_run(wanted: Wanted) -> None:
    """Refuse sensors that measure on a command: a dry run writes to no bus."""
    if wanted.sensors == "srf08" and wanted.output in (None, "recorder"):
        raise ConfigError(
            "sensors='srf08' with output='recorder', which is a dry run and writes to no bus: an ultrasonic measures "
            "only on a command, and a board on its bus that was not set up may take that for its own. Leave sensors= "
            "out, drive with output='pca9685', or give the open ones: sensors=SonarArray(1)"
        )


def _named_output(wanted: Wanted, calibration: CarCalibration, bus: int | str | Smbus) -> PulseOutput | ActuatorProcess:
    """The output by its name, without a car file."""
    output, limits = wanted.output or "recorder", wanted.limits
    has_process = output == "pca9685" and isinstance(bus, int | str)
    if limits is not None and not has_process:
        raise ConfigError(
            "limits= has an effect only with config=, or with output='pca9685' and a bus by number or path, because "
            "the actuator's process keeps them: leave it out, or give them to your own ActuatorProcess"
        )
    if not isinstance(output, str):
        return output
    if output == "recorder":
        return Recorder(calibration, wanted.clock)
    if output != "pca9685":
        raise ConfigError(f"unknown output '{output}': {nearest(output, OUTPUTS)}")
    if not calibration.clock_measured:
        warnings.warn(_UNMEASURED.format(calibration.name), stacklevel=5)
    if isinstance(bus, int | str):
        limits = _seeing(limits or Limits(), wanted.sensors is not None, given=limits is not None)
        return ActuatorProcess(actuator_settings(calibration, bus, limits))
    return Pca9685(calibration, bus, sleep=wanted.sleep)


def _output_of(car: CarFile, wanted: Wanted) -> PulseOutput | ActuatorProcess:
    """The board of a car file, or what stands in for it."""
    if wanted.output is not None and wanted.limits is not None:
        raise ConfigError("limits= has an effect on the board of the car file alone: leave it or output= out")
    if wanted.output == "recorder":
        return Recorder(car.calibration, wanted.clock)
    if wanted.output is not None and not isinstance(wanted.output, str):
        return wanted.output
    require_clock(car)
    has_sensors = bool(car.sensors) if wanted.sensors is None else wanted.sensors != "none"
    limits = _seeing(wanted.limits or car.limits, has_sensors, given=False)
    return ActuatorProcess(replace(car.settings, limits=limits))


def _seeing(limits: Limits, has_sensors: bool, *, given: bool) -> Limits:
    """Limits without the law about observations that do not change, for a car without sensors; given ones stay."""
    return limits if has_sensors or given else replace(limits, evidence_s=None)


def require_clock(car: CarFile) -> None:
    """Refuse to drive a motor from a board whose clock was never measured.

    Raises:
        ConfigError: it was not.
    """
    if not car.clock_is_known:
        raise ConfigError(
            f"'{car.name}': the clock of the board was never measured, so its neutral may be a throttle of up to 29 %. "
            "Run `tral car calibrate`, which measures it with the motor's plug off; output='recorder' is a dry run"
        )


def _check_provided(groups: Sequence[str], sensors: Sensors | None) -> None:
    provided = sorted(provided_by(sensors) or ())
    for group in groups:
        missing = [field.name for field in OPTIONAL_GROUPS[group] if field.name not in provided]
        if missing:
            raise ConfigError(
                f"groups: the sensors of this car do not provide {', '.join(missing)} of the group '{group}'. "
                f"They provide {', '.join(provided) or 'nothing by name'}: give sensors that name these readings in "
                "`provided_readings`, or leave the group out"
            )


def _sensors(wanted: Wanted, car: CarFile | None, bus: int | str | Smbus) -> Sensors | None:
    sensors = wanted.sensors
    if sensors is None and car is not None:
        return open_sensors(car, wanted.clock, wanted.sleep, dry=wanted.output == "recorder")
    if sensors is None or sensors == "none":
        return None
    if not isinstance(sensors, str):
        return sensors
    if sensors == "srf08" and car is None:
        return SonarArray(bus, sleep=wanted.sleep)
    if car is not None:
        raise ConfigError(f"sensors='{sensors}' beside config=: the car file names the sensors; 'none' leaves them out")
    raise ConfigError(f"unknown sensors '{sensors}': {nearest(sensors, SENSORS)}")


class Device(NamedTuple):
    """A sensor or the camera of a car file."""

    name: str
    """Of its driver, or "camera"."""
    open: Callable[[], Sensors]
    """Opens it; see `tral_env.hardware.sensor_drivers.SensorOptions.open`."""
    asleep: Unopened | None
    """Stands in for it while the board is not set up; None: it has nothing to do with the board."""


class Unopened(Physical):
    """Sensors that stay shut in a dry run: each reading is "nothing seen"."""

    def __init__(self, provided_readings: frozenset[str] | None) -> None:
        """Stand in for sensors with these readings."""
        self.provided_readings = provided_readings

    def start(self) -> None:
        """Do nothing."""

    def read(self, now: float) -> Mapping[str, float]:
        """Give no reading."""
        del now
        return {}

    def stop(self) -> None:
        """Do nothing."""


def devices(car: CarFile, clock: Callable[[], float], sleep: Callable[[float], None]) -> Iterator[Device]:
    """All sensors of a car file, and its camera if the lens is known; nothing is opened yet."""
    for each in car.sensors:
        asleep = Unopened(readings_of(each.options)) if _is_beside_the_board(each.options, car) else None
        yield Device(each.driver, partial(each.options.open, clock, sleep), asleep)
    if car.camera is not None and car.camera.lens:
        from tral_env.hardware.camera import Camera  # OpenCV is for cars with a camera

        yield Device("camera", partial(Camera, car.camera, clock), None)


def _is_beside_the_board(options: SensorOptions, car: CarFile) -> bool:
    """Whether a sensor has the bus or the port of the board."""
    device = getattr(options, "bus", getattr(options, "port", None))
    return device is not None and _path(device) == _path(car.board.options.device)


def _path(device: int | str) -> str:
    return os.path.realpath(f"/dev/i2c-{device}" if isinstance(device, int) else device)


def open_sensors(
    car: CarFile, clock: Callable[[], float], sleep: Callable[[float], None], *, dry: bool = False
) -> Sensors | None:
    """Open all sensors of a car file; None: it has none.

    Args:
        car: the car.
        clock: the environment's clock, s.
        sleep: waits some seconds.
        dry: whether the board was not set up. Then what is on its bus or port stays shut: a PCA9685 fresh from power
            answers to the address of the left ultrasonic, and a command for that one would put it to sleep; a serial
            board sends nothing before its driver has set it up.

    Raises:
        HardwareError: a device does not answer; those that did were let go.
        MissingExtraError: a library is not installed.
    """
    opened: list[Sensors] = []
    try:
        for each in devices(car, clock, sleep):
            opened.append(each.asleep if dry and each.asleep is not None else each.open())
    except BaseException:
        for sensor in opened:
            with suppress(OSError):
                sensor.stop()
        raise
    return SensorGroup(*opened) if opened else None
