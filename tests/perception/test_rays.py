"""Pixels to rays: the way back through a distorting lens."""

import cv2
import numpy as np
import pytest

from tral_env.config import WIDE_LENS, CameraConfig
from tral_env.perception.rays import lens_arrays, pixel_rays


def test_rays_of_the_wide_lens_lead_back_to_their_pixels_right_up_to_the_corners():
    corners = np.array([[0.0, 0.0], [639.0, 0.0], [0.0, 479.0], [639.0, 479.0], [330.2, 249.6], [100.0, 400.0]])
    points = np.column_stack([pixel_rays(corners, WIDE_LENS), np.ones(len(corners))])
    again = cv2.projectPoints(points, np.zeros(3), np.zeros(3), *lens_arrays(WIDE_LENS))[0][:, 0]
    assert again == pytest.approx(corners, abs=1e-4)


def test_without_distortion_a_ray_is_a_division():
    lens = CameraConfig()
    assert pixel_rays(np.array([[319.5 + 55.4256, 239.5]]), lens) == pytest.approx(np.array([[0.1, 0.0]]))
