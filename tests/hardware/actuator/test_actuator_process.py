"""The real processes: whatever befalls the policy, the worker or the keeper, pulses end in time."""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults import PROGRAMS, QUICK, SIGNALS, has_ended, is_gone, measure, pulses_in, times_ms, wait_until
from gymnasium.error import ResetNeeded
from rig import NEUTRAL, OFF, SETTINGS

from tral_env.errors import ConfigError, HardwareError
from tral_env.hardware.actuator import client
from tral_env.hardware.actuator.client import ActuatorProcess
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.actuator.wire import State
from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.env import TralCarEnv

BUSY = 2.0
"""Times are allowed to be so much longer than promised: tests share their computer."""
PROMISED_MS = (150.0, 600.0)
"""Until neutral and until no pulses, after any fault but those below."""
LONGER_MS = {"observations frozen": (1100.0, 1550.0), "SIGSTOP of the keeper": (180.0, 630.0)}


@pytest.mark.parametrize("fault", [*PROGRAMS, *SIGNALS])
def test_pulses_end_in_time_after(fault: str, tmp_path: Path, record_property: Callable[[str, object], None]) -> None:
    neutral_ms, off_ms = measure(fault, tmp_path)
    record_property("neutral_ms", neutral_ms)
    record_property("off_ms", off_ms)
    most_neutral_ms, most_off_ms = LONGER_MS.get(fault, PROMISED_MS)
    assert neutral_ms < BUSY * most_neutral_ms
    assert off_ms < BUSY * most_off_ms


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "pulses.log"


@pytest.fixture
def given(log: Path) -> Settings:
    return replace(SETTINGS, bus=str(log), limits=QUICK)


@pytest.fixture
def actuator(given: Settings) -> Iterator[ActuatorProcess]:
    with ActuatorProcess(given) as process:
        yield process


def drive(actuator: ActuatorProcess, seconds: float = 0.2) -> None:
    for _ in range(round(seconds * 80)):
        actuator.command(0.25, 0.5, 0)
        time.sleep(0.0125)
        actuator.check()


def test_a_drive_begins_in_neutral_and_ends_in_neutral_then_no_pulses(given: Settings, log: Path) -> None:
    with ActuatorProcess(given) as actuator:
        assert actuator.pulses_us == NEUTRAL
        actuator.arm()
        drive(actuator)
        assert actuator.applied == (0.25, 0.5)
        assert actuator.pulses_us == (1457.5, 1300.0)
        actuator.neutral()
        assert actuator.pulses_us == NEUTRAL
        worker, keeper = actuator.hello["worker"], actuator.hello["keeper"]
    assert is_gone(worker)
    assert is_gone(keeper)
    order = [pulses for _, pulses in pulses_in(log)]
    assert [order[0], order[-2], order[-1]] == [NEUTRAL, NEUTRAL, OFF]
    assert set(order) == {NEUTRAL, (1457.5, 1300.0), OFF}
    actuator.close()


def test_a_silence_latches_and_arming_again_undoes_it(actuator: ActuatorProcess, log: Path) -> None:
    actuator.arm()
    drive(actuator)
    wait_until(lambda: has_ended(log))
    actuator.command(0.0, 0.5, 0)
    time.sleep(0.05)
    with pytest.raises(HardwareError, match="stopped the car: no new command came for too long"):
        actuator.check()
    assert has_ended(log)
    actuator.arm()
    drive(actuator)
    assert actuator.pulses_us == (1457.5, 1300.0)


def test_the_processes_have_names_of_their_own(actuator: ActuatorProcess) -> None:
    for role in ("keeper", "worker"):
        assert Path(f"/proc/{actuator.hello[role]}/comm").read_text() == f"tral-{role}\n"


def test_arming_an_armed_actuator_takes_no_time(actuator: ActuatorProcess) -> None:
    actuator.arm()
    before = actuator.reply
    assert actuator.arm() == ""
    assert before is not None
    assert actuator.reply is not None
    assert (actuator.reply.state, actuator.reply.sequence) == (State.ARMED, before.sequence + 1), (
        "one question is enough"
    )


def test_a_worker_that_died_is_told_with_the_reason(actuator: ActuatorProcess, log: Path) -> None:
    actuator.arm()
    drive(actuator)
    os.kill(actuator.hello["worker"], signal.SIGKILL)
    with pytest.raises(HardwareError, match="the worker died or stood still"):
        drive(actuator, 2.0)
    with pytest.raises(HardwareError, match="the worker died or stood still"):
        actuator.neutral()
    wait_until(lambda: has_ended(log))


def test_signals_of_a_terminal_do_not_reach_the_process(actuator: ActuatorProcess) -> None:
    pids = actuator.hello["worker"], actuator.hello["keeper"]
    assert all(os.getsid(pid) != os.getsid(0) for pid in pids)
    for pid in pids:
        for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTSTP):
            os.kill(pid, number)
    actuator.arm()
    drive(actuator)


def test_the_worker_tells_what_the_system_granted(actuator: ActuatorProcess) -> None:
    granted = {name: actuator.hello[name] for name in ("realtime", "locked", "spared")}
    assert all(isinstance(value, bool) for value in granted.values())
    for pid in (actuator.hello["worker"], actuator.hello["keeper"]):
        assert (os.sched_getscheduler(pid) == os.SCHED_FIFO) is granted["realtime"]
        locked_kb = int(Path(f"/proc/{pid}/status").read_text().split("VmLck:")[1].split()[0])
        assert (locked_kb > 0) is granted["locked"]


def started(settings: Settings) -> tuple[set[str], bytes]:
    """What a process that was started by hand imports, and its first words."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    main = str(Path(client.__file__).with_name("__main__.py"))
    process = subprocess.Popen(
        [sys.executable, "-I", "-X", "importtime", main, str(theirs.fileno()), settings.to_json()],
        pass_fds=[theirs.fileno()],
        stderr=subprocess.PIPE,
        text=True,
    )
    theirs.close()
    with ours:
        hello = ours.recv(4096)
    lines = process.communicate()[1].splitlines()
    names = {line.split("|")[-1].strip() for line in lines if line.startswith("import time:")}
    return names - {"imported package"}, hello


@pytest.mark.parametrize("driver", ["log", "pca9685"])
def test_a_running_worker_has_imported_the_standard_library_and_the_bus_alone(given: Settings, driver: str) -> None:
    pytest.importorskip("smbus2")
    names, hello = started(replace(given, driver=driver, bus="/dev/null" if driver == "log" else "/dev/i2c-none"))
    assert (b"worker" in hello) is (driver == "log")
    ours = {name for name in names if name.split(".")[0] == "tral_env"}
    assert "tral_env.hardware.actuator.worker" in ours
    assert all(name in ALLOWED or name.startswith("tral_env.hardware.actuator") for name in ours)
    # What Python may import at its start, and "org.python.core", which `copy` looks for in vain.
    at_start = {"sitecustomize", "usercustomize", "_distutils_hack", "a1_coverage", "org"}
    others = {name.split(".")[0] for name in names} - {"tral_env"} - sys.stdlib_module_names - at_start
    assert others == ({"smbus2"} if driver == "pca9685" else set())


ALLOWED = {"tral_env.errors", "tral_env.hardware", "tral_env.hardware.i2c", "tral_env.hardware.serial_port"}


def test_a_board_has_one_owner(actuator: ActuatorProcess, given: Settings, log: Path) -> None:
    actuator.arm()
    with pytest.raises(HardwareError, match=f"another process drives the board at 0x40 on {log}"):
        ActuatorProcess(given)


def test_a_policy_that_is_started_again_waits_for_the_end_of_the_one_before(given: Settings, log: Path) -> None:
    first = ActuatorProcess(given)
    first.arm()
    drive(first)
    os.kill(first.hello["worker"], signal.SIGTERM)
    with ActuatorProcess(given) as second:
        offs = [i for i, (_, pulses) in enumerate(pulses_in(log)) if pulses == OFF]
        assert len(offs) == 1
        second.arm()
        drive(second)
        assert pulses_in(log)[-1][1] == (1457.5, 1300.0)
    first.close()


def test_no_numerics_are_mapped_into_a_running_worker(actuator: ActuatorProcess) -> None:
    maps = Path(f"/proc/{actuator.hello['worker']}/maps").read_text()
    assert "libc" in maps
    assert not any(name in maps for name in ("numpy", "mujoco", "torch", "cv2"))


def test_a_bus_that_cannot_be_opened_is_an_error(given: Settings, tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match="No such file"):
        ActuatorProcess(replace(given, bus=str(tmp_path / "missing" / "log")))
    with pytest.raises(HardwareError, match="No space left"):
        ActuatorProcess(replace(given, bus="/dev/full"))


def test_a_bus_that_is_not_there_is_named_with_the_remedy(given: Settings) -> None:
    pytest.importorskip("smbus2")
    with pytest.raises(HardwareError, match=r"cannot open the I2C bus /dev/i2c-none .*output='recorder'"):
        ActuatorProcess(replace(given, driver="pca9685", bus="/dev/i2c-none"))


def test_a_bus_that_blocks_gets_neutral_then_off_as_soon_as_it_does_not(given: Settings, tmp_path: Path) -> None:
    path = tmp_path / "bus"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    fcntl.fcntl(reader, fcntl.F_SETPIPE_SZ, 4096)
    with ActuatorProcess(replace(given, bus=str(path))) as actuator:
        actuator.arm()
        writer = os.open(path, os.O_WRONLY)
        os.write(writer, b"\n" * 3950)
        os.close(writer)
        with pytest.raises(HardwareError):
            drive(actuator, 5.0)
        wait_until(lambda: is_gone(actuator.hello["worker"]))
        free_ns = time.monotonic_ns()
        text = b""

        def drained() -> bool:
            nonlocal text
            try:
                text += os.read(reader, 65536)
            except BlockingIOError:
                return False
            return text.endswith(b" 0 0\n")

        wait_until(drained)
    os.close(reader)
    (tmp_path / "log").write_bytes(text)
    neutral_ms, off_ms = times_ms(tmp_path / "log", free_ns)
    # The write that hung carries the time of its begin, before the bus was free.
    assert neutral_ms < BUSY * PROMISED_MS[0]
    assert off_ms < BUSY * PROMISED_MS[1]


def test_the_service_manager_hears_as_long_as_the_worker_lives(
    given: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(5.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        with ActuatorProcess(given) as actuator:
            assert [manager.recv(100) for _ in range(4)] == [b"READY=1", *[b"WATCHDOG=1"] * 3]
            os.kill(actuator.hello["worker"], signal.SIGSTOP)
            wait_until(lambda: is_gone(actuator.hello["worker"]))
        manager.setblocking(False)
        waiting = 0
        with contextlib.suppress(BlockingIOError):
            while manager.recv(100):
                waiting += 1
        assert waiting < 5


class Counting:
    """Sensors whose distance changes at each read until they freeze."""

    provided_readings = frozenset({"distance"})

    def __init__(self) -> None:
        self.reads, self.frozen = 0, False

    def start(self) -> None:
        pass

    def read(self, now: float) -> dict[str, float]:
        self.reads += not self.frozen
        return {"distance": 0.025 * self.reads}

    def stop(self) -> None:
        pass


@pytest.fixture
def car(actuator: ActuatorProcess) -> Iterator[TralCarEnv]:
    env = TralCarEnv(output=actuator, sensors=Counting(), max_duration_s=2.0)
    yield env
    env.close()


GO = np.array([0.5, 0.25], np.float32)
GONE = (1385.0, 1400.0)


def test_the_environment_drives_by_the_process_and_ends_in_neutral(car: TralCarEnv, log: Path) -> None:
    for _ in range(2):
        car.reset()
        truncated = False
        while not truncated:
            observation, _, _, truncated, info = car.step(GO)
        assert observation[list(names(car)).index("throttle")] == 0.25
        assert (info["steering_us"], info["throttle_us"]) == NEUTRAL
    order = [pulses for _, pulses in pulses_in(log)]
    assert [pulses for pulses, before in zip(order[1:], order, strict=False) if pulses != before] == 2 * [GONE, NEUTRAL]
    car.close()
    assert has_ended(log)


def steps(car: TralCarEnv, count: int) -> None:
    for _ in range(count):
        car.step(GO)


def names(car: TralCarEnv) -> list[str]:
    from tral_env.interface import CORE_LAYOUT

    return list(CORE_LAYOUT.unpack(car.observation_space.sample()))


def test_the_board_is_set_up_and_armed_before_the_sensors_talk(actuator: ActuatorProcess) -> None:
    class Late(Counting):
        def start(self) -> None:
            assert actuator.reply is not None
            states.append(actuator.reply.state)
            time.sleep(0.6)

    states: list[State] = []
    car = TralCarEnv(output=actuator, sensors=Late())
    car.reset()
    assert states == [State.ARMED]
    assert actuator.reply is not None
    assert actuator.reply.state is State.ARMED, "a start that takes long is no fault"


def test_a_first_step_that_comes_late_arms_again(car: TralCarEnv, log: Path) -> None:
    car.reset()
    wait_until(lambda: has_ended(log))
    steps(car, 5)
    assert pulses_in(log)[-1][1] == GONE


def test_a_first_step_does_not_undo_an_emergency_stop_and_a_reset_says_that_it_does(
    car: TralCarEnv, actuator: ActuatorProcess, log: Path
) -> None:
    assert "armed_again_after" not in car.reset()[1]
    actuator.stop()
    with pytest.raises(HardwareError, match=r"a stop was commanded\. Only a reset arms it again"):
        car.step(GO)
    assert {pulses for _, pulses in pulses_in(log)} <= {NEUTRAL, OFF}
    assert car.reset()[1]["armed_again_after"] == "a stop was commanded"
    steps(car, 5)
    assert pulses_in(log)[-1][1] == GONE


@pytest.mark.parametrize("bad", [[np.nan, 0.5], [0.0, 0.5, 0.5]])
def test_what_is_no_command_ends_in_neutral_at_once(car: TralCarEnv, log: Path, bad: list[float]) -> None:
    car.reset()
    steps(car, 5)
    before_ns = time.monotonic_ns()
    with pytest.raises(ConfigError):
        car.step(np.array(bad))
    assert pulses_in(log)[-1][1] == NEUTRAL
    assert (pulses_in(log)[-1][0] - before_ns) / 1e6 < BUSY * PROMISED_MS[0]
    with pytest.raises(ResetNeeded):
        car.step(GO)


def test_a_policy_that_takes_too_long_is_told_and_may_reset(car: TralCarEnv, log: Path) -> None:
    car.reset()
    car.step(GO)
    wait_until(lambda: has_ended(log))
    with pytest.raises(HardwareError, match="no new command came for too long"):
        car.step(GO)
    car.reset()
    car.step(GO)


def test_sensors_that_freeze_stop_the_car(given: Settings, log: Path) -> None:
    sensors = Counting()
    given = replace(given, limits=replace(QUICK, evidence_s=0.2))
    car = TralCarEnv(output=ActuatorProcess(given), sensors=sensors)
    car.reset()
    steps(car, 40)
    sensors.frozen = True
    with pytest.raises(HardwareError, match="observations did not change"):
        steps(car, 40)
    car.close()
    assert has_ended(log)


def test_the_board_is_driven_by_the_process_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    wanted: list[Any] = []

    def start(settings: Settings) -> None:
        wanted.append(settings)
        raise HardwareError("no car here")

    monkeypatch.setattr("tral_env.hardware.opening.ActuatorProcess", start)
    for sensors, evidence_s in ((None, None), (Counting(), 1.0)):
        for bus, told in ((3, 3), (np.int64(3), 3), (Path("/dev/i2c-3"), "/dev/i2c-3")):
            with pytest.raises(HardwareError, match="no car here"):
                TralCarEnv(output="pca9685", bus=bus, sensors=sensors, calibration=MEASURED)
            assert (wanted[-1].driver, wanted[-1].bus, wanted[-1].limits.evidence_s) == ("pca9685", told, evidence_s)
    with (
        pytest.warns(UserWarning, match="'tt01' does not say that the board's clock was measured"),
        pytest.raises(HardwareError, match="no car here"),
    ):
        TralCarEnv(output="pca9685")


MEASURED = load_calibration("tt01").model_copy(update={"clock_measured": True})
