"""Draw the plots of docs/sensors.md from the sensor models themselves, and print the figures that page states.

Usage: python benchmarks/plot_sensors.py [FOLDER]        (default: docs/img)
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from tral_env.config import HallConfig, ImuConfig, LineConfig, UltrasonicConfig
from tral_env.interface import CONTROL_PERIOD_S, NO_ECHO_M
from tral_env.sensors import imu, ultrasonic
from tral_env.sensors.hall import Hall
from tral_env.sensors.line import DIODES, line_byte

Array = NDArray[np.float64]
SONAR = UltrasonicConfig()
INK, BLUE, RED, GREY = "#222222", "#1f6fb2", "#c8452e", "#9a9a9a"


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "docs" / "img"
    folder.mkdir(parents=True, exist_ok=True)
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True})
    plt.rcParams.update({"grid.color": "#e5e5e5", "legend.frameon": False})
    for draw in (ultrasonic_angle, ultrasonic_distance, ultrasonic_passage, hall_speed, line_offset, imu_rest):
        figure = draw(np.random.default_rng(1))
        figure.tight_layout()
        figure.savefig(folder / f"sensor_{draw.__name__}.png", dpi=110)
        plt.close(figure)


def facing_wall(height: Array, turned: Array) -> tuple[Array, Array]:
    """Hits of the fan, (n, R) and (n, R, 2), on endless walls at perpendicular distances, turned by so many rad."""
    gamma = ultrasonic.ray_angles(SONAR) - turned[:, None]
    distance = np.where(np.cos(gamma) > 1e-6, height[:, None] / np.maximum(np.cos(gamma), 1e-6), -1.0)
    normal = -np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    return distance, np.broadcast_to(normal[:, None], (*gamma.shape, 2)).copy()


def ultrasonic_angle(rng: np.random.Generator) -> plt.Figure:
    turned_deg = np.repeat(np.linspace(-35, 35, 281), 40)
    n = len(turned_deg)
    distance, normal = facing_wall(np.ones(n), np.radians(turned_deg))
    first = ultrasonic.echo(distance, normal, SONAR, rng.random(n))
    reading = ultrasonic.measure(first, rng.random((n, ultrasonic.MEASURE_DRAWS)), SONAR)
    heard = reading < NO_ECHO_M
    figure, (above, below) = plt.subplots(2, 1, figsize=(6.4, 4.6), sharex=True, height_ratios=[2, 1])
    above.plot(turned_deg[heard], reading[heard], ".", ms=3, alpha=0.15, color=BLUE)
    above.plot([], [], "o", ms=4, color=BLUE, label="reading")
    angles = np.linspace(-35, 35, 141)
    above.plot(angles, 1 / np.cos(np.radians(angles)), "--", color=GREY, label="along the boresight")
    above.set(ylabel="range [m]", ylim=(0.95, 1.25), title="Wall at 1 m perpendicular distance")
    above.legend(loc="upper center")
    below.plot(turned_deg[::40], heard.reshape(-1, 40).mean(axis=1), color=BLUE)
    below.set(xlabel="angle of incidence [deg]", ylabel="echo heard", ylim=(-0.05, 1.05))
    return figure


def ultrasonic_distance(rng: np.random.Generator) -> plt.Figure:
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.8))
    draw_range(left, rng)
    draw_resolution(right, rng)
    return figure


def draw_range(axes: Axes, rng: np.random.Generator) -> None:
    """Whole range of both modes with 3 % of outliers, as randomization "hard" has it."""
    true = np.repeat(np.linspace(0.0, 5.6, 1400), 2)
    for mode, colour, marker in (("us", BLUE, "."), ("cm", RED, "x")):
        config = UltrasonicConfig(mode=mode)
        reading = ultrasonic.measure(true, rng.random((len(true), ultrasonic.MEASURE_DRAWS)), config, 0.03)
        axes.plot(true, reading, marker, ms=2.5, color=colour, alpha=0.6, label=f"{mode} mode")
    axes.annotate("no echo", (2.2, NO_ECHO_M), xytext=(3.6, 5.55), color=INK)
    axes.set(xlabel="true range [m]", ylabel="reading [m]", title="3 % outliers")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.92), markerscale=3)


def draw_resolution(axes: Axes, rng: np.random.Generator) -> None:
    """Close up: wave-front jitter and resolution."""
    true = np.repeat(np.linspace(0.97, 1.03, 241), 8)
    for mode, colour, marker in (("us", BLUE, "."), ("cm", RED, "x")):
        config = UltrasonicConfig(mode=mode)
        reading = ultrasonic.measure(true, rng.random((len(true), ultrasonic.MEASURE_DRAWS)), config)
        axes.plot(true, (reading - true) * 1e3, marker, ms=3, color=colour, alpha=0.5, label=f"{mode} mode")
    axes.set(xlabel="true range [m]", ylabel="error [mm]", title="close up: jitter of 8.65 mm", ylim=(-22, 22))


PASSAGE = [
    (-1.0, 1.0, 1.5, 1.0),
    (1.5, 1.0, 1.5, 0.97),  # a frame that stands out by 3 cm
    (1.5, 0.97, 1.56, 0.97),
    (1.56, 0.97, 1.56, 1.08),
    (1.56, 1.08, 2.44, 1.08),  # a door 8 cm behind the wall
    (2.44, 1.08, 2.44, 0.97),
    (2.44, 0.97, 2.5, 0.97),
    (2.5, 0.97, 2.5, 1.0),
    (2.5, 1.0, 4.0, 1.0),
    (4.0, 1.0, 4.0, 2.5),  # an open door, and the room behind it
    (4.0, 2.5, 4.9, 2.5),
    (4.9, 2.5, 4.9, 1.0),
    (4.9, 1.0, 6.5, 1.0),
    (6.5, 1.0, 6.5, 9.0),  # a side corridor
    (8.3, 9.0, 8.3, 1.0),
    (8.3, 1.0, 10.0, 1.0),
]


def cast(x: Array, heading: float) -> tuple[Array, Array]:
    """Hits of a left sonar at (x, 0) of a car with that heading, in `PASSAGE`: distance (n, R), normal (n, R, 2)."""
    angle = ultrasonic.ray_angles(SONAR) + np.pi / 2 + heading
    ray = np.stack([np.cos(angle), np.sin(angle)])
    distance, normal = np.full((len(x), len(angle)), np.inf), np.zeros((len(x), len(angle), 2))
    for x0, y0, x1, y1 in PASSAGE:
        along = np.array([x1 - x0, y1 - y0])
        across = np.array([-along[1], along[0]]) / np.hypot(*along)
        height = across[0] * (x0 - x)[:, None] + across[1] * y0
        t = height / np.where(np.abs(across @ ray) < 1e-9, 1e-9, across @ ray)
        place = ((x[:, None] + t * ray[0] - x0) * along[0] + (t * ray[1] - y0) * along[1]) / (along @ along)
        nearer = (t > 0) & (place >= -1e-6) & (place <= 1 + 1e-6) & (t < distance)
        distance = np.where(nearer, t, distance)
        normal = np.where(nearer[..., None], -np.sign(height)[..., None] * across, normal)
    turn = np.pi / 2 + heading
    forward = np.cos(turn) * normal[..., 0] + np.sin(turn) * normal[..., 1]
    leftward = -np.sin(turn) * normal[..., 0] + np.cos(turn) * normal[..., 1]
    return np.where(np.isinf(distance), -1.0, distance), np.stack([forward, leftward], axis=-1)


def ultrasonic_passage(rng: np.random.Generator) -> plt.Figure:
    x = np.linspace(0.0, 9.5, 951)
    figure, (above, below) = plt.subplots(2, 1, figsize=(8.0, 5.4), sharex=True)
    for heading_deg, colour in ((0.0, BLUE), (12.0, RED)):
        distance, normal = cast(x, np.radians(heading_deg))
        reading = ultrasonic.measure(
            ultrasonic.echo(distance, normal, SONAR, rng.random(len(x))),
            rng.random((len(x), ultrasonic.MEASURE_DRAWS)),
            SONAR,
        )
        label = f"heading {heading_deg:g} deg"
        above.plot(x, np.where(reading < NO_ECHO_M, reading, np.nan), ".", ms=3, color=colour, label=label)
        silent = x[reading == NO_ECHO_M]
        above.plot(silent, np.full(len(silent), 2.75 if heading_deg else 2.85), "|", ms=5, color=colour)
    above.set(
        ylabel="reading [m]", ylim=(0.8, 2.95), title="Left sonar of a car that drives along y = 0 (bars: no echo)"
    )
    above.legend(loc="upper left", bbox_to_anchor=(0.0, 0.85), markerscale=3)
    for x0, y0, x1, y1 in PASSAGE:
        below.plot([x0, x1], [y0, y1], color=INK, lw=1.5)
    below.plot([0, 9.5], [0, 0], ":", color=GREY)
    below.set(xlabel="x [m]", ylabel="y [m]", ylim=(-0.3, 2.7), xlim=(-0.1, 9.6))
    return figure


def hall_speed(rng: np.random.Generator) -> plt.Figure:
    truth = np.concatenate([np.linspace(0, 1, 80), np.full(80, 1.0), np.linspace(1, 2, 60), np.full(60, 2.0)])
    truth = np.concatenate([truth, np.linspace(2, 0.3, 80), np.full(160, 0.3), np.linspace(0.3, 0, 40), np.zeros(40)])
    time_s = CONTROL_PERIOD_S * np.arange(1, len(truth) + 1)
    figure, axes = plt.subplots(figsize=(8.0, 3.6))
    for rate, colour in ((0.05, RED), (0.0, BLUE)):
        axes.plot(
            time_s, told_speed(truth, rate, rng), color=colour, lw=1.2, label=f"told, {rate:.0%} missed and doubled"
        )
    axes.plot(time_s, truth, "--", color=INK, lw=1.0, label="true")
    axes.set(xlabel="time [s]", ylabel="speed [m/s]", title="Hall sensor")
    axes.legend(loc="upper right")
    for rate in (0.0, 0.01, 0.05):
        for speed in (0.3, 1.0, 2.0):
            told = told_speed(np.full(24000, speed), rate, rng)[80:]
            print(f"hall {rate:4.0%} at {speed} m/s: mean {told.mean():.4f}, standard deviation {told.std():.4f} m/s")
    return figure


def told_speed(truth: Array, rate: float, rng: np.random.Generator) -> Array:
    hall, told = Hall(1, HallConfig()), np.zeros(len(truth))
    for k, speed in enumerate(truth):
        travel = np.array([speed * CONTROL_PERIOD_S])
        hall.update(travel, (k + 1) * CONTROL_PERIOD_S, CONTROL_PERIOD_S, rng.random((1, 2)), rate, rate)
        told[k] = hall.speed[0]
    return told


def line_offset(rng: np.random.Generator) -> plt.Figure:
    offset = np.linspace(-0.06, 0.06, 601)
    pose = np.column_stack([np.zeros(601), -offset, np.zeros(601)])
    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.0), sharey=True)
    for ax, width in zip(axes, (0.019, 0.025), strict=True):
        byte = line_byte(pose, np.array([[0.0, 0.0, 1.0, 0.0]]), LineConfig(tape_width=width))
        bits = (byte[:, None] >> np.arange(DIODES)) & 1
        ax.imshow(
            bits.T, aspect="auto", origin="lower", cmap="Greys", extent=(-60, 60, -0.5, 7.5), interpolation="nearest"
        )
        ax.set(xlabel="tape left of the middle by [mm]", title=f"tape of {width * 1e3:.0f} mm", yticks=range(8))
        ax.grid(visible=False)
    axes[0].set_ylabel("bit (7 = leftmost)")
    return figure


def imu_rest(rng: np.random.Generator) -> plt.Figure:
    config, n = ImuConfig(), 400
    truth = np.tile([0, 0, 0, 0, 0, imu.STANDARD_GRAVITY], (n, 1))
    reading = imu.measure(truth, imu.draw_bias(rng.standard_normal(6), config), rng.standard_normal((n, 6)), config)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.4))
    time_s = CONTROL_PERIOD_S * np.arange(n)
    for axis, colour in zip(range(3), (BLUE, RED, GREY), strict=True):
        left.plot(time_s, np.degrees(reading[:, axis]), color=colour, lw=0.8, label="xyz"[axis])
        right.plot(time_s, reading[:, 3 + axis] - truth[:, 3 + axis], color=colour, lw=0.8)
    left.set(xlabel="time [s]", ylabel="rate [deg/s]", title="gyroscope at rest")
    left.legend(loc="upper right", ncols=3)
    right.set(xlabel="time [s]", ylabel="error [m/s$^2$]", title="accelerometer at rest")
    return figure


if __name__ == "__main__":
    main()
