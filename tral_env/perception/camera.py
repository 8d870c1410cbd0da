"""Images of the simulated car: the camera that looks ahead, and any other camera of a model.

The only module of this room that knows MuJoCo. OpenGL is touched when the first image is asked for, not before.
"""

from __future__ import annotations

import os
from types import TracebackType
from typing import Any

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Image
from tral_env.config import CameraConfig
from tral_env.errors import ConfigError, RenderError, nearest
from tral_env.perception import opengl
from tral_env.perception.frustum import Frustum
from tral_env.perception.lens import mounting_turn
from tral_env.perception.rays import cross, pixel_rays

MAX_GEOMS = 5000
"""A picture can show so many geoms."""
_NEVER_SHOWN = 5
"""MuJoCo's last group of geoms; no model of this project uses it."""


_opened_by: int | None = None
"""The process that opened OpenGL first."""
_inherited: list[object] = []
"""What the parent of a forked process holds of OpenGL: to free it in the child would hang."""


class SceneRenderer:
    """Renders any camera of a model at any size.

    Shadows and reflections are off unless asked for: in software OpenGL they cost more than all the rest. One
    OpenGL context serves all courses that share textures and meshes; another look makes a new one.
    """

    def __init__(self, offsamples: int = 4) -> None:
        """Prepare a renderer; the first picture opens OpenGL.

        Args:
            offsamples: samples for each pixel against jagged edges; 0 is fastest.
        """
        self._offsamples = offsamples
        self._gl: Any = None
        self._context: mujoco.MjrContext | None = None
        self._scene: mujoco.MjvScene | None = None
        self._model: mujoco.MjModel | None = None
        self._look: tuple[NDArray[Any], ...] = ()
        self._option = mujoco.MjvOption()
        # MuJoCo paints the rays of rangefinders into the picture unless told not to.
        self._option.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
        self._option.geomgroup[_NEVER_SHOWN] = False
        self._view, self._perturb = mujoco.MjvCamera(), mujoco.MjvPerturb()

    def render(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        camera: str,
        width: int,
        height: int,
        *,
        intrinsics: CameraConfig | None = None,
        mounting: tuple[float, float, float] = (0.0, 0.0, 0.0),
        effects: bool = False,
    ) -> Image:
        """Render the picture of one camera.

        Args:
            model: the compiled scene.
            data: its state; kinematics must be up to date.
            camera: name of a camera of the model.
            width: width of the picture, px.
            height: height of the picture, px.
            intrinsics: focal lengths and principal point instead of the model's field of view; `OnboardCamera` alone
                follows its distortion.
            mounting: roll, pitch, yaw by which the camera is turned away from its place, rad; about x forward,
                y left, z up.
            effects: whether to draw shadows and reflections, as far as the model has them.

        Returns:
            (height, width, 3) uint8.

        Raises:
            RenderError: no OpenGL on this machine, or this process was forked from one that had opened OpenGL.
            ConfigError: the model has no such camera.
        """
        context, scene = self._open(model, width, height)
        self._gl.make_current()
        self._view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._view.fixedcamid = camera_id(model, camera)
        # The camera comes first: MuJoCo lays the endless floor around it, which else would be that of the last picture.
        mujoco.mjv_updateCamera(model, data, self._view, scene)
        for eye in (scene.camera[0], scene.camera[1]):
            _aim(eye, intrinsics, mounting)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            scene.flags[flag] = effects
        # What lies outside the picture may still throw a shadow into it.
        hidden = None if effects else _frustum(scene, width / height).outside(data.geom_xpos, model.geom_rbound)
        self._add_geoms(model, data, scene, hidden)
        viewport = mujoco.MjrRect(0, 0, width, height)
        image = np.empty((height, width, 3), np.uint8)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        mujoco.mjr_render(viewport, scene, context)
        mujoco.mjr_readPixels(image, None, viewport, context)
        return np.ascontiguousarray(image[::-1])

    def _add_geoms(
        self, model: mujoco.MjModel, data: mujoco.MjData, scene: mujoco.MjvScene, hidden: NDArray[np.bool_] | None
    ) -> None:
        """Put the geoms and lights of a model into a scene, but those geoms (ngeom,) that are hidden."""
        groups = model.geom_group.copy()
        if hidden is not None:
            model.geom_group[hidden] = _NEVER_SHOWN
        scene.ngeom = 0
        try:
            mujoco.mjv_addGeoms(model, data, self._option, self._perturb, mujoco.mjtCatBit.mjCAT_ALL, scene)
        finally:
            model.geom_group[:] = groups
        mujoco.mjv_makeLights(model, data, scene)

    def _open(self, model: mujoco.MjModel, width: int, height: int) -> tuple[mujoco.MjrContext, mujoco.MjvScene]:
        """Make or grow, where needed, the contexts that can show this model at this size."""
        _refuse_fork()
        if self._gl is None:
            self._gl = _gl_context(max(width, 640), max(height, 480))
        if self._context is None or self._scene is None or not self._shows(model):
            self._gl.make_current()
            if self._context is not None:
                self._context.free()
            self._context = _render_context(model, self._offsamples, width, height)
            self._scene = mujoco.MjvScene(model, MAX_GEOMS)
            self._look = tuple(np.array(part) for part in _look(model))
        self._model = model
        if width > self._context.offWidth or height > self._context.offHeight:
            self._gl.make_current()
            size = max(width, self._context.offWidth), max(height, self._context.offHeight)
            mujoco.mjr_resizeOffscreen(*size, self._context)
        return self._context, self._scene

    def _shows(self, model: mujoco.MjModel) -> bool:
        """Whether what was uploaded to OpenGL fits this model."""
        return model is self._model or all(np.array_equal(a, b) for a, b in zip(self._look, _look(model), strict=True))

    def close(self) -> None:
        """Free the OpenGL context. The next image opens a new one."""
        if self._gl is not None and _is_forked():
            _inherited.append((self._gl, self._context))
        elif self._gl is not None:
            if self._context is not None:
                with self._gl.as_current():
                    self._context.free()
            self._gl.free()
        self._gl = self._context = self._scene = self._model = None

    def __del__(self) -> None:
        # Left to the garbage collector, the context may be freed while another renderer's is current, whose images
        # then go with it.
        self.close()

    def __enter__(self) -> SceneRenderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class OnboardCamera:
    """The camera that looks ahead, with the lens of a `CameraConfig`."""

    def __init__(
        self, config: CameraConfig | None = None, *, camera: str = "car/front", renderer: SceneRenderer | None = None
    ) -> None:
        """Prepare a camera; the first image opens OpenGL.

        Args:
            config: the lens.
            camera: name of the camera in the model: its place and direction count, its field of view does not.
            renderer: a renderer that other views share; default: one of its own, without smoothing of edges, which
                doubles the cost and hardly helps the detector.
        """
        self.config = config or CameraConfig()
        self._camera = camera
        self.renderer = renderer or SceneRenderer(offsamples=0)
        self._pinhole = self.config
        self._map: tuple[Any, Any] | None = None
        if any(self.config.distortion):
            self._pinhole, self._map = _pinhole_and_map(self.config)

    def capture(
        self, model: mujoco.MjModel, data: mujoco.MjData, mounting: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> Image:
        """Take an image, (config.height, config.width, 3) uint8.

        Args:
            model: the compiled scene.
            data: its state.
            mounting: roll, pitch, yaw of the mounting error, rad.

        Raises:
            RenderError: no OpenGL on this machine.
            ConfigError: the model has no such camera.
        """
        size = self._pinhole.width, self._pinhole.height
        image = self.renderer.render(model, data, self._camera, *size, intrinsics=self._pinhole, mounting=mounting)
        if self._map is None:
            return image
        return np.asarray(cv2.remap(image, self._map[0], self._map[1], cv2.INTER_LINEAR), np.uint8)

    def frustum(self, data: mujoco.MjData, mounting: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Frustum:
        """What the camera sees: of a distorting lens all that its pinhole sees, which is more."""
        camera, lens = camera_id(data.model, self._camera), self._pinhole
        right, up, back = data.cam_xmat[camera].reshape(3, 3).T
        forward, _, upward = (np.stack([-back, -right, up], axis=1) @ mounting_turn(np.array([mounting]))[0]).T
        return Frustum(
            position=data.cam_xpos[camera].copy(),
            forward=forward,
            up=upward,
            left=(-0.5 - lens.cx) / lens.fx,
            right=(lens.width - 0.5 - lens.cx) / lens.fx,
            bottom=(lens.cy + 0.5 - lens.height) / lens.fy,
            top=(lens.cy + 0.5) / lens.fy,
        )

    def close(self) -> None:
        """Free the OpenGL context."""
        self.renderer.close()


def camera_id(model: mujoco.MjModel, name: str) -> int:
    """Index of a named camera in a model.

    Raises:
        ConfigError: the model has no such camera.
    """
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, name)
    if index < 0:
        raise ConfigError(
            f"no camera '{name}' in the model: {nearest(name, (model.camera(i).name for i in range(model.ncam)))}"
        )
    return int(index)


def _is_forked() -> bool:
    """Whether the parent of this process, and not the process itself, has opened OpenGL."""
    return _opened_by is not None and _opened_by != os.getpid()


def _refuse_fork() -> None:
    """Refuse OpenGL where it would hang for ever."""
    if _is_forked():
        raise RenderError(
            "OpenGL was opened in the process from which this one was forked, and would hang here: start the processes "
            'with AsyncVectorEnv(..., context="spawn"), or render nothing before they start'
        )


def _gl_context(width: int, height: int) -> Any:
    """An OpenGL context, current."""
    global _opened_by
    _opened_by = os.getpid()
    try:
        context = _context_class()(width, height)
        context.make_current()
    except Exception as error:  # every backend has errors of its own
        backend = opengl.chosen() or "not set"
        raise RenderError(f"no OpenGL context (MUJOCO_GL={backend}): {error}. {opengl.REMEDY}") from error
    return context


def _context_class() -> Any:
    """The class of context that this machine can open."""
    if opengl.chooses_egl():
        from mujoco.egl import GLContext
    else:
        from mujoco.rendering.classic.gl_context import GLContext
    return GLContext


def _render_context(model: mujoco.MjModel, offsamples: int, width: int, height: int) -> mujoco.MjrContext:
    """Upload a model's look, for pictures of this size: each is cleared as a whole, so a larger buffer costs time.

    The model's own size and number of samples stay as they were.
    """
    quality, overall = model.vis.quality, model.vis.global_
    before = quality.offsamples, overall.offwidth, overall.offheight
    quality.offsamples, overall.offwidth, overall.offheight = offsamples, width, height
    try:
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
    except mujoco.FatalError as error:
        raise RenderError(f"OpenGL refuses the scene: {error}. {opengl.REMEDY}") from error
    finally:
        quality.offsamples, overall.offwidth, overall.offheight = before
    return context


def _look(model: mujoco.MjModel) -> tuple[NDArray[Any], ...]:
    """The parts of a model that OpenGL holds a copy of."""
    return (
        model.tex_data,
        model.tex_width,
        model.mat_texid,
        model.mat_texrepeat,
        model.mesh_vert,
        model.mesh_face,
        model.hfield_data,
    )


def _aim(eye: Any, intrinsics: CameraConfig | None, mounting: tuple[float, float, float]) -> None:
    """Give a camera of a scene its lens and its mounting error.

    The frustum is that of a pinhole whose pixel (u, v) sees the direction ((u - cx) / fx, (v - cy) / fy, 1), with whole
    numbers at the middles of pixels: the image begins at -0.5 and ends at width - 0.5.
    """
    if intrinsics is not None:
        near = eye.frustum_near
        left, right = (-0.5 - intrinsics.cx) / intrinsics.fx, (intrinsics.width - 0.5 - intrinsics.cx) / intrinsics.fx
        eye.frustum_center = near * (left + right) / 2
        eye.frustum_width = near * (right - left) / 2
        eye.frustum_top = near * (intrinsics.cy + 0.5) / intrinsics.fy
        eye.frustum_bottom = near * (intrinsics.cy + 0.5 - intrinsics.height) / intrinsics.fy
    if any(mounting):
        forward, up = np.array(eye.forward), np.array(eye.up)
        axes = np.stack([forward, cross(up, forward), up], axis=1)
        turned = axes @ mounting_turn(np.array([mounting]))[0]
        eye.forward, eye.up = turned[:, 0], turned[:, 2]


def _frustum(scene: mujoco.MjvScene, aspect: float) -> Frustum:
    """What the two eyes of a scene see, which MuJoCo makes one."""
    first, second = scene.camera[0], scene.camera[1]
    near, high, low = first.frustum_near, first.frustum_top, first.frustum_bottom
    width = first.frustum_width or aspect * (high - low) / 2
    return Frustum(
        position=(np.array(first.pos, float) + second.pos) / 2,
        forward=np.array(first.forward, float),
        up=np.array(first.up, float),
        left=(first.frustum_center - width) / near,
        right=(first.frustum_center + width) / near,
        bottom=low / near,
        top=high / near,
    )


def _pinhole_and_map(config: CameraConfig) -> tuple[CameraConfig, tuple[Any, Any]]:
    """A pinhole that sees all that a distorting lens sees, and where each pixel of the lens lies in its image.

    The pinhole has the lens's focal lengths, and an image just large enough for the rays of all pixels of the lens.
    """
    u, v = np.meshgrid(np.arange(config.width, dtype=np.float64), np.arange(config.height, dtype=np.float64))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    rays = pixel_rays(pixels, config).reshape(config.height, config.width, 2)
    x, y = rays[..., 0] * config.fx, rays[..., 1] * config.fy
    cx, cy = np.ceil(-x.min()) + 2, np.ceil(-y.min()) + 2
    pinhole = CameraConfig(
        width=int(np.ceil(x.max() + cx)) + 3,
        height=int(np.ceil(y.max() + cy)) + 3,
        fx=config.fx,
        fy=config.fy,
        cx=float(cx),
        cy=float(cy),
    )
    maps = cv2.convertMaps((x + cx).astype(np.float32), (y + cy).astype(np.float32), cv2.CV_16SC2)
    return pinhole, (maps[0], maps[1])
