"""Steps that move the car on the bench: clock, neutral, ends, direction, dead zone, arming."""

from __future__ import annotations

from tral_env.errors import HardwareError
from tral_env.hardware.actuator.drivers import takes_commands
from tral_env.hardware.actuator.laws import STEPS as DIVISIONS
from tral_env.hardware.actuator.laws import prescale
from tral_env.hardware.bringup.adjust import adjusted, asked_number, period_us
from tral_env.hardware.bringup.bench import MAX_THROTTLE, STEERING_REACH_US, Holder
from tral_env.hardware.bringup.person import NO, YES, Person
from tral_env.hardware.bringup.steps import Found, Guided, Step

_MEASURE_S, _SHOW_S, _TRY_S = 30.0, 1.5, 0.8
"""Neutral stands so long for a measurement; a pulse is shown so long, and a small throttle tried so long."""
_CLOCK_HZ = (22e6, 29e6)
"""Least and greatest clock of a board. Source: its data sheet says 25 MHz; measured boards have 24 to 27."""
_DEAD_ZONE_STEP_US, _MAX_DEAD_ZONE_US = 5, 150
_THROTTLES = (0.1, 0.15, 0.2, 0.25, MAX_THROTTLE)
"""Shares of full throttle that are tried until the wheels turn."""
_CONFLICT = "An end at {} us lies beyond the hard limit {}.{} = {} us of the car file. Move the limit?"
_ARMING_S = (1.0, 1.5, 2.0, 3.0)
"""Times for which neutral stands before the first throttle; the first one that the motor controller takes counts."""


def clock(guided: Guided) -> Found:
    """Measure the clock of the board: with the motor's plug off, the board sends neutral, and a person measures."""
    person, calibration = guided.person, guided.car.calibration
    person.say(
        "The pulses are as long as the board's clock says, and boards differ by some percent: until it is measured,\n"
        "neutral may drive the motor. You need a scope, a logic analyser, or a multimeter that shows Hz."
    )
    while person.ask("Take the plug of the motor off, and type off [q]") != "off":
        person.say("  the motor must not be connected")
    divider = prescale(calibration.oscillator_hz, calibration.period_us) + 1
    while True:
        person.say(f"Neutral stands for {_MEASURE_S:g} s: measure the period at a signal pin.")
        with guided.bench.open(guided.car) as board:
            board.rest(_MEASURE_S)
        answer = person.ask("What is it, with its unit, such as 57.4 Hz or 17.42 ms? [Enter: once more]")
        period = period_us(answer)
        if period is None:
            person.say("  a number and Hz, ms or us" if answer else "")
            continue
        hz = divider * DIVISIONS * 1e6 / period
        if not _CLOCK_HZ[0] <= hz <= _CLOCK_HZ[1]:
            person.say(
                f"  that would be a clock of {hz / 1e6:.2f} MHz, and no board has it: expected a period of "
                f"{divider * DIVISIONS / _CLOCK_HZ[1] * 1e3:.2f} to {divider * DIVISIONS / _CLOCK_HZ[0] * 1e3:.2f} ms"
            )
        elif person.agrees(f"The clock is {hz / 1e6:.3f} MHz, {hz / 25e6 - 1:+.1%} beside the data sheet's. Write it?"):
            return {("board", "oscillator_hz"): round(hz, 1), ("board", "clock_measured"): True}


def neutral(guided: Guided) -> Found:
    """Find the pulses at which the motor rests and the front wheels point straight."""
    person, calibration = guided.person, guided.car.calibration
    throttle, steering = calibration.throttle, calibration.steering
    person.say("Jack the car up: all wheels off the ground, nobody near them. Put the motor's plug in, switch it on.")
    with guided.bench.open(guided.car) as board:
        motor = adjusted(
            person, "Motor", throttle.neutral_us, *_around(throttle.neutral_us, 100),
            lambda us: _show(board, throttle_us=us), "Enter if the wheels stand still",
        )  # fmt: skip
        straight = steering.neutral_us + steering.trim_us
        wheels = adjusted(
            person, "Front wheels", straight, *_around(steering.neutral_us, 250),
            lambda us: _show(board, steering_us=us), "Enter if they point straight",
        )  # fmt: skip
    moved = motor - throttle.neutral_us
    return {
        ("pulses", "throttle", "neutral_us"): motor,
        **_ends(guided, "throttle", forward_us=throttle.forward_us + moved, reverse_us=throttle.reverse_us + moved),
        ("pulses", "steering", "trim_us"): wheels - steering.neutral_us,
    }


def ends(guided: Guided) -> Found:
    """Find the pulses of full left and full right: as far as the wheels go without the servo's hum."""
    person, calibration = guided.person, guided.car.calibration
    steering, throttle = calibration.steering, calibration.throttle
    with guided.bench.open(guided.car) as board:
        low, high = _around(round(board.neutral_us[0]), STEERING_REACH_US)
        left, right = (
            adjusted(
                person,
                f"Full {side}",
                us,
                low,
                high,
                lambda us: _show(board, steering_us=us),
                "Enter if the wheels are at their end and the servo does not hum",
            )
            for side, us in (("left", steering.left_us), ("right", steering.right_us))
        )
    forward, reverse = (
        round(asked_number(person, f"Motor controller, full {way} (its manual says it)", us, 800, 2200, "us"))
        for way, us in (("forward", throttle.forward_us), ("reverse or brake", throttle.reverse_us))
    )
    return {
        **_ends(guided, "steering", left_us=left, right_us=right),
        **_ends(guided, "throttle", forward_us=forward, reverse_us=reverse),
    }


def direction(guided: Guided) -> Found:
    """Find out which way is left, and which way is forward."""
    person = guided.person
    found: dict[tuple[str | int, ...], object] = {}
    with guided.bench.open(guided.car) as board:
        board.drive(_SHOW_S, steering=1.0)
        if not person.agrees("Did the front wheels turn to the left, seen from behind the car?"):
            found.update(_turned_round(guided, "steering", "left_us", "right_us"))
        if _first_turn(person, board) == "n":
            found.update(_turned_round(guided, "throttle", "forward_us", "reverse_us"))
    return found


def _turned_round(guided: Guided, channel: str, one_name: str, other_name: str) -> Found:
    """The other direction: of a board that takes pulses, its ends are exchanged; another board has an option for it."""
    if takes_commands(options := guided.car.board.options):
        name = f"{channel}_reversed"
        guided.person.say(f"  the board gets each {channel} with the other sign from now on")
        return {("board", name): not getattr(options, name)}
    place, pulses = ("pulses", channel), getattr(guided.car.calibration, channel)
    return {(*place, one_name): getattr(pulses, other_name), (*place, other_name): getattr(pulses, one_name)}


def _first_turn(person: Person, board: Holder) -> str:
    """Raise the throttle until the wheels turn: y, they turned forward; n, backward."""
    while True:
        for share in _THROTTLES:
            board.drive(_TRY_S, throttle=share)
            answer = person.chooses(
                f"Throttle {share:.0%}: did the wheels turn as if the car drove forward? 0: they did not turn",
                {"y": YES, "n": NO, "0": ("0", "")},
            )
            if answer != "0":
                return answer
        person.say("  is the motor's switch on, and its battery full? Once more from the beginning")


def dead_zone(guided: Guided) -> Found:
    """Find the largest pulse beside neutral at which the motor still rests."""
    person, throttle = guided.person, guided.car.calibration.throttle
    sign = 1 if throttle.forward_us > throttle.neutral_us else -1
    person.say("The throttle rises in small steps. Say y as soon as the wheels turn.")
    with guided.bench.open(guided.car) as board:
        for beyond in range(_DEAD_ZONE_STEP_US, _MAX_DEAD_ZONE_US + 1, _DEAD_ZONE_STEP_US):
            board.hold(_TRY_S, throttle_us=throttle.neutral_us + sign * beyond)
            if person.chooses(f"{beyond} us beside neutral: do the wheels turn?", {"y": YES, "n": (*NO, "")}) == "y":
                return {("pulses", "throttle", "dead_zone_us"): beyond - _DEAD_ZONE_STEP_US}
    raise HardwareError(
        f"nothing turned up to {_MAX_DEAD_ZONE_US} us beside neutral, and nothing was written: is the motor on? Then "
        "repeat the step dead_zone"
    )


def arming(guided: Guided) -> Found:
    """Find out how long the motor controller wants to see neutral before its first throttle."""
    person = guided.person
    for seconds in _ARMING_S:
        person.ask("Switch the motor controller off and on again, then press Enter [q]")
        with guided.bench.open(guided.car, arming_s=seconds) as board:
            board.drive(_TRY_S, throttle=MAX_THROTTLE)
        if person.agrees(f"After {seconds:g} s of neutral: did the wheels turn?"):
            return {("limits", "arming_s"): seconds}
    raise HardwareError(
        f"the motor controller did not arm within {_ARMING_S[-1]:g} s, and nothing was written: is its neutral right? "
        "Then repeat the step arming"
    )


def _show(board: Holder, steering_us: float | None = None, throttle_us: float | None = None) -> None:
    board.hold(_SHOW_S, steering_us, throttle_us)


def _around(us: int, reach_us: int) -> tuple[int, int]:
    return us - reach_us, us + reach_us


def _ends(guided: Guided, channel: str, **ends_us: int) -> dict[tuple[str | int, ...], object]:
    """Both ends of a channel, and its hard limits.

    A limit that stood at an end goes with it. One that somebody set elsewhere stays: where an end lies beyond it, the
    person decides which of the two gives way.
    """
    pulses = getattr(guided.car.calibration, channel)
    limits = {}
    for name, outer in (("min_us", min), ("max_us", max)):
        limit, end = getattr(pulses, name), outer(ends_us.values())
        follows = limit == outer(getattr(pulses, each) for each in ends_us)
        if follows or (
            outer(limit, end) != limit and guided.person.agrees(_CONFLICT.format(end, channel, name, limit))
        ):
            limits[name] = limit = end
        inner = max if outer is min else min
        ends_us = {each: inner(us, limit) for each, us in ends_us.items()}
    return {("pulses", channel, name): us for name, us in {**ends_us, **limits}.items()}


BOARD_STEPS = (
    Step(name="clock", title="Clock of the board", moves=False, run=clock),
    Step(name="neutral", title="Neutral", moves=True, run=neutral),
    Step(name="ends", title="Ends", moves=True, run=ends),
    Step(name="direction", title="Direction", moves=True, run=direction),
    Step(name="dead_zone", title="Dead zone of the throttle", moves=True, run=dead_zone),
    Step(name="arming", title="Arming of the motor controller", moves=True, run=arming),
)
