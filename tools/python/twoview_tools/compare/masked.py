"""Masks of the compared images (--mask), at the size at which these are compared."""

import functools
import os

import numpy as np

from ..colmap.masks import load_mask


@functools.lru_cache(maxsize=4)
def used_pixels(mask, shape):
    """(height, width) bool of an image of this shape, by the mask's file; None without one. Of an
    image that was scaled down a pixel is used where all under it are."""
    if not mask:
        return None
    import cv2
    used = np.where(load_mask(mask), np.uint8(255), np.uint8(0))
    return cv2.resize(used, shape[::-1], interpolation=cv2.INTER_AREA) == 255


def kept_by_mask(points, used):
    """(n,) bool: which points (n, 2) lie on pixels that are used; all where `used` is None."""
    if used is None or not len(points):
        return np.ones(len(points), bool)
    x, y = (np.clip(np.rint(points[:, k]).astype(int), 0, used.shape[1 - k] - 1) for k in (0, 1))
    return used[y, x]


def write_masks(folder, used):
    """Writes masks as COLMAP looks for them, NAME.png. used: {name: (height, width) bool or None}.
    Returns the folder, "" where there are none."""
    import cv2
    used = {name: mask for name, mask in used.items() if mask is not None}
    if not used:
        return ""
    os.mkdir(folder)
    for name, mask in used.items():
        cv2.imwrite(os.path.join(folder, name + ".png"), np.where(mask, np.uint8(255), np.uint8(0)))
    return folder
