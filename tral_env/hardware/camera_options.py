"""Options of the camera, such as a car file gives them; OpenCV is imported when the camera is opened."""

from __future__ import annotations

from dataclasses import dataclass, replace

from tral_env.calibration.camera_info import load_lens
from tral_env.config import CameraConfig, CarConfig
from tral_env.errors import ConfigError
from tral_env.hardware.actuator.options import check_quantities, quantity
from tral_env.interface import CONTROL_RATE_HZ


@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """The camera that looks ahead."""

    device: int | str = quantity(0, 0, 63)
    """Number (0 is /dev/video0), path, or URL of the camera."""
    width: int = quantity(640, 16, 8192, "px")
    """Width of its images, px."""
    height: int = quantity(480, 16, 8192, "px")
    """Height of its images, px."""
    rate_hz: float = quantity(30.0, 1.0, CONTROL_RATE_HZ, "Hz")
    """Images in a second."""
    lens: str = ""
    """Path of the lens file that `tral calibrate` wrote. Empty: not calibrated yet, and the camera stays off."""
    marker_size: float = quantity(CameraConfig.marker_size, 0.005, 2.0, "m")
    """Edge of a marker's black square, m."""
    forward: float = quantity(CarConfig.camera_x, 0.0, 2.0, "m")
    """The camera stands this far ahead of the rear axle, m."""
    latency_s: float = quantity(0.0, 0.0, 1.0, "s")
    """Time from the exposure of an image until this computer has it, s: it adds to the age of what is seen."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_quantities(self)

    @property
    def oldest_s(self) -> float:
        """Age of the newest image just before the next one comes, s."""
        return 1.0 / self.rate_hz + self.latency_s

    def calibrated(self) -> CameraConfig:
        """The lens for images of this camera.

        Raises:
            CalibrationError: the file of the lens cannot be used.
            ConfigError: the lens was calibrated with images of another size.
        """
        lens = load_lens(self.lens)
        if (lens.width, lens.height) != (self.width, self.height):
            raise ConfigError(
                f"the lens '{self.lens}' is for images of {lens.width} x {lens.height} px, the camera gives "
                f"{self.width} x {self.height}: calibrate it with such images, by `tral calibrate`"
            )
        return replace(lens, rate_hz=self.rate_hz, marker_size=self.marker_size)
