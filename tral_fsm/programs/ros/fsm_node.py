"""The node `fsm`: readings in, commands of a policy out."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from tral_env.errors import ConfigError, TralError
from tral_env.interface import CONTROL_PERIOD_S, Layout
from tral_env.ros import topics
from tral_env.ros.car_node import PUBLISHED
from tral_env.ros.commands import drive_of
from tral_env.ros.diagnostics import FAILED, OK, WARNING, Diagnostics, in_words
from tral_env.ros.msg.sensor import AckermannDriveStamped, Odometry
from tral_env.ros.msg.std import Bool, Header, State, String, Transition, TransitionEvent
from tral_env.ros.node import WARN, Node, Subscription
from tral_env.ros.patience import CAMERA_TIMEOUT_S, check_patience
from tral_env.ros.qos import COMMAND, LATCHED, STATE
from tral_env.ros.readings import MessageReadings
from tral_env.ros.times import nanoseconds, seconds_ns, stamp

READINGS = (*topics.RANGES.values(), topics.JOINTS, topics.APPLIED)

_MISSED_S = 0.1
"""A camera that is said to be dead is believed to be when it was silent for so long, s: an image was missed."""
_LATE_NS = seconds_ns(CONTROL_PERIOD_S)
"""A tick that comes later than this after it was told is late, ns."""
_WHOLE_S = 0.005
"""The other messages of a tick may come so much later than its odometry, s: a topic that others hear too takes another
way."""
_SILENT_S = 1.0
"""A car that told no odometry for so long tells none, s. Source: choice."""
_LOOK_S = 0.02
"""While it drives, the node looks this often whether the camera is still there, s."""


@dataclass(frozen=True, kw_only=True)
class FsmOptions:
    """Parameters of the node."""

    namespace: str = ""
    use_sim_time: bool = False
    camera_timeout_s: float = CAMERA_TIMEOUT_S
    """A policy that needs the camera stops the car when nothing came from it for so long, s; when the camera's process
    is dead, sooner."""

    def __post_init__(self) -> None:
        """Check the time."""
        check_patience("camera_timeout_s", self.camera_timeout_s)


class FsmNode:
    """A policy that drives through messages: each message of odometry is a tick."""

    def __init__(self, policy: Any, options: FsmOptions | None = None) -> None:
        """Open the topics.

        Raises:
            ConfigError: the policy needs readings that this node does not hear.
        """
        self.options = options or FsmOptions()
        self._policy, self._layout = policy, Layout()
        needed = getattr(policy, "needed_readings", None) or ()
        if lacking := sorted(set(needed).difference(self._layout.names)):
            raise ConfigError(f"the policy needs {', '.join(lacking)}, which the node `fsm` does not tell it")
        self._looks = any(name.startswith(("gate_", "marker_")) for name in needed)
        """Whether the policy needs the camera."""
        self.node = node = Node("fsm", namespace=self.options.namespace)
        self._readings = MessageReadings()
        self._heard: list[Subscription[Any]] = [
            node.subscription(topic, *PUBLISHED[topic], wakes=topic == topics.APPLIED) for topic in READINGS
        ]
        self._detections = node.subscription(topics.DETECTIONS, *PUBLISHED[topics.DETECTIONS])
        self._seen_s: float | None = None
        """When the camera told something last, s; None: never in this drive."""
        self._odometry = node.subscription(topics.ODOMETRY, Odometry, STATE, wakes=True)
        self._armed_topic = node.subscription(topics.ARMED, Bool, replace(LATCHED, depth=10), wakes=True)
        self._command = node.publisher(topics.THROTTLE_COMMAND, AckermannDriveStamped, COMMAND)
        self._arm = node.publisher(topics.ARM, Bool, STATE)
        self._state = node.publisher(topics.STATE, String, LATCHED)
        self._transitions = node.publisher(topics.TRANSITION, TransitionEvent, STATE)
        self._diagnostics = Diagnostics(node, "readings", str(getattr(policy, "name", "")))
        self.armed, self.why = False, ""
        """Whether the car drives, and why this node stopped it last."""
        self.answered = self.late = self.skipped = 0
        """Number of ticks that were answered, that came over a control period late, and that were not answered because
        the next one had come too."""
        self._tick_ns = self._answered_ns = self._applied_ns = 0
        self._came_s = self._begun_s = 0.0
        self._told_state = ""
        self.watch: Callable[[Mapping[str, float]], None] = lambda readings: None
        """Called with the readings of each tick that is answered."""
        if hasattr(policy, "trace"):
            policy.trace = self._tell_transition

    def run(self, ended: threading.Event) -> None:
        """Drive until the event is set."""
        try:
            while not ended.is_set():
                self.spin(0.1)
        finally:
            self.node.log(in_words(self.figures))
            self.node.close()

    @property
    def figures(self) -> dict[str, object]:
        """What came of the readings until now."""
        heard = (*self._heard, self._detections, self._odometry)
        return {
            "ticks answered": self.answered,
            "late ticks": self.late,
            "skipped ticks": self.skipped,
            "readings": self._readings.heard,
            "lost messages": sum(subscription.lost for subscription in heard),
            "refused readings": self._readings.refused,
        }

    def spin(self, patience_s: float) -> None:
        """Wait for a tick, and answer it."""
        wait_s = min(patience_s, _LOOK_S) if self.armed else patience_s
        self.node.wait(wait_s if self._is_whole() else min(patience_s, _WHOLE_S))
        self._hear()
        if self._diagnostics.due:
            self._diagnose()
        if not self.armed:
            return
        if self._looks and (why := self._camera_trouble()):
            self.stop(why)
        elif self._tick_ns > self._answered_ns and (self._seen_s is not None or not self._looks) and self._is_whole():
            self._answer()

    def _is_whole(self) -> bool:
        """Whether all messages of the last tick have come: the command as applied is the last one before odometry."""
        return self._applied_ns >= self._tick_ns or time.monotonic() - self._came_s >= _WHOLE_S

    def stop(self, why: str) -> None:
        """Ask the car to stop, and answer no more until it was armed again."""
        self.armed, self.why = False, why
        self._arm.publish(Bool(False))
        self.node.log(f"stops the car: {why}", WARN)
        self._diagnostics.hurry()

    def _hear(self) -> None:
        """Take all that came. The odometry of a tick comes last; so it is looked at first."""
        for armed in self._armed_topic.take():
            if armed.data and not self.armed:
                self._begin()
            self.armed = armed.data
        ticks = self._odometry.take()
        for subscription in self._heard:
            for message in subscription.take():
                self._readings.hear(message)
                if isinstance(message, AckermannDriveStamped):
                    self._applied_ns = nanoseconds(message.header.stamp)
        for message in self._detections.take():
            self._seen_s = time.monotonic()
            self._readings.hear(message)
        if ticks:
            self._tick_ns, self._came_s = nanoseconds(ticks[-1].header.stamp), time.monotonic()
            if self.armed:
                self.skipped += len(ticks) - 1
                self.late += not self.options.use_sim_time and time.time_ns() - self._tick_ns > _LATE_NS

    def _begin(self) -> None:
        """A new drive: the policy and the readings start anew."""
        self.why = ""
        self._policy.reset(1)
        self._readings.reset()
        self._answered_ns, self._seen_s, self._begun_s = 0, None, time.monotonic()

    def _camera_trouble(self) -> str:
        """Why the camera cannot be trusted; empty: it can."""
        if self._seen_s is None or self.options.use_sim_time:  # the car itself sees in simulated time
            return ""
        silent_s = time.monotonic() - self._seen_s
        if silent_s > _MISSED_S and self._detections.is_dead:
            return "the process of the camera is gone"
        if silent_s > self.options.camera_timeout_s:
            return f"nothing from the camera for {self.options.camera_timeout_s:g} s"
        return ""

    def _answer(self) -> None:
        """Let the policy drive a tick."""
        self._answered_ns = self._tick_ns
        now_ns = self._tick_ns if self.options.use_sim_time else time.time_ns()
        readings = self._named(now_ns)
        try:
            steering, throttle = self._policy.act(self._layout.pack(readings, 1)[0]).tolist()
        except TralError as error:
            return self.stop(str(error))
        self.watch(readings)
        command = AckermannDriveStamped(Header(stamp(self._tick_ns), topics.BASE), drive_of(steering, throttle))
        self._command.publish(command)
        self.answered += 1
        self._tell_state()
        return None

    def _diagnose(self) -> None:
        level, message = self._how_it_does()
        self._diagnostics.tell(
            self._tick_ns if self.options.use_sim_time else time.time_ns(), level, message, self.figures
        )

    def _how_it_does(self) -> tuple[int, str]:
        """Level and sentence of its status."""
        if self.why:
            return FAILED, f"stopped the car: {self.why}"
        if not self.armed:
            return WARNING, "the car is not armed"
        if time.monotonic() - max(self._came_s, self._begun_s) > _SILENT_S:
            return WARNING, f"no odometry from the car for over {_SILENT_S:g} s"
        if self._looks and self._seen_s is None:
            return WARNING, "waits for the camera"
        return OK, "drives"

    def _tell_state(self) -> None:
        states = getattr(self._policy, "active_states", None)
        if states and states[0] != self._told_state:
            self._told_state = states[0]
            self._state.publish(String(states[0]))

    def _named(self, now_ns: int) -> dict[str, float]:
        readings = self._readings.readings(now_ns)
        return {name: value for name, value in readings.items() if name in self._layout.names}

    def _tell_transition(self, transit: Any) -> None:
        event = TransitionEvent(
            timestamp=self._tick_ns,
            transition=Transition(label=transit.why),
            start_state=State(label=str(transit.source)),
            goal_state=State(label=str(transit.target)),
        )
        self._transitions.publish(event)
