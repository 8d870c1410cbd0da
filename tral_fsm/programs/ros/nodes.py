"""Nodes by what a command line asks for."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace

from tral_env.config import CarConfig
from tral_env.errors import ConfigError
from tral_env.hardware.camera_options import CameraOptions
from tral_env.hardware.car_file import load_car
from tral_env.ros.body import Body
from tral_env.ros.camera_node import CameraNode, CameraNodeOptions
from tral_env.ros.car_body import FOR_EVER_S, CarBody
from tral_env.ros.car_node import CarNode, CarOptions
from tral_env.ros.commands import CommandLimits
from tral_env.ros.images import CameraImages, Images, StreamImages
from tral_env.ros.node import check_namespace, domain_id
from tral_fsm.programs.ros.asked import Asked
from tral_fsm.programs.ros.fsm_node import FsmNode, FsmOptions

Spinning = Callable[[threading.Event], None]
"""Runs a node until the event is set."""


def car_node(asked: Asked) -> CarNode:
    """The node `car`.

    Raises:
        ConfigError: an option or the car file cannot be used.
        HardwareError: a device does not answer.
    """
    check_namespace(asked.namespace)  # and the domain: before a car is opened
    domain_id()
    options = CarOptions(
        namespace=asked.namespace,
        use_sim_time=asked.use_sim_time or asked.lock_step,
        lock_step=asked.lock_step,
        limits=CommandLimits(timeout_s=asked.command_timeout),
        arm=asked.arm,
    )
    body = _body(asked)
    try:
        return CarNode(body, options)
    except BaseException:
        body.close()
        raise


def camera_node(asked: Asked) -> CameraNode:
    """The node `camera`.

    Raises:
        ConfigError: the car file has no camera, or its lens cannot be used.
    """
    if asked.backend != "car":
        source = functools.partial(_open_source, asked.source) if asked.source else None
        return CameraNode(source, CameraNodeOptions(namespace=asked.namespace))
    car = load_car(asked.config)
    camera = car.camera
    if camera is None:
        raise ConfigError(f"{asked.config}: it has no [camera]: add one with `tral car init`, and calibrate its lens")
    lens = camera.calibrated()
    own = functools.partial(CameraImages, camera)
    opened: Callable[[], Images] = functools.partial(_open_source, asked.source, camera) if asked.source else own
    options = CameraNodeOptions(namespace=asked.namespace, lens=lens, forward=camera.forward, faults=car.fault_limits())
    return CameraNode(opened, options)


def fsm_node(asked: Asked) -> FsmNode:
    """The node `fsm`.

    Raises:
        ConfigError: the policy cannot be made.
    """
    from tral_fsm.evaluation.own_policy import find_policy

    options = FsmOptions(
        namespace=asked.namespace,
        use_sim_time=asked.use_sim_time or asked.lock_step,
        camera_timeout_s=asked.camera_timeout,
    )
    return FsmNode(find_policy(asked.policy), options)


def has_images(asked: Asked) -> bool:
    """Whether the node `camera` has something to look at."""
    if asked.backend == "car":
        camera = load_car(asked.config).camera
        return bool(asked.source) or (camera is not None and bool(camera.lens))
    return bool(asked.source) or asked.camera == "rendered"


def run_all(nodes: Sequence[Spinning], ended: threading.Event) -> None:
    """Run nodes of one process, the first in this thread; when one ends, all do.

    Raises:
        TralError: what a node raised first.
    """
    failures: list[BaseException] = []

    def spin(node: Spinning) -> None:
        try:
            node(ended)
        except BaseException as error:  # raised again by the thread that began it
            failures.append(error)
        finally:
            ended.set()

    threads = [threading.Thread(target=spin, args=(node,)) for node in nodes[1:]]
    for thread in threads:
        thread.start()
    spin(nodes[0])
    for thread in threads:
        thread.join()
    if failures:
        raise failures[0]


def _body(asked: Asked) -> Body:
    if asked.backend == "car":
        from tral_env.hardware.env import TralCarEnv

        # The node `camera` opens the camera, and a camera can be opened once.
        car = load_car(asked.config)
        forward = CarConfig.camera_x if car.camera is None else car.camera.forward
        output = "recorder" if asked.dry else None
        opened = functools.partial(
            TralCarEnv, config=replace(car, camera=None), output=output, max_duration_s=FOR_EVER_S
        )
        return CarBody(opened, car.name, sees=False, camera_x=forward)
    if asked.backend == "twin":
        from tral_env.twin.settings import TwinSettings
        from tral_fsm.programs.ros.twin import TwinBody

        settings = TwinSettings(
            name=f"ros{asked.namespace.strip('/').replace('/', '-')}", scenario=asked.scenario, course=asked.course,
            seed=asked.seed, randomization=asked.randomization, camera=asked.camera == "rendered",
            bus=None, serial=False,
        )  # fmt: skip
        return TwinBody(settings)
    from tral_fsm.programs.ros.simulation import SimulatedBody, SimulationOptions

    return SimulatedBody(
        SimulationOptions(
            scenario=asked.scenario, course=asked.course, seed=asked.seed, randomization=asked.randomization,
            camera=asked.camera, real_time=not asked.lock_step,
        )
    )  # fmt: skip


def _open_source(source: str, options: CameraOptions = CameraOptions()) -> Images:  # noqa: B008 - frozen
    """Open a camera by its number, path or URL; all else is as the options say."""
    if source.startswith(("http://", "https://")):
        return StreamImages(source, options.latency_s)
    return CameraImages(replace(options, device=int(source) if source.isdecimal() else source))
