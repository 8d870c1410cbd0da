"""A calibration as a record for JSON, and the distance of the lens that was found from the true one."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import cv2
import numpy as np

from tral_env.calibration.solve import PARAMETERS, Calibration
from tral_env.config import CameraConfig
from tral_env.perception.rays import lens_arrays, pixel_rays

_SHOWN = PARAMETERS[:4]


def parameters(camera: CameraConfig) -> dict[str, float]:
    """The nine numbers of a lens by name."""
    values = (camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion)
    return dict(zip(PARAMETERS, values, strict=True))


def calibration_record(result: Calibration, truth: CameraConfig | None = None) -> dict[str, Any]:
    """Tell all about a calibration, ready for JSON.

    Args:
        result: the calibration.
        truth: the lens that it should have found; None: it is not known.
    """
    found = parameters(result.camera)
    record: dict[str, Any] = {
        "verdict": "good" if result.good else "poor",
        "advice": list(result.advice),
        "image_size": [result.camera.width, result.camera.height],
        "parameters": found,
        "standard_deviations": result.deviation,
        "rms_px": result.rms_px,
        "held_out_rms_px": result.held_out_px,
        "coverage": result.coverage.tolist(),
        "views": [
            {
                "name": view.name,
                "corners": len(view.ids),
                "error_px": float(error),
                "edge_px": view.edge_px,
                "distance_m": float(distance),
                "tilt_deg": float(np.degrees(np.arccos(np.clip(abs(normal[2]), 0, 1)))),
            }
            for view, error, distance, normal in zip(
                result.views, result.errors_px, result.distances, result.normals, strict=True
            )
        ],
        "rejected": [asdict(one) for one in result.rejected],
    }
    if truth is not None:
        true = parameters(truth)
        record["truth"] = true
        record["difference_px"] = dict(zip(("mean", "max"), difference_px(result.camera, truth), strict=True))
        record["error_percent"] = {name: 100 * (found[name] / true[name] - 1) for name in _SHOWN}
    return record


def difference_px(found: CameraConfig, true: CameraConfig) -> tuple[float, float]:
    """Distance between what two lenses make of the same ray, px: mean and maximum over the pixels of the second."""
    columns, rows = np.arange(true.width, dtype=np.float64), np.arange(true.height, dtype=np.float64)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    points = np.column_stack([pixel_rays(pixels, true), np.ones(len(pixels))])
    again = np.asarray(cv2.projectPoints(points, np.zeros(3), np.zeros(3), *lens_arrays(found))[0])[:, 0]
    apart = np.linalg.norm(again - pixels, axis=1)
    return float(apart.mean()), float(apart.max())
