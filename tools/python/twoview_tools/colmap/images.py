"""Reads image files in the same way as the program `twoview`."""

import math
import os

import numpy as np

from ..unread import left_out, unread_picture
from .errors import BadInput

EXTENSIONS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm", ".webp")


def list_images(folder):
    """(the names of the files with one of EXTENSIONS below a folder, sorted, without hidden ones; a
    line on pictures of formats that are not read, or ""). As in COLMAP, / separates folders."""
    if not os.path.isdir(folder):
        raise BadInput(f"{folder}: no such folder")
    names = sorted(os.path.relpath(os.path.join(root, file), folder).replace(os.sep, "/")
                   for root, _, files in os.walk(folder) for file in files
                   if not file.startswith("."))
    return [name for name in names if name.lower().endswith(EXTENSIONS)], left_out(folder, names)


def decode(path, keeps_depth=False):
    """Decodes to 8 bits (or 16, where the file has them and `keeps_depth`) and 1, 3 (BGR) or 4
    (BGRA) channels, with the pixels as they are stored."""
    # OpenCV reads this variable when it is imported: OFF, so that only our own error line is
    # printed.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "OFF")
    import cv2
    if not os.path.isfile(path):
        raise BadInput(f"image {path}: no such file")
    try:
        image = cv2.imread(path, cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None:
        unread = unread_picture(path)
        raise BadInput(f"image {path} {unread}" if unread else
                       f"image {path}: not an image that OpenCV reads")
    if image.dtype == np.uint16 and not keeps_depth:  # samples are divided by 257 and rounded
        image = ((image.astype(np.uint32) + 128) // 257).astype(np.uint8)
    if image.dtype not in (np.uint8, np.uint16):
        raise BadInput(f"image {path}: samples of {image.dtype}, not of 8 or 16 bits")
    if image.ndim == 3 and image.shape[2] not in (3, 4):
        raise BadInput(f"image {path}: {image.shape[2]} channels, not 1, 3 or 4")
    return image


def shrunk_size(width, height, longer):
    """The size of an image whose longer side is scaled down to `longer`, as the program's --resize
    does: never up, 0 leaves it, and the other side is rounded to whole pixels."""
    if not 0 < longer < max(width, height):
        return width, height
    scale = longer / max(width, height)
    return tuple(max(1, math.floor(side * scale + 0.5)) for side in (width, height))


def shrunk(image, longer):
    """The image, scaled down by area averaging so that its longer side is `longer`."""
    size = shrunk_size(image.shape[1], image.shape[0], longer)
    if size == (image.shape[1], image.shape[0]):
        return image
    import cv2
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def read_luma(path):
    """The luma, (height, width) uint8: 0.299 R + 0.587 G + 0.114 B."""
    image = decode(path)
    if image.ndim == 3:
        import cv2
        image = cv2.cvtColor(image, {3: cv2.COLOR_BGR2GRAY, 4: cv2.COLOR_BGRA2GRAY}[image.shape[2]])
    return np.ascontiguousarray(image)


def read_rgb(path):
    """Reads an image as RGB, (height, width, 3) uint8."""
    image = decode(path)
    return np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else image[..., 2::-1]
