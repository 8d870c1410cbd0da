"""A network that follows a state chart: it sees the estimate of its car, and answers a command and the next state."""

from __future__ import annotations

import numpy as np

from tral_env.arrays import Flags
from tral_env.errors import ConfigError
from tral_env.learned import Chart, LearnedPolicy, Network, Values
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.estimator import Estimator
from tral_fsm.policies.chart_view import ChartView, input_names


class ChartedPolicy(LearnedPolicy):
    """Drives cars with a network that follows the state chart of its teacher."""

    _has_chart = True

    def __init__(self, network: Network) -> None:
        """Make a policy for one car; `reset(n)` for more.

        Raises:
            ConfigError: the network follows no state chart, or was made for other estimates.
        """
        super().__init__(network)
        expected = input_names(self._chart.states, network.learner.detections)
        if self._chart.inputs != expected:
            differs = sorted(set(self._chart.inputs) ^ set(expected)) or ["their order"]
            raise ConfigError(f"the network was made for other estimates: {', '.join(differs[:10])}: train it anew")

    @property
    def _chart(self) -> Chart:
        assert self.network.chart is not None
        return self.network.chart

    def reset(self, n: int = 1) -> None:
        """Start again with n cars."""
        super().reset(n)
        self._chart_view = ChartView(self._chart.states, self.network.learner.detections, n)
        self._estimators = [Estimator() for _ in range(n)]
        self._estimates = [CarEstimate()] * n
        self._all = np.arange(n)

    def _take(self, readings: Values, begins: Flags | None) -> None:
        super()._take(readings, begins)
        if begins is not None:
            self._chart_view.reset(begins)
            for row in np.flatnonzero(begins).tolist():
                self._estimators[row] = Estimator()
        self._estimates = [
            estimator.update(row) for estimator, row in zip(self._estimators, readings.tolist(), strict=True)
        ]

    def _decided(self, rows: Flags | None) -> Values:
        of, seen = self._all, self._view.observation()
        if rows is not None:
            of, seen = np.flatnonzero(rows), seen[rows]
        told = self._chart_view.inputs(of, self._estimates)
        actions, states = self.network.decided(np.concatenate([seen, told], axis=1))
        self._chart_view.enter(of, states, self._estimates)
        return actions

    @property
    def active_states(self) -> list[str]:
        """Name of the state that each car is in."""
        return [self._chart.states[state] for state in self._chart_view.active.tolist()]
