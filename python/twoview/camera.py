"""Camera models: from pixels to rays and back (camera.h). Pixel (0, 0) is the centre of the
top-left pixel."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any, Sequence

import numpy as np

from . import _abi
from .enums import CameraModel


@dataclass(frozen=True)
class Camera:
    """tv_camera: focal lengths and principal point in pixels; k holds the coefficients of the
    model, at most 8."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    model: int = CameraModel.PINHOLE
    k: Sequence[float] = ()

    def _struct(self) -> Any:
        if len(self.k) > 8:
            raise ValueError(f"k: at most 8 coefficients, not {len(self.k)}")
        camera = _abi.tv_camera(int(self.model), int(self.width), int(self.height), 0,
                                float(self.fx), float(self.fy), float(self.cx), float(self.cy))
        camera.k[: len(self.k)] = [float(k) for k in self.k]
        return camera

    @property
    def K(self) -> np.ndarray:
        """The 3x3 matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]])


def camera_struct(name: str, camera: Any) -> Any:
    if isinstance(camera, _abi.tv_camera):
        return camera
    if not isinstance(camera, Camera):
        raise TypeError(f"{name}: a twoview.Camera is expected, not {type(camera).__name__}")
    return camera._struct()


def camera_check(camera: Camera) -> None:
    """Raises TV_ERR_CAMERA for intrinsics that every function refuses."""
    _abi.default_library().call("tv_camera_check", ctypes.byref(camera_struct("camera", camera)))


def camera_valid_angle(camera: Camera) -> float:
    """The largest angle from the optical axis, in radians, at which the lens model is valid."""
    angle = ctypes.c_double()
    _abi.default_library().call("tv_camera_valid_angle",
                                ctypes.byref(camera_struct("camera", camera)), ctypes.byref(angle))
    return angle.value


def _points(function: str, camera: Camera, name: str, given: np.ndarray, columns: int,
            out_columns: int) -> tuple[np.ndarray, np.ndarray]:
    given = _abi.check_array(name, given, np.float64, columns)
    out = np.empty((len(given), out_columns))
    inside = np.empty(len(given), np.uint8)
    _abi.default_library().call(function, ctypes.byref(camera_struct("camera", camera)),
                                _abi.pointer(given), ctypes.c_int32(len(given)),
                                _abi.pointer(out), _abi.pointer(inside))
    return out, inside.view(bool)


def camera_project_points(camera: Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Projects points (n, 3) float64 of the camera's frame. Returns pixels (n, 2), and a (n,) bool
    array that says which points have a pixel."""
    return _points("tv_camera_project_points", camera, "points", points, 3, 2)


def camera_unproject_points(camera: Camera, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unprojects pixels (n, 2) float64. Returns unit rays (n, 3), and a (n,) bool array that says
    which pixels have a ray."""
    return _points("tv_camera_unproject_points", camera, "pixels", pixels, 2, 3)


def camera_undistort(camera: Camera, pixel: Sequence[float]) -> np.ndarray:
    """The pixel (2 numbers) at which a camera without distortion sees what this camera sees at
    `pixel`."""
    given, out = _abi.small_array("pixel", pixel, 2), np.empty(2)
    _abi.default_library().call("tv_camera_undistort",
                                ctypes.byref(camera_struct("camera", camera)),
                                _abi.pointer(given), _abi.pointer(out))
    return out


def camera_scale(camera: Camera, scale: float) -> Camera:
    """The camera of an image that was resized by the factor `scale`."""
    scaled = _abi.tv_camera()
    _abi.default_library().call("tv_camera_scale", ctypes.byref(camera_struct("camera", camera)),
                                ctypes.c_double(scale), ctypes.byref(scaled))
    return Camera(scaled.width, scaled.height, scaled.fx, scaled.fy, scaled.cx, scaled.cy,
                  CameraModel(scaled.model), tuple(scaled.k))
