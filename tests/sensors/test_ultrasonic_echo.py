"""The first echo: what sends sound back, and from how far."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flatland import box, cast, first_echo, wall
from hypothesis import example, given
from hypothesis import strategies as st

from tral_env.config import UltrasonicConfig
from tral_env.sensors import ultrasonic

CONFIG = UltrasonicConfig()


def test_wall_straight_ahead_reads_its_distance() -> None:
    assert first_echo([wall(1.0, 0.0)], CONFIG) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("turned_deg", [-22.0, -15.0, -2.75, 5.5, 15.0, 22.0])
def test_turned_wall_reads_the_perpendicular_distance(turned_deg: float) -> None:
    assert first_echo([wall(1.0, turned_deg)], CONFIG) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("turned_deg", [-60.0, -30.0, -23.0, 23.0, 26.0, 30.0, 45.0, 80.0])
def test_wall_met_too_steeply_gives_no_echo(turned_deg: float) -> None:
    assert first_echo([wall(1.0, turned_deg)], CONFIG) == math.inf


@given(height=st.floats(0.05, 4.9), turned_deg=st.floats(-22.4, 22.4))
def test_any_wall_within_the_limit_reads_its_perpendicular_distance(height: float, turned_deg: float) -> None:
    assert first_echo([wall(height, turned_deg)], CONFIG) == pytest.approx(height, rel=1e-9)


# Nearer than 19 cm, a wall that a ray just misses counts as ending at the ray beside it: an edge within `edge_range`.
@given(height=st.floats(0.2, 4.9), turned_deg=st.floats(22.6, 89.0), side=st.sampled_from([-1, 1]))
@example(height=0.2, turned_deg=62.4375, side=-1)
def test_no_wall_beyond_the_limit_echoes(height: float, turned_deg: float, side: int) -> None:
    assert first_echo([wall(height, side * turned_deg)], CONFIG) == math.inf


@pytest.mark.parametrize(("softness", "limit_deg"), [(0.0, 20.0), (0.5, 22.5), (1.0, 25.0)])
def test_softness_moves_the_limit_between_20_and_25_degrees(softness: float, limit_deg: float) -> None:
    assert first_echo([wall(1.0, limit_deg - 0.2)], CONFIG, softness) == pytest.approx(1.0)
    assert first_echo([wall(1.0, limit_deg + 0.2)], CONFIG, softness) == math.inf


def test_nearer_of_two_walls_is_heard() -> None:
    near = (0.8, -0.2, 0.8, 0.2)
    assert first_echo([wall(2.0, 0.0), near], CONFIG) == pytest.approx(0.8)


def test_nothing_hit_gives_no_echo() -> None:
    assert first_echo([], CONFIG) == math.inf


def test_wall_beyond_the_maximum_range_gives_no_echo() -> None:
    assert first_echo([wall(4.99, 0.0)], CONFIG) == pytest.approx(4.99)
    assert first_echo([wall(5.01, 0.0)], CONFIG) == math.inf


def test_inner_corner_echoes_though_both_walls_are_met_at_45_degrees() -> None:
    corner = [(3.0, 0.0, 0.0, 3.0), (3.0, 0.0, 0.0, -3.0)]
    assert first_echo(corner, CONFIG) == pytest.approx(3.0)


@given(x=st.floats(1.0, 4.0), bearing_deg=st.floats(-24.0, 24.0))
def test_inner_corner_reads_the_distance_of_the_corner_wherever_it_is_in_the_beam(x: float, bearing_deg: float) -> None:
    y = x * math.tan(math.radians(bearing_deg))
    # The walls run a hair past the corner, so that no ray slips between them by rounding.
    corner = [(x + 1e-9, y - 1e-9, x - 9.0, y + 9.0), (x + 1e-9, y + 1e-9, x - 9.0, y - 9.0)]
    assert first_echo(corner, CONFIG) == pytest.approx(math.hypot(x, y), rel=1e-6)


def test_inner_corner_out_of_the_beam_is_not_heard() -> None:
    y = math.tan(math.radians(40.0))
    assert first_echo([(1.0, y, -8.0, y + 9.0), (1.0, y, 10.0, y - 9.0)], CONFIG) == math.inf


def test_two_walls_at_120_degrees_are_no_inner_corner() -> None:
    y = 3.0 * math.tan(math.radians(60.0))
    assert first_echo([(3.0, 0.0, 0.0, y), (3.0, 0.0, 0.0, -y)], CONFIG) == math.inf


def test_outer_corner_is_heard_to_two_metres_only() -> None:
    def outer(x: float) -> float:
        return first_echo([(x, 0.0, x + 3.0, 3.0), (x, 0.0, x + 3.0, -3.0)], CONFIG)

    assert outer(1.0) == pytest.approx(1.0, abs=0.06)
    assert outer(1.9) == pytest.approx(1.9, abs=0.11)
    assert outer(2.1) == math.inf


def test_end_of_a_steep_wall_is_heard_where_it_ends() -> None:
    # A wall at 45 degrees fills the right half of the beam and ends ahead, with nothing behind it.
    heard = first_echo([(1.0, 0.1, -2.0, -2.9)], CONFIG)
    assert heard == pytest.approx(math.hypot(1.0, 0.1), rel=0.1)


def test_face_of_a_slim_post_ahead_echoes_like_a_wall() -> None:
    assert first_echo(box(4.02, 0.0, 0.02), CONFIG) == pytest.approx(4.0)


def slim_post(distance: float, bearing_deg: float) -> float:
    """First echo of a post of 4 cm; a bearing that is a ray's, for slim posts between two rays are not hit."""
    a = math.radians(bearing_deg)
    return first_echo(box(distance * math.cos(a), distance * math.sin(a), 0.02), CONFIG)


def test_slim_post_whose_faces_look_elsewhere_is_heard_by_its_edges() -> None:
    assert slim_post(1.0, 11.0) == pytest.approx(0.98, abs=0.01)


# Halfway out of the beam (11 + 2.75 of 27.5 degrees): 2 m / 2 ** 0.25 = 1.68 m. At the rim: about 1 m.
@pytest.mark.parametrize(("bearing_deg", "reach"), [(11.0, 1.77), (27.5, 1.13)])
def test_edge_is_heard_less_far_off_the_boresight(bearing_deg: float, reach: float) -> None:
    assert slim_post(reach - 0.05, bearing_deg) < reach
    assert slim_post(reach + 0.20, bearing_deg) == math.inf


def test_post_before_a_wall_is_heard_before_the_wall() -> None:
    a = math.radians(11.0)
    post = box(0.5 * math.cos(a), 0.5 * math.sin(a), 0.02)
    assert first_echo([wall(1.0, 0.0), *post], CONFIG) == pytest.approx(0.48, abs=0.01)


def test_step_of_less_than_a_quarter_wavelength_is_smooth() -> None:
    def stepped(step: float) -> float:
        lower, upper = wall(1.0, 45.0), wall(1.0 - step, 45.0)
        middle = math.sqrt(2.0), 0.0
        return first_echo([(lower[0], lower[1], *middle), (middle[0] - step, 0.0, upper[2], upper[3])], CONFIG)

    assert stepped(0.001) == math.inf
    assert stepped(0.03) < 2.0


@given(st.floats(0.1, 2.3), st.floats(0.1, 2.3))
def test_farther_wall_never_reads_nearer(a: float, b: float) -> None:
    near, far = sorted((a, b))
    assert first_echo([wall(near, 10.0)], CONFIG) <= first_echo([wall(far, 10.0)], CONFIG)


def test_mirrored_world_reads_the_same() -> None:
    world = [wall(1.3, 8.0), *box(0.7, 0.1, 0.03)]
    mirrored = [(x0, -y0, x1, -y1) for x0, y0, x1, y1 in world]
    assert first_echo(mirrored, CONFIG) == pytest.approx(first_echo(world, CONFIG), abs=1e-12)


def test_rows_do_not_touch_each_other() -> None:
    worlds = [[wall(0.3 + 0.2 * i, 6.0 * i - 20.0), *box(0.9, 0.03 * i, 0.02)] for i in range(8)]
    hits = [cast(world, CONFIG) for world in worlds]
    softness = np.linspace(0.0, 1.0, 8)
    together = ultrasonic.echo(
        np.concatenate([d for d, _ in hits]), np.concatenate([n for _, n in hits]), CONFIG, softness
    )
    alone = [ultrasonic.echo(d, n, CONFIG, softness[i : i + 1])[0] for i, (d, n) in enumerate(hits)]
    assert together.tobytes() == np.array(alone).tobytes()


@given(
    walls=st.lists(st.tuples(st.floats(0.05, 4.9), st.floats(-75.0, 75.0), st.floats(0.02, 3.0)), max_size=4),
    posts=st.lists(st.tuples(st.floats(0.2, 3.0), st.floats(-0.8, 0.8), st.floats(0.01, 0.3)), max_size=3),
    softness=st.floats(0.0, 1.0),
)
def test_a_ranger_alone_hears_what_it_hears_among_others(
    walls: list[tuple[float, float, float]], posts: list[tuple[float, float, float]], softness: float
) -> None:
    world = [wall(*each) for each in walls] + [side for post in posts for side in box(*post)]
    distance, normal = cast(world, CONFIG)
    rays = [(reach, nx, ny) for reach, (nx, ny) in zip(distance[0].tolist(), normal[0].tolist(), strict=True)]
    alone = ultrasonic.echo_alone(rays, CONFIG, softness)
    among = ultrasonic.echo(np.tile(distance, (3, 1)), np.tile(normal, (3, 1, 1)), CONFIG, np.full(3, softness))
    assert np.full(3, alone).tobytes() == among.tobytes()


def test_sensors_can_be_stacked_on_a_leading_axis() -> None:
    distance, normal = cast([wall(1.5, 12.0)], CONFIG)
    stacked = ultrasonic.echo(np.stack([distance] * 3), np.stack([normal] * 3), CONFIG)
    assert stacked.shape == (3, 1)
    assert stacked[:, 0] == pytest.approx([1.5, 1.5, 1.5])


def test_normal_where_nothing_was_hit_does_not_matter() -> None:
    distance, normal = cast([(1.0, -0.2, 1.0, 0.2)], CONFIG)
    odd = np.where(distance[..., None] < 0, [-1.0, 0.0], normal)
    assert ultrasonic.echo(distance, odd, CONFIG) == pytest.approx(ultrasonic.echo(distance, normal, CONFIG))


def test_fan_spans_the_beam() -> None:
    degrees = np.degrees(ultrasonic.ray_angles(CONFIG))
    assert degrees == pytest.approx(np.arange(-27.5, 27.6, 5.5))
