"""Camera models: from pixels to rays and back (camera.h). Pixel (0, 0) is the centre of the
top-left pixel."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any, NamedTuple, Optional, Sequence, overload

import numpy as np
from numpy.typing import ArrayLike

from . import _abi
from .enums import CameraModel, Refine

SHORTEST_FOCAL = 0.02  # of the image's side: 176 degrees of a pinhole; below it is another unit
FARTHEST_CENTER = 1.0  # image sides that the principal point may lie outside the image
# tools/twoview/files/camera_doubts.cc has the same numbers.
NEAR_MIDDLE, FAR_FROM_MIDDLE = 0.05, 0.08  # of a principal point, as shares of the image's side
SAME_FOCAL, OTHER_FOCAL = 0.05, 0.1  # differences of fx and fy as shares


class Calibration(NamedTuple):
    """tv_calibration: how uncertain the calibration of a camera is, and what of it may be refined.
    Calibration() is that of an exact camera; read_calibration reads one from a file."""

    focal_sigma: float = 0.0  #: relative standard deviation of the focal length, [0, 0.5]
    #: Standard deviation of the principal point, in focal lengths: [0, 0.5], and at most 0.1 where
    #: it may be refined.
    center_sigma: float = 0.0
    refine: int = Refine.NOTHING  #: a Refine


@dataclass(frozen=True, eq=False, init=False)
class Camera:
    """tv_camera: a camera's intrinsics. Two cameras are equal when the library sees the same
    numbers: zeros at the end of k make no difference. read_camera makes one from a file.

    Camera(width, height, fx, fy, cx, cy, model, k), or Camera(K) of a 3x3 matrix, with `size`,
    (width, height), and `distortion`, OpenCV's coefficients: at most 8, of BROWN_CONRADY unless
    `model` is another. Without `size` the image is as large as if its centre were the principal
    point."""

    width: int  #: of the image, pixels
    height: int  #: of the image, pixels
    fx: float  #: focal length along x, pixels
    fy: float  #: focal length along y, pixels
    cx: float  #: principal point, pixels; (0, 0) is the centre of the top-left pixel
    cy: float
    model: int = CameraModel.PINHOLE  #: a CameraModel, of the lens
    #: Coefficients without a unit, at most 8: k1 k2 p1 p2 k3 k4 k5 k6 of BROWN_CONRADY, k1 k2 k3 k4
    #: of KANNALA_BRANDT, none of a PINHOLE. Those that are left out are 0.
    k: Sequence[float] = ()

    @overload
    def __init__(self, width: int, height: int, fx: float, fy: float, cx: float, cy: float,
                 model: int = ..., k: Sequence[float] = ...) -> None: ...

    @overload
    def __init__(self, width: Any, *, size: Optional[Sequence[int]] = ...,
                 distortion: Any = ..., model: Optional[int] = ...) -> None: ...

    def __init__(self, width: Any, height: Any = None, fx: Any = None, fy: Any = None,
                 cx: Any = None, cy: Any = None, model: Any = None, k: Any = (), *,
                 size: Any = None, distortion: Any = ()) -> None:
        if np.ndim(width) != 0:
            if any(value is not None for value in (height, fx, fy, cx, cy)) or len(k):
                raise TypeError("Camera(K): the matrix has the focal lengths and the principal "
                                "point; give size=(width, height) and distortion= beside it")
            width, height, fx, fy, cx, cy = _of_matrix(width, size)
            k = np.ravel(distortion).tolist()
            while k and k[-1] == 0:
                k.pop()
            if model is None and k:
                model = CameraModel.BROWN_CONRADY
            if len(k) > 8:
                raise ValueError(f"distortion: {len(k)} coefficients, of which at most 8 are not 0 "
                                 "(no thin prism and no tilted sensor)")
        else:
            missing = [name for name, value in (("height", height), ("fx", fx), ("fy", fy),
                                                ("cx", cx), ("cy", cy)) if value is None]
            if missing:
                raise TypeError(f"Camera: {', '.join(missing)} missing; Camera(K) takes a 3x3 "
                                "matrix")
            if size is not None or len(np.ravel(distortion)):
                raise TypeError("Camera: size and distortion are of Camera(K); here they are "
                                "width, height and k")
        if not isinstance(k, tuple):  # a list or an array has no hash
            k = tuple(float(value) for value in k)
        if model is None:
            model = CameraModel.PINHOLE
        for name, value in (("width", width), ("height", height), ("fx", fx), ("fy", fy),
                            ("cx", cx), ("cy", cy), ("model", model), ("k", k)):
            object.__setattr__(self, name, value)

    def _key(self) -> tuple[object, ...]:
        k = list(self.k)
        while k and k[-1] == 0:
            k.pop()
        return (self.width, self.height, self.fx, self.fy, self.cx, self.cy, int(self.model), *k)

    def __eq__(self, other: object) -> bool:
        return self._key() == other._key() if isinstance(other, Camera) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._key())

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

    def scaled(self, width: int, height: int) -> Camera:
        """The camera of the same picture at another size, as --scale-camera makes it: on each axis,
        with s = new size / old size, f' = s f and c' = s (c + 0.5) - 0.5.

        width, height: of the picture, pixels.
        Returns a Camera. Raises ValueError for another shape (a crop), where no scale gives both
        sides to within a pixel, and for a side below 1."""
        if width < 1 or height < 1:
            raise ValueError(f"{width}x{height} is no size of a picture")
        if (abs(height - width * self.height / self.width) >= 1
                and abs(width - height * self.width / self.height) >= 1):
            raise ValueError(f"{width}x{height} has not the shape of this camera's "
                             f"{self.width}x{self.height}: a crop, or another mode of the sensor, "
                             "has a camera of its own")
        sx, sy = width / self.width, height / self.height
        return Camera(width, height, sx * self.fx, sy * self.fy, sx * (self.cx + 0.5) - 0.5,
                      sy * (self.cy + 0.5) - 0.5, self.model, self.k)


def _of_matrix(matrix: Any, size: Any) -> tuple[int, int, float, float, float, float]:
    """width, height, fx, fy, cx and cy of K. Raises ValueError that names what K is not."""
    K = np.asarray(matrix, np.float64)
    if K.shape != (3, 3):
        raise ValueError(f"K: shape (3, 3) is expected, not {K.shape}")
    if not np.isfinite(K).all():
        raise ValueError("K: a number is not finite")
    if K[1, 0] != 0 or K[2].tolist() != [0, 0, 1]:
        raise ValueError("K: not [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
    if K[0, 1] != 0:
        raise ValueError("K: skew, which is not supported")
    if not (K[0, 0] > 0 and K[1, 1] > 0):
        raise ValueError("K: a focal length that is not above 0")
    if size is None:
        size = [round(2 * center + 1) for center in K[:2, 2]]
        if min(size) < 1:
            raise ValueError("K: the principal point is not in an image; give size=(width, height)")
    if np.shape(size) != (2,):
        raise ValueError(f"size: (width, height) is expected, not {size!r}")
    for side, focal, center, axis in zip(size, (K[0, 0], K[1, 1]), K[:2, 2], "xy"):
        if focal < SHORTEST_FOCAL * side:
            raise ValueError(f"K: f{axis} is {focal:g} pixels for an image of {side}: is it in "
                             "another unit, as a normalised matrix is?")
        if not -FARTHEST_CENTER * side <= center <= (1 + FARTHEST_CENTER) * side:
            raise ValueError(f"K: c{axis} is {center:g}, far outside an image of {side} pixels")
    question = exchanged(size, (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))
    if question:
        raise ValueError(f"K: {question}")
    return (int(size[0]), int(size[1]), float(K[0, 0]), float(K[1, 1]), float(K[0, 2]),
            float(K[1, 2]))


def exchanged(size: Sequence[int], K: Sequence[float]) -> str:
    """The question whether fx fy cx cy are in another order, where they fit an image of this size
    so and not as they are; else empty."""
    def off_middle(x: float, y: float) -> list[float]:
        return [abs((center + 0.5) / side - 0.5) for center, side in zip((x, y), size)]

    def is_middle(x: float, y: float) -> bool:
        return max(off_middle(x, y)) <= NEAR_MIDDLE

    def is_same(a: float, b: float, share: float) -> bool:
        return abs(a / b - 1) <= share

    fx, fy, cx, cy = K
    is_x_far, is_y_far = (off > FAR_FROM_MIDDLE for off in off_middle(cx, cy))
    question = ""
    if is_x_far and is_y_far and is_middle(cy, cx):
        question = ("are cx and cy exchanged, is this camera of a turned picture, or its size "
                    "[rows, columns] (MATLAB's)?")
    elif is_same(fx, fy, OTHER_FOCAL):
        pass
    elif (is_x_far or is_y_far) and is_middle(fx, fy) and cy and is_same(cx, cy, SAME_FOCAL):
        question = "are fx and cx, fy and cy exchanged?"
    elif is_x_far and is_middle(fy, cy) and cx and is_same(fx, cx, SAME_FOCAL):
        question = "are fy and cx exchanged?"
    return question and (f"fx {fx:g}, fy {fy:g}, cx {cx:g}, cy {cy:g} for an image of "
                         f"{size[0]}x{size[1]}: {question}")


def camera_struct(name: str, camera: Any) -> Any:
    if isinstance(camera, _abi.tv_camera):
        return camera
    if not isinstance(camera, Camera):
        raise TypeError(f"{name}: a twoview.Camera is expected, not {type(camera).__name__}")
    return camera._struct()


def camera_check(camera: Camera) -> None:
    """tv_camera_check: returns None for intrinsics that the library accepts.

    camera: of any model.
    Raises TV_ERR_CAMERA for intrinsics that every function refuses: a side below 1 pixel, a focal
    length that is not above 0, a number that is not finite, another model; ValueError for more
    than 8 coefficients; TypeError for anything but a Camera."""
    _abi.default_library().call("tv_camera_check", ctypes.byref(camera_struct("camera", camera)))


def camera_valid_angle(camera: Camera) -> float:
    """tv_camera_valid_angle: the largest angle from the optical axis, in radians, at which the lens
    model is valid.

    camera: of any model. Raises TV_ERR_CAMERA as camera_check does."""
    angle = ctypes.c_double()
    _abi.default_library().call("tv_camera_valid_angle",
                                ctypes.byref(camera_struct("camera", camera)), ctypes.byref(angle))
    return angle.value


def _points(function: str, camera: Camera, name: str, given: ArrayLike, columns: int,
            out_columns: int) -> tuple[np.ndarray, np.ndarray]:
    given = _abi.check_array(name, given, np.float64, columns)
    out = np.empty((len(given), out_columns))
    inside = np.empty(len(given), np.uint8)
    _abi.default_library().call(function, ctypes.byref(camera_struct("camera", camera)),
                                _abi.pointer(given), ctypes.c_int32(len(given)),
                                _abi.pointer(out), _abi.pointer(inside))
    return out, inside.view(bool)


def camera_project_points(camera: Camera, points: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """tv_camera_project_points: where the camera sees points.

    camera: of any model. points: (n, 3) float64 in the camera's frame, of any unit (x right, y
    down, z forward).
    Returns the pixels (n, 2) float64, and a (n,) bool array that is True for a point that has a
    pixel.
    Raises TypeError for another dtype, ValueError for another shape, TV_ERR_CAMERA."""
    return _points("tv_camera_project_points", camera, "points", points, 3, 2)


def camera_unproject_points(camera: Camera, pixels: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """tv_camera_unproject_points: the directions in which the camera sees pixels.

    camera: of any model. pixels: (n, 2) float64, distorted as in the image.
    Returns unit rays (n, 3) float64 in the camera's frame, and a (n,) bool array that is True for a
    pixel that has a ray.
    Raises TypeError for another dtype, ValueError for another shape, TV_ERR_CAMERA."""
    return _points("tv_camera_unproject_points", camera, "pixels", pixels, 2, 3)


def camera_undistort(camera: Camera, pixel: Sequence[float]) -> np.ndarray:
    """tv_camera_undistort: the pixel (2,) float64 at which a pinhole camera with the same fx, fy,
    cx and cy sees what this camera sees at `pixel`.

    camera: of any model. pixel: 2 numbers, distorted as in the image.
    Raises TV_ERR_OUTSIDE where the lens model is not valid at the pixel, or its ray lies 90 degrees
    and more from the axis; TV_ERR_NOT_FINITE; TV_ERR_CAMERA; ValueError for another shape."""
    given, out = _abi.small_array("pixel", pixel, 2), np.empty(2)
    _abi.default_library().call("tv_camera_undistort",
                                ctypes.byref(camera_struct("camera", camera)),
                                _abi.pointer(given), _abi.pointer(out))
    return out


def camera_scale(camera: Camera, scale: float) -> Camera:
    """tv_camera_scale: the Camera of an image that was resized by the factor `scale`: f' = s f, c'
    = s (c + 0.5) - 0.5, width and height rounded.

    camera: of any model. scale: without a unit, in (0, 16]; 0.5 is the camera of the half picture.
    Raises TV_ERR_ARGUMENT or TV_ERR_NOT_FINITE for another scale or a result that is no camera,
    and TV_ERR_CAMERA."""
    scaled = _abi.tv_camera()
    _abi.default_library().call("tv_camera_scale", ctypes.byref(camera_struct("camera", camera)),
                                ctypes.c_double(scale), ctypes.byref(scaled))
    return Camera(scaled.width, scaled.height, scaled.fx, scaled.fy, scaled.cx, scaled.cy,
                  CameraModel(scaled.model), tuple(scaled.k))
