"""docs/safety.md has every fault that is injected, with times below what the tests hold, and the limits of the code."""

import json
import re
import sys
from pathlib import Path

from faults import PROGRAMS, SIGNALS

from tral_env.hardware.actuator.settings import Limits
from tral_env.hardware.faults import FAULTS, FaultLimits

sys.path.append(str(Path(__file__).parents[3] / "benchmarks"))
import car_faults

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "safety.md").read_text("utf-8")


def test_the_measured_table_has_every_fault() -> None:
    rows = re.findall(r"^\| (.+?) \| (\d+), (\d+) ms \| (\d+), (\d+) ms \|$", PAGE, re.MULTILINE)
    assert [row[0] for row in rows] == [*PROGRAMS, *SIGNALS]
    for fault, *times in rows:
        neutral, longest_neutral, off, longest_off = map(int, times)
        assert neutral <= longest_neutral <= (1100 if fault == "observations frozen" else 190)
        assert off <= longest_off <= (1550 if fault == "observations frozen" else 630)


def test_the_laws_have_the_numbers_of_the_code() -> None:
    told = re.findall(r"^\| `(\w+)` \| ([\d.]+) s \| ", PAGE, re.MULTILINE)
    assert len(told) == 8
    for name, number in told:
        assert getattr(Limits(), name) == float(number)


def test_the_faults_are_those_of_the_code() -> None:
    told = re.findall(r"^\| ([a-z ]+) \| (stop|warn) \| (`.+?) \| (.+) \|$", PAGE, re.MULTILINE)
    limits = FaultLimits()
    assert told == [
        (
            fault.name,
            fault.decision.value,
            ", ".join(f"`{name}` = {getattr(limits, name):g}" for name in fault.limits),
            fault.meaning,
        )
        for fault in FAULTS.values()
    ]


def test_the_table_of_drives_has_every_fault_of_the_benchmark() -> None:
    time = r"(\d+, \d+ ms|stays|neutral stays|drives on)"
    rows = re.findall(rf"^\| (.+?) \| {time} \| {time} \| (?:[\d.]+ m|-) \|$", PAGE, re.MULTILINE)
    assert [fault for fault, *_ in rows] == list(car_faults.ALL)
    drives = json.loads((ROOT / "benchmarks" / "results" / "car_faults.json").read_text("utf-8"))["drives"]
    assert "\n".join(car_faults.table(drives)) in PAGE
    goes_on = {fault for fault, neutral, _ in rows if neutral == "drives on"}
    assert goes_on == set(car_faults.GOES_ON)
