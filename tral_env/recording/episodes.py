"""The recordings of an environment: each episode is a file of its own; a policy may tell what it does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tral_env.interface import Layout

if TYPE_CHECKING:
    from tral_env.recording.recorder import Recorder


class PolicyWatch:
    """What a policy tells of itself by `active_states`, `wanted_clearance` and `trace`, as far as it has them."""

    def __init__(self, policy: Any) -> None:
        """Watch a policy; its own `trace`, if it has one, is still called."""
        self._policy, self._fired = policy, list[Any]()
        if hasattr(policy, "trace"):
            before = policy.trace

            def both(transit: Any) -> None:
                self._fired.append(transit)
                if before is not None:
                    before(transit)

            policy.trace = both
        self.restart()

    def restart(self) -> None:
        """Forget what the policy did before an episode."""
        self._fired.clear()
        self._state = self._active()

    def take(self) -> dict[str, Any]:
        """State that acted, wish and transitions of the tick that has ended, as `Recorder.tick` takes them."""
        fired, before = tuple(self._fired), self._state
        self._fired.clear()
        self._state = self._active()
        wanted = getattr(self._policy, "wanted_clearance", None)
        return {
            "state": before if fired else self._state,
            "wanted": None if wanted is None else tuple(np.ravel(wanted).tolist()[:2]),
            "transitions": fired,
        }

    def _active(self) -> str:
        states: Sequence[str] = getattr(self._policy, "active_states", ())
        return states[0] if states else ""


class EpisodeRecorder:
    """Records the episodes of one environment, the first into a file, the next ones beside it."""

    def __init__(
        self,
        path: Path | str | None,
        *,
        layout: Layout,
        clock: Callable[[], float],
        configuration: Mapping[str, object],
        files: Mapping[str, bytes],
    ) -> None:
        """Name the first file; an episode whose file exists takes `drive-2.mcap`, `drive-3.mcap` and so on.

        Args:
            path: the file; None: nothing is recorded, and nothing else below happens.
            layout: columns of the observations.
            clock: clock of the environment, s.
            configuration: see `Recorder`.
            files: see `Recorder`.
        """
        self._path, self._layout, self._clock = None if path is None else Path(path), layout, clock
        self._configuration, self._files = configuration, dict(files)
        self._watch: PolicyWatch | None = None
        self.current: Recorder | None = None
        """Records the episode that runs."""

    def watch(self, policy: Any, files: Mapping[str, bytes] | None = None) -> None:
        """Record what a policy does, too, and keep its files from the next episode on.

        Args:
            policy: the policy; only what it tells of itself is used.
            files: its files, name -> content.
        """
        if self._path is not None:
            self._watch = PolicyWatch(policy)
            self._files |= files or {}

    def begin(self) -> None:
        """Begin the file of an episode, and end that of the one before.

        Raises:
            ConfigError: the file cannot be made.
        """
        self.close()
        if self._path is None:
            return
        if self._watch is not None:
            self._watch.restart()
        # A car that records nothing needs neither MCAP nor OpenCV.
        from tral_env.recording.file import free_path
        from tral_env.recording.recorder import Recorder

        self.current = Recorder(
            free_path(self._path),
            layout=self._layout,
            configuration=self._configuration,
            files=self._files,
            start_s=self._clock(),
        )

    def tick(self, observation: NDArray[np.float32], action: NDArray[np.floating], **told: Any) -> None:
        """Record a step that has ended; see `Recorder.tick`."""
        if self.current is not None:
            policy = {} if self._watch is None else self._watch.take()
            self.current.tick(time_s=self._clock(), observation=observation, action=action, **policy, **told)

    def frame(self, source: str, data: bytes) -> None:
        """Record bytes of a sensor that have come now."""
        if self.current is not None:
            self.current.frame(self._clock(), source, data)

    def image(self, exposed_s: float, pixels: NDArray[np.uint8]) -> None:
        """Record an image; see `Recorder.image`."""
        if self.current is not None:
            self.current.image(exposed_s, pixels)

    def say(self, text: str, level: str = "info") -> None:
        """Record a word."""
        if self.current is not None:
            self.current.say(self._clock(), text, level)

    def close(self) -> None:
        """End the file of the episode; a second call does nothing."""
        if self.current is not None:
            self.current.close()
