"""How well does a machine pass its gates? Every crossing of many drives: offset from the middle, angle, path.

    python benchmarks/gates.py --policy gate_scurve --seeds 1000:1200 --out gates.jsonl
    python benchmarks/gates.py --plot docs/img/gates.png gates.jsonl

The script appends each drive to the file as it ends; started again, it goes on where it stopped.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from run_settings import ClusterAddress, RunSettings

from tral_env.config import CarConfig
from tral_env.course.plan import BOX_KINDS, Plan
from tral_env.errors import ConfigError, TralError
from tral_env.se2 import relative, to_inner, to_outer
from tral_fsm import MachinePolicy, load_machine
from tral_fsm.evaluation.batch import BatchRunner
from tral_fsm.evaluation.choices import Camera, Randomization
from tral_fsm.evaluation.cluster import Workers
from tral_fsm.evaluation.episode import EpisodeRequest, Tick, outcome
from tral_fsm.evaluation.files import prepare_folder, write_figure
from tral_fsm.evaluation.pool import stop_check
from tral_fsm.evaluation.records import digest, drive_missing, read_lines
from tral_fsm.evaluation.seeds import parse_seeds, stretches
from tral_fsm.evaluation.statistics import wilson
from tral_fsm.terminal import drives_bar

CHUNK = 8
"""Number of drives in a batch."""
NEAR_M = 1.6
"""Length of the recorded path before the plane of a gate, and behind it."""
STEP_M = 0.05
"""Distance between two points of the path along the gate's axis."""
TOUCH_M = 0.03
"""A car in collision touches a post if the post is nearer than this."""


def main(
    files: Annotated[list[Path] | None, typer.Argument(help="Files to show, with --table or --plot.")] = None,
    seeds: Annotated[str, typer.Option(help="Seeds FIRST:END.")] = "1000:1200",
    policy: str = "gate_scurve",
    camera: Camera = "rendered",
    randomization: Randomization = "default",
    processes: Annotated[int, typer.Option(min=1)] = 2,
    cluster: ClusterAddress = None,
    out: Path = Path("benchmarks/results/gates.jsonl"),
    table: Annotated[bool, typer.Option(help="Print the table of the files, and drive nothing.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw the paths through the gates into this picture.")] = None,
) -> None:
    """Drive seeds of the family `gates` and print a table."""
    try:
        if plot is not None:
            draw(files or [out], plot)
        if not (table or plot is not None):
            drive(
                parse_seeds(seeds),
                RunSettings(policy=policy, camera=camera, randomization=randomization),
                cluster or processes,
                out,
            )
        if table or plot is None:
            print(markdown(files or [out]))
    except TralError as error:
        raise SystemExit(f"Error: {error}") from None


def drive(seeds: range, settings: RunSettings, processes: Workers, out: Path) -> None:
    """Drive the seeds that the file does not hold yet, and append each drive as it ends.

    Raises:
        ConfigError: the file was made with other settings, or another machine.
    """
    machine = MachinePolicy(load_machine(settings.policy)).definition  # a machine that cannot drive begins no file
    drive_missing(
        {"gates": seeds},
        batch,
        lambda line: ("gates", line["seed"]),
        out=out,
        settings=settings,
        machines={settings.policy: digest(machine)},
        chunk=CHUNK,
        processes=processes,
        bar=drives_bar,
    )


class GateWatch:
    """An observer of a drive that records its paths through the gates."""

    def __init__(self, seed: int, plan: Plan) -> None:
        self.seed, self.plan, self.gates, self.widths = seed, plan, plan.gate_pose, plan.gate_width
        self.paths: list[list[tuple[float, float]]] = [[] for _ in self.gates]
        self.crossings: dict[int, tuple[float, float]] = {}
        self.next = 0
        self._info: Mapping[str, Any] = {}

    def __call__(self, tick: Tick) -> None:
        """Take a tick of the drive."""
        self._info = tick.info
        self.follow(tick.info["pose"], int(tick.info["gates_passed"]))

    def follow(self, pose: NDArray[np.float64], passed: int) -> None:
        """Take the pose after a tick and the number of gates passed so far."""
        for gate in range(len(self.gates)):
            x, y = to_inner(self.gates[gate], pose[0], pose[1])
            path = self.paths[gate]
            if abs(x) < NEAR_M and abs(y) < NEAR_M and (not path or abs(x - path[-1][0]) >= STEP_M):
                path.append((round(x, 3), round(y, 3)))
        if passed > self.next:
            _, y, angle = relative(self.gates[self.next], pose)
            self.crossings[self.next] = (round(y, 4), round(math.degrees(angle), 2))
            self.next = passed

    def record(self, info: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """The drive as a line of the file; `info` is that after its last tick."""
        info = info or self._info
        return {
            "kind": "drive",
            "seed": self.seed,
            "outcome": outcome(info),
            "gate_contact": bool(info["collision"]) and near_post(self.plan, info["pose"]) < TOUCH_M,
            "time_s": round(float(info["time_s"]), 3),
            "progress": round(float(info["progress"]), 4),
            "gates": [
                {"width_m": round(float(width), 3), "passed": gate in self.crossings}
                | dict(zip(("offset_m", "angle_deg"), self.crossings.get(gate, (None, None)), strict=True))
                | {"path": self.paths[gate]}
                for gate, width in enumerate(self.widths)
            ],
        }


def near_post(plan: Plan, pose: NDArray[np.float64]) -> float:
    """Distance between a car and the nearest gate post, m; infinite without gates."""
    car = CarConfig()
    body = np.array([*to_outer(pose, car.middle_x, 0.0), pose[2]])
    half = np.array([car.length, car.width]) / 2
    gaps = [math.inf]
    for k in np.flatnonzero(plan.box_kind == BOX_KINDS.index("post")):
        post = np.array([*plan.box_position[k, :2], plan.box_yaw[k]])
        gaps += [gap(body, half, post, plan.box_size[k, :2]), gap(post, plan.box_size[k, :2], body, half)]
    return min(gaps)


def gap(
    one: NDArray[np.float64], half: NDArray[np.float64], other: NDArray[np.float64], other_half: NDArray[np.float64]
) -> float:
    """Distance of the nearest corner of a rectangle from another rectangle, m; pose (3,), half sides (2,) of each."""
    corners = [to_outer(one, *(half * signs)) for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
    beyond = [np.maximum(np.abs(to_inner(other, *corner)) - other_half, 0.0) for corner in corners]
    return min(math.hypot(*each) for each in beyond)


def batch(scenario: str, seeds: Sequence[int], settings: RunSettings) -> list[dict[str, Any]]:
    """Records of drives that run side by side."""
    requests = [EpisodeRequest(0, scenario, seed) for seed in seeds]
    stop = stop_check()
    camera, level = settings.camera, settings.randomization
    with BatchRunner([scenario], rows=len(seeds), camera=camera, randomization=level) as runner:
        watches = [GateWatch(request.seed, runner.draw(request)[0].plan) for request in requests]
        observers = {k: [watch, stop] for k, watch in enumerate(watches)}
        runner.drive([load_machine(settings.policy)], requests, observers=observers)
    return [watch.record() for watch in watches]


def read(path: Path) -> tuple[dict[str, str], list[dict[str, Any]]]:
    """Settings and drives of a file.

    Raises:
        ConfigError: there are none.
    """
    found = list(read_lines(path))
    drives = sorted((line for line in found if line["kind"] == "drive"), key=lambda line: int(line["seed"]))
    runs = [line["settings"] for line in found if line["kind"] == "run"]
    if not drives or not runs:
        raise ConfigError(f"{path}: no drives in it")
    return runs[0], drives


def markdown(paths: list[Path]) -> str:
    """The files as a Markdown table."""
    rows = [
        "| machine | level | seeds | drives arrived | 95 % | gates passed | post touched | offset cm, median / 95 % | "
        "angle deg, median / 95 % | time s |",
        "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for path in paths:
        settings, drives = read(path)
        good = [one for one in drives if one["outcome"] == "success"]
        gates = [gate for one in drives for gate in one["gates"]]
        crossed = [gate for gate in gates if gate["passed"]]
        low, high = wilson(len(good), len(drives))
        rows.append(
            f"| {settings['policy']} | {settings['randomization']} | {stretches(one['seed'] for one in drives)} "
            f"| {len(good)}/{len(drives)} | {low:.1%} to {high:.1%} | {len(crossed)}/{len(gates)} "
            f"| {sum(one['gate_contact'] for one in drives)} "
            f"| {spread([100 * gate['offset_m'] for gate in crossed])} "
            f"| {spread([gate['angle_deg'] for gate in crossed])} "
            f"| {np.median([one['time_s'] for one in good]) if good else math.nan:.0f} |"
        )
    return "\n".join(rows)


def spread(values: list[float]) -> str:
    """Median and 95 % quantile of absolute values."""
    return "{:.1f} / {:.1f}".format(*np.quantile(np.abs(values), [0.5, 0.95])) if values else "-"


def draw(paths: list[Path], to: Path) -> None:
    """Draw all paths through the gates, a panel for each file; black: posts of the narrowest to the widest gate.

    Raises:
        ConfigError: no folder or no format for the picture.
    """
    from matplotlib.figure import Figure

    if to.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise ConfigError(f"--plot {to}: unknown suffix '{to.suffix}'. Allowed: .png, .svg, .pdf")
    prepare_folder(to.parent, f"--plot {to}")
    columns = min(len(paths), 2)
    rows = -(-len(paths) // columns)
    figure = Figure(figsize=(5.5 * columns, 3.2 * rows), layout="constrained")
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for unused in panels[len(paths) :]:
        unused.axis("off")
    for panel, path in zip(panels, paths, strict=False):
        settings, drives = read(path)
        for one in drives:
            for gate in one["gates"]:
                if gate["path"]:
                    x, y = np.transpose(gate["path"])
                    colour, order = ("tab:blue", 1) if gate["passed"] else ("tab:red", 2)
                    panel.plot(x, y, color=colour, alpha=0.25 if gate["passed"] else 0.9, linewidth=0.8, zorder=order)
        for side in (-1, 1):
            panel.plot([0, 0], [side * 0.3, side * 0.6], color="black", linewidth=2, zorder=3)
        panel.set_title(
            f"{settings['policy']}, {settings['randomization']}: rear axle, {len(drives)} drives", loc="left"
        )
        panel.set(xlim=(-NEAR_M, NEAR_M), ylim=(-0.8, 0.8), xlabel="along the gate's axis, m", ylabel="to the left, m")
        panel.set_aspect("equal")
        panel.grid(alpha=0.3)
    write_figure(to, figure, 90)


if __name__ == "__main__":
    typer.run(main)
