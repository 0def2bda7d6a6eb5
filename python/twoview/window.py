"""Bundle adjustment of a window of views: tv_adjust_window."""

from __future__ import annotations

from ctypes import addressof, byref, c_size_t
from dataclasses import dataclass
from typing import Any, Optional, Sequence

import numpy as np

from . import _abi
from ._record import Record
from .camera import Camera, camera_struct
from .options import WindowOptions, to_struct


@dataclass(frozen=True, eq=False, repr=False)
class WindowResult(Record):
    """tv_window_result with the adjusted views (n,) of twoview.WINDOW_VIEW and points (m, 3)."""

    views: np.ndarray  #: (n,) of WINDOW_VIEW, adjusted
    points: np.ndarray  #: (m, 3) float64, adjusted, in the world's frame
    #: (k,) float32: each observation's distance in pixels, and -1 where it was discarded.
    errors_px: np.ndarray
    covariances: Optional[np.ndarray]  #: (n, 6, 6), or None where they are not known
    num_views: int  #: how many views were adjusted
    num_points: int  #: how many points took part
    num_observations: int  #: how many observations took part
    num_behind: int  #: discarded: the point lies behind the camera at the start
    num_invalid: int  #: discarded: the pixel has no ray, or is not finite
    num_single: int  #: discarded: only one view has an observation of the point
    num_iterations: int  #: steps that were tried
    converged: bool  #: False where max_iterations ended it
    held_first_view: bool  #: True where nothing else fixes the frame
    scale_is_free: bool  #: True where nothing determines the scale
    initial_cost: float  #: of observations and priors, pixels squared, before
    final_cost: float  #: and after
    initial_rms_px: float  #: distance along one axis in units of sigma, before
    rms_px: float  #: and after
    noise_px: float  #: standard deviation of an observation of sigma 1; 0: not known

    def __str__(self) -> str:
        ended = "converged" if self.converged else "not converged"
        return (f"{self.num_views} views, {self.num_points} points, {self.num_observations} "
                f"observations, {ended} after {self.num_iterations} iterations: "
                f"{self.initial_rms_px:.3f} to {self.rms_px:.3f} px rms")


def adjust_window(cameras: Sequence[Camera], views: np.ndarray, points: np.ndarray,
                  observations: np.ndarray, pose_priors: Optional[np.ndarray] = None,
                  gravity_priors: Optional[np.ndarray] = None,
                  distance_priors: Optional[np.ndarray] = None,
                  world_down: Sequence[float] = (0.0, 1.0, 0.0), covariances: bool = False,
                  options: Optional[WindowOptions] = None, **keywords: Any) -> WindowResult:
    """tv_adjust_window: bundle adjustment of several views from a given start, which is not
    modified.

    cameras: Cameras that the views share. views: (n,) of twoview.WINDOW_VIEW; R (9, row-major) and
    t are cam_from_world, idx_camera is an index of `cameras`, and fixed is 1 for a pose that is
    held. points: (m, 3) float64, in the world's frame and in the unit of the views' t.
    observations: (k,) of twoview.OBSERVATION (pixels). pose_priors, gravity_priors,
    distance_priors: None, or arrays of twoview.POSE_PRIOR, GRAVITY_PRIOR and DISTANCE_PRIOR.
    world_down: 3 numbers, the direction of gravity in the world's frame. covariances: whether those
    of the views are computed. options: a WindowOptions, or its fields as keywords.
    Returns a WindowResult.
    Raises TypeError or ValueError for an array that C could not read, TV_ERR_ARGUMENT for a count,
    an index, a rotation, a prior or an option out of its range, TV_ERR_NOT_FINITE,
    TV_ERR_CAMERA."""
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
    library.call("tv_adjust_window", _abi.pointer(memory), size, byref(window), byref(wanted),
                 _abi.pointer(found), _abi.pointer(errors), byref(result))
    return WindowResult(
        views, points, errors, found if result.has_covariance else None, result.num_views,
        result.num_points, result.num_observations, result.num_behind, result.num_invalid,
        result.num_single, result.num_iterations, bool(result.converged),
        bool(result.held_first_view), bool(result.scale_is_free), result.initial_cost,
        result.final_cost, result.initial_rms_px, result.rms_px, result.noise_px)
