"""What a picture says about states and transitions, and that it fits where it stands."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_fsm.conditions.combined import AllSpec, AnySpec, NotSpec
from tral_fsm.conditions.gates import ArucoGateFoundSpec, MarkerFoundSpec
from tral_fsm.conditions.simple import AlwaysSpec, DistanceSpec, FinishedSpec, SensorLevelSpec, TimerSpec, TurnedSpec
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.machine import TransitionSpec
from tral_fsm.draw import text
from tral_fsm.states.basic import MotorSpec, StopSpec
from tral_fsm.states.fsm_state import FSMStateSpec

FRONT = SensorLevelSpec(sensor="front", below=0.5)


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        (AlwaysSpec(), "Always"),
        (DistanceSpec(distance=3.4), "Distance 3.4 m"),
        (TimerSpec(seconds=1.0), "Timer 1 s"),
        (TurnedSpec(angle_deg=82.0), "Turned 82°"),
        (FRONT, "SensorLevel front < 0.5 m"),
        (SensorLevelSpec(sensor="left", above=1.5, readings=2), "SensorLevel left > 1.5 m, readings 2"),
        (MarkerFoundSpec(ids=(40, 41), max_age=6.0), "MarkerFound ids 40, 41, age ≤ 6 s"),
        (ArucoGateFoundSpec(hand_over=False), "ArucoGateFound not hand over"),
        (NotSpec(of=(FRONT,)), "not SensorLevel front < 0.5 m"),
        (AnySpec(of=(FinishedSpec(), TimerSpec(seconds=5.0))), "Finished or Timer 5 s"),
        (
            AllSpec(of=(AnySpec(of=(FinishedSpec(), TimerSpec(seconds=5.0))), AlwaysSpec())),
            "(Finished or Timer 5 s) and Always",
        ),
    ],
)
def test_a_condition_is_its_type_and_the_values_that_matter(condition: ConditionSpec, words: str) -> None:
    assert text.condition(condition).replace("\N{NO-BREAK SPACE}", " ") == words


def test_the_place_stands_before_the_first_line() -> None:
    transition = TransitionSpec(id=0, source=0, target=1, when=TimerSpec(seconds=1.0))
    assert text.transition_lines(transition, "2. ") == ["2. Timer 1 s"]


def test_a_state_shows_its_type_and_what_differs_from_the_defaults() -> None:
    assert text.state_lines(StopSpec(id=0)) == ["Stop"]
    assert text.state_lines(MotorSpec(id=0, speed=0.5, steering=-1.0)) == ["Motor", "speed 0.5 m/s, steering -1"]


def test_a_state_is_named_by_id_and_label() -> None:
    assert text.state_name(StopSpec(id=7)) == "7"
    assert text.state_name(StopSpec(id=7, label="wait")) == "7: wait"


def test_an_inner_machine_is_named() -> None:
    assert text.state_lines(FSMStateSpec(id=0, machine="corner")) == ["FSMState: corner"]


def test_names_without_end_are_cut() -> None:
    assert len(text.state_name(StopSpec(id="x" * 1000))) == 40


@given(st.text(max_size=60))
def test_nothing_that_no_picture_can_show_is_shown(words: str) -> None:
    assert text.printable(words).isprintable()


def test_a_parameter_stays_with_its_value_and_unit() -> None:
    gate = TransitionSpec(
        id=0, source=0, target=0, when=MarkerFoundSpec(ids=(40,), max_ahead=3.0, max_bearing_deg=60.0)
    )
    assert text.transition_lines(gate) == ["MarkerFound ids 40,", "ahead ≤ 3 m, bearing ≤ 60°"]


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=40), st.booleans())
def test_words_are_never_wider_than_reckoned(words: str, bold: bool) -> None:
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextToPath

    font = FontProperties(family="DejaVu Sans", size=text.SIZE, weight="bold" if bold else "normal")
    width, _, _ = TextToPath().get_text_width_height_descent(words, font, ismath=False)
    assert width <= text.width(words, bold) + 1


def test_room_of_a_state_and_a_label_holds_all_their_lines() -> None:
    state = MotorSpec(id="drive", speed=0.5)
    assert text.state_size(state)[1] >= 3 * text.LINE
    transitions = [TransitionSpec(id=i, source=0, target=1, when=TimerSpec(seconds=1.0)) for i in range(2)]
    assert text.label_size(transitions, ["1. ", "2. "])[1] == 2 * text.LINE
