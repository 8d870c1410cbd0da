"""The line of the moment: renewed in place, and never a reason to wait."""

from __future__ import annotations

import os
import pty

from rich.console import Console

from tral_fsm.cli.show_car import table_of_car_drive
from tral_fsm.terminal import StatusLine


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_on_a_terminal_the_line_is_renewed_and_no_wider_than_it() -> None:
    person, program = pty.openpty()
    line = StatusLine(program, Clock(), 2.0)
    line.show("first")
    line.say("stays")
    line.show("x" * 500)
    shown = ""
    while shown.count("\x1b[K") < 3:
        shown += os.read(person, 4096).decode()
    assert shown.startswith("\rfirst\x1b[K\r\x1b[Kstays\r\n\rx")
    assert shown.count("x") == 79
    for end in (person, program):
        os.close(end)


def test_in_a_file_a_new_line_comes_now_and_then() -> None:
    read, write = os.pipe()
    clock = Clock()
    line = StatusLine(write, clock, 2.0)
    for _ in range(8):
        line.show(f"{clock.now:g} s")
        clock.now += 0.5
    line.say("the end")
    assert os.read(read, 4096).decode() == "0 s\n2 s\nthe end\n"
    for end in (read, write):
        os.close(end)


def test_a_reader_that_does_not_read_keeps_nobody_waiting() -> None:
    read, write = os.pipe()
    os.set_blocking(write, False)
    try:
        while True:
            os.write(write, b"x" * 65536)
    except BlockingIOError:
        os.set_blocking(write, True)
    StatusLine(write, Clock(), 0.0).say("nobody reads this")
    assert set(os.read(read, 1 << 20)) == {ord("x")}
    os.close(read)
    StatusLine(write, Clock(), 0.0).say("nor this: the reader is gone")
    os.close(write)


REPORT = {
    "arguments": {"policy": "wall"},
    "ended_by": "STOP no motion: told to drive for 2.0 s without motion",
    "failed": True,
    "warnings": ["WARN battery low: 6.4 V in the mean"],
    "figures": {
        "ticks": 200,
        "time_s": 2.5,
        "distance_m": 1.25,
        "mean_speed_mps": 0.5,
        "late_ticks": 2,
        "lateness_ms": {"p50": 0.1, "p99": 2.0, "max": 12.5},
        "retries": 3,
        "states_s": {"follow": 2.0, "": 0.5},
    },
}


def test_the_table_of_a_drive_has_its_end_first_and_all_numbers() -> None:
    console = Console(width=120, record=True, file=open(os.devnull, "w"))  # noqa: PTH123, SIM115
    console.print(table_of_car_drive(REPORT))
    lines = [line.rstrip() for line in console.export_text().splitlines() if line.strip()]
    console.file.close()
    assert lines[0] == "wall"
    assert [" ".join(line.split()) for line in lines if "─" not in line][1:] == [
        "ended by STOP no motion: told to drive for 2.0 s without motion",
        "time 2.5 s, 200 ticks",
        "way 1.2 m, 0.50 m/s in the mean",
        "late ticks 2 (1.0%)",
        "lateness p50 0.1, p99 2.0, max 12.5 ms",
        "tried again 3 transactions",
        "states follow 2.0 s, - 0.5 s",
        "warnings WARN battery low: 6.4 V in the mean",
    ]


def test_a_drive_that_never_began_has_a_table_too() -> None:
    figures = REPORT["figures"] | {"ticks": 0, "states_s": {}}  # type: ignore[operator]
    assert table_of_car_drive(REPORT | {"figures": figures, "arguments": {}}).row_count == 8
