"""The absolute pose of a camera from pixels and points in space."""

from __future__ import annotations

from ctypes import byref
from dataclasses import dataclass
from typing import Any, Optional

import numpy as np
from numpy.typing import ArrayLike

from . import _abi
from ._record import Record, judged, rotation, table, vector
from .camera import Camera, camera_struct
from .context import Context, check_context
from .enums import Reason, Verdict
from .options import AbsolutePoseOptions, to_struct


@dataclass(frozen=True, eq=False, repr=False)
class AbsolutePose(Record):
    """tv_absolute_pose, with the pose cam_from_world: x = R X + t. A value that was not estimated
    is None. print shows the pose and the verdict; == compares all fields."""

    verdict: Verdict  #: whether the result can be relied on
    reasons: Reason  #: why the verdict is not OK
    num_matches: int  #: how many pixels and points were given
    num_inliers: int  #: how many of them agree with the pose
    num_iterations: int  #: samples that were drawn
    R: Optional[np.ndarray]  #: (3, 3), rotation
    t: Optional[np.ndarray]  #: (3,), translation in the unit of the points
    alternative_R: Optional[np.ndarray]  #: (3, 3), the second pose that points on a plane permit
    alternative_t: Optional[np.ndarray]  #: (3,), its translation
    covariance: Optional[np.ndarray]  #: (6, 6): w0 w1 w2 d0 d1 d2 of absolute_pose.h
    coverage: float  #: share of 8x8 cells with an inlier
    rms_error_px: float  #: root mean square of the inliers' errors, pixels
    noise_px: float  #: standard deviation of a pixel's coordinate, from the residuals
    seed: int  #: of the sampler, as it was used

    def __str__(self) -> str:
        name = "no pose" if self.R is None else "pose"
        verdict = self.verdict.name.lower()
        rows = [("", f"{judged(name, verdict, self.reasons)}: {self.num_inliers} of "
                     f"{self.num_matches} points agree")]
        if self.R is not None:
            rows += [("rotation", rotation(self.R)), ("t", vector(self.t) + ", x = R X + t"),
                     ("noise", f"{self.noise_px:.2f} px")]
        return table(rows)


def estimate_absolute_pose(context: Context, camera: Camera, pixels: ArrayLike,
                           points: ArrayLike, ratios: Optional[ArrayLike] = None,
                           options: Optional[AbsolutePoseOptions] = None,
                           sigmas: Optional[ArrayLike] = None,
                           **keywords: Any) -> tuple[AbsolutePose, np.ndarray]:
    """tv_estimate_absolute_pose: the pose of a camera from pixels of known points.

    context: of enough matches. camera: of any model. pixels: (n, 2) float64, as in the image
    (distorted). points: (n, 3) float64, of any unit. ratios: None, or (n,) float32; lower means
    more reliable. options: an AbsolutePoseOptions, or its fields as keywords. sigmas: None (1 for
    all), or (n,) float32, the standard deviations of the pixels in units of that of the most
    precise ones.
    Returns an AbsolutePose, and the inlier mask (n,) bool.
    Raises TypeError or ValueError for an array that C could not read, TV_ERR_LIMITS for more
    matches than the context's max_matches, TV_ERR_CAMERA, TV_ERR_ARGUMENT and TV_ERR_NOT_FINITE for
    an option or a sigma out of its range."""
    wanted = to_struct(check_context(context).library, AbsolutePoseOptions, options, keywords)
    pixels = _abi.check_array("pixels", pixels, np.float64, 2)
    points = _abi.check_array("points", points, np.float64, 3)
    matches = context.library.make(_abi.tv_pixel_points)
    matches.num = len(pixels)
    matches.pixels, matches.points = _abi.pointer(pixels), _abi.pointer(points)
    kept: list[np.ndarray] = [points]  # the struct only points to them
    for name, array in (("points", points), ("ratios", ratios), ("sigmas", sigmas)):
        if array is None:
            continue
        if name != "points":
            kept.append(_abi.check_array(name, array, np.float32))
            setattr(matches, name, _abi.pointer(kept[-1]))
        if len(kept[-1]) != len(pixels):
            raise ValueError(f"{len(pixels)} pixels and {len(kept[-1])} {name}")
    found = context.library.make(_abi.tv_absolute_pose)
    inliers = np.zeros(len(pixels), np.uint8)
    context.call("tv_estimate_absolute_pose", byref(camera_struct("camera", camera)),
                 byref(matches), byref(wanted), byref(found), _abi.pointer(inliers))
    del kept

    def array_of(field: str, has: int, *shape: int) -> Optional[np.ndarray]:
        return np.array(getattr(found, field)).reshape(shape) if has else None

    return AbsolutePose(
        Verdict(found.verdict), Reason(found.reasons), found.num_matches, found.num_inliers,
        found.num_iterations, array_of("R", found.has_pose, 3, 3),
        array_of("t", found.has_pose, 3), array_of("alternative_R", found.has_alternative, 3, 3),
        array_of("alternative_t", found.has_alternative, 3),
        array_of("covariance", found.has_covariance, 6, 6), found.coverage, found.rms_error_px,
        found.noise_px, found.seed), inliers.view(bool)
