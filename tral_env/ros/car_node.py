"""The node `car`: readings out, commands in, at 80 Hz; it arms by a message, and stops when commands cease."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field
from typing import Any

from cyclonedds.idl import IdlStruct

from tral_env.errors import HardwareError, TralError
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.ros import topics
from tral_env.ros.body import Body, Tick
from tral_env.ros.commands import CommandGate, CommandLimits, Received
from tral_env.ros.description import robot_description, static_transforms
from tral_env.ros.diagnostics import OK, WARNING, Diagnostics, in_words
from tral_env.ros.msg.geometry import TFMessage, TransformStamped
from tral_env.ros.msg.sensor import AckermannDriveStamped, BatteryState, Imu, JointState, Odometry, Range
from tral_env.ros.msg.std import Bool, Clock, Int64, String
from tral_env.ros.msg.vision import Detection3DArray, MarkerArray
from tral_env.ros.node import ERROR, WARN, Node, Publisher
from tral_env.ros.odometry import DeadReckoning
from tral_env.ros.qos import ANY_COMMAND, CLOCK, LATCHED, SEEN, SENSOR_DATA, STATE, WHO, Profile
from tral_env.ros.readings import ReadingMessages
from tral_env.ros.times import seconds_ns, stamp

_EPOCH_NS = 1_000_000_000
"""The simulated time begins here: a stamp of 0 would mean "now"."""
_WINDOW = 0.8
"""For this share of a period the node waits for the answer to the readings that it has just told."""
_STEP_PATIENCE_S = 10.0
"""In lock-step, the answer to a tick may take so long, s; then the car stops."""
PUBLISHED: dict[str, tuple[type[IdlStruct], Profile]] = {
    **dict.fromkeys(topics.RANGES.values(), (Range, SENSOR_DATA)),
    topics.IMU: (Imu, SENSOR_DATA),
    topics.BATTERY: (BatteryState, SENSOR_DATA),
    topics.DETECTIONS: (Detection3DArray, SEEN),
    topics.CAMERA_URL: (String, LATCHED),
    topics.JOINTS: (JointState, STATE),
    topics.APPLIED: (AckermannDriveStamped, STATE),
    topics.ODOMETRY: (Odometry, STATE),
    topics.TRUTH: (Odometry, STATE),
    topics.TF: (TFMessage, STATE),
    topics.TF_STATIC: (TFMessage, LATCHED),
    topics.DESCRIPTION: (String, LATCHED),
    topics.COURSE: (MarkerArray, LATCHED),
    topics.RESULT: (String, LATCHED),
    topics.ARMED: (Bool, WHO),
}
"""Topic -> type and profile; one is opened when its first message is told."""


@dataclass(frozen=True, kw_only=True)
class CarOptions:
    """Parameters of the node."""

    namespace: str = ""
    use_sim_time: bool = False
    """Whether stamps are the simulated time, which /clock tells then."""
    lock_step: bool = False
    """Whether the simulation waits for the answer to each tick, and does not wait for the clock on the wall."""
    limits: CommandLimits = field(default_factory=CommandLimits)
    arm: bool = False
    """Whether the car is armed at the start, without a message."""


class CarNode:
    """Drives a body by messages."""

    def __init__(self, body: Body, options: CarOptions | None = None) -> None:
        """Open the topics; the car is not armed."""
        self.options = options or CarOptions()
        self.body = body
        self.node = Node("car", namespace=self.options.namespace)
        self.gate = CommandGate(self.options.limits)
        self._messages, self._reckoning = ReadingMessages(), DeadReckoning()
        self._publishers: dict[str, Publisher[Any]] = {}
        hear = self.node.subscription
        self._commands = (
            (hear(topics.SPEED_COMMAND, AckermannDriveStamped, ANY_COMMAND, wakes=True), False),
            (hear(topics.THROTTLE_COMMAND, AckermannDriveStamped, ANY_COMMAND, wakes=True), True),
        )
        self._arms = hear(topics.ARM, Bool, STATE, wakes=True)
        self._cars = hear(topics.ARMED, Bool, LATCHED)
        self._resets = hear(topics.RESET, Int64, STATE, wakes=True)
        self._diagnostics = Diagnostics(self.node, "commands", body.name)
        self._clock = self.node.publisher(topics.CLOCK, Clock, CLOCK) if self.options.use_sim_time else None
        self._tick = Tick({})
        self._now_ns = 0
        self._drives = False
        """Whether the body is armed."""
        self._over = False
        """Whether the drive is over: the next one begins at the start. Else a car goes on where it was stopped."""
        self.ticks = self.unanswered = 0
        """Number of ticks until now, and of those that an armed car drove by an older command: no answer had come."""

    def run(self, ended: threading.Event) -> None:
        """Drive until the event is set; the car stops at the end."""
        try:
            self._begin()
            while not ended.is_set():
                self.spin()
        finally:
            self.close()

    def spin(self) -> None:
        """One tick: hear, drive, tell."""
        self._hear_orders()
        command = self._command()
        if command is not None and self.gate.armed:
            self._tick = self._driven(*command)
        else:
            self._stop_body()
            self._tick = self.body.rest()
        self.ticks += 1
        if self._tick.over:
            self._over = True
            self._disarm(self._tick.over)
        self._tell()

    def close(self) -> None:
        """Stop the car, say how it went, and leave."""
        try:
            self.body.close()
        finally:
            self.node.log(in_words(self.figures))
            self.node.close()

    @property
    def figures(self) -> dict[str, object]:
        """What came of the commands until now."""
        return {
            "ticks": self.ticks,
            "commands": self.gate.taken,
            "late commands": self.gate.late,
            "lost commands": sum(subscription.lost for subscription, _ in self._commands),
            "refused commands": self.gate.refused,
            "ticks without an answer": self.unanswered,
        }

    def _begin(self) -> None:
        self._tell_armed()
        self._tell_latched()
        if self.options.arm:
            self._arm()
        else:
            self.node.log(f"waits until true comes on {self.node.resolve(topics.ARM)}")
        self._tick = self.body.rest()
        self._tell()

    def _driven(self, steering: float, throttle: float) -> Tick:
        try:
            return self.body.step(steering, throttle)
        except HardwareError as error:
            self._disarm(str(error))
            return self.body.rest()

    def _command(self) -> tuple[float, float] | None:
        """Wait for the answer to the readings of this tick, or until it must begin without."""
        began_s = time.monotonic()
        wait_s = _STEP_PATIENCE_S if self.options.lock_step else _WINDOW * CONTROL_PERIOD_S
        while self.gate.armed:
            self._hear_commands()
            left_s = began_s + wait_s - time.monotonic()
            if self.gate.answers_ns >= self._now_ns:
                break
            if left_s <= 0.0:
                self.unanswered += self.gate.has_command
                if self.options.lock_step:
                    self._disarm(f"no answer to a tick for {_STEP_PATIENCE_S:g} s")
                break
            self.node.wait(left_s)
            self._hear_orders()
        was_armed = self.gate.armed
        command = self.gate.command(self._tick.readings.get("speed"), self._now_s())
        if was_armed and command is None:
            self._tell_stop()
        return command

    def _hear_commands(self) -> None:
        for subscription, open_loop in self._commands:
            for message in subscription.take():
                source = message.sample_info.publication_handle  # type: ignore[attr-defined]
                self.gate.hear(Received(message, source, open_loop), self._now_s(), self._time_ns())
        if self._drives and not self.gate.armed:
            self._tell_stop()

    def _hear_orders(self) -> None:
        resets, orders = self._resets.take(), self._arms.take()
        for message in resets:
            self._disarm("reset")
            if message.data < 0:
                self.node.log(f"not reset: the seed {message.data} is below 0", ERROR)
                continue
            try:
                self.body.reset(message.data)
            except TralError as error:
                self.node.log(f"not reset: {error}", ERROR)
                continue
            self._over = False
            self._messages.reset()
            self._reckoning.reset()
            self._tell_latched()
            self.node.log(f"reset to seed {message.data}")
        for order in orders:
            if not order.data:
                self._disarm("stopped by a message on the topic arm")
            elif not self.gate.armed:
                self._arm()

    def _arm(self) -> None:
        try:
            if self._cars.alive > 1:
                name = self.node.full_name
                raise HardwareError(f"two nodes are {name}: end one, or give each car a --namespace of its own")
            self._tick = self.body.arm()
        except TralError as error:
            self.gate.why = str(error)
            self.node.log(f"not armed: {error}", ERROR)
            self._tell_armed()
            return
        for subscription, _ in self._commands:
            subscription.take()  # what was sent before is no command
        if self._over:
            self._reckoning.reset()
        self._messages.reset()
        self._drives, self._over = True, False
        self._now_ns = self._time_ns()
        self.gate.arm(self._now_s())
        self._tell_armed()
        self.node.log("armed")
        self._tell()

    def _disarm(self, why: str) -> None:
        if self.gate.armed:
            self.gate.disarm(why)
            self._tell_stop()

    def _tell_stop(self) -> None:
        """The gate has shut: stop the body, and say why. Who asked to arm before that did not know of it."""
        self._arms.take()
        self._stop_body()
        self._tell_armed()
        self.node.log(f"stopped: {self.gate.why}", WARN)
        self._diagnostics.hurry()

    def _stop_body(self) -> None:
        if not self._drives:
            return
        self._drives = False
        try:
            self.body.stop()
        except OSError as error:  # also a HardwareError; the actuator's process stops the car by itself then
            self.gate.why = str(error)
            self.node.log(f"the stop could not be commanded: {error}", ERROR)

    def _now_s(self) -> float:
        """Time by which commands grow old: one that never goes back."""
        simulated_s = self.body.sim_time_s if self.options.use_sim_time else None
        return time.monotonic() if simulated_s is None else simulated_s

    def _time_ns(self) -> int:
        if not self.options.use_sim_time or self.body.sim_time_s is None:
            return time.time_ns()
        return _EPOCH_NS + seconds_ns(self.body.sim_time_s)

    def _tell(self) -> None:
        """Tell the readings of the tick; the odometry comes last, so that who hears it has heard the others."""
        self._now_ns = now_ns = self._time_ns()
        if self._clock is not None:
            self._clock.publish(Clock(stamp(now_ns)))
        readings = self._tick.readings
        for topic, message in (*self.body.extra(now_ns), *self._messages.of(readings, now_ns, sees=self.body.sees)):
            self._publish(topic, message)
        if "distance" in readings:
            self._reckoning.update(
                readings["distance"], readings["speed"], readings.get("steering", 0.0), readings.get("throttle", 0.0)
            )
        else:
            self._reckoning.lose()
        self._publish(topics.TF, TFMessage([self._reckoning.transform(now_ns)]))
        self._publish(topics.ODOMETRY, self._reckoning.message(now_ns))
        if self._diagnostics.due:
            self._diagnose(now_ns)

    def _publish(self, topic: str, message: IdlStruct) -> None:
        if topic not in self._publishers:
            kind, profile = PUBLISHED[topic]
            self._publishers[topic] = self.node.publisher(topic, kind, profile)
        self._publishers[topic].publish(message)

    def _tell_armed(self) -> None:
        self._publish(topics.ARMED, Bool(self.gate.armed))

    def _tell_latched(self) -> None:
        now_ns = self._time_ns()
        self._publish(topics.DESCRIPTION, String(robot_description(self.body.camera_x)))
        latched = self.body.latched(now_ns)
        transforms = static_transforms(now_ns, self.body.camera_x)
        for topic, message in latched:
            if isinstance(message, TransformStamped):
                transforms.append(message)
            else:
                self._publish(topic, message)
        self._publish(topics.TF_STATIC, TFMessage(transforms))

    def _diagnose(self, now_ns: int) -> None:
        armed = self.gate.armed
        message = "armed" if armed else f"stopped: {self.gate.why}"
        if self._tick.trouble:
            message += f"; no readings: {self._tick.trouble}"
        figures = {"armed": str(armed).lower(), **self.figures}
        self._diagnostics.tell(now_ns, OK if armed else WARNING, message, figures)
