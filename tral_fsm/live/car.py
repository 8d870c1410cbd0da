"""A real car in the page: the page runs in a process of its own, is sent moments, and may ask for the stop.

The program that drives never waits for it. What it cannot take at once is not sent, and when it ends nothing changes.
"""

from __future__ import annotations

import math
import os
import pickle
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from tral_env.errors import ConfigError
from tral_env.interface import CONTROL_RATE_HZ
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.live.address import LOCAL, free_port, new_token
from tral_fsm.live.frame import CarFrame, Frame
from tral_fsm.runtime.machine import Transit
from tral_fsm.runtime.policy import MachinePolicy
from tral_fsm.teleop.hands import Hands

STOP = b"stop"
_EVERY = 4
"""A page is sent every so many ticks: 20 a second."""
_END_S = 3.0
_MAX_BYTES = 1 << 16


class CarPage:
    """The page beside a drive: a device whose only button is the emergency stop. A page that is lost is no stop."""

    name = "page in the browser"

    def __init__(self, policy: Any, driver: str, host: str, port: int) -> None:
        """Start the process of the page.

        Args:
            policy: what drives; the transitions of a machine are shown.
            driver: its name.
            host: address to listen on.
            port: the first port to try.

        Raises:
            ConfigError: this computer cannot listen there.
        """
        port = free_port(host, port)
        self._policy, self._driver, self._ticks = policy, driver, 0
        self._transit: Transit | None = None
        machine = None
        if isinstance(policy, MachinePolicy):
            machine, policy.trace = policy.definition, self._note
        self._line, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._line.setblocking(False)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", __name__, str(theirs.fileno()), host, str(port)],
                pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip
        if not self._send(machine):
            self._send(None)  # the page does without its drawing

    def _note(self, transit: Transit) -> None:
        self._transit = transit

    def _send(self, what: object) -> bool:
        """Send something if that can be done at once; whatever goes wrong here is no matter of the drive."""
        try:
            data = pickle.dumps(what)
            if len(data) > _MAX_BYTES:
                return False
            self._line.send(data)
        except (OSError, pickle.PicklingError, AttributeError, TypeError):  # it is busy or gone, or takes no such thing
            return False
        return True

    def poll(self, now_s: float) -> Hands:
        """Whether somebody pressed the stop in the page; see `Device.poll`."""
        del now_s
        try:
            return Hands(stop=self._line.recv(_MAX_BYTES) == STOP)
        except OSError:
            return Hands()

    def show(self, readings: Mapping[str, float], action: tuple[float, float]) -> None:
        """Send what came of a tick."""
        self._ticks += 1
        if self._ticks % _EVERY:
            return
        policy = self._policy
        states = getattr(policy, "active_states", None) or [""]
        is_machine = isinstance(policy, MachinePolicy)
        estimate = policy.estimates[0] if is_machine else None
        car = CarFrame(
            name=self._driver,
            time_s=self._ticks / CONTROL_RATE_HZ,
            readings=dict(readings),
            action=action,
            pose=None if estimate is None else estimate.pose,
            state=states[0],
            transit=self._transit,
            estimate=estimate,
            wanted_mps=float(policy.speed_target[0]) if is_machine else math.nan,
        )
        self._send(car)

    def close(self) -> None:
        """End the page."""
        self._line.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


class CarView:
    """The other end: what the page shows, and its stop."""

    def __init__(self, line: socket.socket) -> None:
        """Wait for the machine that drives, if there is one."""
        self._line, self._ended = line, threading.Event()
        machine: MachineDefinition | None = pickle.loads(line.recv(_MAX_BYTES))
        self._machine, self._stopped = machine, False
        self._show(CarFrame(name="the car is not armed yet", time_s=0.0, readings={}, action=(0.0, 0.0)))

    def _show(self, car: CarFrame) -> None:
        self.frame = Frame(
            episode=0,
            title="the real car",
            plan=None,
            cars=(car,),
            machine=self._machine,
            as_loaded=self._machine,
            notice="The stop was asked for." if self._stopped else "",
        )

    def run(self) -> None:
        """Take moments until the drive ends."""
        while data := self._line.recv(_MAX_BYTES):
            self._show(pickle.loads(data))

    def emergency_stop(self) -> None:
        """Ask the program that drives to stop the car."""
        with suppress(OSError):
            self._line.send(STOP)
            self._stopped = True
        self._show(self.frame.cars[0])


def main(arguments: list[str], annotate: Callable[[Any], Any] | None = None) -> None:
    """Be the process of the page: its socket, its address and its port."""
    from tral_fsm.live.page import Page

    os.nice(10)
    number, host, port = arguments
    with socket.socket(fileno=int(number)) as line:
        view = CarView(line)
        token = None if host in LOCAL else new_token()
        try:
            page = Page(view, host=host, port=int(port), token=token, annotate=annotate)
        except ConfigError as error:
            sys.exit(f"No page: {error}. The drive goes on without it.")
        print(f"Open {page.url} in a browser.", file=sys.stderr, flush=True)
        try:
            view.run()
        finally:
            page.close()


if __name__ == "__main__":
    main(sys.argv[1:])
