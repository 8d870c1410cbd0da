"""The nodes together, in lock-step, over loopback: a policy drives through messages as it drives in the plain env."""

from __future__ import annotations

import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from cyclonedds.core import Policy
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from tral_env.errors import ConfigError, CourseError, HardwareError
from tral_env.ros import topics
from tral_env.ros.body import Tick
from tral_env.ros.car_node import CarNode, CarOptions
from tral_env.ros.commands import CommandLimits, drive_of
from tral_env.ros.definition import type_hash
from tral_env.ros.msg.graph import ParticipantEntitiesInfo
from tral_env.ros.msg.sensor import AckermannDrive, AckermannDriveStamped, Odometry, Range
from tral_env.ros.msg.std import Bool, DiagnosticArray, DiagnosticStatus, Header, Int64, String
from tral_env.ros.node import Node, check_namespace, domain_id
from tral_env.ros.odometry import NOT_MEASURED
from tral_env.ros.qos import COMMAND, LATCHED, SENSOR_DATA, STATE, Profile
from tral_env.ros.readings import yaw_of
from tral_env.ros.times import stamp
from tral_fsm import load_policy
from tral_fsm.programs.ros.fsm_node import FsmNode, FsmOptions
from tral_fsm.programs.ros.simulation import SimulatedBody, SimulationOptions

SEED, TICKS = 3, 240
PATIENCE_S = 60.0


def body() -> SimulatedBody:
    return SimulatedBody(SimulationOptions(scenario="straight", seed=SEED, real_time=False))


class Running:
    """A node in a thread."""

    def __init__(self, run: Callable[[threading.Event], None]) -> None:
        self._ended = threading.Event()
        self._thread = threading.Thread(target=run, args=(self._ended,))
        self._thread.start()

    def end(self) -> None:
        self._ended.set()
        self._thread.join()


def after(does: Callable[[], None], told: Callable[[], Any]) -> Any:
    """What is told once something was done."""
    does()
    return told()


def until(what: Callable[[], Any]) -> Any:
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        if found := what():
            return found
        time.sleep(0.01)
    raise AssertionError("it never came")


@pytest.fixture
def probe() -> Iterator[Node]:
    node = Node("probe")
    yield node
    node.close()


def plain_way() -> list[tuple[float, float]]:
    """Places of the car in the plain env."""
    env = gym.make("tral_env:TralCorridor-v0", scenario="straight", groups=("imu", "battery"))
    policy = load_policy("wall")
    observation, _ = env.reset(seed=SEED)
    places = []
    for _ in range(TICKS):
        observation, _, _, _, info = env.step(policy.act(observation[:24]))
        places.append((float(info["pose"][0]), float(info["pose"][1])))
    env.close()
    return places


def test_in_lock_step_the_car_drives_as_in_the_plain_environment(probe: Node) -> None:
    car = CarNode(body(), CarOptions(lock_step=True, use_sim_time=True))
    fsm = FsmNode(load_policy("wall"), FsmOptions(use_sim_time=True))
    places: list[tuple[float, float]] = []
    step = car.body.step

    def noted(steering: float, throttle: float) -> Any:
        tick = step(steering, throttle)
        places.append(tuple(car.body.info["pose"][:2].tolist()))  # type: ignore[attr-defined]
        return tick

    car.body.step = noted  # type: ignore[method-assign]
    arm, state = probe.publisher(topics.ARM, Bool, STATE), probe.subscription("/fsm/state", String, LATCHED)
    until(lambda: arm.listeners == 1)
    running = [Running(car.run), Running(fsm.run)]
    try:
        until(lambda: fsm._armed_topic.publishers)
        arm.publish(Bool(True))
        until(lambda: len(places) >= TICKS)
    finally:
        for each in running:
            each.end()
    begun = next(i for i, place in enumerate(places) if place != places[0])
    assert state.take()[-1].data == "follow"
    waits = next(i for i, place in enumerate(plain_way()) if place != plain_way()[0])
    shift = begun - waits
    assert 0 <= shift < 40  # neutral, until the first answer came
    n = min(len(places) - shift, TICKS)
    np.testing.assert_allclose(places[shift : shift + n], plain_way()[:n], atol=0.02)


class Statuses:
    """Hears what nodes tell of themselves."""

    def __init__(self, probe: Node) -> None:
        self._heard = probe.subscription(topics.DIAGNOSTICS, DiagnosticArray, STATE)
        self.last: dict[str, DiagnosticStatus] = {}

    def hear(self, name: str) -> DiagnosticStatus | None:
        """The last status of a name."""
        for array in self._heard.take():
            self.last |= {each.name: each for each in array.status}
        return self.last.get(name)

    def level(self, name: str) -> int | None:
        """Its level."""
        told = self.hear(name)
        return None if told is None else told.level

    def figures(self, name: str) -> dict[str, str]:
        """Its figures."""
        told = self.hear(name)
        return {} if told is None else {each.key: each.value for each in told.values}


class Clockless:
    """A car node that a test spins, on simulated time, and a publisher of commands."""

    def __init__(self, probe: Node) -> None:
        self.node = CarNode(body(), CarOptions(use_sim_time=True, limits=CommandLimits(timeout_s=0.15)))
        self.node._begin()
        self.arm = probe.publisher(topics.ARM, Bool, STATE)
        self.command = probe.publisher(topics.SPEED_COMMAND, AckermannDriveStamped, COMMAND)
        self.armed = probe.subscription(topics.ARMED, Bool, LATCHED)
        self.odometry = probe.subscription(topics.ODOMETRY, Odometry, STATE)
        until(lambda: self.arm.listeners and self.command.listeners and self.armed.publishers)

    def spin(self, ticks: int, speed: float | None = None) -> None:
        gate = self.node.gate
        for _ in range(ticks):
            if speed is not None:
                taken = gate.taken
                self.command.publish(AckermannDriveStamped(drive=AckermannDrive(speed=speed)))
                until(lambda: after(self.node._hear_commands, lambda: not gate.armed or gate.taken > taken))  # noqa: B023
            self.node.spin()

    def ask(self, arm: bool) -> None:
        self.arm.publish(Bool(arm))
        until(lambda: after(self.node.spin, lambda: self.node.gate.armed == arm))

    @property
    def speed(self) -> float:
        return float(self.node.body.info["speed_mps"])  # type: ignore[attr-defined]


@pytest.fixture
def car(probe: Node) -> Iterator[Clockless]:
    found = Clockless(probe)
    yield found
    found.node.close()


def test_a_car_drives_by_speed_stops_without_commands_and_stays_until_it_is_armed(car: Clockless) -> None:
    car.spin(20, speed=0.8)
    assert car.speed == pytest.approx(0.0, abs=0.01)  # nobody armed it
    car.ask(True)
    car.spin(120, speed=0.8)
    assert car.speed > 0.3
    until(lambda: after(car.node.spin, lambda: not car.node.gate.armed))
    assert car.node.gate.why == "no command for 0.15 s"
    car.spin(160, speed=0.8)
    assert car.speed == pytest.approx(0.0, abs=0.05)
    assert car.armed.take()[-1].data is False
    car.ask(True)
    car.spin(120, speed=0.8)
    assert car.speed > 0.3


def test_a_car_that_is_armed_again_goes_on_from_where_it_was_stopped(car: Clockless) -> None:
    car.ask(True)
    car.spin(120, speed=0.8)
    car.ask(False)
    until(lambda: after(car.node.spin, lambda: car.speed == pytest.approx(0.0, abs=0.01)))
    before = car.node._reckoning.x
    car.ask(True)
    assert before > 0.1
    assert car.node._reckoning.x == pytest.approx(before, abs=0.05)


def test_a_seed_that_is_none_stops_the_car_and_the_node_goes_on(car: Clockless, probe: Node) -> None:
    reset = probe.publisher(topics.RESET, Int64, STATE)
    until(lambda: reset.listeners)
    car.ask(True)
    reset.publish(Int64(-1))
    until(lambda: after(car.node.spin, lambda: not car.node.gate.armed))
    assert car.node.gate.why == "reset"
    car.spin(2)


@pytest.mark.parametrize("error", [CourseError("no such course"), ConfigError("the twin refuses")])
def test_a_reset_or_an_arming_that_fails_is_told_and_the_node_goes_on(
    error: Exception, car: Clockless, probe: Node, caplog: pytest.LogCaptureFixture
) -> None:
    def fails(*_: Any) -> Any:
        raise error

    caplog.set_level("INFO")
    reset = probe.publisher(topics.RESET, Int64, STATE)
    until(lambda: reset.listeners)
    car.node.body.reset = car.node.body.arm = fails  # type: ignore[method-assign]
    reset.publish(Int64(3))
    car.arm.publish(Bool(True))

    def told() -> set[str]:
        return {each.message for each in caplog.records}

    until(lambda: after(car.node.spin, lambda: {f"not reset: {error}", f"not armed: {error}"} <= told()))
    assert not car.node.gate.armed


def test_a_car_that_reads_nothing_tells_why_and_that_it_knows_no_place(car: Clockless, probe: Node) -> None:
    statuses = Statuses(probe)
    car.node.body.rest = lambda: Tick({}, trouble="no answer")  # type: ignore[method-assign]
    until(lambda: after(car.node.spin, lambda: statuses.hear("/car: commands")))
    assert statuses.last["/car: commands"].message == "stopped: not armed yet; no readings: no answer"
    assert car.odometry.take()[-1].pose.covariance[0] == NOT_MEASURED


def test_a_node_tells_on_the_terminal_too_why_the_car_stands(car: Clockless, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    car.ask(True)
    car.ask(False)
    assert [(each.name, each.message) for each in caplog.records] == [
        ("tral.ros.car", "armed"),
        ("tral.ros.car", "stopped: stopped by a message on the topic arm"),
    ]


def test_a_message_that_came_before_a_stop_does_not_arm_the_car_after_it(car: Clockless) -> None:
    car.ask(True)
    car.spin(5, speed=0.5)
    step = car.node.body.step

    def fails(steering: float, throttle: float) -> Any:
        car.node.body.step = step  # type: ignore[method-assign]
        car.arm.publish(Bool(True))
        assert car.node.node.wait(PATIENCE_S)  # it has come
        raise HardwareError("a device failed")

    car.node.body.step = fails  # type: ignore[method-assign]
    car.spin(20)
    assert not car.node.gate.armed
    assert car.node.gate.why == "a device failed"


def test_the_car_tells_on_diagnostics_and_at_the_end_what_came_of_the_commands(
    probe: Node, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    statuses = Statuses(probe)
    car = Clockless(probe)
    car.ask(True)
    car.spin(20, speed=0.5)
    car.command.publish(AckermannDriveStamped(drive=AckermannDrive(speed=math.nan)))
    until(lambda: after(car.node.spin, lambda: statuses.figures("/car: commands").get("refused commands") == "1"))
    told = statuses.last["/car: commands"]
    assert told.level == 1
    assert told.message.startswith("stopped: a command is no number")
    figures = statuses.figures("/car: commands")
    assert (figures["commands"], figures["late commands"], figures["lost commands"]) == ("20", "0", "0")
    car.node.close()
    assert "20 commands, 0 late commands, 0 lost commands, 1 refused commands" in caplog.records[-1].message


def test_a_tick_for_which_no_answer_came_is_counted(car: Clockless) -> None:
    car.ask(True)
    car.spin(5, speed=0.5)
    before = car.node.unanswered
    car.spin(3)
    assert car.node.unanswered - before == 3


def test_the_policy_node_tells_ticks_that_were_skipped_or_late_and_readings_that_were_refused(probe: Node) -> None:
    statuses = Statuses(probe)
    fsm = FsmNode(load_policy("wall"))
    armed = probe.publisher(topics.ARMED, Bool, LATCHED)
    odometry = probe.publisher(topics.ODOMETRY, Odometry, STATE)
    sonar = probe.publisher(topics.RANGES["left"], Range, SENSOR_DATA)
    until(lambda: armed.listeners and odometry.listeners and sonar.listeners)
    armed.publish(Bool(True))
    until(lambda: after(lambda: fsm.spin(0.0), lambda: fsm.armed))
    for _ in range(3):
        sonar.publish(Range(Header(stamp(time.time_ns()), "ultrasonic_left"), range=math.nan))
    until(lambda: after(lambda: fsm.spin(0.0), lambda: fsm.figures["refused readings"] == 3))
    for _ in range(2):
        odometry.publish(Odometry(Header(stamp(time.time_ns() - 10**9))))
    until(lambda: after(lambda: fsm.spin(0.0), lambda: fsm.answered + fsm.skipped == 2))
    assert fsm.late == fsm.answered
    until(
        lambda: after(lambda: fsm.spin(0.0), lambda: statuses.figures("/fsm: readings").get("refused readings") == "3")
    )
    fsm.stop("the policy failed")
    until(lambda: after(lambda: fsm.spin(0.0), lambda: statuses.level("/fsm: readings") == 2))
    assert statuses.last["/fsm: readings"].message == "stopped the car: the policy failed"
    fsm.node.close()


def test_the_policy_node_is_not_well_while_nothing_comes(probe: Node) -> None:
    statuses = Statuses(probe)
    fsm = FsmNode(load_policy("office"))
    armed = probe.publisher(topics.ARMED, Bool, LATCHED)
    odometry = probe.publisher(topics.ODOMETRY, Odometry, STATE)
    until(lambda: armed.listeners and odometry.listeners)
    armed.publish(Bool(True))
    until(lambda: after(lambda: fsm.spin(0.0), lambda: fsm.armed))

    def told(message: str) -> bool:
        fsm._diagnostics.hurry()
        fsm.spin(0.0)
        statuses.hear("/fsm: readings")
        return statuses.last["/fsm: readings"].message == message if statuses.last else False

    until(lambda: told("waits for the camera"))
    fsm._begun_s -= 1.1
    until(lambda: told("no odometry from the car for over 1 s"))
    assert statuses.last["/fsm: readings"].level == 1
    fsm._seen_s = fsm._came_s = time.monotonic()
    until(lambda: told("drives"))
    assert statuses.last["/fsm: readings"].level == 0
    fsm.node.close()


@pytest.mark.parametrize("seconds", [math.nan, math.inf, 0.0, -1.0])
def test_a_camera_is_waited_for_some_time(seconds: float) -> None:
    with pytest.raises(ConfigError, match="camera_timeout_s"):
        FsmOptions(camera_timeout_s=seconds)


def test_a_policy_that_needs_readings_which_nobody_tells_it_is_refused() -> None:
    class Reads:
        needed_readings = frozenset({"battery", "speed", "imu_gyro_z"})

    with pytest.raises(ConfigError, match="the policy needs battery, imu_gyro_z, which the node `fsm` does not tell"):
        FsmNode(Reads())


def test_one_message_does_not_arm_two_cars_of_one_name(car: Clockless) -> None:
    other = CarNode(body(), CarOptions(use_sim_time=True))
    other._begin()
    until(lambda: car.node._cars.alive == other._cars.alive == 2)
    car.arm.publish(Bool(True))
    until(lambda: after(car.node.spin, lambda: "two nodes are /car" in car.node.gate.why))
    until(lambda: after(other.spin, lambda: "two nodes are /car" in other.gate.why))
    assert not car.node.gate.armed
    assert not other.gate.armed
    other.close()
    until(lambda: car.node._cars.alive == 1)
    car.ask(True)


def test_a_simulated_car_that_rests_keeps_to_the_clock_also_in_lock_step(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    monkeypatch.setattr("tral_fsm.programs.ros.simulation.time.sleep", slept.append)
    resting = body()
    resting.step(0.0, 0.3)
    assert slept == []
    resting.rest()
    assert slept == [1 / 80]
    resting.close()


def test_the_truth_of_a_simulated_car_is_its_pose_and_both_of_its_speeds() -> None:
    turning = body()
    told, yaws = [], []
    for _ in range(80):
        turning.step(0.5, 0.4)
        (truth,) = (message for topic, message in turning.extra(0) if topic == topics.TRUTH)
        assert isinstance(truth, Odometry)
        told.append(truth.twist.twist)
        yaws.append(yaw_of(truth.pose.pose.orientation))
    assert told[-1].angular.z == pytest.approx(80 * (yaws[-1] - yaws[-2]), rel=0.02)
    assert told[-1].angular.z > 0.3
    assert told[-1].linear.x == pytest.approx(turning.info["speed_mps"])
    turning.close()


def test_a_message_stops_the_car(car: Clockless) -> None:
    car.ask(True)
    car.spin(60, speed=0.8)
    car.ask(False)
    assert car.node.gate.why == "stopped by a message on the topic arm"


def test_who_needs_the_camera_stops_the_car_when_it_falls_silent(probe: Node) -> None:
    fsm = FsmNode(load_policy("office"), FsmOptions(camera_timeout_s=0.05))
    arm = probe.subscription(topics.ARM, Bool, STATE)
    until(lambda: arm.publishers)
    fsm.armed, fsm._seen_s = True, time.monotonic() - 0.1
    fsm.spin(0.0)
    assert until(arm.take)[0].data is False
    assert not fsm.armed
    fsm.node.close()


def test_a_policy_begins_anew_also_when_the_car_is_armed_again_at_once(probe: Node) -> None:
    begun: list[int] = []

    class Counts:
        def reset(self, n: int) -> None:
            begun.append(n)

    fsm = FsmNode(Counts())
    armed = probe.publisher(topics.ARMED, Bool, LATCHED)
    until(lambda: armed.listeners)
    armed.publish(Bool(True))
    until(lambda: after(lambda: fsm.spin(0.0), lambda: begun))
    for told in (False, True):
        armed.publish(Bool(told))
    until(lambda: after(lambda: fsm.spin(0.1), lambda: len(begun) == 2))
    fsm.node.close()


def test_a_tick_is_answered_when_it_is_whole_also_if_its_odometry_came_first(
    probe: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tral_fsm.programs.ros.fsm_node._WHOLE_S", PATIENCE_S)
    seen: list[Mapping[str, float]] = []
    fsm = FsmNode(load_policy("wall"))
    fsm.watch = seen.append
    armed = probe.publisher(topics.ARMED, Bool, LATCHED)
    odometry = probe.publisher(topics.ODOMETRY, Odometry, STATE)
    applied = probe.publisher(topics.APPLIED, AckermannDriveStamped, STATE)
    until(lambda: armed.listeners and odometry.listeners and applied.listeners)
    armed.publish(Bool(True))
    until(lambda: after(lambda: fsm.spin(0.0), lambda: fsm.armed))
    now = stamp(time.time_ns())
    odometry.publish(Odometry(Header(now)))
    until(lambda: after(lambda: fsm.spin(0.0), lambda: fsm._tick_ns))
    assert seen == []
    applied.publish(AckermannDriveStamped(Header(now), drive_of(0.5, 0.0)))
    until(lambda: after(lambda: fsm.spin(0.0), lambda: seen))
    assert seen[0]["steering"] == pytest.approx(0.5)
    fsm.node.close()


@pytest.mark.parametrize("text", ["233", "-1", "one"])
def test_a_domain_that_is_none_is_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(ConfigError, match="ROS_DOMAIN_ID"):
        domain_id()


def test_names_resolve_as_in_ros() -> None:
    assert check_namespace("car1/") == "/car1"
    assert check_namespace("") == "/"
    with pytest.raises(ConfigError, match="namespace"):
        check_namespace("/car 1")
    node = Node("fsm", namespace="/car1")
    assert [node.resolve(name) for name in ("odom", "/clock", "~/state")] == ["/car1/odom", "/clock", "/car1/fsm/state"]
    assert Node.full_name.fget(node) == "/car1/fsm"  # type: ignore[attr-defined]
    node.close()


def test_a_car_that_cannot_be_stopped_or_armed_tells_why_and_the_node_goes_on(car: Clockless) -> None:
    car.ask(True)
    car.spin(5, speed=0.5)

    def fails() -> Any:
        raise HardwareError("the board is gone")

    car.node.body.stop = fails  # type: ignore[method-assign]
    car.node.body.arm = fails  # type: ignore[method-assign]
    car.ask(False)
    assert car.node.gate.why == "the board is gone"
    car.arm.publish(Bool(True))
    car.spin(20)
    assert not car.node.gate.armed


def test_two_cars_in_one_network_do_not_hear_each_other() -> None:
    nodes = [Node("fsm", namespace=namespace) for namespace in ("/car1", "/car2")]
    told = nodes[0].publisher(topics.ARM, Bool, STATE)
    heard = [node.subscription(topics.ARM, Bool, STATE) for node in nodes]
    until(lambda: told.listeners == 1)
    told.publish(Bool(True))
    assert until(heard[0].take)[0].data is True
    assert heard[1].take() == []
    assert heard[1].publishers == 0
    for node in nodes:
        node.close()


def test_a_node_wakes_for_a_message_and_not_again_once_it_was_taken() -> None:
    node = Node("car")
    arm, heard = node.publisher(topics.ARM, Bool, STATE), node.subscription(topics.ARM, Bool, STATE, wakes=True)
    until(lambda: arm.listeners)
    assert not node.wait(0.0)
    arm.publish(Bool(True))
    assert node.wait(PATIENCE_S)
    assert node.wait(0.0)
    assert len(heard.take()) == 1
    assert not node.wait(0.0)
    node.close()


def test_two_processes_that_write_one_topic_do_not_hang_a_node_that_hears_it() -> None:
    """A node writes and hears a topic, as nodes of one process do, while another process writes it all the time."""
    other = subprocess.Popen([sys.executable, "-c", FLOOD])
    node = Node("car")
    arm, heard = node.publisher(topics.ARM, Bool, STATE), node.subscription(topics.ARM, Bool, STATE, wakes=True)
    try:
        until(lambda: arm.listeners and heard.publishers == 2)
        ticks, of_the_other, end_s = 0, 0, time.monotonic() + PATIENCE_S
        while ticks < 3000 or not of_the_other:
            assert time.monotonic() < end_s
            arm.publish(Bool(True))
            node.wait(0.0)
            of_the_other += sum(not each.data for each in heard.take())
            ticks += 1
    finally:
        other.terminate()
        other.wait()
        node.close()


FLOOD = """
import time
from tral_env.ros.msg.std import Bool
from tral_env.ros.node import Node
from tral_env.ros.qos import STATE

arm = Node("laptop").publisher("arm", Bool, STATE)
while True:
    arm.publish(Bool(False))
    time.sleep(0.0001)
"""


def test_the_graph_names_each_node_and_what_it_owns() -> None:
    listener, node = Node("ros2cli"), Node("car", namespace="/car1")
    node.publisher(topics.ARM, Bool, STATE)
    participant = listener._participant
    topic = Topic(participant, "ros_discovery_info", ParticipantEntitiesInfo)
    graph = DataReader(participant, topic, Profile(latched=True, depth=100).qos())

    def told() -> Any:
        found = [each.node_entities_info_seq[0] for each in graph.read(10)]
        return [each for each in found if each.node_name == "car" and len(each.writer_gid_seq) == 2]

    found = until(told)[-1]
    assert found.node_namespace == "/car1"
    node.close()
    listener.close()


def test_who_offers_a_topic_tells_its_hash() -> None:
    node = Node("car")
    arm = node.publisher(topics.ARM, Bool, STATE)
    user_data = arm._writer.get_qos()[Policy.Userdata]
    assert user_data is not None
    assert bytes(user_data.data) == f"typehash={type_hash(Bool)};".encode()
    node.close()
