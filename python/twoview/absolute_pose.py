"""The absolute pose of a camera from pixels and points in space."""

from __future__ import annotations

from ctypes import byref
from dataclasses import dataclass
from typing import Any, Optional

import numpy as np

from . import _abi
from .camera import Camera, camera_struct
from .context import Context, check_context
from .enums import Reason, Verdict
from .options import AbsolutePoseOptions, to_struct


@dataclass(frozen=True)
class AbsolutePose:
    """tv_absolute_pose, with the pose cam_from_world: x = R X + t. A value that was not estimated
    is None."""

    verdict: Verdict
    reasons: Reason
    num_matches: int
    num_inliers: int
    num_iterations: int
    R: Optional[np.ndarray]  #: (3, 3), rotation
    t: Optional[np.ndarray]  #: (3,), translation in the unit of the points
    alternative_R: Optional[np.ndarray]  #: the second pose that points on a plane permit
    alternative_t: Optional[np.ndarray]
    covariance: Optional[np.ndarray]  #: (6, 6): w0 w1 w2 d0 d1 d2 of absolute_pose.h
    coverage: float  #: share of 8x8 cells with an inlier
    rms_error_px: float
    noise_px: float
    seed: int


def estimate_absolute_pose(context: Context, camera: Camera, pixels: np.ndarray,
                           points: np.ndarray, ratios: Optional[np.ndarray] = None,
                           options: Optional[AbsolutePoseOptions] = None,
                           sigmas: Optional[np.ndarray] = None,
                           **keywords: Any) -> tuple[AbsolutePose, np.ndarray]:
    """tv_estimate_absolute_pose: returns the pose and the inlier mask, (n,) bool.

    pixels: (n, 2) float64, as in the image (distorted). points: (n, 3) float64. ratios: (n,)
    float32; lower means more reliable. sigmas: (n,) float32, the standard deviations of the pixels
    in units of that of the most precise ones; None: 1 for all."""
    wanted = to_struct(check_context(context).library, AbsolutePoseOptions, options, keywords)
    pixels = _abi.check_array("pixels", pixels, np.float64, 2)
    points = _abi.check_array("points", points, np.float64, 3)
    matches = context.library.make(_abi.tv_pixel_points)
    matches.num = len(pixels)
    matches.pixels, matches.points = _abi.pointer(pixels), _abi.pointer(points)
    for name, array in (("points", points), ("ratios", ratios), ("sigmas", sigmas)):
        if array is None:
            continue
        if name != "points":
            array = _abi.check_array(name, array, np.float32)
            setattr(matches, name, _abi.pointer(array))
        if len(array) != len(pixels):
            raise ValueError(f"{len(pixels)} pixels and {len(array)} {name}")
    found = context.library.make(_abi.tv_absolute_pose)
    inliers = np.zeros(len(pixels), np.uint8)
    context.call("tv_estimate_absolute_pose", byref(camera_struct("camera", camera)),
                 byref(matches), byref(wanted), byref(found), _abi.pointer(inliers))

    def array_of(field: str, has: int, *shape: int) -> Optional[np.ndarray]:
        return np.array(getattr(found, field)).reshape(shape) if has else None

    return AbsolutePose(
        Verdict(found.verdict), Reason(found.reasons), found.num_matches, found.num_inliers,
        found.num_iterations, array_of("R", found.has_pose, 3, 3),
        array_of("t", found.has_pose, 3), array_of("alternative_R", found.has_alternative, 3, 3),
        array_of("alternative_t", found.has_alternative, 3),
        array_of("covariance", found.has_covariance, 6, 6), found.coverage, found.rms_error_px,
        found.noise_px, found.seed), inliers.view(bool)
