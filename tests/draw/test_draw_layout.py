"""A laid-out machine: nothing on top of another, every arrow from outline to outline, always the same."""

from itertools import combinations, pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tral_fsm import load_machine, machine_names
from tral_fsm.conditions.simple import DistanceSpec, SensorLevelSpec, TimerSpec
from tral_fsm.definition.machine import MachineDefinition, TransitionSpec
from tral_fsm.draw.layered.shapes import Arrangement, Point, Rect
from tral_fsm.draw.layout import layout
from tral_fsm.states.basic import IdleSpec, MotorSpec

CONDITIONS = st.sampled_from(
    [TimerSpec(seconds=1.0), DistanceSpec(distance=2.5), SensorLevelSpec(sensor="left", above=1.5, readings=3)]
)


@st.composite
def machines(draw: st.DrawFn) -> MachineDefinition:
    """Any states, any arrows between them: circles, several between the same two, to themselves, none at all."""
    n = draw(st.integers(1, 9))
    states = tuple(
        MotorSpec(id=i, label="m" * draw(st.integers(0, 30)), speed=0.5) if draw(st.booleans()) else IdleSpec(id=i)
        for i in range(n)
    )
    place = st.integers(0, n - 1)
    ways = draw(st.lists(st.tuples(place, place, CONDITIONS), max_size=3 * n))
    transitions = tuple(TransitionSpec(id=k, source=a, target=b, when=when) for k, (a, b, when) in enumerate(ways))
    return MachineDefinition(root=draw(place), states=states, transitions=transitions)


DIRECTIONS = st.sampled_from([None, "right", "down"])


def chain(n: int) -> MachineDefinition:
    return MachineDefinition(
        root=0,
        states=tuple(IdleSpec(id=i) for i in range(n)),
        transitions=tuple(
            TransitionSpec(id=i, source=i, target=i + 1, when=TimerSpec(seconds=1.0)) for i in range(n - 1)
        ),
    )


def outline(box: Rect, point: Point) -> bool:
    """Whether the point is on the outline of the box."""
    x, y = point[0] - box.x, point[1] - box.y
    return (x in (0, box.w) and 0 <= y <= box.h) or (y in (0, box.h) and 0 <= x <= box.w)


def through(a: Point, b: Point, rect: Rect) -> bool:
    """Whether a right-angled piece of a line runs through the inside of a rectangle."""
    return (
        max(a[0], b[0]) > rect.x
        and min(a[0], b[0]) < rect.x + rect.w
        and max(a[1], b[1]) > rect.y
        and min(a[1], b[1]) < rect.y + rect.h
    )


def ends(machine: MachineDefinition, laid: Arrangement, transition: int) -> tuple[Rect, Rect]:
    box = dict(zip((state.id for state in machine.states), laid.boxes, strict=True))
    way = machine.transitions[transition]
    return box[way.source], box[way.target]


@given(machines(), DIRECTIONS, st.booleans())
@settings(max_examples=60)
def test_nothing_stands_on_top_of_another(machine: MachineDefinition, direction: None, bundled: bool) -> None:
    laid = layout(machine, direction=direction, bundled=bundled)
    rects = [*laid.boxes, *(route.label for route in laid.routes)]
    assert not [(a, b) for a, b in combinations(rects, 2) if a.overlaps(b)]


@given(machines(), DIRECTIONS, st.booleans())
@settings(max_examples=60)
def test_no_arrow_runs_through_a_box_or_a_label(machine: MachineDefinition, direction: None, bundled: bool) -> None:
    laid = layout(machine, direction=direction, bundled=bundled)
    rects = [*laid.boxes, *(route.label for route in laid.routes)]
    lines = [*(route.points for route in laid.routes), laid.root]
    assert not [(a, b, r) for line in lines for a, b in pairwise(line) for r in rects if through(a, b, r)]


@given(machines(), DIRECTIONS, st.booleans())
@settings(max_examples=60)
def test_every_transition_has_an_arrow_between_its_boxes(
    machine: MachineDefinition, direction: None, bundled: bool
) -> None:
    laid = layout(machine, direction=direction, bundled=bundled)
    assert sorted(i for route in laid.routes for i in route.transitions) == list(range(len(machine.transitions)))
    for route in laid.routes:
        for transition in route.transitions:
            source, target = ends(machine, laid, transition)
            assert outline(source, route.points[0])
            assert outline(target, route.points[-1])
    root = [state.id for state in machine.states].index(machine.root)
    assert outline(laid.boxes[root], laid.root[1])


@given(machines())
@settings(max_examples=40)
def test_all_is_on_the_grid_right_angled_and_on_the_page(machine: MachineDefinition) -> None:
    laid = layout(machine)
    assert all(value % 10 == 0 for box in laid.boxes for value in (box.x, box.y, box.w, box.h))
    for line in [*(route.points for route in laid.routes), laid.root]:
        assert all(0 <= x <= laid.width and 0 <= y <= laid.height and x % 10 == y % 10 == 0 for x, y in line)
        assert all((a[0] == b[0]) != (a[1] == b[1]) for a, b in pairwise(line))
    for rect in [*laid.boxes, *(route.label for route in laid.routes)]:
        assert rect.x >= 0
        assert rect.y >= 0
        assert rect.x + rect.w <= laid.width
        assert rect.y + rect.h <= laid.height


@given(machines())
@settings(max_examples=30)
def test_no_arrow_ends_where_another_does(machine: MachineDefinition) -> None:
    laid = layout(machine)
    points = [point for route in laid.routes for point in (route.points[0], route.points[-1])]
    assert len(points) == len(set(points))


@pytest.mark.parametrize("name", machine_names())
def test_the_same_machine_gives_the_same_arrangement(name: str) -> None:
    assert layout(load_machine(name)) == layout(load_machine(name))


@pytest.mark.parametrize("name", machine_names())
def test_packaged_machines_make_no_wallpaper(name: str) -> None:
    laid = layout(load_machine(name))
    assert max(laid.width, laid.height) <= 2500
    assert laid.width * laid.height <= 4e6


def test_bundled_transitions_share_one_arrow() -> None:
    machine = load_machine("office")
    pairs = {(t.source, t.target) for t in machine.transitions}
    assert len(layout(machine).routes) == len(pairs) < len(machine.transitions)


def test_each_has_its_own_unless_bundled() -> None:
    machine = load_machine("office")
    assert [route.transitions for route in layout(machine, bundled=False).routes] == [
        (i,) for i in range(len(machine.transitions))
    ]


def test_a_chain_is_straight() -> None:
    laid = layout(chain(5), direction="right")
    assert len({box.y for box in laid.boxes}) == 1
    assert [box.x for box in laid.boxes] == sorted(box.x for box in laid.boxes)
    assert all(len(route.points) == 2 for route in laid.routes)


def test_a_long_chain_leads_down_rather_than_off_the_page() -> None:
    assert layout(chain(12), state_size=lambda state: (200, 40)).direction == "down"


def test_boxes_have_at_least_the_size_that_is_asked_for() -> None:
    laid = layout(chain(3), state_size=lambda state: (100 * (int(state.id) + 1), 70))
    assert [(box.w >= 100 * (i + 1), box.h >= 70) for i, box in enumerate(laid.boxes)] == [(True, True)] * 3


def test_the_boxes_of_a_large_machine_stay_apart() -> None:
    n = 120
    ways = [(i, (7 * i + 3) % n) for i in range(n)] + [(i, (i + 1) % n) for i in range(n)]
    laid = layout(
        MachineDefinition(
            root=0,
            states=tuple(IdleSpec(id=i) for i in range(n)),
            transitions=tuple(
                TransitionSpec(id=k, source=a, target=b, when=TimerSpec(seconds=1.0)) for k, (a, b) in enumerate(ways)
            ),
        )
    )
    assert len(laid.boxes) == n
    assert not [(a, b) for a, b in combinations(laid.boxes, 2) if a.overlaps(b)]
