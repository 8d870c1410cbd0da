"""How a node does: a level, a sentence and figures on /diagnostics, each second and at once when something changed."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from tral_env.ros import topics
from tral_env.ros.msg.std import DiagnosticArray, DiagnosticStatus, Header, KeyValue
from tral_env.ros.node import Node
from tral_env.ros.qos import STATE
from tral_env.ros.times import stamp

OK, WARNING, FAILED = 0, 1, 2
"""Levels of diagnostic_msgs/msg/DiagnosticStatus."""
_PERIOD_S = 1.0


class Diagnostics:
    """Tells one status of a node."""

    def __init__(
        self, node: Node, subject: str, hardware_id: str = "", clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Open the topic.

        Args:
            node: whose status it is.
            subject: what is told of: the status is named "/car: commands", for example.
            hardware_id: the car or the camera.
            clock: gives a time that never goes back, s.
        """
        self._publisher = node.publisher(topics.DIAGNOSTICS, DiagnosticArray, STATE)
        self._name, self._hardware_id = f"{node.full_name}: {subject}", hardware_id
        self._clock, self._due_s = clock, -1.0

    @property
    def due(self) -> bool:
        """Whether it is time to tell again."""
        return self._clock() >= self._due_s

    def hurry(self) -> None:
        """Something has changed: tell it next time."""
        self._due_s = -1.0

    def tell(self, now_ns: int, level: int, message: str, figures: Mapping[str, object]) -> None:
        """Tell how it is now.

        Args:
            now_ns: time of ROS, ns.
            level: one of `OK`, `WARNING`, `FAILED`.
            message: a sentence.
            figures: name -> number or text.
        """
        self._due_s = self._clock() + _PERIOD_S
        status = DiagnosticStatus(
            level=level,
            name=self._name,
            message=message,
            hardware_id=self._hardware_id,
            values=[KeyValue(name, str(value)) for name, value in figures.items()],
        )
        self._publisher.publish(DiagnosticArray(Header(stamp(now_ns)), [status]))


def in_words(figures: Mapping[str, object]) -> str:
    """Figures as a line of a log."""
    return ", ".join(f"{value} {name}" for name, value in figures.items())
