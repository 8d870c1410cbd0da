"""What a person does with the drive: clock, course, driver, and trouble for the car."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import viser

from tral_env.course.generate import SCENARIOS
from tral_env.course.layout import example_names
from tral_fsm.live.drive import Order
from tral_fsm.live.frame import Frame
from tral_fsm.live.hands import BY_HAND, KEYS, Keys
from tral_fsm.live.lane import SIDES
from tral_fsm.live.replay import Replay

SPEEDS = {
    "0.1 x": 0.1,
    "0.25 x": 0.25,
    "0.5 x": 0.5,
    "real time": 1.0,
    "2 x": 2.0,
    "4 x": 4.0,
    "as fast as it goes": math.inf,
}
LEVELS = ("none", "default", "hard")
_GENERATED = "generated"
_PUSH_MPS = 0.4
_SLIDER_S = 0.3
"""The slider of a recording follows in such steps."""


def _press(keys: Keys, key: str, event: Any) -> None:
    del event
    keys.press(key)


def _label(button: viser.GuiButtonHandle, paused: bool) -> None:
    """Say on a button what it will do."""
    button.label = "Go on" if paused else "Pause"
    button.icon = viser.Icon.PLAYER_PLAY if paused else viser.Icon.PLAYER_PAUSE


class Controls:
    """The buttons of a simulated drive."""

    def __init__(
        self, gui: viser.GuiApi, order: Callable[[Order], None], frame: Frame, drivers: Sequence[str], keys: Keys
    ) -> None:
        """Make them.

        Args:
            gui: where they are.
            order: has something done by the thread that drives.
            frame: the drive as it is.
            drivers: names that can be chosen.
            keys: what a person presses while driving.
        """
        self._gui, self.order = gui, order
        self._add_clock()
        for key, what in KEYS.items():
            gui.add_command(what, description="with the driver `by hand`", hotkey=key).on_trigger(
                partial(_press, keys, key)
            )
        with gui.add_folder("Course"):
            self._add_course(frame)
        with gui.add_folder("Driver"):
            self._add_driver(drivers, frame)
        with gui.add_folder("Trouble"):
            self._add_trouble()
        self._paused = False

    def _add_clock(self) -> None:
        gui = self._gui
        self.pause = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE)
        self.step = gui.add_button_group("step", ("1 tick", "10", "80"))
        self.speed = gui.add_dropdown("clock", tuple(SPEEDS), initial_value="real time")
        self.again = gui.add_button("Restart", icon=viser.Icon.REFRESH)
        self.pause.on_click(lambda _: self.order(lambda drive: drive.pause(not drive.paused)))
        self.step.on_click(lambda event: self._step(event.target.value))
        self.speed.on_update(lambda event: self._set_speed(event.target.value))
        self.again.on_click(lambda _: self.order(lambda drive: drive.restart()))

    def _step(self, told: str) -> None:
        ticks = int(told.split()[0])

        def step(drive: Any) -> None:
            if not drive.paused:
                drive.pause(True)
            drive.step(ticks)

        self.order(step)

    def _set_speed(self, told: str) -> None:
        self.order(lambda drive: drive.set_speed(SPEEDS[told]))

    def _add_course(self, frame: Frame) -> None:
        gui, course = self._gui, frame.course
        named = (_GENERATED, *example_names())
        self.course = gui.add_dropdown(
            "course", named, initial_value=course.course if course.course in named else _GENERATED
        )
        self.file = gui.add_text("or its file", "" if course.course in named else course.course or "")
        self.scenario = gui.add_dropdown("family", tuple(SCENARIOS), initial_value=course.scenario)
        self.seed = gui.add_number("seed", course.seed, min=0, step=1)
        levels = LEVELS if course.randomization in LEVELS else (*LEVELS, course.randomization)
        self.level = gui.add_dropdown("cars differ", levels, initial_value=course.randomization)
        self.drive = gui.add_button("Drive this course", icon=viser.Icon.ROAD)
        self.drive.on_click(lambda _: self.choose())

    def choose(self) -> None:
        """Drive what is chosen."""
        file, name = self.file.value.strip(), self.course.value
        wanted = {
            "scenario": self.scenario.value,
            "course": file or (None if name == _GENERATED else name),
            "seed": int(self.seed.value),
            "randomization": self.level.value,
        }
        self.order(lambda drive: drive.choose(**wanted))

    def _add_driver(self, drivers: Sequence[str], frame: Frame) -> None:
        gui = self._gui
        names = tuple(dict.fromkeys([*(car.name for car in frame.cars), *drivers, BY_HAND]))
        self.driver = gui.add_dropdown("driver", names, initial_value=frame.cars[0].name)
        self.path = gui.add_text("or its file", "")
        self.take = gui.add_button("Take over now", icon=viser.Icon.STEERING_WHEEL)
        self.beside = gui.add_dropdown(
            "beside it", ("nobody", *names), initial_value=frame.cars[1].name if len(frame.cars) > 1 else "nobody"
        )
        self.race = gui.add_button("Drive side by side", icon=viser.Icon.CAR)
        self.take.on_click(lambda _: self.take_over())
        self.race.on_click(lambda _: self.side_by_side())

    def take_over(self) -> None:
        """Let the chosen driver go on with the first car."""
        name = self.path.value.strip() or self.driver.value
        self.order(lambda drive: drive.lanes[0].take_driver(name))

    def side_by_side(self) -> None:
        """Let two drivers drive the same course from the start, or one alone."""
        names = [self.path.value.strip() or self.driver.value]
        names += [] if self.beside.value == "nobody" else [self.beside.value]
        self.order(lambda drive: drive.drive_with(names))

    def _add_trouble(self) -> None:
        gui = self._gui
        self.push = gui.add_button_group("push", ("left", "right", "on", "back"))
        self.push.on_click(lambda event: self._push(event.target.value))
        self.silent: dict[str, Any] = {}
        for side in SIDES:
            self.silent[side] = box = gui.add_checkbox(f"take the {side} ultrasonic away", False)
            box.on_update(partial(self._silence, side))
        self.friction: Any = gui.add_slider("friction", 0.2, 1.4, 0.05, 0.9, marks=((0.9, "0.9"),))
        self.battery: Any = gui.add_slider("battery [V]", 5.5, 8.4, 0.1, 7.2, marks=((7.2, "7.2"),))
        self.friction.on_update(lambda event: self._change(event, "friction"))
        self.battery.on_update(lambda event: self._change(event, "battery_v"))

    def _push(self, where: str) -> None:
        forward, left = {"left": (0.0, 1.0), "right": (0.0, -1.0), "on": (1.0, 0.0), "back": (-1.0, 0.0)}[where]
        self.order(lambda drive: drive.each(lambda lane: lane.push(forward * _PUSH_MPS, left * _PUSH_MPS)))

    def _silence(self, side: str, event: Any) -> None:
        silent = bool(event.target.value)
        if event.client is not None:
            self.order(lambda drive: drive.each(lambda lane: lane.silence(side, silent)))

    def _change(self, event: Any, name: str) -> None:
        value = float(event.target.value)
        if event.client is not None:
            self.order(lambda drive: drive.each(lambda lane: lane.change(**{name: value})))

    def show(self, frame: Frame) -> None:
        """Follow what became of the orders."""
        if frame.paused != self._paused:
            self._paused = frame.paused
            _label(self.pause, frame.paused)
        for side, box in self.silent.items():
            if box.value != (silent := side in frame.cars[0].silent):
                box.value = silent
        for name, slider in (("friction", self.friction), ("battery_v", self.battery)):
            value = frame.parameters.get(name, slider.value)
            told = round(float(min(max(value, slider.min), slider.max)), 3)
            if told != slider.value:
                slider.value = told


class ReplayControls:
    """The buttons of a recorded drive."""

    def __init__(self, gui: viser.GuiApi, replay: Replay) -> None:
        """Make them."""
        self._replay = replay
        self.pause = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE)
        self.speed = gui.add_dropdown("clock", tuple(SPEEDS)[:-1], initial_value="real time")
        self.time: Any = gui.add_slider("time [s]", 0.0, max(replay.duration_s, 0.1), 0.05, 0.0)
        self.pause.on_click(lambda _: replay.pause(not replay.frame.paused))
        self.speed.on_update(lambda event: replay.set_speed(SPEEDS[event.target.value]))
        self.time.on_update(self._move)
        self._paused, self._shown_s = False, 0.0

    def _move(self, event: Any) -> None:
        if event.client is not None:
            self._replay.go_to(float(event.target.value))

    def show(self, frame: Frame) -> None:
        """Follow the clock."""
        if frame.paused != self._paused:
            self._paused = frame.paused
            _label(self.pause, frame.paused)
        if abs(frame.cars[0].time_s - self._shown_s) >= _SLIDER_S:
            self._shown_s = self.time.value = round(frame.cars[0].time_s, 2)
