"""A twin as a process: `serve` is that process, `TwinProcess` starts one and speaks to it."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, Self

from tral_env.checks import check_number
from tral_env.errors import HardwareError, TralError
from tral_env.hardware.physical import Physical
from tral_env.twin.control import CONTROL_SOCKET, Answer, ControlServer, Request, ask
from tral_env.twin.settings import TwinSettings
from tral_env.twin.twin import Twin

_SWITCH_S = 0.0005
"""Threads of the twin give way to each other after this time: a transaction must not wait for a tick."""
_END_S = 10.0


def serve(
    settings: TwinSettings,
    ready: Callable[[dict[str, Any]], None],
    ended: threading.Event | None = None,
    seconds: float | None = None,
) -> None:
    """Run a twin until it is told to end, by the control socket, by a signal or by an event.

    Args:
        settings: of the twin.
        ready: is told the first status, when everything stands.
        ended: ends it too.
        seconds: it ends by itself after so long; None: never.

    Raises:
        TralError: it cannot be built.
    """
    ended = threading.Event() if ended is None else ended
    before = [(number, signal.signal(number, lambda *_: ended.set())) for number in (signal.SIGINT, signal.SIGTERM)]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_S)
    try:
        with (
            closing(Twin(settings)) as twin,
            closing(ControlServer(settings.run_folder / CONTROL_SOCKET, _answers(twin, ended))),
        ):
            twin.start()
            ready(twin.status())
            ended.wait(seconds)
    finally:
        sys.setswitchinterval(interval)
        for number, handler in before:
            signal.signal(number, handler)


def _answers(twin: Twin, ended: threading.Event) -> dict[str, Answer]:
    """What the control socket answers."""

    def reset(request: Request) -> dict[str, Any]:
        twin.reset(int(request["seed"]))
        return {}

    def down(request: Request) -> dict[str, Any]:
        ended.set()
        return {}

    def fault(request: Request) -> dict[str, Any]:
        name = str(request.get("name"))
        if request.get("off"):
            twin.faults.end(name)
        else:
            seconds = request.get("seconds")
            rate, after = request.get("rate", 0.1), request.get("after", 0.0)
            check_number("after", after, "s")
            lasts = math.inf if seconds is None else seconds
            if after > 0.0:
                twin.faults.at(twin.clock() + after, name, rate=rate, seconds=lasts)
            else:
                twin.faults.begin(name, rate=rate, seconds=lasts)
        return {}

    return {
        "fault": fault,
        "status": lambda request: twin.status(),
        "outcome": lambda request: twin.outcome(),
        "look": lambda request: twin.look(),
        "course": lambda request: twin.car.course.to_json(),
        "reset": reset,
        "down": down,
    }


class TwinProcess(Physical):
    """A twin in a process of its own, which ends with this one."""

    def __init__(self, settings: TwinSettings) -> None:
        """Start it, and wait until its files stand.

        Raises:
            HardwareError: it does not start; the message says why.
        """
        self.settings = settings
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tral_env.twin", settings.to_json()],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True, text=True,
        )  # fmt: skip
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        told = json.loads(line) if line.startswith("{") else {"error": "the twin's process ended"}
        if "error" in told:
            self.close()
            raise HardwareError(told["error"])
        self.first_status: dict[str, Any] = told

    @property
    def pid(self) -> int:
        """Process id of the twin."""
        return self._process.pid

    @property
    def folder(self) -> Path:
        """Folder of the twin's files."""
        return self.settings.run_folder

    def ask(self, do: str, **more: Any) -> Any:
        """Ask the twin, see `tral_env.twin.control`."""
        return ask(self.folder, do=do, **more)

    def status(self) -> dict[str, Any]:
        """See `Twin.status`."""
        found: dict[str, Any] = self.ask("status")
        return found

    def outcome(self) -> dict[str, Any] | None:
        """How the drive ended, see `Twin.outcome`; None: it goes on."""
        found: dict[str, Any] | None = self.ask("outcome")
        return found

    def fault(self, name: str, **how: Any) -> None:
        """Begin a fault, now or `after` s; ``off=True`` ends it. `rate`, `seconds`: see `FaultInjector.begin`."""
        self.ask("fault", name=name, **how)

    def reset(self, seed: int) -> None:
        """Put the car at the start of the course of a seed."""
        self.ask("reset", seed=seed)

    def close(self) -> None:
        """End the twin; a second call does nothing."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> Self:
        """The running twin."""
        return self

    def __exit__(self, *_: object) -> None:
        """End it."""
        self.close()


def main(arguments: list[str]) -> int:
    """Be the process of `TwinProcess`: it ends with its standard input, and tells its status on standard output."""

    ended = threading.Event()

    def tell(content: dict[str, Any]) -> None:
        sys.stdout.write(json.dumps(content) + "\n")
        sys.stdout.flush()

    def end_with_the_starter() -> None:
        os.read(sys.stdin.fileno(), 1)
        ended.set()

    threading.Thread(target=end_with_the_starter, daemon=True).start()
    try:
        serve(TwinSettings.from_json(arguments[0]), tell, ended)
    except TralError as error:
        tell({"error": str(error)})
        return 1
    return 0
