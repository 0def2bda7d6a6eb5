"""The depth map of an image, from several images whose poses are known (depth_map.h)."""

from __future__ import annotations

from ctypes import addressof, byref, c_int32, c_size_t
from dataclasses import dataclass
from typing import Any, Optional, Sequence

import numpy as np

from . import _abi
from .camera import Camera, camera_struct
from .options import DepthOptions, to_struct


@dataclass(frozen=True)
class DepthMap:
    """What sweep_depth returns, as Room.add takes it."""

    camera: Camera  #: the pinhole on whose pixels the map lies
    distance: np.ndarray  #: (height, width) float32, along the pixel's ray; 0: not known
    sigma: np.ndarray  #: (height, width) float32, of the distance
    witnesses: np.ndarray  #: (height, width) uint8, how many other views show the same there
    grey: np.ndarray  #: (height, width) uint8, the reference image as the camera would see it; 0
    #: beyond its edges, so that it is Room.add's mask as well


def sweep_depth(images: Sequence[np.ndarray], cameras: Sequence[Camera],
                R: Sequence[Sequence[Sequence[float]]], t: Sequence[Sequence[float]],
                options: Optional[DepthOptions] = None, **keywords: Any) -> DepthMap:
    """tv_sweep_depth: the depth of images[0] from all images.

    images: 2 to max_views of (height, width) uint8, all of one size, read without a copy.
    cameras: one for each image. R, t: the pose world_from_cam of each, x_world = R x_cam + t.
    options: a DepthOptions, or its fields as keywords; near_depth and far_depth are required.
    Raises TypeError or ValueError for what C could not read, TV_ERR_CAMERA for an image that is
    not of its camera's size or of another size than the first, TV_ERR_ARGUMENT where an R is no
    rotation, the range is missing, or an option or the number of images is out of its range,
    TV_ERR_NOT_FINITE for an R, a t or an option."""
    library = _abi.default_library()
    wanted = to_struct(library, DepthOptions, options, keywords)
    if not len(images) == len(cameras) == len(R) == len(t) or not len(images):
        raise ValueError("images, cameras, R and t: one of each for each view is expected")
    views = (_abi.tv_depth_view * len(images))()
    lenses = [camera_struct(f"cameras[{i}]", camera) for i, camera in enumerate(cameras)]
    for i, view in enumerate(views):
        view.image = _abi.check_image(f"images[{i}]", images[i])
        view.camera = addressof(lenses[i])
        rotation = _abi.small_array(f"R[{i}]", R[i], 3, 3)
        view.world_from_cam_R[:] = rotation.ravel().tolist()
        view.world_from_cam_t[:] = _abi.small_array(f"t[{i}]", t[i], 3).tolist()
    size, camera = c_size_t(), _abi.tv_camera()
    library.call("tv_depth_size", byref(lenses[0]), byref(wanted), byref(size))
    library.call("tv_depth_map_camera", byref(lenses[0]), byref(wanted), byref(camera))
    memory = np.empty(size.value + _abi.CONTEXT_ALIGNMENT, np.uint8)
    memory = memory[-memory.ctypes.data % _abi.CONTEXT_ALIGNMENT:]
    shape = (camera.height, camera.width)
    distance, sigma = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    witnesses, grey = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
    arrays = _abi.tv_depth_arrays(*(array.ctypes.data
                                    for array in (distance, sigma, witnesses, grey)))
    library.call("tv_sweep_depth", _abi.pointer(memory), size, views, c_int32(len(images)),
                 byref(wanted), byref(arrays))
    pinhole = Camera(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    return DepthMap(pinhole, distance, sigma, witnesses, grey)
