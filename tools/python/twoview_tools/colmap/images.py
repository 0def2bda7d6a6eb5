"""Reads image files in the same way as the program `twoview`."""

import math
import os
import re

import numpy as np

from ..folders import copies_of, natural_key, second_endings
from ..unread import unread_picture, unread_pictures
from .errors import BadInput

EXTENSIONS = (".jpg", ".jpeg", ".jpe", ".png", ".bmp", ".pgm", ".ppm", ".pnm", ".pbm", ".tif",
              ".tiff", ".webp", ".jp2")
#: the note on files of which holds_more is true
MORE = ("there are files that hold several pictures (pages of a TIFF, frames of an animation): the "
        "first of each is used")
_BLOCK = 8  # pixels a side, over which the brightness of possible copies is averaged


def list_images(folder):
    """(the names of the files with one of EXTENSIONS below a folder in their natural order; [(name,
    why)] of the pictures that are left out: hidden files, formats that are not read, second
    pictures of a name and copies; a note on names, or ""). As in COLMAP, / separates folders."""
    if not os.path.isdir(folder):
        raise BadInput(f"{folder}: no such folder")
    names = sorted((os.path.relpath(os.path.join(root, file), folder).replace(os.sep, "/")
                    for root, _, files in os.walk(folder) for file in files), key=natural_key)
    pictures = [name for name in names if name.lower().endswith(EXTENSIONS)]
    left_out = {name: "is a hidden file (its name begins with a dot)" for name in pictures
                if any(part.startswith(".") for part in name.split("/"))}
    for name in second_endings([name for name in pictures if name not in left_out], EXTENSIONS):
        left_out[name] = "has the name of another picture, but for the ending"
    copies, note = copies_of(folder, [name for name in pictures if name not in left_out],
                             _correlation)
    for name in copies:
        left_out[name] = "is a copy of another picture, by its name and its look"
    return ([name for name in pictures if name not in left_out],
            list(left_out.items()) + unread_pictures(folder, names), note)


def _correlation(path, other):
    """The correlation of two pictures' brightness in blocks, as in tools/twoview/files/copies.cc;
    -1 where they cannot be compared."""
    import cv2
    blocks = []
    for file in (path, other):
        try:
            luma = read_luma(file)
        except BadInput:
            return -1
        size = [max(1, side // _BLOCK) for side in luma.shape[::-1]]
        blocks.append(cv2.resize(luma, size, interpolation=cv2.INTER_AREA).astype(float))
    if blocks[0].shape != blocks[1].shape:
        return -1
    deviations = [block - block.mean() for block in blocks]
    sigmas = [math.sqrt((deviation * deviation).mean()) for deviation in deviations]
    if 0 in sigmas:
        return 1 if sigmas[0] == sigmas[1] else -1
    return float((deviations[0] * deviations[1]).mean() / (sigmas[0] * sigmas[1]))


def _white(path):
    """The largest sample of a binary PNM file, or of one of 16 bits, by its header; 0 for other
    files, and for numbers of 8 bits, which OpenCV scales itself."""
    with open(path, "rb") as file:
        head = file.read(4096)
    if head[:2] not in (b"P2", b"P3", b"P5", b"P6"):
        return 0
    words = re.sub(rb"#[^\n]*", b"", head[2:]).split(None, 3)
    white = int(words[2]) if len(words) > 2 and words[2].isdigit() else 0
    return white if white > 255 or head[1:2] in b"56" else 0


def _panorama(path):
    """What a JPEG panorama's XMP says of its projection, such as "equirectangular"; else ""."""
    with open(path, "rb") as file:
        head = file.read(1 << 17)
    if head[:3] != b"\xff\xd8\xff":
        return ""
    found = re.search(rb"ns\.adobe\.com/xap/1\.0/\0.*?GPano:ProjectionType[\s=\"'>]+(\w+)", head,
                      re.DOTALL)
    return found[1].decode() if found and found[1] != b"rectilinear" else ""


def _to_8_bits(image, low, high):
    """Samples so that `low` becomes 0 and `high` 255, rounded; beyond them they are cut off."""
    above = np.clip(image.astype(np.int64) - low, 0, high - low)
    return ((510 * above + high - low) // (2 * (high - low))).astype(np.uint8)


def decode(path, keeps_depth=False):
    """Decodes to 8 bits (or 16, where the file has them and `keeps_depth`) and 1, 3 (BGR) or 4
    (BGRA) channels, with the pixels as they are stored; samples of 16 bits become 8 by the rule of
    tools/twoview/files/image_file.h."""
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
                       f"image {path} is no image that OpenCV reads")
    if panorama := _panorama(path):
        raise BadInput(f"image {path} is a panorama ({panorama}, by its XMP), and no camera here "
                       "describes it: cut flat views out of it")
    white = _white(path)
    if image.dtype == np.uint8 and 0 < white < 255:
        image = _to_8_bits(image, 0, white)
    if image.dtype == np.uint16 and not keeps_depth:
        white = white if 255 < white < 65535 else 65535
        ordered = np.sort(image, axis=None)
        low, high = (int(ordered[max(1, -(-per_mille * ordered.size // 1000)) - 1])
                     for per_mille in (5, 995))
        stretches = high > low and 2 * (high - low) < white
        image = _to_8_bits(image, *((low, high) if stretches else (0, white)))
    if image.dtype not in (np.uint8, np.uint16):
        raise BadInput(f"image {path}: samples of {image.dtype}, not of 8 or 16 bits")
    if image.ndim == 3 and image.shape[2] not in (3, 4):
        raise BadInput(f"image {path}: {image.shape[2]} channels, not 1, 3 or 4")
    return image


def _tiff_pages(data):
    """The number of a TIFF file's pages but for previews and masks."""
    order = "big" if data[:1] == b"M" else "little"

    def number(at, count):
        return int.from_bytes(data[at:at + count], order)
    pages, at, seen = 0, number(4, 4), set()
    while at and at < len(data) and at not in seen:
        seen.add(at)
        count = number(at, 2)
        values = {number(entry, 2): number(entry + 8, 2 if number(entry + 2, 2) == 3 else 4)
                  for entry in range(at + 2, at + 2 + 12 * count, 12)}
        # Tag 254, NewSubfileType: 1 is a reduced picture, 4 a mask; tag 256 is the width.
        pages += not values.get(254, 0) & 5 and values.get(256, 0) > 0
        at = number(at + 2 + 12 * count, 4)
    return pages


def holds_more(path):
    """Whether a file holds more pictures than the one that is read: pages of a TIFF, frames of an
    animated PNG or WebP. The rule is that of tools/twoview/files/image_header.cc."""
    with open(path, "rb") as file:
        head = file.read(4096)
        if head[:4] in (b"II*\0", b"MM\0*"):
            return _tiff_pages(head + file.read()) > 1
        if head[:8] == b"\x89PNG\r\n\x1a\n":
            at = head.find(b"acTL")
            return at > 0 and int.from_bytes(head[at + 4:at + 8], "big") > 1
        # Of an animated WebP the flag 2 of its first chunk, VP8X, is set.
        return head[:4] == b"RIFF" and head[8:16] == b"WEBPVP8X" and bool(head[20] & 2)


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
