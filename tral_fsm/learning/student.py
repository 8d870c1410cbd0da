"""The network that learns from a machine, and the decisions from which it learns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.learned import Chart, Network, Values, sizes
from tral_fsm.learning.networks import as_network, falling, nn, perceptron, torch
from tral_fsm.learning.teacher_settings import TeacherSettings

LAST_RATE = 0.1
"""The learning rate falls to this share of it by the end."""


class Samples:
    """The newest decisions with the machine's answers; the oldest make room."""

    def __init__(self, room: int, inputs: int) -> None:
        self._inputs, self._answers = np.zeros((room, inputs), np.float32), np.zeros((room, 2), np.float32)
        self._states = np.zeros(room, np.int64)
        self.total = 0
        """Decisions so far, those that were forgotten included."""

    def add(self, inputs: Values, answers: Values, states: NDArray[np.integer]) -> None:
        """Keep k decisions: (k, inputs), the machine's actions (k, 2) and its states (k,)."""
        at = (self.total + np.arange(len(inputs))) % len(self._inputs)
        self._inputs[at], self._answers[at], self._states[at] = inputs, answers, states
        self.total += len(inputs)

    def newest(self, count: int) -> dict[str, torch.Tensor]:
        """The newest decisions, at most `count`, the oldest first."""
        count = min(count, self.total, len(self._inputs))
        at = (self.total - count + np.arange(count)) % len(self._inputs)
        inputs = self._inputs[at]
        if np.abs(inputs).max(initial=0.0) <= 1.0:  # features, not plain readings
            inputs = inputs.astype(np.float16)
        kept = {"inputs": inputs, "answers": self._answers[at], "states": self._states[at]}
        return {name: torch.from_numpy(values) for name, values in kept.items()}

    def window(self, reserve: int) -> tuple[int, int]:
        """First and number of the decisions that stay while `reserve` more are added."""
        first = max(self.total + reserve - len(self._inputs), 0)
        return first, max(self.total - first, 1)

    def draw(self, window: tuple[int, int], size: int, rng: np.random.Generator) -> list[torch.Tensor]:
        """Some decisions of a window, drawn with replacement: inputs, actions, states."""
        at = (window[0] + rng.integers(window[1], size=size)) % len(self._inputs)
        return [torch.from_numpy(values[at]) for values in (self._inputs, self._answers, self._states)]


class Student:
    """The network that learns, and the running mean of it that drives."""

    def __init__(self, settings: TeacherSettings, machine: str, chart: Chart | None, seed: int) -> None:
        torch.manual_seed(seed)
        self.settings, self._machine, self._chart = settings, machine, chart
        self.inputs, answers = sizes(settings.learner, chart)
        """Number of inputs."""
        units = [self.inputs, *settings.layers, answers]
        self._net, self._mean = (perceptron(units, settings.activation) for _ in range(2))
        self._mean.load_state_dict(self._net.state_dict())
        self._optimizer = torch.optim.Adam(self._net.parameters(), settings.learning_rate)
        self._seed, self._rng = seed, np.random.default_rng(seed)
        self._updates = 0
        weights = torch.tensor([settings.steering_weight, 1.0])
        self._weights = 2 * weights / weights.sum()

    def learn(self, samples: Samples, window: tuple[int, int], updates: int, share: float) -> float:
        """Take some steps of gradient descent; gives the mean loss.

        Args:
            samples: the decisions.
            window: see `Samples.window`.
            updates: number of steps.
            share: of the training that is done, in [0, 1].
        """
        settings = self.settings
        rate = settings.learning_rate * falling(share, LAST_RATE)
        for group in self._optimizer.param_groups:
            group["lr"] = rate
        total = 0.0
        for _ in range(updates):
            inputs, answers, states = samples.draw(window, settings.batch, self._rng)
            told = self._net(inputs)
            error = nn.functional.huber_loss(told[:, :2], answers, reduction="none", delta=settings.huber)
            loss = (error * self._weights).mean()
            if self._chart is not None:
                loss = loss + settings.state_weight * nn.functional.cross_entropy(told[:, 2:], states)
            self._optimizer.zero_grad()
            loss.backward()
            self._optimizer.step()
            self._follow()
            total += loss.item()
        return total / updates

    def _follow(self) -> None:
        """Move the running mean towards the network."""
        self._updates += 1
        keep = min(self.settings.average, (1 + self._updates) / (10 + self._updates))
        with torch.no_grad():
            for mean, new in zip(self._mean.parameters(), self._net.parameters(), strict=True):
                mean.lerp_(new, 1 - keep)

    def network(self) -> Network:
        """The running mean as it is now."""
        provenance = {"algorithm": "teacher", "teacher": self._machine}
        return as_network(
            list(self._mean), self.settings.learner, output="clip", provenance=provenance, chart=self._chart
        )

    def state(self) -> dict[str, Any]:
        """What a later training needs to go on."""
        return {
            "net": self._net.state_dict(),
            "mean": self._mean.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "updates": self._updates,
        }

    def load(self, state: dict[str, Any]) -> None:
        """Go on from the state of an earlier training."""
        self._net.load_state_dict(state["net"])
        self._mean.load_state_dict(state["mean"])
        self._optimizer.load_state_dict(state["optimizer"])
        self._updates = state["updates"]
        self._rng = np.random.default_rng((self._seed, self._updates))
