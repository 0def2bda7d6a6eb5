"""Bundle adjustment of a window of views: tv_adjust_window."""

from __future__ import annotations

from ctypes import addressof, byref, c_size_t
from dataclasses import dataclass
from typing import Any, Optional, Sequence

import numpy as np

from . import _abi
from .camera import Camera, camera_struct
from .options import WindowOptions, to_struct


@dataclass(frozen=True)
class WindowResult:
    """tv_window_result with the adjusted views (n,) of twoview.WINDOW_VIEW and points (m, 3)."""

    views: np.ndarray
    points: np.ndarray
    #: (k,) float32: each observation's distance in pixels, and -1 where it was discarded.
    errors_px: np.ndarray
    covariances: Optional[np.ndarray]  #: (n, 6, 6), or None where they are not known
    num_views: int
    num_points: int
    num_observations: int
    num_behind: int
    num_invalid: int
    num_single: int
    num_iterations: int
    converged: bool
    held_first_view: bool
    scale_is_free: bool
    initial_cost: float
    final_cost: float
    initial_rms_px: float
    rms_px: float
    noise_px: float


def adjust_window(cameras: Sequence[Camera], views: np.ndarray, points: np.ndarray,
                  observations: np.ndarray, pose_priors: Optional[np.ndarray] = None,
                  gravity_priors: Optional[np.ndarray] = None,
                  distance_priors: Optional[np.ndarray] = None,
                  world_down: Sequence[float] = (0.0, 1.0, 0.0), covariances: bool = False,
                  options: Optional[WindowOptions] = None, **keywords: Any) -> WindowResult:
    """tv_adjust_window: bundle adjustment of several views from a given start, which is not
    modified.

    views: (n,) of twoview.WINDOW_VIEW; R (9, row-major) and t are cam_from_world, idx_camera is an
    index of `cameras`, and fixed is 1 for a pose that is held. points: (m, 3) float64.
    observations: (k,) of twoview.OBSERVATION. The priors are arrays of twoview.POSE_PRIOR,
    GRAVITY_PRIOR and DISTANCE_PRIOR. covariances: whether those of the views are computed."""
    library = _abi.default_library()
    wanted = to_struct(library, WindowOptions, options, keywords)
    structs = (_abi.tv_camera * len(cameras))(
        *(camera_struct("cameras", camera) for camera in cameras))
    views = _abi.check_array("views", views, _abi.WINDOW_VIEW).copy()
    points = _abi.check_array("points", points, np.float64, 3).copy()
    arrays = {"views": views, "points": points,
              "observations": _abi.check_array("observations", observations, _abi.OBSERVATION)}
    for name, array, dtype in (("pose_priors", pose_priors, _abi.POSE_PRIOR),
                               ("gravity_priors", gravity_priors, _abi.GRAVITY_PRIOR),
                               ("distance_priors", distance_priors, _abi.DISTANCE_PRIOR)):
        if array is not None:
            arrays[name] = _abi.check_array(name, array, dtype)
    window = library.make(_abi.tv_window, {"world_down": world_down})
    window.num_cameras, window.cameras = len(cameras), addressof(structs)
    for name, array in arrays.items():
        setattr(window, "num_" + name, len(array))
        setattr(window, name, array.ctypes.data)
    size = c_size_t()
    library.call("tv_adjust_window_size", byref(window), byref(size))
    block = np.empty(size.value + _abi.CONTEXT_ALIGNMENT, np.uint8)
    memory = block[-block.ctypes.data % _abi.CONTEXT_ALIGNMENT:]
    found = np.zeros((len(views), 6, 6)) if covariances else None
    errors = np.empty(len(observations), np.float32)
    result = library.make(_abi.tv_window_result)
    library.call("tv_adjust_window", byref(window), byref(wanted), _abi.pointer(memory), size,
                 _abi.pointer(found), _abi.pointer(errors), byref(result))
    return WindowResult(
        views, points, errors, found if result.has_covariance else None, result.num_views,
        result.num_points, result.num_observations, result.num_behind, result.num_invalid,
        result.num_single, result.num_iterations, bool(result.converged),
        bool(result.held_first_view), bool(result.scale_is_free), result.initial_cost,
        result.final_cost, result.initial_rms_px, result.rms_px, result.noise_px)
