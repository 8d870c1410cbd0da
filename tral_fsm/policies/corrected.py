"""A machine whose commands a network corrects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.learned import Correction, LearnedPolicy, Network
from tral_env.learner import corrected
from tral_fsm.formats import tral_json
from tral_fsm.runtime.policy import MachinePolicy


class CorrectedPolicy:
    """Drives cars with a machine; a network adds a bounded correction."""

    def __init__(self, network: Network, correction: Correction) -> None:
        """Make a policy for one car; `reset(n)` for more.

        Raises:
            FormatError: the machine of the correction cannot run.
        """
        self.machine = MachinePolicy(tral_json.loads(correction.machine, "the machine of the policy"))
        self.learned, self._bounds = LearnedPolicy(network), correction.bounds
        self.needed_readings = self.machine.needed_readings | self.learned.needed_readings
        """Names of the readings without which it cannot drive, see `tral_env.interface.check_readings`."""

    def reset(self, n: int = 1) -> None:
        """Start again with n cars."""
        self.machine.reset(n)
        self.learned.reset(n)

    def reset_rows(self, rows: NDArray[np.bool_]) -> None:
        """Start the cars again where `rows` (n,) is true."""
        self.machine.reset_rows(rows)
        self.learned.reset_rows(rows)

    def act(self, observation: NDArray[np.floating]) -> NDArray[np.float32]:
        """Run one tick: (d,) or (n, d) to (2,) or (n, 2), as the machine alone does.

        Raises:
            ConfigError: the observation is none.
        """
        return corrected(self.machine.act(observation), self.learned.act(observation), self._bounds)

    def predict(
        self,
        observation: NDArray[np.floating],
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """The signature of Stable-Baselines3's policies, see `MachinePolicy.predict`."""
        command, _ = self.machine.predict(observation, None, episode_start)
        correction, _ = self.learned.predict(observation, None, episode_start)
        return corrected(command, correction, self._bounds), state

    @property
    def active_states(self) -> list[str]:
        """Name of the machine's active state in each car."""
        return self.machine.active_states


def policy_of(network: Network) -> LearnedPolicy | CorrectedPolicy:
    """The policy that a network is: alone, or with the machine that it corrects."""
    return LearnedPolicy(network) if network.correction is None else CorrectedPolicy(network, network.correction)
