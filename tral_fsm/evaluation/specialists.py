"""The packaged machines of all families of courses as one contender."""

from __future__ import annotations

from dataclasses import replace

from tral_env.course.generate import SCENARIOS
from tral_fsm.definition import packaged
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.episode import EpisodeRequest
from tral_fsm.evaluation.row_policies import DriverPool
from tral_fsm.policies.families import machine_for


def machines_of_families() -> dict[str, MachineDefinition]:
    """Family -> the packaged machine that is made for it."""
    return {family: packaged.load(machine_for([family])) for family in SCENARIOS}


class Specialists(DriverPool):
    """The machine of the family of each request, in the rows of a batch."""

    def __init__(self, n: int) -> None:
        """Take n rows."""
        machines = machines_of_families()
        super().__init__(list(machines.values()), n)
        self._number = {family: number for number, family in enumerate(machines)}

    def assign(self, row: int, request: EpisodeRequest) -> None:
        """Let the machine of the request's family drive a row, from its root on."""
        super().assign(row, replace(request, machine=self._number[request.scenario]))
