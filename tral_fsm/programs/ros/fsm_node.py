"""The node `fsm`: readings in, commands of a policy out."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import Any

from tral_env.interface import Layout
from tral_env.ros import topics
from tral_env.ros.car_node import PUBLISHED
from tral_env.ros.commands import drive_of
from tral_env.ros.msg.sensor import AckermannDriveStamped, Odometry
from tral_env.ros.msg.std import Bool, Header, State, String, Transition, TransitionEvent
from tral_env.ros.node import Node, Subscription
from tral_env.ros.qos import COMMAND, LATCHED, STATE
from tral_env.ros.readings import MessageReadings
from tral_env.ros.times import nanoseconds, stamp

READINGS = (*topics.RANGES.values(), topics.DETECTIONS, topics.BATTERY, topics.IMU, topics.JOINTS, topics.APPLIED)


@dataclass(frozen=True, kw_only=True)
class FsmOptions:
    """Parameters of the node."""

    namespace: str = ""
    use_sim_time: bool = False
    reading_timeout_s: float = 0.1
    """Without odometry for so long, the policy answers no more, s."""


class FsmNode:
    """A policy that drives through messages: each message of odometry is a tick."""

    def __init__(self, policy: Any, options: FsmOptions | None = None) -> None:
        """Open the topics."""
        self.options = options or FsmOptions()
        self._policy = policy
        self.node = node = Node("fsm", namespace=self.options.namespace)
        self._readings = MessageReadings()
        self._layout = Layout()
        self._heard: list[Subscription[Any]] = [node.subscription(topic, *PUBLISHED[topic]) for topic in READINGS]
        self._odometry = node.subscription(topics.ODOMETRY, Odometry, STATE, wakes=True)
        self._armed_topic = node.subscription(topics.ARMED, Bool, LATCHED, wakes=True)
        self._command = node.publisher(topics.THROTTLE_COMMAND, AckermannDriveStamped, COMMAND)
        self._arm = node.publisher(topics.ARM, Bool, STATE)
        self._state = node.publisher(topics.STATE, String, LATCHED)
        self._transitions = node.publisher(topics.TRANSITION, TransitionEvent, STATE)
        self.armed = False
        self._tick_ns = self._answered_ns = 0
        self._told_state = ""
        self.ages_s: list[float] = []
        """Age of the newest range in each tick, s."""
        if hasattr(policy, "trace"):
            policy.trace = self._tell_transition

    def run(self, ended: threading.Event) -> None:
        """Drive until the event is set."""
        try:
            while not ended.is_set():
                self.spin(0.1)
        finally:
            self.node.close()

    def spin(self, patience_s: float) -> None:
        """Wait for a tick, and answer it."""
        self.node.wait(patience_s)
        for armed in self._armed_topic.take():
            if armed.data and not self.armed:
                self._policy.reset(1)
                self._readings.reset()
                self._answered_ns = 0
            self.armed = armed.data
        ticks = self._odometry.take()
        for subscription in self._heard:
            for message in subscription.take():
                self._readings.hear(message)
        if ticks:
            self._tick_ns = nanoseconds(ticks[-1].header.stamp)
        if self.armed and self._tick_ns > self._answered_ns:
            self._answer()

    def _answer(self) -> None:
        self._answered_ns = self._tick_ns
        now_ns = self._tick_ns if self.options.use_sim_time else time.time_ns()
        observation = self._layout.pack(self._named(now_ns), 1)[0]
        steering, throttle = self._policy.act(observation).tolist()
        command = AckermannDriveStamped(Header(stamp(self._tick_ns), topics.BASE), drive_of(steering, throttle))
        self._command.publish(command)
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
