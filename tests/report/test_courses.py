"""Courses side by side on a sheet."""

from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, Segment
from tral_fsm.report.courses import course_sheet


def test_each_course_has_a_panel_with_its_name_and_length() -> None:
    plans = {f"{n} m": build_plan(Course(name="short", segments=(Segment(length=n),))) for n in (4.0, 5.0, 6.0, 7.0)}
    sheet = course_sheet(plans)
    assert [ax.get_title(loc="left") for ax in sheet.axes] == [f"{t}: {p.length:.1f} m" for t, p in plans.items()]
    assert {ax.get_subplotspec().get_geometry()[:2] for ax in sheet.axes} == {(2, 3)}
