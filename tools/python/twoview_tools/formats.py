"""The Python tools' reader of pairs files and of camera files, for which it calls the package
(twoview.camera_files).

The program's readers are tools/twoview's pairs_file.cc, camera_file.cc and yaml_values.cc. Both
languages read the cases of test/formats and must accept, refuse and choose alike
(test/python/test_formats.py, test/cli/test_formats.cc).

Numbers. A number is decimal, with an optional sign, point and exponent (`-5`, `.5`, `5.`, `1e-3`).
It must be finite and within a double's range; hexadecimal, octal, `1_000` and `yes` are no numbers.

pairs.txt, PAIRS.txt. A line holds name0 name1 [rot0 rot1 [K0(9) K1(9) [T_0to1(16)]]]: 2, 4, 22 or
38 fields with white space between them. Blank lines are skipped, and so are lines whose first
character after white space is "#". Lines end with LF or CR LF; a byte order mark is skipped. `rot`
is a number of whole quarter turns counter-clockwise, read modulo 4. K is [fx 0 cx 0 fy cy 0 0 1]
with positive focal lengths. T is [R t; 0 0 0 1]; R is replaced by the nearest rotation, of which no
element may differ by more than 0.01, and det R must be positive (rotations.made_rotation). A file
without a pair is refused. The message for a refused line has the line's number.

Camera file. docs/formats.md states the formats and their entries. A name that is not known and may
concern the lens is refused; others are left out. A lens of Brown and Conrady whose coefficients are
all 0 is a pinhole. If a matrix gives
rows and cols, their product must equal its number of values. A file without a camera is refused.

YAML. The first document of a file is read, as a map. A name given twice and an alias are refused.

Which entry serves an image (choose_entry):
1. One entry serves every image.
2. Of several entries, the one whose name is a prefix of the image's file name, without its folders.
   If there are several such names, the longest is chosen (cam10 before cam1).
3. Else the entry whose fx and cx equal those of the pair line's K to a relative error of 1e-6. If
   such entries differ in any number the choice is ambiguous, and the image is refused.
4. Else none serves it, and the image is refused.
"""

import math
import os
import re
import sys
import warnings
from dataclasses import dataclass
from typing import Optional

import numpy as np
from twoview import camera_files
from twoview.camera import exchanged

from .rotations import made_rotation

MAX_PAIRS_BYTES = 64 << 20
FIELD_COUNTS = (2, 4, 22, 38)
# tools/twoview/files/camera_doubts.cc has the reasons for these.
OTHER_SCALE, SAME_SCALE, SAME_INTRINSICS = 1.15, 0.1, 0.1
SAME_K = 1e-6  # relative; a larger difference means that K and a camera are not the same
# A file that is refused. The message is one line that names the file and the error in it.
FormatError = camera_files.FormatError

_BLANK = " \t\r\v\f"


@dataclass(frozen=True)
class Camera:
    """A camera as its file describes it. k holds the model's coefficients, at most 8; it is empty
    for a pinhole."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    model: str = "pinhole"  # the lens: pinhole, brown_conrady or kannala_brandt
    k: tuple = ()


@dataclass(frozen=True)
class Pair:
    """A line of a pairs file. A value that the line does not have is None, except turns, which are
    then (0, 0)."""

    name0: str
    name1: str
    number: int  # the line's number in the file, from 1
    text: str  # the line's fields, joined by one space
    turns: tuple = (0, 0)  # quarter turns of image 0 and 1 counter-clockwise, 0 to 3
    K0: Optional[np.ndarray] = None
    K1: Optional[np.ndarray] = None
    R: Optional[np.ndarray] = None  # true pose: x1 = R x0 + t
    t: Optional[np.ndarray] = None


# ---- pairs -------------------------------------------------------------------------------------

def _field(text):
    try:
        return camera_files.parse_number(text)
    except FormatError as error:
        raise FormatError(f"'{text}' {error}") from None


MOST_TURNS = 45  # nobody turns a picture so often: such a number is one of degrees


def _turns(text):
    value = _field(text)
    if value != math.floor(value) or abs(value) > 1e6:
        raise FormatError(f"'{text}' is no number of quarter turns")
    if abs(value) >= MOST_TURNS:
        raise FormatError(f"'{text}' is no number of quarter turns (1 is 90 degrees)")
    return int(value) & 3


def _matrix(name, fields):
    K = np.array([_field(field) for field in fields]).reshape(3, 3)
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        raise FormatError(f"{name} has a focal length that is not above 0")
    if K[0, 1]:
        raise FormatError(f"{name} has skew, which is not supported")
    if K[1, 0] or K[2].tolist() != [0, 0, 1]:
        raise FormatError(f"{name} is not [fx 0 cx 0 fy cy 0 0 1]")
    if max(K[0, 0], K[1, 1]) < 20 and np.abs(K[:2, 2]).max() <= 2:
        raise FormatError(f"{name} is normalised: pixels are needed")
    return K


def _motion(fields):
    T = np.array([_field(field) for field in fields]).reshape(4, 4)
    try:
        R = made_rotation(T[:3, :3], "T_0to1")
    except ValueError as error:
        raise FormatError(str(error)) from None
    if T[3].tolist() != [0, 0, 0, 1]:
        raise FormatError("the last row of T_0to1 is not 0 0 0 1")
    return R, T[:3, 3]


def parse_pair(line, number=1):
    """Parses a line of a pairs file. `number` is the line's number in the file."""
    fields = re.split(f"[{_BLANK}]+", line.strip(_BLANK))
    if len(fields) not in FIELD_COUNTS:
        raise FormatError(f"{len(fields)} fields, not 38 (name0 name1 rot0 rot1 K0 K1 T_0to1)")
    found = {}
    if len(fields) >= 4:
        found["turns"] = _turns(fields[2]), _turns(fields[3])
    if len(fields) >= 22:
        found["K0"], found["K1"] = _matrix("K0", fields[4:13]), _matrix("K1", fields[13:22])
    if len(fields) == 38:
        found["R"], found["t"] = _motion(fields[22:])
    return Pair(fields[0], fields[1], number, " ".join(fields), **found)


def parse_pairs(text, name):
    """Parses the text of a pairs file; `name` is used in messages."""
    pairs = []
    for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1):
        start = line.lstrip(_BLANK)
        if not start or start.startswith("#"):
            continue
        try:
            pairs.append(parse_pair(line, number))
        except FormatError as error:
            raise FormatError(f"{name}: line {number}: {error}") from None
    if not pairs:
        raise FormatError(f"{name}: no pair in it")
    return pairs


def read_pairs(path):
    """Reads the pairs of a file. FormatError names the line that is refused; OSError is not
    caught."""
    return parse_pairs(camera_files.read_text(path, MAX_PAIRS_BYTES), path)


# ---- cameras -----------------------------------------------------------------------------------

def _plain(camera):
    """A twoview.Camera as a Camera of this module, which needs no library."""
    return Camera(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy,
                  camera.model.name.lower(), tuple(camera.k))


def _note(text):
    print(f"twoview: note: {text}", file=sys.stderr)


def _parsed(text, name):
    """camera_files.parse_cameras, whose warning becomes a line of the program's form."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", camera_files.CameraFileWarning)
        cameras = camera_files.parse_cameras(text, name)
    for warning in said:
        if issubclass(warning.category, camera_files.CameraFileWarning):
            _note(warning.message)
    return cameras


def parse_camera(text, name):
    """Parses the text of a camera file; `name` is used in messages."""
    return _plain(camera_files.only_camera(_parsed(text, name), None, name))


def parse_cameras(text, name):
    """Parses the text of a camera file of any format as {name: Camera}."""
    return {entry: _plain(camera)
            for entry, camera in _parsed(text, name).items()}


def read_camera(path):
    """Reads the one camera of a file of any format. FormatError names the file; OSError is not
    caught."""
    return parse_camera(camera_files.read_text(path), path)


def parse_camera_set(text, name):
    """Parses the text of a cameras.yaml as {entry: Camera}, in the order of the file."""
    left_out = []
    cameras = camera_files.camera_set_of(camera_files.parse_yaml(text, name), name, left_out)
    if left_out:
        _note(f"{name}: left out: {', '.join(left_out)}")
    return {entry: _plain(camera) for entry, camera in cameras.items()}


def read_camera_set(path):
    """Reads a cameras.yaml as {entry: Camera}. FormatError names the file; OSError is not
    caught."""
    return parse_camera_set(camera_files.read_text(path), path)


def read_cameras_of(paths):
    """Reads camera files of any format as {name: Camera}. A camera without a name (OpenCV's files)
    gets the name of its file without the extension."""
    cameras = {}
    for path in paths:
        for name, camera in parse_cameras(camera_files.read_text(path), path).items():
            cameras[name or os.path.splitext(os.path.basename(path))[0]] = camera
    return cameras


def choose_entry(cameras, image, K=None):
    """The name of the entry of {name: Camera} that serves an image, or None. K is the 3x3 matrix of
    the pair's line. Raises FormatError if K fits entries that differ."""
    if len(cameras) == 1:
        return next(iter(cameras))
    file = image.rsplit("/", 1)[-1]
    begins = [name for name in cameras if name and file.startswith(name)]
    if begins:
        return max(begins, key=len)
    if K is None:
        return None
    fits = [name for name, camera in cameras.items()
            if abs(K[0][0] - camera.fx) <= SAME_K * abs(camera.fx)
            and abs(K[0][2] - camera.cx) <= SAME_K * abs(camera.cx)]
    for name in fits[1:]:
        if cameras[name] != cameras[fits[0]]:
            raise FormatError(f"image {image}: its K fits the cameras {fits[0]} and {name}, which "
                              "differ")
    return fits[0] if fits else None


def check_K(camera, image, K, width, height):
    """Raises FormatError where K, of a pair's line, is not of an image of this size, as the
    program's files/camera_doubts.cc does: of another order, of another size, or not those of the
    entry `camera`, which may be None."""
    fx, fy, cx, cy = K[0][0], K[1][1], K[0][2], K[1][2]
    where, K = f"image {image}: K of the list's line", (fx, fy, cx, cy)
    question = exchanged((width, height), K)
    if question:
        raise FormatError(f"{where}: {question}")
    numbers = "fx %g, fy %g, cx %g, cy %g"
    if camera is not None:
        own = camera.fx, camera.fy, camera.cx, camera.cy
        if not (all(abs(a / b - 1) <= SAME_INTRINSICS for a, b in zip(K[:2], own[:2]))
                and abs(cx - camera.cx) <= SAME_INTRINSICS * camera.width
                and abs(cy - camera.cy) <= SAME_INTRINSICS * camera.height):
            raise FormatError(f"{where}: {numbers % K}, but cameras.yaml has {numbers % own} for "
                              f"pictures of {camera.width}x{camera.height}: are they of pictures "
                              "of another size? Correct one of the two")
        return
    x, y = 2 * (cx + 0.5) / width, 2 * (cy + 0.5) / height
    is_larger, is_smaller = min(x, y) > OTHER_SCALE, 0 < min(x, y) and max(x, y) < 1 / OTHER_SCALE
    if ((is_larger and max(x, y) > 2)
            or ((is_larger or is_smaller) and abs(x / y - 1) <= SAME_SCALE)):
        raise FormatError(f"{where}: {numbers % K} are of pictures of about {2 * cx + 1:.0f}x"
                          f"{2 * cy + 1:.0f}, but this one is {width}x{height}: scale them, or "
                          "give a camera file that has its size")


def choose_camera(cameras, image, K=None):
    """The Camera that serves an image; None if there are no cameras. Raises FormatError if no
    camera serves it."""
    if not cameras:
        return None
    entry = choose_entry(cameras, image, K)
    if entry is None:
        raise FormatError(
            f"image {image}: none of the cameras {', '.join(cameras)} begins its name or "
            "has its K"
        )
    return cameras[entry]
