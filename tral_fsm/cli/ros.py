"""`tral ros`: the car, its camera and its policy as nodes of ROS 2."""

from __future__ import annotations

import signal
import threading
from typing import Annotated, Literal

import typer

app = typer.Typer(no_args_is_help=True, help="Run the car, its camera and its policy as nodes of ROS 2, without ROS.")

Backend = Literal["car", "twin", "simulation"]
Namespace = Annotated[str, typer.Option(help="Before all topics, such as /car1.")]
SimTime = Annotated[bool, typer.Option("--use-sim-time", help="Stamps are the simulated time, as /clock tells it.")]


def _until_stopped() -> threading.Event:
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    return ended


@app.command("car")
def car(
    backend: Annotated[Backend, typer.Option(help="Which car.")] = "simulation",
    scenario: Annotated[str, typer.Option(help="Family of courses; `tral courses` lists them.")] = "office",
    course: Annotated[str | None, typer.Option(help="One course instead of a family: its name or its file.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Draws course, car and noise.")] = 7,
    namespace: Namespace = "",
    use_sim_time: SimTime = False,
    lock_step: Annotated[bool, typer.Option("--lock-step", help="Each tick waits for its answer.")] = False,
    arm: Annotated[bool, typer.Option("--arm", help="Arm at the start.")] = False,
) -> None:
    """Run the node `car`."""
    from tral_env.ros.car_node import CarNode, CarOptions
    from tral_fsm.programs.ros.simulation import SimulatedBody, SimulationOptions

    body = SimulatedBody(SimulationOptions(scenario=scenario, course=course, seed=seed, real_time=not lock_step))
    options = CarOptions(namespace=namespace, use_sim_time=use_sim_time or lock_step, lock_step=lock_step, arm=arm)
    CarNode(body, options).run(_until_stopped())


@app.command("fsm")
def fsm(
    policy: Annotated[str, typer.Option(help="Machine, trained policy, or FILE.py:NAME.")] = "office",
    namespace: Namespace = "",
    use_sim_time: SimTime = False,
) -> None:
    """Run the node `fsm`."""
    from tral_fsm.evaluation.own_policy import find_policy
    from tral_fsm.programs.ros.fsm_node import FsmNode, FsmOptions

    FsmNode(find_policy(policy), FsmOptions(namespace=namespace, use_sim_time=use_sim_time)).run(_until_stopped())
