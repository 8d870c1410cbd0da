"""The real car as a Gymnasium environment: the spaces of the simulated one, paced by a clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from tral_env.checks import check_number
from tral_env.errors import CarStoppedError, ConfigError, HardwareError
from tral_env.hardware.actuator.client import ActuatorProcess
from tral_env.hardware.actuator.settings import Limits
from tral_env.hardware.car_file import CarFile
from tral_env.hardware.episode import Episode, episode_recorder
from tral_env.hardware.faults import FaultLimits, Look
from tral_env.hardware.i2c import BusName, Smbus
from tral_env.hardware.opening import OUTPUTS, SENSORS, Wanted, open_parts
from tral_env.hardware.pulses import CarCalibration
from tral_env.hardware.pwm import PulseOutput
from tral_env.hardware.sensors import Sensors, image_times, provided_by, watch_frames, watch_images
from tral_env.interface import (
    CONTROL_PERIOD_S,
    CONTROL_RATE_HZ,
    OPTIONAL_GROUPS,
    Layout,
    action_space,
    as_command,
    group_names,
)

__all__ = ["OUTPUTS", "SENSORS", "TralCarEnv"]

Observation = NDArray[np.float32]


class TralCarEnv(gym.Env[Observation, NDArray[np.float32]]):
    """The real car, behind the spaces of ``TralCorridor-v0``.

    ## Description
    The car is a 1:10 Ackermann car with a servo, a motor controller and the sensors that it is given. By default it
    stands: no motor moves, and its pulses are recorded. Frame: x forward, y left, z up, angles counter-clockwise. A
    step sends the command at once, then sleeps until its period of 1/80 s is over, then reads the sensors. A step that
    comes late counts in ``info["late_ticks"]``, and the schedule moves back with it: late steps are never caught up in
    a burst. A step or a reset that fails commands neutral before the error leaves it.

    With a car file, or with ``output="pca9685"`` and a bus by number or path, a process of its own owns the board. It
    goes to neutral when no new command comes for `Limits.silence_s`, and ends the pulses after `Limits.off_s`: when this process hangs, is
    stopped or is killed. An output or a bus that is an object is driven by this process, without that protection. A
    calibration whose clock was never measured is warned of: neutral may drive then, see docs/safety.md. A car file whose
    board was never measured is refused.

    A dry run of a car file, ``output="recorder"``, opens no sensor on the bus or the port of the board: until the board
    is set up, a command for a sensor may disturb it. Their readings are "nothing seen" then. Without a car file,
    ``sensors="srf08"`` is refused beside ``output="recorder"``: a dry run writes to no bus.

    In each step the car is watched for the faults of `tral_env.hardware.faults`. One that stops it raises a
    `CarStoppedError`, after the stop; the others stand in the info.

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
    | `warnings` | | if there are any: the faults that are only told, a text each |
    | `armed_again_after` | | of `reset` alone, if the actuator's process had stopped the car: why, in words |

    ## Arguments
    ```python
    import gymnasium as gym

    env = gym.make("tral_env:TralCar-v0", output="pca9685", sensors="srf08")
    ```

    | argument | default | meaning |
    | --- | --- | --- |
    | `config` | `None` | The car file, such as ``"car.toml"``: path, or a `CarFile`. It names board, pulses, sensors and limits. |
    | `calibration` | `None` | Pulses of the car: the name of a packaged calibration, the path of a file, or a `CarCalibration`. `None`: those of the car file, or of `"tt01"` without one. |
    | `output` | `None` | `"recorder"` keeps the pulses, `"pca9685"` drives by the PWM board, or a `PulseOutput` or an `ActuatorProcess` of your own. `None`: the board of the car file, or `"recorder"` without one. |
    | `sensors` | `None` | `"srf08"`: three ultrasonics, beside `output="pca9685"`; `"none"`: no reading. An object of your own, see `tral_env.hardware.sensors.Sensors`. `None`: those of the car file, or none without one. |
    | `bus` | `None` | I2C bus of what is opened by name: a number, a path, or an object like `smbus2.SMBus`. `None`: bus 1. The car file has its own. |
    | `limits` | `None` | When the actuator's process stops the car: `tral_env.hardware.actuator.settings.Limits`. `None`: those of the car file, or the defaults; for a car without sensors without `evidence_s`. Refused where no such process is started. |
    | `faults` | `None` | By which numbers faults are noticed: `tral_env.hardware.faults.FaultLimits`. `None`: those of the car file, or the defaults, where the actuator's process drives; elsewhere no fault stops the car, because a car that is not driven does not move. |
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
        config: str | Path | CarFile | None = None,
        calibration: str | Path | CarCalibration | None = None,
        output: str | PulseOutput | ActuatorProcess | None = None,
        sensors: str | Sensors | None = None,
        bus: BusName | Smbus | None = None,
        limits: Limits | None = None,
        faults: FaultLimits | None = None,
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
        self._unasked = {field.name for fields in OPTIONAL_GROUPS.values() for field in fields} - {*self._layout.names}
        self.readings: Mapping[str, float] = {}
        """What the sensors told last, also what the observation has no field for, such as the battery."""
        self._max_duration_s, self._clock, self._sleep = max_duration_s, clock, sleep
        self._running, self._closed = False, False
        self._read_s = clock()
        self._episode = Episode()
        self.calibration, self.output, self._actuator, self.sensors, self._watch = open_parts(
            Wanted(
                config=config,
                calibration=calibration,
                output=output,
                sensors=sensors,
                bus=bus,
                limits=limits,
                faults=faults,
                groups=groups,
                clock=clock,
                sleep=sleep,
            )
        )
        self.recording = episode_recorder(
            record, self._layout, clock, self.calibration,
            config=str(config) if isinstance(config, str | Path) else config, output=output, sensors=sensors,
            max_duration_s=max_duration_s,
        )  # fmt: skip
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

    @property
    def retries(self) -> int:
        """Number of transactions with the board that were tried again."""
        return self._actuator.retries

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
            self._actuator.neutral()
            super().reset(seed=seed)
            if options:
                raise ConfigError(f"unknown reset option(s) {', '.join(options)}: the real car has none")
            self.recording.begin()  # it may wait for the disk, so before the car is armed
            # The board first here too: one that lost its supply answers to the address of the first ultrasonic again.
            stopped_by = self._actuator.arm()
            if self.sensors is not None:
                self.sensors.start()
            self._actuator.resume()
            self._episode = Episode(start_s=self._clock(), evidence=self._episode.evidence)
            if self._watch is not None:
                self._watch.reset()
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
            CarStoppedError: a fault was noticed, and the car was stopped.
            ResetNeeded: there was no reset, or the episode is over.
        """
        if not self._running:
            raise ResetNeeded("TralCar-v0 stands in neutral: call reset() first")
        with self._neutral_if_it_fails():
            self._apply(action)
            self._pace()
            self._actuator.check()
            told = self._episode.observation
            observation = self._observe()
            self.recording.tick(
                told,
                action,
                applied=self._actuator.applied,
                pulses_us=self._actuator.pulses_us,
                late_ticks=self._episode.late_ticks,
                lateness_s=self._episode.lateness_s,
            )
            self._stop_at_a_fault()
            truncated = self._clock() - self._episode.start_s >= self._max_duration_s
            if truncated:
                self._running = False
                self._actuator.neutral()
        return observation, 0.0, False, truncated, self._info()

    def stop(self) -> None:
        """Stop the car at once, in an emergency; only `reset` arms it again.

        With the actuator's process it brakes, if `Limits.brake` says so; otherwise it goes to neutral.

        Raises:
            HardwareError: a device does not answer.
        """
        self._running = False
        self._actuator.stop()

    def close(self) -> None:
        """Send neutral, then let go of all devices; a second call does nothing.

        Raises:
            HardwareError: neutral could not be sent. Another call tries again.
        """
        if self._closed:
            return
        self._running = False
        try:
            self._actuator.close()
        finally:
            if self.sensors is not None:
                self.sensors.stop()
            self.recording.close()
        self._closed = True

    def _apply(self, action: NDArray[np.floating]) -> None:
        steering, throttle = np.clip(as_command(action), -1.0, 1.0).tolist()
        if self._episode.tick == 0:
            self._actuator.resume()
        self._actuator.command(steering, throttle, self._episode.evidence)

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
        self._read_s = self._clock()
        readings: Mapping[str, float] = {} if self.sensors is None else self.sensors.read(self._read_s)
        for name, value in readings.items():
            if not np.isfinite(value):
                raise HardwareError(f"the sensors say {name} = {value!r}: expected a finite number")
        self._episode.weigh(readings)
        self.readings = readings
        steering, throttle = self._actuator.applied
        asked = {name: value for name, value in readings.items() if name not in self._unasked}
        observation: Observation = self._layout.pack({**asked, "steering": steering, "throttle": throttle}, 1)[0]
        self._episode.observation = observation
        return observation

    def _stop_at_a_fault(self) -> None:
        """Look at the car after a tick; a fault that stops it is an error.

        Raises:
            CarStoppedError: the car was stopped.
        """
        if self._watch is None:
            return
        episode, actuator = self._episode, self._actuator
        image = image_times(self.sensors)
        look = Look(
            self._read_s, self.readings, actuator.applied[1],
            image_s=image and image.exposed_s, changed_s=image and image.changed_s,
            retries=actuator.retries, late_ticks=episode.late_ticks, ticks=episode.tick,
        )  # fmt: skip
        if fault := self._watch.update(look):
            actuator.stop()
            self.recording.say(str(fault), "error")
            raise CarStoppedError(str(fault))

    def _info(self) -> dict[str, Any]:
        steering_us, throttle_us = self._actuator.pulses_us
        info = {
            "tick": self._episode.tick,
            "late_ticks": self._episode.late_ticks,
            "steering_us": steering_us,
            "throttle_us": throttle_us,
        }
        warned = self._watch.warnings if self._watch is not None else ()
        return info | ({"warnings": tuple(map(str, warned))} if warned else {})

    @contextmanager
    def _neutral_if_it_fails(self) -> Iterator[None]:
        """End the episode in neutral when the block fails; an OSError of a bus becomes a HardwareError."""
        try:
            yield
        except BaseException as error:
            self._running = False
            try:
                self._actuator.neutral()
            except Exception as second:
                error.add_note(f"Neutral could not be commanded either ({second}): cut the power of the motor.")
            self.recording.say(f"{type(error).__name__}: {error}", "error")
            if isinstance(error, OSError) and not isinstance(error, HardwareError):
                raise HardwareError(f"a device of the car failed, neutral was commanded: {error}") from error
            raise
