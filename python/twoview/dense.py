"""A dense cloud of two images whose motion is known."""

from __future__ import annotations

from ctypes import byref, c_int32, c_size_t
from typing import Any, Optional, Sequence

import numpy as np

from . import _abi
from .camera import Camera, camera_struct
from .options import DenseOptions, to_struct


def densify(image0: np.ndarray, camera0: Camera, image1: np.ndarray, camera1: Camera,
            R: Sequence[Sequence[float]], t: Sequence[float],
            sparse: Optional[np.ndarray] = None, max_points: int = 100000,
            options: Optional[DenseOptions] = None, **keywords: Any) -> np.ndarray:
    """tv_densify: points all over two images whose motion is known.

    image0, image1: (height, width) uint8, read without a copy. camera0, camera1: of each image's
    size; with a TwoView, those of corrected_camera. R: 3x3, a rotation, and t: 3 numbers, not
    zero, of x1 = R x0 + t. sparse: None, or (n,) of twoview.POINT, as reconstruct and triangulate
    give them: they tell the range of depth. max_points: the most points that are returned, spread
    evenly. options: a DenseOptions, or its fields as keywords.
    Returns (n,) of twoview.DENSE_POINT: position (in camera 0's frame, in the unit of t), pixel0,
    pixel1, sigma (of the distance, in the unit of t), similarity (a correlation), grey.
    Raises TypeError or ValueError for an array that C could not read, TV_ERR_CAMERA for an image
    that is not of its camera's size, TV_ERR_ARGUMENT where R is no rotation, t is zero or an option
    is out of its range, TV_ERR_NOT_FINITE for R, t or an option."""
    library = _abi.default_library()
    wanted = to_struct(library, DenseOptions, options, keywords)
    views = (_abi.tv_image * 2)(_abi.check_image("image0", image0),
                                _abi.check_image("image1", image1))
    lenses = [camera_struct("camera0", camera0), camera_struct("camera1", camera1)]
    rotation, translation = _abi.small_array("R", R, 3, 3), _abi.small_array("t", t, 3)
    pair = _abi.camera_pair(lenses[0], lenses[1], rotation, translation)
    known = np.zeros(0, _abi.POINT) if sparse is None else sparse
    known = _abi.check_array("sparse", known, _abi.POINT)
    wanted.sparse, wanted.num_sparse = known.ctypes.data, len(known)
    if not 0 <= max_points < 2**31:
        raise ValueError(f"max_points: {max_points} is out of range")
    size, count = c_size_t(), c_int32()
    library.call("tv_dense_size", byref(lenses[0]), byref(lenses[1]), byref(wanted), byref(size))
    memory = np.empty(size.value + _abi.CONTEXT_ALIGNMENT, np.uint8)
    memory = memory[-memory.ctypes.data % _abi.CONTEXT_ALIGNMENT:]
    points = np.zeros(min(max_points, wanted.max_cells), _abi.DENSE_POINT)
    library.call("tv_densify", _abi.pointer(memory), size, byref(pair), views, byref(wanted),
                 _abi.pointer(points), c_int32(len(points)), byref(count))
    return points[:count.value].copy()
