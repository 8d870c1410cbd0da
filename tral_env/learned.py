"""A trained network as a policy, in numpy: neither torch nor the program that trained it is needed to drive.

`tral_env.policy_file` reads and writes it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from tral_env.arrays import Flags
from tral_env.checks import check_rows, one_of
from tral_env.errors import ConfigError
from tral_env.interface import CORE_FIELDS, CORE_LAYOUT
from tral_env.learner import Actuation, LearnerConfig, LearnerView, check_correction

Values = NDArray[np.float32]

BLAS = ThreadpoolController().select(user_api="blas")
"""What multiplies NumPy's matrices. Threads of its own would hardly make a network faster, and wait for the next one
busily, on cores that simulate cars or train."""
MIN_DEVIATION = 1e-6
"""An input that differs less is no input, and dividing by less makes numbers beyond float32."""
MAX_LAYERS = 16
"""A network has so many layers at most."""

ACTIVATIONS: Mapping[str, Callable[[Values], Values]] = {
    "relu": lambda x: np.maximum(x, 0.0, out=x),
    "tanh": lambda x: np.tanh(x, out=x),
}
"""What follows each layer but the last, by name."""
OUTPUTS: Mapping[str, Callable[[Values], Values]] = {
    "clip": lambda x: np.minimum(np.maximum(x, -1.0, out=x), 1.0, out=x),
    "tanh": lambda x: np.tanh(x, out=x),
}
"""What follows the last layer, by name: actions are in [-1, 1]."""


@dataclass(frozen=True, kw_only=True)
class Correction:
    """What a network corrects: the steering of a machine, and the speed that the machine wants.

    A correction of the throttle would be in vain: the machine's speed regulator takes it back.
    """

    machine: str
    """Text of the machine's file, TRAL JSON."""
    steering: float
    """Largest correction of the steering, which is added."""
    speed: float
    """Largest correction of the speed, as a share of it: with 0.5 a car drives at 0.5 to 1.5 times the speed."""

    def __post_init__(self) -> None:
        check_correction(self.steering, self.speed)
        if not isinstance(self.machine, str):
            raise ConfigError("machine of the correction: expected the text of its file")


@dataclass(frozen=True, kw_only=True)
class Chart:
    """The state chart that a network follows: beside its actions it answers which state comes next.

    It sees in which state it is, and other inputs behind those of the learner, see `tral_fsm.policies.charted`.
    """

    states: tuple[str, ...]
    """Names of the states; the first one begins."""
    inputs: tuple[str, ...]
    """Names of the inputs."""

    def __post_init__(self) -> None:
        for name, values in (("states", self.states), ("inputs", self.inputs)):
            if not isinstance(values, tuple) or not values or not all(isinstance(each, str) for each in values):
                raise ConfigError(f"{name} of the chart: expected one name or more")
            if len(set(values)) < len(values):
                raise ConfigError(f"{name} of the chart: each name may stand there once")


def _check_numbers(place: str, values: object) -> None:
    if not isinstance(values, np.ndarray) or values.dtype != np.float32:
        kind = f"array of {values.dtype}" if isinstance(values, np.ndarray) else type(values).__name__
        raise ConfigError(f"{place}: got {kind}, expected an array of float32")
    if not np.isfinite(values).all():
        raise ConfigError(f"{place}: got numbers that are not finite")


def sizes(learner: LearnerConfig, chart: Chart | None) -> tuple[int, int]:
    """Numbers of inputs and answers of a network: those of the learner and two actions, and those of its chart."""
    inputs = LearnerView(learner, 1).size
    return (inputs, 2) if chart is None else (inputs + len(chart.inputs), 2 + len(chart.states))


@dataclass(frozen=True, kw_only=True, eq=False)
class Network:
    """A perceptron that decides for cars."""

    learner: LearnerConfig
    """What it sees, how often it decides, and what its two answers mean."""
    layers: Sequence[tuple[Values, Values]]
    """Weights (outputs, inputs) and biases (outputs,) of each layer."""
    activation: str = "relu"
    """One of `ACTIVATIONS`."""
    output: str = "clip"
    """One of `OUTPUTS`."""
    normalization: tuple[Values, Values] | None = None
    """Mean and standard deviation of each input, which are taken from it and divided by; None: inputs stay as they
    are."""
    correction: Correction | None = None
    """What it corrects; None: its actions are commands themselves."""
    chart: Chart | None = None
    """The state chart that it follows; None: it has no states."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """Where it comes from: algorithm, courses, seeds, versions, curve; for JSON."""
    _transposed: tuple[tuple[Values, Values], ...] = field(init=False, repr=False, default=())
    """The layers with weights (inputs, outputs)."""

    def __post_init__(self) -> None:
        one_of("activation", self.activation, ACTIVATIONS)
        one_of("output", self.output, OUTPUTS)
        if self.correction is not None and (self.learner.action != "throttle" or self.learner.drive_range is not None):
            raise ConfigError("a correction has action='throttle' and no drive_range: it has limits of its own")
        if not 1 <= len(self.layers) <= MAX_LAYERS:
            raise ConfigError(f"{len(self.layers)} layers: expected 1 to {MAX_LAYERS}")
        if self.chart is not None and self.correction is not None:
            raise ConfigError("a network follows a state chart or corrects a machine, not both")
        inputs, answers = sizes(self.learner, self.chart)
        for place, values in zip(("mean", "standard deviation"), self.normalization or (), strict=False):
            _check_numbers(f"{place} of the inputs", values)
            if values.shape != (inputs,):
                raise ConfigError(f"{place} of the inputs has shape {values.shape}: expected ({inputs},)")
        if self.normalization is not None and not (self.normalization[1] >= MIN_DEVIATION).all():
            raise ConfigError(f"standard deviation of the inputs: expected {MIN_DEVIATION:g} or more")
        for index, (weight, bias) in enumerate(self.layers):
            _check_numbers(f"weights of layer {index}", weight)
            _check_numbers(f"biases of layer {index}", bias)
            outputs = answers if index == len(self.layers) - 1 else len(bias)
            if weight.shape != (outputs, inputs) or bias.shape != (outputs,):
                raise ConfigError(
                    f"layer {index} has weights {weight.shape} and biases {bias.shape}: expected ({outputs}, {inputs}) "
                    f"and ({outputs},)"
                )
            inputs = outputs
        transposed = tuple((np.ascontiguousarray(weight.T), bias) for weight, bias in self.layers)
        object.__setattr__(self, "_transposed", transposed)  # frozen; a product with these takes a quarter less time

    def actions(self, observation: Values) -> Values:
        """Actions (k, 2) in [-1, 1] for observations (k, inputs), see `LearnerView`."""
        return OUTPUTS[self.output](self._answers(observation)[:, :2])

    def decided(self, observation: Values) -> tuple[Values, NDArray[np.intp]]:
        """Actions (k, 2) in [-1, 1], and the place (k,) of the next state among those of the chart."""
        answers = self._answers(observation)
        return OUTPUTS[self.output](answers[:, :2]), answers[:, 2:].argmax(axis=1)

    def _answers(self, observation: Values) -> Values:
        """The last layer, before what follows it."""
        if len(observation) == 1:  # too small for threads
            return self._computed(observation)
        with BLAS.limit(limits=1):
            return self._computed(observation)

    def _computed(self, observation: Values) -> Values:
        x = observation
        if self.normalization is not None:
            x = (x - self.normalization[0]) / self.normalization[1]
        activation = ACTIVATIONS[self.activation]
        for weight, bias in self._transposed[:-1]:
            x = np.dot(x, weight)  # for a single row this takes two thirds of the time of @
            x = activation(np.add(x, bias, out=x))
        weight, bias = self._transposed[-1]
        x = np.dot(x, weight)
        return np.add(x, bias, out=x)


class LearnedPolicy:
    """Drives cars with a network."""

    _has_chart = False
    """Whether its networks follow a state chart."""

    def __init__(self, network: Network) -> None:
        """Make a policy for one car; `reset(n)` for more.

        Raises:
            ConfigError: the network follows a state chart.
        """
        if (network.chart is not None) != self._has_chart:
            does = "follows no" if self._has_chart else "follows a"
            raise ConfigError(f"the network {does} state chart: tral_fsm.load_policy finds the policy for it")
        self.network = network
        self.needed_readings = _needed(network.learner)
        """Names of the readings without which it cannot drive, see `tral_env.interface.check_readings`."""
        self._size = CORE_LAYOUT.size
        self._low = np.array([each.low for each in CORE_FIELDS], np.float32)
        self._high = np.array([each.high for each in CORE_FIELDS], np.float32)
        self._distance, self._speed = CORE_LAYOUT.column("distance"), CORE_LAYOUT.column("speed")
        self.reset()

    def reset(self, n: int = 1) -> None:
        """Start again with n cars."""
        learner = self.network.learner
        self._view, self._actuation = LearnerView(learner, n), Actuation(learner, n)
        self._fresh, self._any_fresh = np.ones(n, bool), True
        self._way = np.zeros(n, np.float32)
        self._wanted = np.zeros((n, 2))

    def reset_rows(self, rows: Flags) -> None:
        """Start the cars again where `rows` (n,) is true.

        Raises:
            ConfigError: `rows` is not one truth value for each car.
        """
        check_rows("rows to reset", rows, len(self._fresh))
        self._fresh |= rows
        self._any_fresh = bool(self._fresh.any())

    def act(self, observation: NDArray[np.floating]) -> Values:
        """Run one tick. A car whose distance has fallen begins a new episode.

        Args:
            observation: (d,) or (n, d), the columns of `tral_env.interface.Layout`; not features.

        Returns:
            (2,) or (n, 2): steering, throttle.

        Raises:
            ConfigError: the observation has another shape, or a value is NaN or out of its bounds.
        """
        readings = self._checked(observation)
        way = readings[:, self._distance].copy()
        fell = way < self._way
        self._way = way
        self._take(readings, self._fresh | fell if self._any_fresh or np.count_nonzero(fell) else None)
        due = self._view.common_due
        if due:
            self._wanted = self._wants(None)
        elif due is None and (rows := self._view.due).any():
            self._wanted[rows] = self._wants(rows)
        command = self._actuation.command(self._wanted, readings[:, self._speed]).astype(np.float32)
        return command[0] if np.ndim(observation) == 1 else command

    def _take(self, readings: Values, begins: Flags | None) -> None:
        """Take over the readings (n, d) of a tick; episodes begin in the rows `begins` (n,), or in none."""
        if begins is None:
            self._view.update(readings)
            return
        self._view.update(readings, ~begins)
        self._view.reset(begins, readings)
        self._actuation.reset(begins)
        self._fresh[:] = self._any_fresh = False

    def _wants(self, rows: Flags | None) -> NDArray[np.float64]:
        """What the network wants of the cars in `rows` (n,), or of all, see `Actuation.wanted`."""
        actions = self._decided(rows)
        if not math.isfinite(actions.sum()):
            raise ConfigError("the network decided for a number that is not finite: its weights are too large")
        return self._actuation.wanted(actions)

    def _decided(self, rows: Flags | None) -> Values:
        """Actions of the cars in `rows` (n,), or of all."""
        seen = self._view.observation()
        return self.network.actions(seen if rows is None else seen[rows])

    def _checked(self, observation: NDArray[np.floating]) -> Values:
        try:
            rows = np.asarray(observation, np.float32)
        except (TypeError, ValueError) as error:
            raise ConfigError(f"observation: got {observation!r:.80}, expected an array of numbers") from error
        rows = rows[None] if rows.ndim == 1 else rows
        rows = rows[:, : self._size] if rows.ndim == 2 else rows
        if rows.shape != (len(self._fresh), self._size):
            raise ConfigError(
                f"observation has shape {np.shape(observation)}, expected ({len(self._fresh)}, {self._size} or more): "
                "the fields of tral_env.interface.CORE_LAYOUT, and a row for each car of reset(n); the policy makes "
                "its features itself"
            )
        within = np.greater_equal(rows, self._low) & np.less_equal(rows, self._high)
        if np.count_nonzero(within) != within.size:
            row, column = np.argwhere(~within)[0].tolist()
            each = CORE_FIELDS[column]
            raise ConfigError(
                f"observation: {each.name} = {rows[row, column]:g} in row {row}, allowed {each.low:g} to "
                f"{each.high:g} {each.unit}: hand over the readings as the environment gives them, not normalized"
            )
        return rows

    def predict(
        self,
        observation: NDArray[np.floating],
        state: Any = None,
        episode_start: Flags | None = None,
        deterministic: bool = True,
    ) -> tuple[Values, Any]:
        """The signature of Stable-Baselines3's policies.

        Args:
            observation: (d,) or (n, d); n as in the last `reset`, or another one where all cars begin an episode.
            state: returned unchanged, since the policy keeps its own.
            episode_start: (n,) true for cars whose episode begins now.
            deterministic: not used, since the policy always is.

        Returns:
            Action (2,) or (n, 2), and the state.

        Raises:
            ConfigError: see `act`.
        """
        n = 1 if np.ndim(observation) <= 1 else len(observation)
        if n != len(self._fresh) and (self._fresh.all() or (episode_start is not None and np.all(episode_start))):
            self.reset(n)
        if episode_start is not None and n == len(self._fresh):
            self.reset_rows(np.atleast_1d(episode_start))
        return self.act(observation), state


def _needed(learner: LearnerConfig) -> frozenset[str]:
    names = CORE_LAYOUT.names
    if learner.observation == "features" and not learner.detections:
        names = tuple(name for name in names if not name.startswith(("gate_", "marker_")))
    return frozenset(names)
