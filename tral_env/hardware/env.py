"""The real car as a Gymnasium environment: the spaces of the simulated one, paced by a clock."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from tral_env.checks import check_number
from tral_env.errors import ConfigError, HardwareError, nearest
from tral_env.hardware.actuator.client import ActuatorProcess
from tral_env.hardware.actuator.settings import Limits
from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.commands import Commands, PulseCommands, actuator_settings
from tral_env.hardware.episode import Episode, episode_recorder
from tral_env.hardware.i2c import BusName, Smbus, named
from tral_env.hardware.pulses import CarCalibration
from tral_env.hardware.pwm import Pca9685, PulseOutput, Recorder
from tral_env.hardware.sensors import Sensors, provided_by, watch_frames, watch_images
from tral_env.hardware.sonar import SonarArray
from tral_env.interface import (
    CONTROL_PERIOD_S,
    CONTROL_RATE_HZ,
    OPTIONAL_GROUPS,
    Layout,
    action_space,
    as_command,
    group_names,
)

_UNMEASURED = (
    "the calibration '{}' does not say that the board's clock was measured (clock_measured): boards differ by up to "
    "8 %, and then neutral is a throttle of up to 29 %. Take the motor's plug off, measure the period at a pin, and "
    "set oscillator_hz; docs/real_car.md says how"
)
Observation = NDArray[np.float32]
OUTPUTS = ("recorder", "pca9685")
"""`TralCarEnv` opens these outputs by name."""
SENSORS = ("srf08",)
"""`TralCarEnv` opens these sensors by name."""


class TralCarEnv(gym.Env[Observation, NDArray[np.float32]]):
    """The real car, behind the spaces of ``TralCorridor-v0``.

    ## Description
    The car is a 1:10 Ackermann car with a servo, a motor controller and the sensors that it is given. By default it
    stands: no motor moves, and its pulses are recorded. Frame: x forward, y left, z up, angles counter-clockwise. A
    step sends the command at once, then sleeps until its period of 1/80 s is over, then reads the sensors. A step that
    comes late counts in ``info["late_ticks"]``, and the schedule moves back with it: late steps are never caught up in
    a burst. A step or a reset that fails commands neutral before the error leaves it.

    With ``output="pca9685"`` and a bus by number or path, a process of its own owns the board. It goes to neutral when
    no new command comes for `Limits.silence_s`, and ends the pulses after `Limits.off_s`: when this process hangs, is
    stopped or is killed. An output or a bus that is an object is driven by this process, without that protection. A
    calibration whose clock was never measured is warned of: neutral may drive then, see docs/safety.md.

    ## Action Space
    `Box(-1, 1, (2,), float32)`:

    | # | action | min | max | unit | meaning |
    | --- | --- | --- | --- | --- | --- |
    | 0 | `steering` | -1 | 1 | share of full lock | +1 = full left |
    | 1 | `throttle` | -1 | 1 | share of full throttle | +1 = full forward, 0 = neutral, -1 = full reverse or brake |

    A command beyond the bounds counts as the bound. The slew limits of the calibration hold it back, though never a
    throttle of 0. Then the calibration turns it into pulses.

    ## Observation Space
    `Box((d,), float32)` in SI units: the fields of `tral_env.interface.CORE_LAYOUT`, then those of `groups`, as
    ``TralCorridor-v0`` has them. A field without a sensor is "nothing seen"; `provided_readings` names the others, and
    `tral_env.interface.check_readings` refuses a policy that needs more. Steering and throttle are the command as
    applied, after the slew limit.

    ## Rewards
    The reward is 0: the car cannot see its progress.

    ## Starting State
    The car stands where you put it. `reset` commands neutral, starts the sensors and reads them once. With the
    actuator's process, it first arms, which holds neutral for `Limits.arming_s`. If no step follows at once, the pulses
    end, and the first step arms again; after anything else that stopped the car, an emergency stop for example, only
    `reset` does, and says so in its info. The seed changes nothing, and there are no reset options.

    ## Episode End
    ### Termination
    Never: the car cannot see that it has arrived, or what it has touched.

    ### Truncation
    The episode took `max_duration_s`. The car is in neutral then.

    ## Info
    | key | unit | what it is |
    | --- | --- | --- |
    | `tick` | | number of steps since reset |
    | `late_ticks` | | number of steps that came too late |
    | `steering_us` | us | pulse of the servo that was sent last; 0: none |
    | `throttle_us` | us | pulse of the motor controller that was sent last; 0: none |
    | `armed_again_after` | | of `reset` alone, if the actuator's process had stopped the car: why, in words |

    ## Arguments
    ```python
    import gymnasium as gym

    env = gym.make("tral_env:TralCar-v0", output="pca9685", sensors="srf08")
    ```

    | argument | default | meaning |
    | --- | --- | --- |
    | `calibration` | `'tt01'` | Pulses of the car: the name of a packaged calibration, the path of a file, or a `CarCalibration`. |
    | `output` | `'recorder'` | `"recorder"` keeps the pulses, `"pca9685"` drives by the PWM board, or a `PulseOutput` or an `ActuatorProcess` of your own. |
    | `sensors` | `None` | `"srf08"`: three ultrasonics. An object of your own, see `tral_env.hardware.sensors.Sensors`. `None`: no reading. |
    | `bus` | `1` | I2C bus of what is opened by name: a number, a path, or an object like `smbus2.SMBus`. |
    | `limits` | `None` | When the actuator's process stops the car: `tral_env.hardware.actuator.settings.Limits`. `None`: its defaults, without `evidence_s` for a car without sensors. Refused where no such process is started. |
    | `groups` | `()` | Optional groups of readings behind the core ones; the sensors must name all of them in `provided_readings`. |
    | `max_duration_s` | `60.0` | Length of an episode, s, above 0. |
    | `record` | `None` | Each episode is recorded into this file, or beside it if it exists: `drive.mcap`, `drive-2.mcap`. See `watch`. `None`: nothing is. |
    | `clock` | `time.monotonic` | Gives a time that never goes back, s. |
    | `sleep` | `time.sleep` | Waits some seconds. |
    | `render_mode` | `None` | The real car draws no pictures: nothing else is allowed. |

    ## Version History
    * v0: the first version.
    """  # noqa: E501

    metadata: dict[str, Any] = {"render_modes": [], "render_fps": int(CONTROL_RATE_HZ)}  # noqa: RUF012

    def __init__(
        self,
        *,
        calibration: str | Path | CarCalibration = "tt01",
        output: str | PulseOutput | ActuatorProcess = "recorder",
        sensors: str | Sensors | None = None,
        bus: BusName | Smbus = 1,
        limits: Limits | None = None,
        groups: Iterable[str] = (),
        max_duration_s: float = 60.0,
        record: str | Path | None = None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        render_mode: None = None,
    ) -> None:
        """Open the output, which sends neutral; the arguments stand in the docstring of the class.

        Raises:
            CalibrationError: the calibration cannot be used.
            ConfigError: an option is not allowed.
            MissingExtraError: smbus2 is not installed.
            HardwareError: a device does not answer.
        """
        if render_mode is not None:
            raise ConfigError(f"render_mode = {render_mode!r}: the real car has none")
        check_number("max_duration_s", max_duration_s, "s")
        if not max_duration_s > 0:
            raise ConfigError(f"max_duration_s = {max_duration_s!r}: expected a number above 0")
        self.render_mode = None
        groups = group_names(groups)
        self._layout = Layout.of(groups)
        self.observation_space: spaces.Box = self._layout.space()  # type: ignore[assignment]
        self.action_space: spaces.Box = action_space()  # type: ignore[assignment]
        self.calibration = load_calibration(calibration)
        self._max_duration_s, self._clock, self._sleep = max_duration_s, clock, sleep
        self._running, self._closed = False, False
        self._episode = Episode()
        opened = named(bus)
        _check_limits(limits, output, opened)
        if limits is None:
            limits = Limits(evidence_s=None) if sensors is None else Limits()
        # The board first: until it is set up it answers to the address of the first ultrasonic too.
        self.output = _output(output, self.calibration, opened, limits, clock, sleep)
        self._commands = _commands(self.output, self.calibration)
        self.sensors: Sensors | None = None
        try:
            self.sensors = _sensors(sensors, opened, sleep)
            _check_provided(groups, self.sensors)
        except BaseException:
            if isinstance(sensors, str) and self.sensors is not None:
                self.sensors.stop()
            self.output.close()
            raise
        self.recording = episode_recorder(
            record, self._layout, clock, self.calibration, output=output, sensors=sensors, max_duration_s=max_duration_s
        )
        """Records the episodes, or nothing without `record`."""
        watch_frames(self.sensors, self.recording.frame)
        watch_images(self.sensors, self.recording.image)

    @property
    def provided_readings(self) -> frozenset[str] | None:
        """Names of the fields that the car measures; None: its sensors do not say. See `interface.check_readings`."""
        provided = provided_by(self.sensors)
        return None if provided is None else provided | {"steering", "throttle"}

    def watch(self, policy: Any, files: Mapping[str, bytes] | None = None) -> None:
        """Record the states and transitions of the policy that drives, too; without `record` nothing happens.

        Args:
            policy: what it tells by `active_states`, `wanted_clearance` and `trace` is recorded, if it has them.
            files: files of the policy that a recording keeps, name -> content; from the next reset on.
        """
        self.recording.watch(policy, files)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Command neutral, arm, and start the sensors at once; put the car in its place before.

        A wrapper that resets by itself is nobody who looked at the car: leave autoreset off.

        Raises:
            ConfigError: an option was given; there are none. Neutral has been commanded.
            HardwareError: a device does not answer.
        """
        with self._neutral_if_it_fails():
            self._running = False
            self._commands.neutral()
            super().reset(seed=seed)
            if options:
                raise ConfigError(f"unknown reset option(s) {', '.join(options)}: the real car has none")
            self.recording.begin()  # it may wait for the disk, so before the car is armed
            # The board first here too: one that lost its supply answers to the address of the first ultrasonic again.
            stopped_by = self._commands.arm()
            if self.sensors is not None:
                self.sensors.start()
            self._commands.resume()
            self._episode = Episode(start_s=self._clock(), evidence=self._episode.evidence)
            observation = self._observe()
        self._running = True
        return observation, self._info() | ({"armed_again_after": stopped_by} if stopped_by else {})

    def step(self, action: NDArray[np.floating]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Send a command, wait for the end of its period, read the sensors.

        Args:
            action: (2,) steering, throttle.

        Raises:
            ConfigError: the action has another shape, or is not finite; neutral has been commanded.
            HardwareError: a device failed; neutral has been commanded.
            ResetNeeded: there was no reset, or the episode is over.
        """
        if not self._running:
            raise ResetNeeded("TralCar-v0 stands in neutral: call reset() first")
        with self._neutral_if_it_fails():
            self._apply(action)
            self._pace()
            self._commands.check()
            told = self._episode.observation
            observation = self._observe()
            self.recording.tick(
                told,
                action,
                applied=self._commands.applied,
                pulses_us=self._commands.pulses_us,
                late_ticks=self._episode.late_ticks,
                lateness_s=self._episode.lateness_s,
            )
            truncated = self._clock() - self._episode.start_s >= self._max_duration_s
            if truncated:
                self._running = False
                self._commands.neutral()
        return observation, 0.0, False, truncated, self._info()

    def close(self) -> None:
        """Send neutral, then let go of all devices; a second call does nothing.

        Raises:
            HardwareError: neutral could not be sent. Another call tries again.
        """
        if self._closed:
            return
        self._running = False
        try:
            self._commands.close()
        finally:
            if self.sensors is not None:
                self.sensors.stop()
            self.recording.close()
        self._closed = True

    def _apply(self, action: NDArray[np.floating]) -> None:
        steering, throttle = np.clip(as_command(action), -1.0, 1.0).tolist()
        if self._episode.tick == 0:
            self._commands.resume()
        self._commands.command(steering, throttle, self._episode.evidence)

    def _pace(self) -> None:
        """Sleep until the period is over; periods follow each other without drift until one is late."""
        episode, now = self._episode, self._clock()
        episode.lateness_s = 0.0
        if episode.deadline_s is not None and now > episode.deadline_s:
            episode.late_ticks += 1
            episode.lateness_s = now - episode.deadline_s
            episode.deadline_s = None
        deadline_s = now + CONTROL_PERIOD_S if episode.deadline_s is None else episode.deadline_s
        if now < deadline_s:
            self._sleep(deadline_s - now)
        episode.deadline_s = deadline_s + CONTROL_PERIOD_S
        episode.tick += 1

    def _observe(self) -> Observation:
        readings: Mapping[str, float] = {} if self.sensors is None else self.sensors.read(self._clock())
        for name, value in readings.items():
            if not np.isfinite(value):
                raise HardwareError(f"the sensors say {name} = {value!r}: expected a finite number")
        self._episode.weigh(readings)
        steering, throttle = self._commands.applied
        observation: Observation = self._layout.pack({**readings, "steering": steering, "throttle": throttle}, 1)[0]
        self._episode.observation = observation
        return observation

    def _info(self) -> dict[str, Any]:
        steering_us, throttle_us = self._commands.pulses_us
        return {
            "tick": self._episode.tick,
            "late_ticks": self._episode.late_ticks,
            "steering_us": steering_us,
            "throttle_us": throttle_us,
        }

    @contextmanager
    def _neutral_if_it_fails(self) -> Iterator[None]:
        """End the episode in neutral when the block fails; an OSError of a bus becomes a HardwareError."""
        try:
            yield
        except BaseException as error:
            self._running = False
            try:
                self._commands.neutral()
            except Exception as second:
                error.add_note(f"Neutral could not be commanded either ({second}): cut the power of the motor.")
            self.recording.say(f"{type(error).__name__}: {error}", "error")
            if isinstance(error, OSError) and not isinstance(error, HardwareError):
                raise HardwareError(f"a device of the car failed, neutral was commanded: {error}") from error
            raise


def _output(
    output: str | PulseOutput | ActuatorProcess,
    calibration: CarCalibration,
    bus: int | str | Smbus,
    limits: Limits,
    clock: Callable[[], float],
    sleep: Callable[[float], None],
) -> PulseOutput | ActuatorProcess:
    if not isinstance(output, str):
        return output
    if output == "recorder":
        return Recorder(calibration, clock)
    if output == "pca9685" and not calibration.clock_measured:
        warnings.warn(_UNMEASURED.format(calibration.name), stacklevel=3)
    if output == "pca9685" and isinstance(bus, int | str):
        return ActuatorProcess(actuator_settings(calibration, bus, limits))
    if output == "pca9685":
        return Pca9685(calibration, bus, sleep=sleep)
    raise ConfigError(f"unknown output '{output}': {nearest(output, OUTPUTS)}")


def _check_limits(limits: Limits | None, output: object, bus: object) -> None:
    if limits is not None and not (output == "pca9685" and isinstance(bus, int | str)):
        raise ConfigError(
            "limits= has an effect only with output='pca9685' and a bus by number or path, because the actuator's "
            "process keeps them: leave it out, or give them to your own ActuatorProcess"
        )


def _commands(output: PulseOutput | ActuatorProcess, calibration: CarCalibration) -> Commands:
    return output if isinstance(output, ActuatorProcess) else PulseCommands(output, calibration)


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


def _sensors(sensors: str | Sensors | None, bus: int | str | Smbus, sleep: Callable[[float], None]) -> Sensors | None:
    if not isinstance(sensors, str):
        return sensors
    if sensors == "srf08":
        return SonarArray(bus, sleep=sleep)
    raise ConfigError(f"unknown sensors '{sensors}': {nearest(sensors, SENSORS)}")
