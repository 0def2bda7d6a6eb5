"""Masks of pictures (--mask): the twin of tools/twoview/files/mask_file.cc."""

import os
import sys

import numpy as np

from .errors import BadInput
from .images import decode, shrunk


def load_mask(path):
    """(height, width) bool, True where the mask is not black. Raises BadInput."""
    try:
        pixels = decode(path, keeps_depth=True)
    except BadInput as error:
        raise BadInput(f"--mask: {error}") from None
    if pixels.ndim == 3 and pixels.shape[2] == 4:
        if (pixels[..., 3] < np.iinfo(pixels.dtype).max).any():
            raise BadInput(f"--mask: {path} has transparent pixels: save it without, black where "
                           "it leaves out")
        pixels = pixels[..., :3]
    used = pixels != 0 if pixels.ndim == 2 else (pixels != 0).any(axis=2)
    if not used.any():
        raise BadInput(f"--mask: {path} is black all over, so it leaves nothing of a picture")
    return used


def mask_note(mask, name):
    """A note where the mask leaves nothing out, or more than half; else empty."""
    left_out = 1 - mask.mean()
    if left_out == 0:
        return f"the mask of {name} leaves nothing out: it has no black pixel"
    if left_out < 0.5:
        return ""
    return (f"the mask of {name} leaves {100 * left_out:.3g} % of the picture out: black is what "
            f"is left out, is it inverted?")


class Masks:
    """The mask of every picture: one file that serves all, or a folder with NAME.png (COLMAP's
    a.jpg.png) or STEM.png (a.png) for each picture. Black is left out, anything else is used."""

    def __init__(self, path=""):
        self.path = path
        self._only = None
        self._is_noted = False
        if path and not os.path.exists(path):
            raise BadInput(f"--mask: {path}: no such file or folder")

    def of(self, name, luma):
        """(height, width) bool, True where the picture `name` of these pixels is used; None
        without masks. Raises BadInput as the C++ reader does."""
        if not self.path:
            return None
        file = self.file_of(name)
        mask = self._only if self._only is not None else load_mask(file)
        if file == self.path:
            self._only = mask
        if mask.shape != luma.shape:
            raise BadInput(f"--mask: {file} is {mask.shape[1]}x{mask.shape[0]}, and picture {name} "
                           f"{luma.shape[1]}x{luma.shape[0]}")
        note = mask_note(mask, name)
        if note and not self._is_noted:  # one line, of the first picture
            self._is_noted = True
            print(f"twoview: note: {note}", file=sys.stderr)
        return mask

    def file_of(self, name):
        """The file of the mask of the picture `name`."""
        if not os.path.isdir(self.path):
            return self.path
        file = os.path.basename(name)
        for tried in (name, os.path.splitext(name)[0], file, os.path.splitext(file)[0]):
            candidate = os.path.join(self.path, tried.lstrip("/") + ".png")
            if os.path.isfile(candidate):
                return candidate
        raise BadInput(f"--mask: {self.path} has no mask of {name}: {file}.png or "
                       f"{os.path.splitext(file)[0]}.png")


def shrunk_mask(mask, longer):
    """The mask of the picture that is scaled down: a pixel is used where all under it are."""
    if mask is None or not longer:
        return mask
    return shrunk(np.where(mask, np.uint8(255), np.uint8(0)), longer) == 255
