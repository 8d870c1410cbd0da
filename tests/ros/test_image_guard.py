"""Images that are too old or frozen stop the car, by the laws of the real car."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from test_ros_nodes import Statuses, after, until

from tral_env.errors import ConfigError
from tral_env.geometry import WHEEL_RADIUS_M
from tral_env.hardware.faults import FaultLimits
from tral_env.ros import topics
from tral_env.ros.camera_node import CameraNode, CameraNodeOptions
from tral_env.ros.image_guard import ImageGuard
from tral_env.ros.images import Exposed
from tral_env.ros.msg.sensor import JointState
from tral_env.ros.msg.std import Bool
from tral_env.ros.node import Node
from tral_env.ros.qos import LATCHED, STATE

GREY = np.zeros((480, 640), np.uint8)
PERIOD_S = 0.05


class Watched:
    """A guard on a clock of the test, and a camera of 20 Hz."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.guard = ImageGuard(clock=lambda: self.now_s)
        self.guard.begin()

    def drive(self, seconds: float, speed: float, *, frozen: bool = False, age_s: float = 0.03) -> str:
        """Drive on; what was found, or nothing."""
        for _ in range(round(seconds / PERIOD_S)):
            self.now_s += PERIOD_S
            if age_s < 1.0:
                shade = 0 if frozen else round(self.now_s * 1000) % 251
                self.guard.note(np.full_like(GREY, shade), age_s)
            if fault := self.guard.judge(speed):
                return str(fault)
        return ""


@pytest.fixture
def watched() -> Watched:
    return Watched()


def test_images_that_come_and_change_are_no_fault(watched: Watched) -> None:
    assert watched.drive(5.0, 0.5) == ""


def test_one_image_while_the_car_moves_is_a_fault(watched: Watched) -> None:
    assert watched.drive(1.0, 0.5) == ""
    assert watched.drive(1.0, 0.5, frozen=True).startswith("STOP camera frozen: one image for 0.5 s")


def test_one_image_while_the_car_stands_is_none(watched: Watched) -> None:
    assert watched.drive(5.0, 0.0, frozen=True) == ""


def test_images_that_stay_away_are_a_fault(watched: Watched) -> None:
    assert watched.drive(1.0, 0.5) == ""
    assert watched.drive(1.0, 0.5, age_s=1.0).startswith("STOP camera stale: the newest image is 0.5 s old")


def test_images_that_come_too_late_are_a_fault(watched: Watched) -> None:
    assert watched.drive(1.0, 0.5, age_s=0.6).startswith("STOP camera stale")


def test_the_first_image_may_take_two_seconds_after_arming(watched: Watched) -> None:
    assert watched.drive(1.9, 0.0, age_s=1.0) == ""
    assert watched.drive(1.0, 0.0, age_s=1.0).startswith("STOP camera stale")


def test_the_next_arming_begins_anew(watched: Watched) -> None:
    watched.drive(1.0, 0.5)
    assert watched.drive(1.0, 0.5, frozen=True)
    watched.guard.begin()
    assert watched.drive(2.0, 0.5) == ""


def test_the_node_stops_the_car_until_it_is_told_so_and_watches_again_after_the_next_arming(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    probe = Node("probe")
    armed = probe.publisher(topics.ARMED, Bool, LATCHED)
    joints = probe.publisher(topics.JOINTS, JointState, STATE)
    node = CameraNode(lambda: pytest.fail("no camera"), CameraNodeOptions(faults=FaultLimits(image_s=0.05)))
    orders: list[bool] = []
    monkeypatch.setattr(node._arm, "publish", lambda order: orders.append(order.data))
    until(lambda: armed.listeners and joints.listeners)
    try:
        for _ in range(2):
            orders.clear()
            armed.publish(Bool(True))
            joints.publish(JointState(name=[topics.HALL_WHEEL], position=[1.0], velocity=[20.0]))
            until(lambda: after(lambda: see_the_same(node), lambda: len(orders) > 1))
            assert not any(orders)
            armed.publish(Bool(False))
            until(lambda: after(node.judge, lambda: not node._armed))
            orders.clear()
            see_the_same(node)
            assert orders == []
    finally:
        node.node.close()
        probe.close()


def test_a_guard_that_fails_ends_the_node(monkeypatch: pytest.MonkeyPatch) -> None:
    node, ended = CameraNode(lambda: pytest.fail("no camera")), threading.Event()
    monkeypatch.setattr(node, "judge", lambda: 1 / 0)
    monkeypatch.setattr(node, "_watch", lambda ended: ended.wait(60.0))
    with pytest.raises(ZeroDivisionError):
        node.run(ended)
    assert ended.is_set()


def test_a_car_whose_speed_nobody_tells_any_more_counts_as_standing() -> None:
    probe, node = Node("probe"), CameraNode(lambda: pytest.fail("no camera"))
    joints = probe.publisher(topics.JOINTS, JointState, STATE)
    until(lambda: joints.listeners)
    joints.publish(JointState(name=[topics.HALL_WHEEL], position=[1.0], velocity=[20.0]))
    assert until(node.speed) == pytest.approx(20.0 * WHEEL_RADIUS_M)
    until(lambda: node.speed() == 0.0)
    node.node.close()
    probe.close()


def see_the_same(node: CameraNode) -> None:
    node.look(Exposed(b"", GREY, time.time_ns()))
    node.judge()


def test_an_image_of_the_future_was_exposed_now(watched: Watched) -> None:
    assert watched.drive(0.1, 0.5, age_s=-3600.0) == ""
    assert watched.drive(1.0, 0.5, age_s=1.0).startswith("STOP camera stale: the newest image is 0.5 s old")


def test_an_arming_right_after_a_stop_begins_anew() -> None:
    probe, node = Node("probe"), CameraNode(lambda: pytest.fail("no camera"))
    armed = probe.publisher(topics.ARMED, Bool, LATCHED)
    until(lambda: armed.listeners)
    armed.publish(Bool(True))
    until(lambda: after(node.judge, lambda: node._armed))
    node._why = "camera stale"
    for told in (False, True):
        armed.publish(Bool(told))
    until(lambda: after(node.judge, lambda: not node._why))
    assert node._armed
    node.node.close()
    probe.close()


def test_a_camera_whose_images_stay_away_is_not_said_to_look() -> None:
    probe, node = Node("probe"), CameraNode(lambda: pytest.fail("no camera"))
    statuses = Statuses(probe)

    def told(level: int, message: str) -> bool:
        node._diagnostics.hurry()
        node.judge()
        statuses.hear("/camera: images")
        last = statuses.last.get("/camera: images")
        return last is not None and (last.level, last.message) == (level, message)

    until(lambda: told(1, "no image yet"))
    node.look(Exposed(b"", GREY, time.time_ns()))
    until(lambda: told(0, "looks"))
    node._seen_s -= 1.1
    until(lambda: told(1, "no image for over 1 s"))
    node.node.close()
    probe.close()


def test_images_of_another_size_than_those_of_the_lens_are_refused() -> None:
    node = CameraNode(lambda: pytest.fail("no camera"))
    with pytest.raises(ConfigError, match="the images are 320 x 240 px, those of the lens 640 x 480 px"):
        node.look(Exposed(b"", GREY[::2, ::2], time.time_ns()))
    node.node.close()
