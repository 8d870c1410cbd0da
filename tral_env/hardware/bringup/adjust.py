"""Values that a person finds by trying: a pulse that is moved by keys, a measured period with its unit."""

from __future__ import annotations

import re
from collections.abc import Callable

from tral_env.hardware.bringup.person import Person

_STEPS_US = {"+": 10, "-": -10, "++": 40, "--": -40}
"""Answer -> how far the pulse moves, us."""
_QUANTITY = re.compile(r"(\d+(?:[.,]\d+)?)\s*(hz|ms|us|µs)")
_PERIODS_US = {"ms": 1e3, "us": 1.0, "µs": 1.0}


def adjusted(
    person: Person,
    what: str,
    us: int,
    low: int,
    high: int,
    show: Callable[[int], None],
    good: str = "Enter if it is good",
) -> int:
    """Let a person move a pulse until it is good.

    Args:
        person: who decides.
        what: name of the pulse.
        us: where to begin, us.
        low: least pulse, us.
        high: greatest pulse, us.
        show: holds a pulse for a moment.
        good: what ends the search.

    Returns:
        The pulse, us.
    """
    while True:
        show(us)
        answer = person.ask(f"{what} {us} us: {good}; + - move by 10 us, ++ -- by 40, or type a pulse [q]")
        if not answer:
            return us
        wanted = us + _STEPS_US[answer] if answer in _STEPS_US else int(answer) if answer.isdecimal() else None
        if wanted is None:
            person.say(f"  '{answer}' is none of + - ++ --, a whole number of us, or Enter")
        elif not low <= wanted <= high:
            person.say(f"  {wanted} us is outside of {low} to {high} us")
        else:
            us = wanted


def asked_number(person: Person, question: str, usual: float, low: float, high: float, unit: str) -> float:
    """Ask for a number, of which Enter is the usual one."""
    while True:
        answer = person.ask(f"{question} [Enter = {usual:g} {unit}]").removesuffix(unit).strip().replace(",", ".")
        try:
            number = float(answer) if answer else usual
        except ValueError:
            person.say(f"  '{answer}' is no number")
            continue
        if low <= number <= high:
            return number
        person.say(f"  {number:g} {unit} is outside of {low:g} to {high:g} {unit}")


def period_us(text: str) -> float | None:
    """Period of pulses, us, from a measurement with its unit such as ``57.4 Hz`` or ``17.42 ms``; None: it is none."""
    found = _QUANTITY.fullmatch(text.strip().lower())
    if found is None or not (value := float(found[1].replace(",", "."))):
        return None
    return 1e6 / value if found[2] == "hz" else value * _PERIODS_US[found[2]]
