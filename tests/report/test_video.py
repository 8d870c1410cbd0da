from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from films import film
from lane import Cruiser, Lane

from tral_env.interface import MAX_AGE_S
from tral_env.recording.video import VideoWriter
from tral_fsm.draw.panels import TONES
from tral_fsm.evaluation.episode import Tick
from tral_fsm.evaluation.rollout import drive
from tral_fsm.report.drive.state_colours import StateColours
from tral_fsm.report.drive.video import FPS, HEIGHT, INSET_WIDTH, WIDTH, DriveVideo, compose, sight_line

RED = (200, 30, 40)


class Painted:
    """Views of one colour each."""

    def stills(self) -> Painted:
        return self

    def take(self, view: str, width: int, height: int) -> Callable[[], np.ndarray]:
        return lambda: self.paint(view, width, height)

    def paint(self, view: str, width: int, height: int) -> np.ndarray:
        colour = {"chase": (90, 90, 90), "onboard": (10, 200, 30)}[view]
        return np.full((height, width, 3), colour, np.uint8)

    def close(self) -> None:
        pass


def ticks(ending: str = "success") -> list[Tick]:
    seen: list[Tick] = []
    drive(Lane(ending), Cruiser(), seed=1, on_step=seen.append)
    return seen


def last_tick(ending: str = "success") -> Tick:
    return ticks(ending)[-1]


def picture(tick: Tick) -> np.ndarray:
    views = Painted()
    return compose(views.paint("chase", WIDTH, HEIGHT), views.paint("onboard", 288, 216), tick, RED)


def test_a_video_has_sixteen_frames_a_second_and_holds_its_end_for_one(tmp_path: Path) -> None:
    with DriveVideo(tmp_path / "drive.mp4", Painted()) as video:
        drive(Lane(steps=160), Cruiser(), seed=1, on_step=video)
    made = film(tmp_path / "drive.mp4")
    # 160 ticks are two seconds of driving.
    assert len(made.pictures) == 3 * FPS
    assert made.fps == FPS


def test_a_video_of_a_drive_that_broke_off_is_finished_without_hiding_the_error(tmp_path: Path) -> None:
    def drive_on(video: DriveVideo) -> None:
        video(ticks()[0])
        raise RuntimeError("broke off")

    with pytest.raises(RuntimeError, match="broke off"), DriveVideo(tmp_path / "drive.mp4", Painted()) as video:
        drive_on(video)
    assert len(film(tmp_path / "drive.mp4").pictures) == 1
    assert list(tmp_path.iterdir()) == [tmp_path / "drive.mp4"]


def test_a_video_without_a_frame_leaves_no_file(tmp_path: Path) -> None:
    DriveVideo(tmp_path / "drive.mp4", Painted()).close()
    assert list(tmp_path.iterdir()) == []


def test_a_video_whose_encoder_broke_off_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    add, pictures = VideoWriter.add, iter(range(2))

    def breaks_off_at_its_second_picture(writer: VideoWriter, image: np.ndarray) -> None:
        if next(pictures) == 1:
            raise OSError("no space left on device")
        add(writer, image)

    monkeypatch.setattr(VideoWriter, "add", breaks_off_at_its_second_picture)
    with pytest.raises(OSError, match="no space"), DriveVideo(tmp_path / "drive.mp4", Painted()) as video:
        list(map(video, ticks()[:1] * 2))
    assert list(tmp_path.iterdir()) == []


def test_the_onboard_view_is_inset_at_the_upper_right() -> None:
    image = picture(last_tick())
    assert tuple(image[100, WIDTH - 12 - INSET_WIDTH // 2]) == (10, 200, 30)


def test_the_active_state_shows_its_colour() -> None:
    assert tuple(picture(last_tick())[50, 16]) == RED


def test_a_range_with_an_echo_is_green_and_one_without_is_grey() -> None:
    image = picture(last_tick())
    # The lane has 1 m to the left and no echo ahead; 40 px are a metre.
    assert tuple(image[HEIGHT - 48, 137 - 30]) == (90, 220, 90)
    assert tuple(image[HEIGHT - 48 - 50, 137]) == (170, 170, 170)


@pytest.mark.parametrize("ending", ["success", "collision", "missed_gate", "timeout"])
def test_a_drive_that_is_over_says_how_it_ended(ending: str) -> None:
    middle = slice(HEIGHT // 2 - 40, HEIGHT // 2 + 5), slice(WIDTH // 2 - 110, WIDTH // 2 + 110)
    views, tick = Painted(), last_tick(ending)
    image = compose(views.paint("chase", WIDTH, HEIGHT), views.paint("onboard", 288, 216), tick, RED, over=True)
    colour = (90, 220, 90) if ending == "success" else (240, 60, 50)
    assert (image[middle] == colour).all(axis=-1).sum() > 500


def test_a_drive_that_goes_on_says_no_outcome() -> None:
    middle = slice(HEIGHT // 2 - 40, HEIGHT // 2 + 5), slice(WIDTH // 2 - 110, WIDTH // 2 + 110)
    assert (picture(ticks()[0])[middle] == 90).all()


NOTHING = {
    f"{what}_{name}": value
    for what in ("gate", "marker")
    for name, value in (("id", -1.0), ("x", 0.0), ("y", 0.0), ("age", MAX_AGE_S))
}
GATE = {"gate_id": 2.0, "gate_x": 1.5, "gate_y": -0.25, "gate_age": 0.4}
SIGN = {"marker_id": 40.0, "marker_x": 2.0, "marker_y": 0.7, "marker_age": 0.1}


@pytest.mark.parametrize(
    ("seen", "told"),
    [
        ({}, "no gate or sign in sight"),
        (GATE, "gate 2: 1.50 m ahead, -0.25; 0.4 s ago"),
        (SIGN, "sign 40, 2.1 m; 0.1 s ago"),
        (SIGN | {"marker_id": 7.0}, "marker 7, 2.1 m; 0.1 s ago"),
        (GATE | SIGN, "sign 40, 2.1 m; 0.1 s ago"),
        (GATE | SIGN | {"marker_age": 0.4}, "gate 2: 1.50 m ahead, -0.25; 0.4 s ago"),
    ],
)
def test_the_newer_of_gate_and_sign_is_told_with_its_age(seen: dict[str, float], told: str) -> None:
    assert sight_line(NOTHING | seen) == told


def test_states_take_the_next_colours_in_the_order_of_their_first_tick() -> None:
    colours = StateColours(["a", "b", "a"])
    assert colours.states == ("a", "b")
    assert [colours.tone(name) for name in "cba"] == [TONES[2], TONES[1], TONES[0]]
    assert colours.rgb("a") == (0x0B, 0x5C, 0xAD)


def test_given_colours_are_kept_and_other_states_take_none_of_them() -> None:
    colours = StateColours(given={"b": TONES[0], "a": TONES[1]})
    assert [colours.tone(name) for name in "abc"] == [TONES[1], TONES[0], TONES[2]]
    assert colours.states == ("a", "b", "c")
