"""A machine whose commands a network corrects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.learned import Correction, LearnedPolicy, Network
from tral_env.learner import speed_factors, steered
from tral_fsm.formats import tral_json
from tral_fsm.runtime.policy import MachinePolicy


class CorrectedPolicy:
    """Drives cars with a machine; a network corrects its steering and its speed, within bounds."""

    def __init__(self, network: Network, correction: Correction) -> None:
        """Make a policy for one car; `reset(n)` for more.

        Raises:
            FormatError: the machine of the correction cannot run.
        """
        self.machine = MachinePolicy(tral_json.loads(correction.machine, "the machine of the policy"))
        self.learned, self._correction = LearnedPolicy(network), correction
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
        correction = np.atleast_2d(self.learned.act(observation))
        self.machine.scale_speeds(speed_factors(correction, self._correction.speed))
        return self._steered(self.machine.act(observation), correction)

    def predict(
        self,
        observation: NDArray[np.floating],
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """The signature of Stable-Baselines3's policies, see `MachinePolicy.predict`."""
        observation = self.machine.begin_episodes(observation, episode_start)
        answer, _ = self.learned.predict(observation, None, episode_start)
        correction = np.atleast_2d(answer)
        self.machine.scale_speeds(speed_factors(correction, self._correction.speed))
        return self._steered(self.machine.act(observation), correction), state

    def _steered(self, command: NDArray[np.float32], correction: NDArray[np.float32]) -> NDArray[np.float32]:
        found = steered(np.atleast_2d(command), correction, self._correction.steering)
        return found[0] if command.ndim == 1 else found

    @property
    def active_states(self) -> list[str]:
        """Name of the machine's active state in each car."""
        return self.machine.active_states
