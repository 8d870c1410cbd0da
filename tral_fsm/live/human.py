"""`render_mode="human"` of the environments: the page, without hands on the drive."""

from __future__ import annotations

import sys
from typing import Any

from tral_env.se2 import Pose
from tral_fsm.live import require_viser
from tral_fsm.live.frame import CarFrame, Frame
from tral_fsm.live.pace import Clock

_FRAME_S = 0.02
"""A frame is made so often at the most."""
_GIVEN_UP_S = 0.25
"""A program that is later than this no longer tries to catch up."""


class HumanPage:
    """Shows the car of an environment in real time; it opens with the first reset."""

    def __init__(self, port: int = 8080, clock: Clock | None = None) -> None:
        """Prepare the page.

        Args:
            port: the first port to try; 0: any.
            clock: how time is told and waited for.

        Raises:
            MissingExtraError: the library of the page is missing.
        """
        require_viser()
        self._port, self._clock = port, clock or Clock()
        self._episode, self._time_s = 0, float("inf")
        self._begun = self._shown_until = 0.0
        self.page: Any = None
        """The page; None before the first reset."""

    def show(self, world: Any) -> None:
        """See `tral_env.human.HumanView`."""
        time_s = float(world.sim.time_s[0])
        if time_s < self._time_s:
            self._episode += 1
            self._begun = self._clock.now() - time_s
            self._shown_until = 0.0
        self._time_s = time_s
        self._wait(self._begun + time_s)
        if self._clock.now() >= self._shown_until:
            self._shown_until = self._clock.now() + _FRAME_S
            self.frame = self._frame(world)
        if self.page is None:
            self._open()

    def _wait(self, due: float) -> None:
        late = self._clock.now() - due
        if late < 0.0:
            self._clock.sleep(-late)
        elif late > _GIVEN_UP_S:
            self._begun += late

    def _frame(self, world: Any) -> Frame:
        sim, info = world.sim, {name: values[0] for name, values in world.info().items()}
        pose: Pose = tuple(info["pose"].tolist())
        steering, throttle = sim.command[0].tolist()
        car = CarFrame(
            name="action",
            time_s=self._time_s,
            readings=dict(zip(world.layout.names, world.observation()[0].tolist(), strict=True)),
            action=(steering, throttle),
            pose=pose,
            qpos=sim.physics.qpos[0].copy(),
            speed_mps=float(info["speed_mps"]),
            gates=(int(info["gates_passed"]), int(info["gates_total"])),
            progress=float(info["progress"]),
        )
        name = world.config.course or ", ".join(world.config.scenarios)
        return Frame(episode=self._episode, title=str(name), plan=world.plans[0], cars=(car,))

    def _open(self) -> None:
        from tral_fsm.live.page import Page

        self.page = Page(self, port=self._port)
        print(f"Open {self.page.url} in a browser.", file=sys.stderr)

    def close(self) -> None:
        """Stop serving."""
        if self.page is not None:
            self.page.close()
