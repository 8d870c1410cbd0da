"""The twin: car, boards and files put together, and the loop that runs them in real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

from tral_env.errors import ConfigError, SimulationError
from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.physical import Physical
from tral_env.hardware.sonar import ADDRESSES
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.twin.bus import I2cBus, TwinSmbus
from tral_env.twin.camera import CameraStream, RenderRequest
from tral_env.twin.car import TwinCar
from tral_env.twin.devices import DeviceFiles, why_no_files
from tral_env.twin.faults import FaultInjector
from tral_env.twin.hall import HALL_SOCKET, HallPin
from tral_env.twin.lateness import Lateness
from tral_env.twin.pca9685 import Pca9685Chip
from tral_env.twin.pulse_log import PulseLog
from tral_env.twin.pwm_chip import PwmChip
from tral_env.twin.receivers import MotorController, Servo
from tral_env.twin.serial_boards import SerialBoard, SimulatedBoard2016, SimulatedUcboard
from tral_env.twin.serial_port import SerialPort
from tral_env.twin.settings import TwinSettings
from tral_env.twin.srf08 import Srf08Chip

_MAX_BEHIND_S = 0.1
"""Ticks are made up for when the loop is behind by no more than this; what is more is skipped, and told."""


class Twin(Physical):
    """One simulated car behind its devices. `start` runs it in a thread; `tick` is one control period."""

    def __init__(
        self,
        settings: TwinSettings,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Build the car and its boards; nothing runs, and no file is there.

        Args:
            settings: what to build.
            clock: gives the time, s.
            sleep: waits some seconds.
        """
        self.settings, self.clock, self._sleep = settings, clock, sleep
        calibration = load_calibration(settings.calibration)
        self._outputs = calibration.steering.channel, calibration.throttle.channel
        self.car = TwinCar(settings.corridor())
        self.servo, self.controller = Servo(calibration), MotorController(calibration)
        self.pca9685 = Pca9685Chip(settings.clock_hz, clock=clock)
        self.rangers = {side: Srf08Chip(address, self._echoes_of(side), clock) for side, address in ADDRESSES.items()}
        self.bus = I2cBus([self.pca9685, *self.rangers.values()])
        self.smbus = TwinSmbus(self.bus)
        self.boards: dict[str, SerialBoard] = {
            "board2016": SimulatedBoard2016(calibration),
            "ucboard": SimulatedUcboard(calibration),
        }
        self.pwm = PwmChip()
        self.pulses = PulseLog(self._standing_us, clock)
        self.bus.after = self.pwm.after = self.pulses.note
        self.lateness = Lateness()
        self.camera: CameraStream | None = None
        self.files: DeviceFiles | None = None
        self.hall: HallPin | None = None
        self.ports: dict[str, SerialPort] = {}
        self.camera_gone = self.camera_frozen = False
        self.faults = FaultInjector(self)
        self.failure = ""
        """Why the twin stands still, in words; empty: it does not."""
        self.why_no_files = "" if settings.files else "the settings ask for none"
        self._lock, self._running = threading.RLock(), threading.Event()
        self._stack = ExitStack()
        self._next_s = clock()
        self.reset(settings.seed)

    def reset(self, seed: int) -> None:
        """Put the car at the start of the course of a seed; boards and files stay as they are.

        Raises:
            SimulationError: the twin has failed: it drives no more.
        """
        if self.failure:
            raise SimulationError(f"the twin has failed ({self.failure}): end it (`tral twin down`) and start it anew")
        with self._lock:
            self.car.reset(seed, self.clock())
            self.seed = seed
            if self.camera is not None:
                self.camera.place(self.car.render_setup())

    def tick(self, now_s: float) -> list[float]:
        """Do one control period that ends at a time, s; gives back the times of the hall sensor's edges, s."""
        with self._lock:
            self.faults.turn(now_s)
            steering, throttle, total_s = 0.0, 0.0, 0.0
            for seconds, (steering_us, throttle_us) in self.pulses.take():
                share = max(seconds, 1e-9)
                steering += share * self.servo.hear(steering_us)
                throttle += share * self.controller.hear(throttle_us, now_s)
                total_s += share
            listening = sum(ranger.fired_s is not None for ranger in self.rangers.values())
            edges_s = self.car.tick(steering / total_s, throttle / total_s, now_s, together=listening > 1)
            for port in self.ports.values():
                port.turn(self.car.board_readings, now_s)
            if self.camera is not None and self.camera.is_due(now_s):
                self.camera.expose(self._render_request(now_s))
        return edges_s

    def start(self) -> Self:
        """Show the files, if this computer can, and run in real time in a thread of its own."""
        self.settings.run_folder.mkdir(parents=True, exist_ok=True)
        self._open_files()
        self._open_ports()
        if self.settings.camera:
            self.camera = CameraStream(self.car.render_setup(), self._render_request(self.clock()))
            self._stack.callback(self.camera.close)
        self.hall = HallPin(self.settings.run_folder / HALL_SOCKET)
        self._stack.callback(self.hall.close)
        self._running.set()
        self._next_s = self.clock() + CONTROL_PERIOD_S
        thread = threading.Thread(target=self._run, daemon=True)
        thread.start()
        self._stack.callback(thread.join)
        return self

    def close(self) -> None:
        """Stop, and take all files away; a second call does nothing."""
        self._running.clear()
        self._stack.close()
        self.car.close()
        with suppress(OSError):  # it was never made, or somebody put a file there
            self.settings.run_folder.rmdir()

    def __enter__(self) -> Self:
        """The running twin."""
        return self.start()

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    @property
    def i2c_path(self) -> Path:
        """The bus as a file.

        Raises:
            ConfigError: it is none.
        """
        if self.files is None:
            raise ConfigError(f"the twin's bus is no file: {self.why_no_files}. Its bus is the object `smbus`")
        return self.files.i2c_path

    @property
    def disk(self) -> Path:
        """Folder that is a small disk of its own, for what may fill a disk; only where the twin has device files."""
        return self.settings.run_folder / "disk"

    def outcome(self) -> dict[str, Any] | None:
        """How the drive ended: ``ended``, ``time_s`` and ``progress``; None: it goes on."""
        outcome = self.car.outcome
        return None if outcome is None else asdict(outcome)

    def look(self) -> dict[str, Any]:
        """The car at this moment, for a page that shows it."""
        with self._lock:
            return {
                "seed": self.seed,
                "qpos": self.car.qpos.tolist(),
                "truth": dict(self.car.info),
                "readings": self.car.readings,
                "outcome": self.outcome(),
                "failure": self.failure,
                "faults": list(self.faults.active),
                "armed": self.controller.armed,
                "lost_s": self.lateness.lost_s,
            }

    def status(self) -> dict[str, Any]:
        """What the twin is and how it does, for people and tests."""
        with self._lock:
            info = dict(self.car.info)
            steering_us, throttle_us = self._standing_us()
        return {
            "seed": self.seed,
            "failure": self.failure,
            "i2c": None if self.files is None else str(self.i2c_path),
            "why_no_files": self.why_no_files,
            "serial": {name: str(port.path) for name, port in self.ports.items()},
            "camera": None if self.camera is None else self.camera.url,
            "faults": {name: end_s if end_s < float("inf") else None for name, end_s in self.faults.active.items()},
            "battery_v": self.car.battery_v,
            "hall": str(self.settings.run_folder / HALL_SOCKET),
            "oscillator_hz": self.pca9685.oscillator_hz,
            "steering_us": steering_us,
            "throttle_us": throttle_us,
            "controller_armed": self.controller.armed,
            "outcome": self.outcome(),
            "truth": info,
            "transactions": self.bus.transactions,
            "lateness": dict(self.lateness.record()),
        }

    def _open_files(self) -> None:
        settings = self.settings
        if not settings.files:
            return
        self.why_no_files = why_no_files()
        if self.why_no_files:
            return
        number = settings.bus if settings.bus is not None else 1
        link = None if settings.bus is None else Path(f"/dev/i2c-{settings.bus}")
        folder, name = settings.run_folder / "dev", f"i2c-{number}"
        self.files = DeviceFiles(folder, self.bus, i2c_name=name, tree=self.pwm, link=link, disk=self.disk)
        self._stack.callback(self.files.close)

    def _render_request(self, now_s: float) -> RenderRequest:
        return self.car.render_request(now_s, gone=self.camera_gone, frozen=self.camera_frozen)

    def _open_ports(self) -> None:
        if not self.settings.serial:
            return
        for number, (name, board) in enumerate(self.boards.items()):
            port = SerialPort(self.settings.run_folder / f"tty-{name}", board, seed=self.seed + number)
            self.ports[name] = port
            self._stack.callback(port.unplug)

    def _run(self) -> None:
        while self._running.is_set():
            now_s = self.clock()
            if now_s < self._next_s:
                self._sleep(self._next_s - now_s)
            self._late(self.clock() - self._next_s)
            try:
                edges_s = self.tick(self._next_s)
            except Exception as error:  # told by `status`: there is nobody else to tell
                self.failure = str(error) or type(error).__name__
                return
            if edges_s and self.hall is not None:
                self.hall.send(edges_s)
            self._next_s += CONTROL_PERIOD_S

    def _late(self, late_s: float) -> None:
        self.lateness.add(max(late_s, 0.0))
        if late_s > _MAX_BEHIND_S:
            self.lateness.lost_s += late_s
            self._next_s += late_s

    def _standing_us(self) -> tuple[float, float]:
        kind, (steering, throttle) = self.settings.board, self._outputs
        if kind in self.boards:
            return self.boards[kind].pulses_us(self.clock())
        chip = self.pca9685 if kind == "pca9685" else self.pwm
        return chip.pulse_us(steering), chip.pulse_us(throttle)

    def _echoes_of(self, side: str) -> Callable[[float], list[float] | None]:
        return lambda fired_s: self.car.echoes(side, fired_s)
