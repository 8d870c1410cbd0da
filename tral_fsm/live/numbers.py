"""Sliders for the numbers of the machine that drives: each change holds from the next tick on."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import viser

from tral_env.errors import ConfigError
from tral_fsm.definition.machine import MachineDefinition, StateSpec
from tral_fsm.formats import write
from tral_fsm.live.drive import LiveDrive, Order
from tral_fsm.live.frame import CarFrame, Frame
from tral_fsm.tuning.listing import Listed, listing
from tral_fsm.tuning.parameters import Site, Value, is_optional_number, sites, with_value
from tral_fsm.tuning.ranges import limits, span_of

_ACTIVE = "the active state"
_STEPS = 200
FILE = "machine.json"
_SETTLED_S = 0.7
"""A state that is active for so long gets its sliders."""


@dataclass(kw_only=True)
class _Asked:
    """Changes of a number that were ordered: its slider is where a person put it until they are carried out."""

    open: int = 0
    """So many wait."""
    before: Any = None
    """The frame that was shown before the last one was carried out."""


class Numbers:
    """A panel with the numbers of one state, and of the transitions that leave it."""

    def __init__(self, gui: viser.GuiApi, order: Callable[[Order], None]) -> None:
        """Show nothing yet.

        Args:
            gui: where the panel is.
            order: has something done by the thread that drives.
        """
        self._gui, self._order = gui, order
        self._part: Any = gui.add_dropdown("numbers of", (_ACTIVE,), hint="a state, with the transitions that leave it")
        self._folder = gui.add_folder("Numbers")
        self._changes = gui.add_markdown("")
        self._save = gui.add_button("Save as machine file", icon=viser.Icon.DOWNLOAD)
        self._back = gui.add_button("As the file has it", icon=viser.Icon.ARROW_BACK_UP)
        self._save.on_click(self._download)
        self._back.on_click(lambda _: order(_as_loaded))
        self._machine: MachineDefinition | None = None
        self._loaded: MachineDefinition | None = None
        self._shown: Any = None
        self.inputs: dict[str, Any] = {}
        """Path of a number -> what a person changes it with."""
        self.gifts: dict[str, Any] = {}
        """Path of a number that is null in the file -> the box that gives it a value."""
        self._parts: list[Any] = []
        self._asked: dict[str, _Asked] = {}
        self._lock = threading.Lock()
        """Handlers of the page, the thread that drives and the one that shows count what was asked for."""
        self._nulls: tuple[str, ...] = ()
        self._active = "", 0.0, ""
        """The active state, since when, and the one whose numbers are shown."""

    def show(self, frame: Frame) -> None:
        """Follow the machine and, where that is asked for, its active state."""
        machine, loaded = frame.machine, frame.as_loaded
        if loaded is not self._loaded:
            self._loaded = loaded
            names = () if loaded is None else part_names(loaded)
            self._part.options = (*names, _ACTIVE)
            self._part.value = self._part.options[0]
        active = self._settled(frame.cars[0]) if self._part.value == _ACTIVE else ""
        if machine is None or loaded is None:
            self._clear()
            self._shown = self._machine = None
            return
        if machine is not self._machine:
            self._nulls = nulls(machine)
        wanted = (id(loaded), self._part.value, active, self._nulls)
        if wanted != self._shown:
            self._shown = wanted
            self._build(machine, loaded, active or self._part.value)
        with self._lock:
            before = len(self._asked)
            self._asked = {path: one for path, one in self._asked.items() if one.open or one.before is frame}
            waits = set(self._asked)
        if machine is not self._machine or len(waits) < before:
            self._machine = machine
            self._follow(machine, loaded, waits)

    def _settled(self, car: CarFrame) -> str:
        """The active state, once it has been active for a while."""
        state, since, shown = self._active
        if car.state != state or car.time_s < since:
            state, since = car.state, car.time_s
        if not shown or car.time_s - since >= _SETTLED_S:
            shown = state
        self._active = state, since, shown
        return shown

    def _clear(self) -> None:
        for part in self._parts:
            part.remove()
        self._parts, self.inputs, self.gifts = [], {}, {}

    def _build(self, machine: MachineDefinition, loaded: MachineDefinition, part: str) -> None:
        """Make the sliders of a part."""
        self._clear()
        before = {one.path: one.value for one in listing(loaded)}
        empty = {site.path: site for site in sites(loaded) if site.value is None and is_optional_number(site)}
        values = {one.path: one for one in listing(machine)}
        with self._folder:
            for place, (heading, paths) in enumerate(parts(machine, part)):
                folder = self._gui.add_folder(heading, expand_by_default=place == 0)
                self._parts.append(folder)
                with folder:
                    for path in paths:
                        if path in empty and (path in values or can_give(machine, empty[path])):
                            self.gifts[path] = self._gift(empty[path], path in values)
                        if path in values:
                            self.inputs[path] = self._input(values[path], before.get(path))

    def _gift(self, site: Site, given: bool) -> Any:
        """A box that gives a value to a number that is null in the file, or takes it back."""
        box = self._gui.add_checkbox(
            f"give {site.name} a value", given, hint="; ".join(filter(None, (_meaning(site), "in the file: null")))
        )
        box.on_update(lambda event: self._give(event, site))
        return box

    def _give(self, event: Any, site: Site) -> None:
        if event.client is not None:
            self.change(site.path, first_value(site) if event.target.value else None)

    def _input(self, number: Listed, before: Value | None) -> Any:
        """A slider, a checkbox or a list, by what the number is."""
        gui, value = self._gui, number.value
        label, hint = label_of(number), hint_of(number, before)
        handle: Any
        if isinstance(value, bool):
            handle = gui.add_checkbox(label, value, hint=hint)
        elif isinstance(value, str):
            choices = number.parameter.choices if number.parameter is not None else (value,)
            handle = gui.add_dropdown(label, tuple(map(str, choices)), initial_value=value, hint=hint)
        else:
            low, high, step = span_of_slider(number)
            marks = ((float(before), f"{before:g}"),) if isinstance(before, int | float) else None
            handle = gui.add_slider(label, low, high, step, float(value), marks=marks, hint=hint)
        path, whole = number.path, isinstance(value, int) and not isinstance(value, bool)
        handle.on_update(lambda event: self._change(event, path, whole))
        return handle

    def _change(self, event: Any, path: str, whole: bool) -> None:
        if event.client is None:
            return  # this program set the slider
        value = event.target.value
        self.change(path, round(value) if whole else value)

    def change(self, path: str, value: Value | None) -> None:
        """Let the machine of the first car go on with another value."""
        with self._lock:
            asked = self._asked.setdefault(path, _Asked())
            asked.open += 1

        def retune(drive: LiveDrive) -> None:
            try:
                drive.lanes[0].retune(path, value)
            finally:
                with self._lock:
                    asked.open, asked.before = asked.open - 1, drive.frame

        self._order(retune)

    def _follow(self, machine: MachineDefinition, loaded: MachineDefinition, waits: Collection[str]) -> None:
        """Show the values of a machine that was changed, but for those that wait, and what differs from its file."""
        values = {one.path: one for one in listing(machine)}
        for path, box in self.gifts.items():
            if box.value != (path in values):
                box.value = path in values
        for path, handle in self.inputs.items():
            if path in values and path not in waits and values[path].value != handle.value:
                value = values[path].value
                handle.value = value if isinstance(value, bool | str) else float(value)
        self._changes.content = changes(machine, loaded)

    def _download(self, event: Any) -> None:
        if self._machine is not None and event.client is not None:
            event.client.send_file_download(FILE, machine_file(self._machine))


def _as_loaded(drive: LiveDrive) -> None:
    drive.lanes[0].retune_all()


def machine_file(machine: MachineDefinition) -> bytes:
    """A machine as the content of a file that every command takes."""
    return write(machine, "json").encode()


def part_names(machine: MachineDefinition) -> list[str]:
    """Names of the states as a drive tells them."""
    return [_name(state) for state in machine.states]


def _name(state: StateSpec) -> str:
    return state.label or str(state.id)


def nulls(machine: MachineDefinition) -> tuple[str, ...]:
    """Paths of the numbers that are null and may be given a value."""
    return tuple(site.path for site in sites(machine) if site.value is None and is_optional_number(site))


def can_give(machine: MachineDefinition, site: Site) -> bool:
    """Whether a number that is null may have a value beside the others: a state has a speed or a throttle, not both."""
    try:
        with_value(machine, site.path, first_value(site))
    except ConfigError:
        return False
    return True


def parts(machine: MachineDefinition, name: str) -> list[tuple[str, list[str]]]:
    """Paths of the numbers of a state and of the transitions that leave it, under headings; those that are null too.

    Args:
        machine: the machine.
        name: of the state in a drive; that of an inner state, "corner/turn left", gives those of both.
    """
    found = []
    told = {one.path for one in listing(machine)} | set(nulls(machine))
    paths = [site.path for site in sites(machine) if site.path in told]
    outer, _, inner = name.partition("/")
    for state in machine.states:
        if _name(state) != outer:
            continue
        prefix = f"state[{state.id}]"
        found.append((f"{_name(state)}: {state.type}", [path for path in paths if path.startswith(f"{prefix}.")]))
        for transition in machine.transitions:
            if transition.source == state.id:
                its = [path for path in paths if path.startswith(f"transition[{transition.id}].")]
                found.append((f"to {transition.target}, by {transition.id}: {transition.when.type}", its))
        if inner and isinstance(state.inner, MachineDefinition):
            found += [
                (heading, [f"{prefix}/{path}" for path in within]) for heading, within in parts(state.inner, inner)
            ]
    return [(heading, of) for heading, of in found if of]


def label_of(number: Listed) -> str:
    """Name of a number with its unit."""
    name = number.path.rpartition("].")[2]
    return f"{name} [{number.unit}]" if number.unit else name


def hint_of(number: Listed, before: Value | None) -> str:
    """What a number means, what its definition allows, and what it was."""
    told = [_meaning(number.site), f"in the file: {'null' if before is None else before}"]
    if isinstance(number.value, float | int) and not isinstance(number.value, bool):
        low, high = limits_of(number)
        told.insert(1, f"allowed: {low:g} to {high:g} {number.unit}".rstrip())
    return "; ".join(part for part in told if part)


def _meaning(site: Site) -> str:
    return site.spec.model_fields[site.name].description or ""


def first_value(site: Site) -> Value:
    """What a number that was null begins with: the middle of where a search would look, else 1, as far as allowed."""
    low, high = limits(site.spec, site.name)
    span = span_of(site.spec, site.name, 0.0)
    value = 1.0 if span is None else (span.low + span.high) / 2.0
    return round(min(max(value, low), high), 3)


def limits_of(number: Listed) -> tuple[float, float]:
    """Limits of a number in its definition."""
    return limits(number.site.spec, number.site.name)


def span_of_slider(number: Listed) -> tuple[float, float, float]:
    """Ends and step of a slider: where a search would look, within the limits of the definition."""
    value = float(number.value)
    low, high = limits_of(number)
    if number.parameter is not None:
        low, high = max(low, number.parameter.low), min(high, number.parameter.high)
    low = value - 1.0 if math.isinf(low) else low
    high = max(value, low) + 1.0 if math.isinf(high) else high
    if isinstance(number.value, int):
        return float(min(low, value)), float(max(high, value)), 1.0
    return min(low, value), max(high, value), round_step((high - low) / _STEPS)


def round_step(step: float) -> float:
    """The next smaller of 1, 2, 5, 10 and so on."""
    power = 10.0 ** math.floor(math.log10(step))
    return max(size * power for size in (1.0, 2.0, 5.0) if size * power <= step * 1.0001)


def changes(machine: MachineDefinition, loaded: MachineDefinition) -> str:
    """What differs from the file, as Markdown."""
    before = {one.path: one.value for one in listing(loaded)}
    lines = [
        f"| `{one.name}` | {before.get(one.path, 'null')} | {one.value} {one.unit} |"
        for one in listing(machine)
        if one.value != before.get(one.path)
    ]
    return "\n".join(["| changed | file | now |", "| --- | --- | --- |", *lines]) if lines else "Nothing is changed."
