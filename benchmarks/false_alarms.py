"""Stops that are not due: the laws of `tral_env.hardware.faults` look at simulated drives, and stop none of them.

    python benchmarks/false_alarms.py --out runs/false_alarms.json

Machines drive courses of their own families. A stop is not due if the drive goes on without a touch. Beside the laws
with their limits, stricter ones look on: a margin tells at which share of its limit a law would stop the first healthy
drive. Drives that failed do not count there. A simulated drive ends at the goal line, at any speed, and a wall may
stand behind it: a stop just before counts by itself, "at the goal".
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from tral_env.hardware.faults import Decision, FaultLimits, FaultWatch, Look
from tral_env.hardware.faults.laws import SIDES, Law, NoMotion, SonarFrozen, SonarSilent, TooNear
from tral_env.interface import CONTROL_PERIOD_S, CORE_LAYOUT
from tral_fsm import load_machine
from tral_fsm.evaluation.batch import BatchRunner
from tral_fsm.evaluation.episode import EpisodeRequest, Tick
from tral_fsm.evaluation.files import prepare_folder
from tral_fsm.evaluation.host import host
from tral_fsm.policies.families import machine_for

FAMILIES = ("corners", "office", "obstacles", "gates", "doors", "lane_change")
LEVELS = ("default", "hard")
SHARES = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)
"""Stricter limits, as shares of the limit; `rolling_share` is divided by them."""
AT_GOAL_S = 0.3
"""So long before the end of a drive a stop is "at the goal", s."""
RANGES = ("ultrasonic_left", "ultrasonic_front", "ultrasonic_right")


def stricter(share: float, brake: float) -> Iterator[tuple[str, Law]]:
    """Each law with a limit that is stricter by a share."""
    limits = FaultLimits()

    def scaled(*names: str) -> FaultLimits:
        return replace(limits, **{name: getattr(limits, name) * share for name in names})

    yield "standstill_s", NoMotion(replace(scaled("standstill_s"), blind_m=None))
    yield "blind_m", NoMotion(replace(scaled("blind_m"), standstill_s=None))
    for side in SIDES:
        yield "silent_s", SonarSilent(scaled("silent_s"), side)
        yield "frozen_m and frozen_cm_m", SonarFrozen(scaled("frozen_m", "frozen_cm_m"), side)
    yield "rolling_share", TooNear(replace(limits, rolling_share=limits.rolling_share / share), brake)


class Watched:
    """A drive under watch: the first time at which each law would have stopped it; it is not stopped."""

    def __init__(self, unit: str, brake: float) -> None:
        self._stricter = [((name, share), law) for share in SHARES for name, law in stricter(share, brake)]
        self._watch, self._unit = FaultWatch(frozenset(CORE_LAYOUT.names), FaultLimits(), brake), unit
        self.stops: dict[str, tuple[float, str]] = {}
        """Fault -> time, s, and what was measured."""
        self.broken: dict[tuple[str, float], float] = {}
        """Limit and share of it -> time at which that would have stopped the drive, s."""
        self.ticks = 0

    @property
    def end_s(self) -> float:
        """Time of the last tick, s."""
        return self.ticks * CONTROL_PERIOD_S

    def __call__(self, tick: Tick) -> None:
        """Look at a tick."""
        self.ticks += 1
        readings = {name: float(value) for name, value in CORE_LAYOUT.unpack(tick.observation).items()}
        if self._unit == "cm":
            readings |= {name: round(readings[name], 2) for name in RANGES}
        look = Look(tick.index * CONTROL_PERIOD_S, readings, readings["throttle"])
        for key, law in self._stricter:
            if key not in self.broken and law.update(look):
                self.broken[key] = look.time_s
        found = self._watch.update(look)
        assert found is None or found.fault.decision is Decision.STOP
        if found is not None:
            self.stops.setdefault(found.fault.name, (look.time_s, found.detail))


def drives(family: str, level: str, seeds: range, unit: str, brake: float) -> dict[str, Any]:
    """Drive one family on one level."""
    watched = [Watched(unit, brake) for _ in seeds]
    with BatchRunner([family], randomization=level, rows=len(seeds)) as runner:
        results = runner.drive(
            [load_machine(machine_for([family]))],
            [EpisodeRequest(0, family, seed) for seed in seeds],
            observers={number: [each] for number, each in enumerate(watched)},
        )
    stops: Counter[str] = Counter()
    broken: dict[str, Counter[str]] = {}
    told = []
    for each, result in zip(watched, results, strict=True):
        for name, (time_s, detail) in each.stops.items():
            why = "at the goal" if each.end_s - time_s < AT_GOAL_S else "not due"
            why = why if result.success else "the drive failed"
            stops[f"{name}, {why}"] += 1
            told.append(f"seed {result.seed}, {time_s:.2f} of {each.end_s:.2f} s, {why}: {name}, {detail}")
        for (name, share), time_s in each.broken.items():
            if result.success and each.end_s - time_s >= AT_GOAL_S:
                broken.setdefault(name, Counter())[f"{share:g}"] += 1
    return {
        "family": family,
        "level": level,
        "unit": unit,
        "brake": brake,
        "drives": len(results),
        "hours": sum(each.ticks for each in watched) * CONTROL_PERIOD_S / 3600.0,
        "successes": sum(result.success for result in results),
        "stops": dict(stops),
        "told": told,
        "healthy_drives_stopped_at_a_share_of_the_limit": {name: dict(each) for name, each in broken.items()},
    }


def main() -> None:
    """Drive all families on all levels."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--first", type=int, default=100)
    parser.add_argument("--courses", type=int, default=50)
    parser.add_argument("--families", default=",".join(FAMILIES))
    parser.add_argument("--levels", default=",".join(LEVELS))
    parser.add_argument("--unit", choices=("us", "cm"), default="us", help="of the ultrasonics' ranges")
    parser.add_argument("--brake", type=float, default=0.0, help="Limits.brake, by which the car would be stopped")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    if given.out is not None:
        prepare_folder(given.out.parent)
    found = []
    for family in given.families.split(","):
        for level in given.levels.split(","):
            found.append(
                drives(family, level, range(given.first, given.first + given.courses), given.unit, given.brake)
            )
            print(json.dumps(found[-1]), flush=True)
            if given.out is not None:
                given.out.write_text(json.dumps({"host": host(), "first": given.first, "families": found}, indent=1))


if __name__ == "__main__":
    main()
