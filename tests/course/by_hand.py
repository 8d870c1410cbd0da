"""Courses written down in a test."""

from __future__ import annotations

import pytest

from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course
from tral_env.course.plan import Plan
from tral_env.errors import CourseError


def plan_of(*segments: dict[str, object], **members: object) -> Plan:
    return build_plan(Course.model_validate({"name": "test", "segments": segments, **members}))


def complaint(*segments: dict[str, object], **members: object) -> str:
    with pytest.raises(CourseError) as caught:
        plan_of(*segments, **members)
    return str(caught.value)
