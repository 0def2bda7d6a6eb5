"""Image and CompressedImage as the bytes of an image file, without loss. Raw pictures become PGM
and PPM, whose bytes are the message's own; compressed ones keep the file that they hold."""

import re
import struct

import numpy as np

from . import BadInput
from .messages import Damaged

# {encoding: (type of a sample, samples a pixel, which of them are red, green, blue; () for grey)}
PLAIN = {
    "mono8": ("u1", 1, ()), "8UC1": ("u1", 1, ()), "mono16": ("u2", 1, ()), "16UC1": ("u2", 1, ()),
    "rgb8": ("u1", 3, (0, 1, 2)), "bgr8": ("u1", 3, (2, 1, 0)), "8UC3": ("u1", 3, (2, 1, 0)),
    "rgba8": ("u1", 4, (0, 1, 2)), "bgra8": ("u1", 4, (2, 1, 0)), "8UC4": ("u1", 4, (2, 1, 0)),
    "rgb16": ("u2", 3, (0, 1, 2)), "bgr16": ("u2", 3, (2, 1, 0)), "16UC3": ("u2", 3, (2, 1, 0)),
    "rgba16": ("u2", 4, (0, 1, 2)), "bgra16": ("u2", 4, (2, 1, 0)), "16UC4": ("u2", 4, (2, 1, 0))}
# ROS names the first two pixels of the first two rows, OpenCV those at (1, 1).
BAYER = {"rggb": "BG", "bggr": "RG", "gbrg": "GR", "grbg": "GB"}
# Both orders of 4:2:2, under ROS 1's and ROS 2's names.
YUV = {"yuv422": "UYVY", "uyvy": "UYVY", "yuv422_yuy2": "YUY2", "yuyv": "YUY2"}
READ = ("mono8, mono16, rgb8, bgr8, rgba8, bgra8, the same of 16 bits, bayer, uyvy (yuv422), yuyv "
        "(yuv422_yuy2), 8UC1, 8UC3, 8UC4, 16UC1")
# The first bytes of files that the program reads.
FILES = ((b"\xff\xd8\xff", ".jpg"), (b"\x89PNG\r\n\x1a\n", ".png"), (b"BM", ".bmp"),
         (b"II*\0", ".tif"), (b"MM\0*", ".tif"))
DEPTH_HEADER_BYTES = 12  # of compressedDepth: the kind of coding and two floats


def is_depth(message):
    """Whether these pictures are depths, by the encoding alone."""
    name = message.format if hasattr(message, "format") else message.encoding
    return "compressedDepth" in name or name.split(";")[0].strip() in ("16UC1", "32FC1")


def opencv():
    """The package cv2, which only mosaics and YUV need."""
    try:
        import cv2
    except ImportError:
        raise ImportError("bayer and yuv pictures need OpenCV", name="cv2") from None
    return cv2


def _pnm(pixels):
    """(ending, buffers) of pixels (h, w) or (h, w, 3), red first, 8 or 16 bits."""
    kind, most = ("P5" if pixels.ndim == 2 else "P6"), np.iinfo(pixels.dtype).max
    if pixels.itemsize == 2:
        pixels = pixels.astype(">u2", copy=False)
    head = f"{kind}\n{pixels.shape[1]} {pixels.shape[0]}\n{most}\n".encode()
    return (".pgm" if kind == "P5" else ".ppm"), (head, np.ascontiguousarray(pixels).data)


def _rows(message, kind, samples):
    """The samples (h, w * samples) of an Image, whose rows may be longer than their pixels."""
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    height, width = int(message.height), int(message.width)
    row_bytes, data = width * samples * dtype.itemsize, np.asarray(message.data, np.uint8)
    if width == 0 or height == 0:
        raise Damaged("has a picture of no pixels")
    step = int(message.step) or row_bytes
    if step < row_bytes:
        raise Damaged(f"has rows of {step} bytes, which {width} pixels of {message.encoding} do "
                      "not fit into")
    if len(data) < step * (height - 1) + row_bytes:
        raise Damaged(f"has {len(data)} bytes for {height} rows of {step}")
    rows = np.lib.stride_tricks.as_strided(data, (height, row_bytes), (step, 1), writeable=False)
    return np.ascontiguousarray(rows).view(dtype) if dtype.itemsize > 1 else rows


def _bayer(mosaic, pattern):
    cv2 = opencv()
    mosaic = np.ascontiguousarray(mosaic, mosaic.dtype.newbyteorder("="))
    return cv2.cvtColor(mosaic, getattr(cv2, f"COLOR_Bayer{BAYER[pattern]}2RGB"))


def encode(message):
    """(ending, buffers, (width, height)) of an Image. Damaged where its size does not fit, BadInput
    for an encoding that is not read."""
    name = message.encoding
    if name in PLAIN:
        kind, samples, colours = PLAIN[name]
        pixels = _rows(message, kind, samples)
        if colours:
            pixels = pixels.reshape(len(pixels), -1, samples)
            if colours != tuple(range(samples)):
                pixels = pixels[:, :, list(colours)]
    elif (bayer := re.fullmatch("bayer_(rggb|bggr|gbrg|grbg)(8|16)", name)) is not None:
        pixels = _bayer(_rows(message, "u2" if bayer[2] == "16" else "u1", 1), bayer[1])
    elif name in YUV:
        cv2 = opencv()
        if message.width % 2:
            raise Damaged(f"has an odd width of {message.width}, which {name} cannot have")
        rows = _rows(message, "u1", 2)
        pixels = cv2.cvtColor(np.ascontiguousarray(rows).reshape(len(rows), -1, 2),
                              getattr(cv2, f"COLOR_YUV2RGB_{YUV[name]}"))
    else:
        raise BadInput(f"pictures of the encoding '{name}' are not read ({READ} are)")
    return (*_pnm(pixels), (int(message.width), int(message.height)))


def _size(data, ending):
    """(width, height) by the header of a JPEG or PNG; None where it does not tell."""
    if ending == ".png" and len(data) >= 24:
        return struct.unpack_from(">II", data, 16)
    at = 2
    while ending == ".jpg" and at + 9 <= len(data) and data[at] == 0xff:
        marker, length = struct.unpack_from(">BH", data, at + 1)
        if 0xc0 <= marker <= 0xcf and marker not in (0xc4, 0xc8, 0xcc):
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        at += 1 if marker == 0xff else 2 + length
    return None


def encode_compressed(message):
    """As encode, of a CompressedImage; the size is None where the file's header does not tell."""
    about, data = message.format, memoryview(np.asarray(message.data, np.uint8))
    if "compressedDepth" in about:
        if not about.startswith("16UC1"):
            raise BadInput(f"pictures of the format '{about}' are not read (16UC1; compressedDepth "
                           "and files of pictures are)")
        data = data[DEPTH_HEADER_BYTES:]
    head = bytes(data[:16])
    ending = next((ending for magic, ending in FILES if head.startswith(magic)), None)
    if ending is None and head[:4] == b"RIFF" and head[8:12] == b"WEBP":
        ending = ".webp"
    if ending is None:
        if len(data) == 0:
            raise Damaged("has a picture of no bytes")
        raise BadInput(f"pictures of the format '{about}' that begin with {head[:8].hex(' ')} are "
                       "not read (JPEG, PNG, BMP, TIFF and WebP are)")
    bayer = re.match("bayer_(rggb|bggr|gbrg|grbg)", about)
    if bayer is not None and "bgr" not in about.partition("compressed")[2]:
        cv2 = opencv()
        mosaic = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        if mosaic is None:
            raise Damaged("has a picture that is cut or damaged")
        if mosaic.ndim == 2:
            return (*_pnm(_bayer(mosaic, bayer[1])), mosaic.shape[::-1])
    return ending, (data,), _size(data, ending)
