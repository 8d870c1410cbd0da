"""Policies of any kind in rows of cars: machines, policies for many cars at once, policies for one car."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import ConfigError, PolicyError
from tral_env.interface import Policy
from tral_env.world import Step, World
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.episode import NO_WISH, EpisodeRequest, EpisodeResult
from tral_fsm.evaluation.loop import Index, Pair, Policies
from tral_fsm.runtime.driver import Driver
from tral_fsm.runtime.machine import Trace


class RowPolicies(Policies, Protocol):
    """The policies of n rows, each of which drives one request after the other."""

    def assign(self, row: int, request: EpisodeRequest) -> None:
        """Start the policy of a request in a row whose car stands at its start."""
        ...

    def release(self, row: int) -> None:
        """End the policy of a row."""
        ...


class Spectator(Protocol):
    """Is shown the drives of a batch."""

    def watch(self, rows: Index, numbers: Index, world: World, step: Step) -> None:
        """See a tick.

        Args:
            rows: (k,) rows that drove.
            numbers: (k,) numbers of their requests.
            world: the cars.
            step: what all n rows got.
        """
        ...

    def finish(self, number: int, result: EpisodeResult) -> None:
        """See the result of a request, after its last tick."""
        ...


class DriverPool:
    """The machines of n rows, any machine in any row; a driver is used again after its drive."""

    def __init__(self, definitions: Sequence[MachineDefinition], n: int) -> None:
        self._definitions = definitions
        self._drivers: list[Driver | None] = [None] * n
        self._machine = [-1] * n
        self._idle = [[Driver(definition)] for definition in definitions]  # the first one checks its definition

    def assign(self, row: int, request: EpisodeRequest) -> None:
        """Let the machine of a request drive a row, from its root on."""
        machine = request.machine
        idle = self._idle[machine]
        driver = idle.pop() if idle else Driver(self._definitions[machine], checked=True)
        driver.reset()
        self._drivers[row], self._machine[row] = driver, machine

    def release(self, row: int) -> None:
        """Free the driver of a row for other rows."""
        self._idle[self._machine[row]].append(self._driver(row))
        self._drivers[row] = None

    def _driver(self, row: int) -> Driver:
        driver = self._drivers[row]
        assert driver is not None
        return driver

    def act(self, rows: Index, observation: NDArray[np.floating]) -> tuple[list[Pair], list[Pair]]:
        """Commands and wanted clearances."""
        commands, wanted = [], []
        for row, readings in zip(rows.tolist(), observation[rows].tolist(), strict=True):
            driver = self._driver(row)
            commands.append(driver.act(readings))
            wanted.append(driver.wanted_clearance)
        return commands, wanted

    def state(self, row: int) -> str:
        """Name of the active state."""
        return self._driver(row).active_path

    def watch(self, row: int, trace: Trace | None) -> None:
        """Call this for each transition that fires in a row; None: nothing."""
        self._driver(row).trace = trace


class Unwatched:
    """What policies without states tell."""

    def state(self, row: int) -> str:
        """Empty: there are no states."""
        return ""

    def watch(self, row: int, trace: Trace | None) -> None:
        """Do nothing: there are no transitions."""


class BatchedPolicy(Unwatched):
    """One policy that drives all n rows with each call."""

    def __init__(self, policy: Policy, n: int, name: str = "") -> None:
        """Take the policy over.

        Args:
            policy: acts on (n, d). One with `reset_rows(rows)` can start single rows again.
            n: number of rows.
            name: its name in errors; empty: that of its class.
        """
        self._policy, self._n, self._name = policy, n, name or type(policy).__name__
        self._drives = False
        policy.reset(n)

    def assign(self, row: int, request: EpisodeRequest) -> None:
        """Start a row again.

        Raises:
            ConfigError: the policy cannot start a row while others drive.
        """
        if not self._drives:
            return
        reset: Callable[[NDArray[np.bool_]], object] | None = getattr(self._policy, "reset_rows", None)
        if reset is None:
            raise ConfigError(f"policy {self._name} cannot start one car while others drive")
        reset(np.arange(self._n) == row)

    def release(self, row: int) -> None:
        """Do nothing: a row that does not drive is not asked."""

    def act(self, rows: Index, observation: NDArray[np.floating]) -> tuple[Sequence[Any], Sequence[Pair]]:
        """Commands of the rows; the policy keeps no clearance.

        Raises:
            PolicyError: the policy did not answer two finite numbers for each row.
        """
        self._drives = True
        commands = np.asarray(self._policy.act(observation), np.float32)
        if commands.shape != (self._n, 2):
            raise PolicyError(
                f"policy {self._name} answered commands of shape {commands.shape}: expected {(self._n, 2)}: steering, "
                "throttle of each car"
            )
        driven = commands[rows]
        if not np.isfinite(driven).all():
            raise PolicyError(f"policy {self._name} answered {driven[~np.isfinite(driven).all(axis=1)][0]}: not finite")
        return list(driven), [NO_WISH] * len(rows)


class SinglePolicies(Unwatched):
    """Policies for one car, one made for each row."""

    def __init__(self, make: Callable[[], Policy], n: int) -> None:
        """Keep the way to make a policy; none is made before a row needs it."""
        self._make = make
        self._policies: list[Policy | None] = [None] * n

    def _policy(self, row: int) -> Policy:
        policy = self._policies[row]
        if policy is None:
            policy = self._policies[row] = self._make()
        return policy

    def assign(self, row: int, request: EpisodeRequest) -> None:
        """Start the policy of a row again."""
        self._policy(row).reset(1)

    def release(self, row: int) -> None:
        """Do nothing: the row keeps its policy."""

    def act(self, rows: Index, observation: NDArray[np.floating]) -> tuple[Sequence[Any], Sequence[Pair]]:
        """Commands of the rows and the clearances that they want."""
        policies = [self._policy(row) for row in rows.tolist()]
        commands = [one.act(np.array(observation[row])) for one, row in zip(policies, rows, strict=True)]
        return commands, [_wish(one) for one in policies]


def _wish(policy: Policy) -> Pair:
    wanted = getattr(policy, "wanted_clearance", None)
    if wanted is None:
        return NO_WISH
    side, metres = np.asarray(wanted, float)[0].tolist()
    return side, metres


class MixedPolicies(Unwatched):
    """Policies of several kinds in the rows of one batch; `EpisodeRequest.machine` says which one drives."""

    def __init__(self, members: Sequence[RowPolicies], n: int) -> None:
        """Take over the members, each of which has all n rows."""
        self._members = members
        self._member = np.full(n, -1)

    def assign(self, row: int, request: EpisodeRequest) -> None:
        """Start the policy of a request in a row."""
        self._member[row] = request.machine
        self._members[request.machine].assign(row, replace(request, machine=0))

    def release(self, row: int) -> None:
        """End the policy of a row."""
        self._members[self._member[row]].release(row)
        self._member[row] = -1

    def act(self, rows: Index, observation: NDArray[np.floating]) -> tuple[Sequence[Any], Sequence[Pair]]:
        """Commands of the rows and the clearances that they want, each from its member."""
        commands, wishes = np.zeros((len(rows), 2), np.float32), np.full((len(rows), 2), np.nan)
        member = self._member[rows]
        for number in np.unique(member).tolist():
            mine = member == number
            commands[mine], wishes[mine] = self._members[number].act(rows[mine], observation)
        return list(commands), [(side, metres) for side, metres in wishes.tolist()]
