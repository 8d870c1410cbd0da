"""Device files of the twin: unmodified programs talk to them, and nothing stays behind."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from adafruit import BusIO

from tral_env.errors import HardwareError
from tral_env.hardware.sonar import SonarArray
from tral_env.twin import devices
from tral_env.twin.bus import I2cBus
from tral_env.twin.devices import DeviceFiles, why_no_files
from tral_env.twin.faults import BusTimeouts, stuck
from tral_env.twin.pca9685 import Pca9685Chip
from tral_env.twin.pwm_chip import PwmChip
from tral_env.twin.srf08 import Srf08Chip

pytestmark = pytest.mark.usefixtures("device_files")
smbus2 = pytest.importorskip("smbus2")
NUMBER = 910 + int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
"""Of the bus: workers of pytest do not share one."""
LINK = Path(f"/dev/i2c-{NUMBER}")


class Rig:
    """A board and three ultrasonics behind files."""

    def __init__(self, folder: Path) -> None:
        self.board = Pca9685Chip(26.5e6)
        rangers = [Srf08Chip(0x70 + k, lambda fired_s, k=k: [1.0 + k]) for k in range(3)]
        self.bus, self.pwm = I2cBus([self.board, *rangers]), PwmChip()
        self.files = DeviceFiles(
            folder / "dev", self.bus, i2c_name=LINK.name, tree=self.pwm, link=LINK, disk=folder / "disk"
        )


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(tmp_path)
    yield rig
    rig.files.close()
    assert mounts(tmp_path) == []
    assert not os.path.lexists(LINK)


def mounts(folder: Path) -> list[str]:
    return [line.split()[1] for line in Path("/proc/mounts").read_text().splitlines() if str(folder) in line]


def gone_within(folder: Path, seconds: float) -> bool:
    until_s = time.monotonic() + seconds
    while (mounts(folder) or os.path.lexists(LINK)) and time.monotonic() < until_s:
        time.sleep(0.01)
    return not mounts(folder) and not os.path.lexists(LINK)


def errno_of(call: Any) -> int | None:
    try:
        call()
    except OSError as error:
        return error.errno
    return None


def test_smbus2_speaks_to_the_chips(rig: Rig) -> None:
    with smbus2.SMBus(NUMBER) as bus:
        assert bus.read_byte_data(0x40, 0x00) == 0x11
        bus.write_byte_data(0x40, 0x00, 0x20)
        bus.write_i2c_block_data(0x40, 0x06, [0, 0, 100, 0, 0, 0, 200, 0])
        assert bus.read_i2c_block_data(0x40, 0x06, 8) == [0, 0, 100, 0, 0, 0, 200, 0]
        assert bus.read_word_data(0x40, 0x08) == 100
        bus.write_word_data(0x40, 0x08, 300)
        bus.write_byte(0x40, 0xFE)
        assert bus.read_byte(0x40) == 0x1E
        written, read = smbus2.i2c_msg.write(0x40, [0x08]), smbus2.i2c_msg.read(0x40, 2)
        bus.i2c_rdwr(written, read)
        assert list(read) == [300 & 0xFF, 300 >> 8]
        assert errno_of(lambda: bus.read_byte_data(0x41, 0)) == errno.EREMOTEIO
        assert errno_of(lambda: bus.read_block_data(0x40, 0)) in (errno.EOPNOTSUPP, errno.EINVAL)
    assert rig.board.pulse_us(0) == pytest.approx(300 * rig.board.step_us)


def test_read_and_write_are_transactions_with_the_address_of_the_opening(rig: Rig) -> None:
    import fcntl

    file = os.open(rig.files.i2c_path, os.O_RDWR)
    fcntl.ioctl(file, 0x0703, 0x40)
    os.write(file, bytes([0xFE]))
    assert os.read(file, 1) == b"\x1e"
    assert errno_of(lambda: fcntl.ioctl(file, 0x5401, 0)) == errno.ENOTTY
    os.close(file)


def test_errors_of_the_bus_reach_the_caller(rig: Rig) -> None:
    rig.bus.faults["stuck"] = stuck
    with smbus2.SMBus(str(rig.files.i2c_path)) as bus:
        assert errno_of(lambda: bus.read_byte_data(0x40, 0)) == errno.EAGAIN
        rig.bus.faults.clear()
        assert bus.read_byte_data(0x40, 0) == 0x11


def test_a_bus_that_blocks_keeps_its_caller_and_nobody_who_opens_it(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tral_env.twin.faults.BLOCKS_S", 0.5)
    rig.bus.faults["timeout"] = BusTimeouts()
    with smbus2.SMBus(NUMBER) as bus, ThreadPoolExecutor() as pool:
        begun_s = time.monotonic()
        blocked = pool.submit(errno_of, lambda: bus.read_byte_data(0x40, 0))
        time.sleep(0.1)
        os.close(os.open(rig.files.i2c_path, os.O_RDWR))
        assert not blocked.done()
        assert blocked.result() == errno.ETIMEDOUT
        assert time.monotonic() - begun_s >= 0.5


def test_the_cars_own_sonars_range_through_the_file(rig: Rig) -> None:
    with smbus2.SMBus(NUMBER) as bus:
        bus.write_byte_data(0x40, 0x00, 0x20)  # the board leaves address 0x70
    sonars = SonarArray(bus=NUMBER)
    sonars.start()
    sonars.read(time.monotonic())
    time.sleep(0.07)
    readings = sonars.read(time.monotonic())
    assert [round(readings[f"ultrasonic_{side}"], 3) for side in ("left", "front", "right")] == [1.0, 2.0, 3.0]
    sonars.stop()


def test_adafruits_library_drives_the_board_through_the_file(rig: Rig) -> None:
    library = pytest.importorskip("adafruit_pca9685", exc_type=ImportError)
    with smbus2.SMBus(NUMBER) as bus:

        def write_then_read(address: int, data: bytes, length: int) -> bytes:
            read = smbus2.i2c_msg.read(address, length)
            bus.i2c_rdwr(*([smbus2.i2c_msg.write(address, data)] if data else []), read)
            return bytes(read)

        busio = BusIO(lambda address, data: bus.i2c_rdwr(smbus2.i2c_msg.write(address, data)), write_then_read)
        board = library.PCA9685(busio, reference_clock_speed=26_500_000)
        board.frequency = 50
        board.channels[2].duty_cycle = 0x1330
        time.sleep(0.001)
        assert rig.board.pulse_us(2) == pytest.approx(0x133 / 4096 / board.frequency * 1e6)


@pytest.mark.skipif(shutil.which("i2cdetect") is None, reason="i2c-tools are not installed")
def test_i2c_tools_find_the_chips(rig: Rig) -> None:
    table = run("i2cdetect", "-y", str(NUMBER))
    found = [word for line in table.splitlines()[1:] for word in line.split()[1:] if word != "--"]
    assert found == ["40", "70", "71", "72"]
    assert run("i2cget", "-y", str(NUMBER), "0x40", "0xfe") == "0x1e\n"
    run("i2cset", "-y", str(NUMBER), "0x40", "0x00", "0x20")
    assert run("i2cget", "-y", str(NUMBER), "0x70", "0x00") == "0x0a\n"


def run(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_pwm_outputs_are_files(rig: Rig) -> None:
    chip = rig.files.i2c_path.parent / "pwm" / "pwmchip0"
    assert sorted(path.name for path in chip.parent.parent.iterdir()) == [LINK.name, "pwm"]
    (chip / "export").write_text("0")
    for name, text in (("period", "17430000"), ("duty_cycle", "1530000"), ("enable", "1")):
        (chip / "pwm0" / name).write_text(text)
    assert (chip / "pwm0" / "duty_cycle").read_text() == "1530000\n"
    assert rig.pwm.pulse_us(0) == 1530.0
    assert errno_of(lambda: (chip / "export").write_text("0")) == errno.EBUSY
    assert errno_of(lambda: (chip / "pwm0" / "duty_cycle").write_text("20000000")) == errno.EINVAL
    assert not (chip / "pwm1").exists()


def test_a_second_bus_of_the_same_number_is_refused(rig: Rig, tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match="is there already"):
        DeviceFiles(tmp_path / "other", rig.bus, i2c_name=LINK.name, link=LINK)


PROGRAM = """
import sys, time
sys.path.insert(0, {tests!r})
from pathlib import Path
from test_device_files import Rig
rig = Rig(Path(sys.argv[1]))
print(rig.files.pid, flush=True)
time.sleep(60)
"""


def started(folder: Path) -> tuple[subprocess.Popen[str], int]:
    code = textwrap.dedent(PROGRAM).format(tests=str(Path(__file__).parent))
    program = subprocess.Popen([sys.executable, "-c", code, str(folder)], stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    return program, int(program.stdout.readline())


def ended(program: subprocess.Popen[str]) -> None:
    program.kill()
    program.wait()
    assert program.stdout is not None
    program.stdout.close()


def test_a_program_that_is_killed_leaves_no_mount_and_no_link(tmp_path: Path) -> None:
    program, _ = started(tmp_path)
    assert len(mounts(tmp_path)) == 2
    ended(program)
    assert gone_within(tmp_path, 5.0)


def test_what_two_killed_programs_leave_the_next_start_takes_away(tmp_path: Path) -> None:
    program, files = started(tmp_path)
    os.kill(files, signal.SIGKILL)
    ended(program)
    assert mounts(tmp_path)  # dead
    rig = Rig(tmp_path)
    with smbus2.SMBus(NUMBER) as bus:
        assert bus.read_byte_data(0x40, 0x00) == 0x11
    rig.files.close()
    assert not mounts(tmp_path)


def test_files_whose_program_is_killed_fail_and_are_taken_away_at_the_end(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    bus = smbus2.SMBus(NUMBER)
    os.kill(rig.files.pid, signal.SIGKILL)
    assert errno_of(lambda: bus.read_byte_data(0x40, 0)) in (errno.ECONNABORTED, errno.ENOTCONN, errno.ENODEV)
    assert errno_of(bus.close) in (None, errno.ENOTCONN)
    rig.files.close()
    assert not mounts(tmp_path)
    assert not os.path.lexists(LINK)


def test_this_computer_can_show_files() -> None:
    assert why_no_files() == ""


def test_a_package_that_cannot_be_imported_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    if reason := why_no_files():
        pytest.skip(reason)

    def fails(name: str) -> None:
        raise OSError("libfuse3.so.3: cannot open shared object file")

    monkeypatch.setattr(devices.importlib, "import_module", fails)
    assert why_no_files().endswith("cannot be imported here: libfuse3.so.3: cannot open shared object file")
