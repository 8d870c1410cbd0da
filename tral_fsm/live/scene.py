"""The course and its cars in three dimensions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
import viser
from numpy.typing import NDArray

from tral_env.config import LineConfig
from tral_env.course.markers import marker_image
from tral_env.course.plan import Plan
from tral_env.course.scene import PREFIX, Pool, place
from tral_fsm.live import meshes
from tral_fsm.live.frame import CarFrame, Frame, Ghost
from tral_fsm.live.overlays import Belief, Colour, Fans, Path

Array = NDArray[np.float64]
PATHS: tuple[Colour, ...] = ((30, 90, 200), (220, 120, 0), (120, 60, 180), (0, 130, 90))
"""Colours of cars that drive side by side, and of the path of one whose driver has no states."""
GHOST: Colour = (120, 120, 130)
"""Colour of the best earlier drive."""
_TINT = 0.75
"""Share of its own colour in a car that drives beside another one."""
_GHOST_OPACITY = 0.4

_AMBIENT = 1.6
"""Light from everywhere, so that no side of a wall is black."""


class Scene:
    """Draws frames; a part is sent when it is new."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Draw nothing yet."""
        self._scene = server.scene
        self._plan: Plan | None = None
        self._course: list[Any] = []
        self._cars: list[_Car] = []
        self._ghost = _Ghost(server.scene)
        server.scene.configure_environment_map(None)
        server.scene.configure_default_lights(True, cast_shadow=False)
        server.scene.add_light_ambient("/light", intensity=_AMBIENT)

    def restart(self) -> None:
        """A new drive begins: the paths so far turn pale."""
        for car in self._cars:
            car.path.fade()

    def show(self, frame: Frame, tones: Mapping[str, str]) -> None:
        """Draw a frame.

        Args:
            frame: the moment.
            tones: colour of each state of the first car by its name, such as "#0b5cad".
        """
        if not is_same(frame.plan, self._plan):
            self._lay(frame.plan)
            for car in self._cars:
                car.path.clear()
        if len(self._cars) != len(frame.cars):
            while self._cars:
                self._cars.pop().remove()
            tinted = len(frame.cars) > 1
            self._cars = [_Car(self._scene, k, tinted) for k in range(len(frame.cars))]
        for car, seen in zip(self._cars, frame.cars, strict=True):
            car.show(seen, frame.plan, tones)
        self._ghost.show(frame.ghost)

    def _lay(self, plan: Plan | None) -> None:
        """Draw another course."""
        for handle in self._course:
            handle.remove()
        self._course, self._plan = [], plan
        if plan is None:
            return
        scene = self._scene
        self._course.append(scene.add_glb("/course/boxes", meshes.glb(meshes.course_mesh(plan)), cast_shadow=False))
        self._course.append(scene.add_glb("/course/floor", meshes.glb(meshes.floor_mesh(plan)), cast_shadow=False))
        if (tape := meshes.tape_mesh(plan, LineConfig().tape_width)) is not None:
            self._course.append(scene.add_glb("/course/tape", meshes.glb(tape)))
        self._course += [self._marker(plan, k) for k in range(len(plan.marker_id))]

    def _marker(self, plan: Plan, k: int) -> Any:
        """The face of a marker."""
        placed, pool = place(plan, Pool.of(plan)), Pool.of(plan)
        geom = pool.boxes + k
        image = np.repeat(marker_image(int(plan.marker_id[k]))[..., None], 3, axis=2)
        normal = np.array([np.cos(plan.marker_yaw[k]), np.sin(plan.marker_yaw[k]), 0.0])
        return self._scene.add_image(
            f"/course/marker_{k}",
            image,
            2.0 * placed.geom_size[geom, 0],
            2.0 * placed.geom_size[geom, 1],
            format="png",
            wxyz=placed.geom_quat[geom],
            position=plan.marker_position[k] + 0.002 * normal,
        )


def is_same(one: Plan | None, other: Plan | None) -> bool:
    """Whether two courses look the same."""
    if one is None or other is None:
        return one is other
    pairs = ((one.box_position, other.box_position), (one.box_size, other.box_size), (one.route, other.route))
    return one is other or all(np.array_equal(mine, its) for mine, its in pairs)


class _Car:
    """One car of the scene, with what is drawn over the course for it."""

    def __init__(self, scene: viser.SceneApi, number: int, tinted: bool) -> None:
        """Add it; a tinted car and its path have the colour of its number alone."""
        self._model = meshes.car_model()
        self._data = mujoco.MjData(self._model)
        self._root = int(self._model.joint(f"{PREFIX}root").qposadr[0])
        self._handles = {}
        self._tone, self._is_tinted = PATHS[number % len(PATHS)], tinted
        self._all = scene.add_frame(f"/car_{number}", show_axes=False)
        for name, mesh in meshes.body_meshes(self._model).items():
            if tinted:
                meshes.tint(mesh, self._tone, _TINT)
            handle = scene.add_glb(f"/car_{number}/{name.removeprefix(PREFIX)}", meshes.glb(mesh))
            self._handles[int(self._model.body(name).id)] = handle
        self._fans = Fans(scene, f"/car_{number}/car")
        self._belief = Belief(scene, f"/belief_{number}")
        self.path = Path(scene, f"/path_{number}")

    def show(self, car: CarFrame, plan: Plan | None, tones: Mapping[str, str]) -> None:
        """Put the bodies where they are."""
        data = self._data
        if car.qpos is not None:
            data.qpos[:] = car.qpos
        elif car.pose is not None:
            x, y, yaw = car.pose
            data.qpos[self._root : self._root + 2] = x, y
            data.qpos[self._root + 3], data.qpos[self._root + 6] = np.cos(yaw / 2), np.sin(yaw / 2)
        mujoco.mj_kinematics(self._model, data)
        for body, handle in self._handles.items():
            handle.position, handle.wxyz = data.xpos[body], data.xquat[body]
        self._fans.show(car.readings)
        if car.pose is not None:
            has_tone = car.state in tones and not self._is_tinted
            self.path.show(car.pose, _rgb(tones[car.state]) if has_tone else self._tone)
        self._belief.show(car, None if plan is None else tuple(plan.start.tolist()))

    def remove(self) -> None:
        """Take the car out of the scene."""
        self._all.remove()
        self._belief.remove()
        self.path.clear()


class _Ghost:
    """The pale car of the best earlier drive."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._handle: Any = None
        self._shown: Ghost | None = None

    def show(self, ghost: Ghost | None) -> None:
        """Put it where it is; None: there is none."""
        if ghost == self._shown:
            return
        self._shown = ghost
        if ghost is None:
            if self._handle is not None:
                self._handle.visible = False
            return
        if self._handle is None:
            self._handle = self._make()
        x, y, yaw = ghost.pose
        self._handle.visible = True
        self._handle.position, self._handle.wxyz = (x, y, 0.0), (np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2))

    def _make(self) -> Any:
        whole = meshes.standing_car()
        return self._scene.add_mesh_simple(
            "/ghost", whole.vertices, whole.faces, color=GHOST, opacity=_GHOST_OPACITY, cast_shadow=False
        )


def _rgb(colour: str) -> Colour:
    """A colour such as "#0b5cad" as three numbers."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
