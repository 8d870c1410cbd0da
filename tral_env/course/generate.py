"""Seeded courses: drafts of a family until one can be driven."""

from __future__ import annotations

import re
from collections import Counter

import numpy as np

from tral_env.checks import one_of
from tral_env.course.drafts import Draft as Draft
from tral_env.course.drafts import uniform
from tral_env.course.families import FAMILIES as FAMILIES
from tral_env.course.families import SCENARIOS as SCENARIOS
from tral_env.course.families import START_AT
from tral_env.course.families import Family as Family
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course
from tral_env.course.plan import Plan
from tral_env.errors import CourseError

ATTEMPTS = 200
"""The generator gives up when this many drafts have failed; a few in a hundred fail."""


def generate(scenario: str, rng: np.random.Generator, *, hard: bool = False) -> Course:
    """Draw a course.

    Args:
        scenario: one of `FAMILIES`.
        rng: source of all randomness; the same state gives the same course.
        hard: gates may stand right behind a corner, and where there is a wall on one side only.

    Raises:
        ConfigError: no such scenario.
        CourseError: no draft could be driven, see `draw`.
    """
    return generate_plan(scenario, rng, hard=hard)[0]


def generate_plan(scenario: str, rng: np.random.Generator, *, hard: bool = False) -> tuple[Course, Plan]:
    """Draw a course as `generate` does, and give its plan with it, which shows that the car can drive it.

    Raises:
        ConfigError: no such scenario.
        CourseError: no draft could be driven, see `draw`.
    """
    one_of("scenario", scenario, FAMILIES)
    return draw(scenario, FAMILIES[scenario], rng, hard=hard)


def draw(name: str, family: Family, rng: np.random.Generator, *, hard: bool = False) -> tuple[Course, Plan]:
    """Draw drafts of a family until one can be driven, and give it with its plan.

    Raises:
        CourseError: none of `ATTEMPTS` drafts can be driven; the message tells the most frequent cause.
    """
    causes: list[str] = []
    for _ in range(ATTEMPTS):
        try:
            draft = family.sketch(rng, hard)
            course = Course.model_validate({"name": name, "start": _start(rng, draft), **draft})
            plan = build_plan(course)
        except CourseError as error:
            causes.append(str(error))
            continue
        if len(plan.box_kind) <= family.max_boxes and len(plan.marker_id) <= family.max_markers:
            return course, plan
        causes.append(
            f"{len(plan.box_kind)} boxes and {len(plan.marker_id)} markers, where the family allows "
            f"{family.max_boxes} and {family.max_markers}"
        )
    raise CourseError(f"no drivable course of '{name}' in {ATTEMPTS} drafts. {_most_frequent(causes)}")


def _most_frequent(causes: list[str]) -> str:
    """Tell how often the most frequent cause came, and its first text; causes that differ in numbers alone are one."""
    kinds = [re.sub(r"-?\d+(\.\d+)?", "#", cause) for cause in causes]
    (kind, count), *_ = Counter(kinds).most_common(1)
    return f"The most frequent cause, in {count} drafts: {causes[kinds.index(kind)]}"


def _start(rng: np.random.Generator, draft: Draft) -> Draft:
    first = draft["segments"][0]
    sixth = first["width"] / 6
    at = round(first["length"] / 2, 3) if draft.get("closed") else START_AT
    return {"at": at, "offset": uniform(rng, -sixth, sixth), "heading_deg": round(-5 + 10 * rng.random(), 2)}
