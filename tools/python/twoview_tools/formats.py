"""The only Python reader of pairs files, camera files and a data set's cameras.yaml.

The program's readers are tools/twoview's pairs_file.cc, camera_file.cc and yaml_values.cc. Both
languages read the cases of test/formats and must accept, refuse and choose alike
(test/python/test_formats.py, test/cli/test_formats.cc).

Numbers. A number is decimal, with an optional sign, point and exponent (`-5`, `.5`, `5.`, `1e-3`).
It must be finite and within a double's range; hexadecimal, octal, `1_000` and `yes` are no numbers.

pairs.txt, PAIRS.txt. A line holds name0 name1 [rot0 rot1 [K0(9) K1(9) [T_0to1(16)]]]: 2, 4, 22 or
38 fields with white space between them. Blank lines are skipped, and so are lines whose first
character after white space is "#". Lines end with LF or CR LF; a byte order mark is skipped. `rot`
is a number of whole quarter turns counter-clockwise, read modulo 4. K is [fx 0 cx 0 fy cy 0 0 1]
with positive focal lengths. T is [R t; 0 0 0 1]; each element of R R^T must be within 1e-3 of the
identity's, and det R must be positive. A file without a pair is refused. The message for a refused
line has the line's number.

Camera file. OpenCV's YAML and ROS's camera_info: image_width, image_height (whole, from 1 to 10^6),
camera_matrix (nine numbers, or a map with data), distortion_model (absent, none, plumb_bob,
rational_polynomial, equidistant) and distortion_coefficients (0, 4, 5 or 8 numbers; equidistant:
4). Names that are not known are ignored. A lens of Brown and Conrady whose coefficients are all 0
is a pinhole. If a matrix gives rows and cols, their product must equal its number of values.

cameras.yaml. A map from an entry's name to a map of fx fy cx cy image_width image_height, and k1 k2
p1 p2 k3, each 0 where it is absent. Names that are not known are ignored; a file without an entry
is refused.

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
from dataclasses import dataclass
from typing import Optional

import numpy as np

MAX_PAIRS_BYTES, MAX_CAMERA_BYTES = 64 << 20, 1 << 20
FIELD_COUNTS = (2, 4, 22, 38)
SAME_K = 1e-6  # relative; a larger difference means that K and a camera are not the same
COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3")
# The camera model for each distortion_model of a camera file. None: the file has no such entry; "":
# the entry is empty.
MODELS = {None: "brown_conrady", "": "brown_conrady", "none": "pinhole",
          "plumb_bob": "brown_conrady", "rational_polynomial": "brown_conrady",
          "equidistant": "kannala_brandt"}

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?\.?(nan|inf|infinity)", re.IGNORECASE)
_BLANK = " \t\r\v\f"


class FormatError(ValueError):
    """A file that is refused. The message is one line that names the file and the error in it."""


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


def _number(text):
    """Parses a finite number. FormatError gives the reason if `text` is not one."""
    if _NUMBER.fullmatch(text):
        value = float(text)
        is_zero = not re.search("[1-9]", re.split("[eE]", text)[0])
        if math.isfinite(value) and (value != 0 or is_zero):
            return value
    if _NOT_FINITE.fullmatch(text):
        raise FormatError("is not finite")
    raise FormatError("is no number")


def _read_text(path, most_bytes):
    """The text of a file. Bytes that are not UTF-8 are preserved, since they may be part of a file
    name."""
    with open(path, "rb") as f:
        data = f.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise FormatError(f"{path}: larger than {most_bytes} bytes")
    return data.decode("utf-8", "surrogateescape")


# ---- pairs -------------------------------------------------------------------------------------

def _field(text):
    try:
        return _number(text)
    except FormatError as error:
        raise FormatError(f"'{text}' {error}") from None


def _turns(text):
    value = _field(text)
    if value != math.floor(value) or abs(value) > 1e6:
        raise FormatError(f"'{text}' is no number of quarter turns")
    return int(value) & 3


def _matrix(name, fields):
    K = np.array([_field(field) for field in fields]).reshape(3, 3)
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        raise FormatError(f"{name} has a focal length that is not above 0")
    if K[0, 1]:
        raise FormatError(f"{name} has skew, which is not supported")
    if K[1, 0] or K[2].tolist() != [0, 0, 1]:
        raise FormatError(f"{name} is not [fx 0 cx 0 fy cy 0 0 1]")
    return K


def _motion(fields):
    T = np.array([_field(field) for field in fields]).reshape(4, 4)
    R = T[:3, :3]
    if not np.abs(R @ R.T - np.eye(3)).max() <= 1e-3:
        raise FormatError("T_0to1 holds no rotation")
    if np.linalg.det(R) < 0:
        raise FormatError("T_0to1 holds a reflection, no rotation")
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
    return parse_pairs(_read_text(path, MAX_PAIRS_BYTES), path)


# ---- YAML --------------------------------------------------------------------------------------

def _value(node, name):
    """Converts a YAML node to None, text, a list or a dict. Numbers stay text, since _number parses
    them instead of YAML."""
    import yaml
    if isinstance(node, yaml.ScalarNode):
        is_null = node.style is None and node.value in ("", "~", "null", "Null", "NULL")
        return None if is_null else node.value
    if isinstance(node, yaml.SequenceNode):
        return [_value(item, name) for item in node.value]
    values = {}
    for key, item in node.value:
        text = key.value if isinstance(key, yaml.ScalarNode) else "?"
        if text in values:
            raise FormatError(f"{name}: line {key.start_mark.line + 1}: {text} is given twice")
        values[text] = _value(item, name)
    return values


def _parse_yaml(text, name):
    """Parses the first document of a YAML text; FormatError if it is no map."""
    import yaml
    text = text.removeprefix("\ufeff")
    if text.startswith("%YAML:"):  # '%YAML:1.0', OpenCV's first line, is no valid YAML
        text = "#" + text[1:]
    try:
        for event in yaml.parse(text, yaml.BaseLoader):
            if isinstance(event, yaml.AliasEvent):
                line = event.start_mark.line + 1
                raise FormatError(f"{name}: line {line}: aliases are not supported")
            if isinstance(event, yaml.DocumentEndEvent):
                break
        root = next(yaml.compose_all(text, yaml.BaseLoader), None)
    except yaml.YAMLError as error:
        raise FormatError(f"{name}: no YAML: {' '.join(str(error).split())}") from None
    if not isinstance(root, yaml.MappingNode):
        raise FormatError(f"{name}: no YAML map of names and values")
    return _value(root, name)


def _finite(value, entry, where):
    try:
        return _number(value if isinstance(value, str) else "")
    except FormatError as error:
        raise FormatError(f"{where}: {entry} {error}") from None


def _at(values, entry, where):
    if values.get(entry) is None:
        raise FormatError(f"{where}: {entry} is missing")
    return values[entry]


def _number_at(values, entry, where):
    return _finite(_at(values, entry, where), entry, where)


def _side_at(values, entry, where):
    value = _number_at(values, entry, where)
    if value == 0:
        raise FormatError(f"{where}: {entry} is 0")
    if value != math.floor(value) or not 1 <= value <= 1e6:
        raise FormatError(f"{where}: {entry} is not a number of pixels")
    return int(value)


def _check_focal(value, entry, where):
    if value <= 0:
        raise FormatError(f"{where}: {entry} is {'negative' if value < 0 else '0'}")


def _flat(values, entry, where):
    for i, value in enumerate(values):
        name = f"{entry}[{i}]"
        if isinstance(value, list):
            yield from _flat(value, name, where)
        else:
            yield _finite(value, name, where)


def _numbers_at(values, entry, where):
    """The numbers of an entry: a list, a list of lists, or a map with data."""
    node = _at(values, entry, where)
    listed = node
    if isinstance(node, dict):
        if "data" not in node:
            raise FormatError(f"{where}: {entry} has no data")
        listed = node["data"]
    if not isinstance(listed, list):
        raise FormatError(f"{where}: {entry} is not a list of numbers")
    found = list(_flat(listed, entry, where))
    if isinstance(node, dict) and "rows" in node and "cols" in node:
        rows, cols = (_number_at(node, side, f"{where}: {entry}") for side in ("rows", "cols"))
        if rows * cols != len(found):
            raise FormatError(f"{where}: {entry} has {len(found)} numbers, not rows x cols = "
                              f"{node['rows']} x {node['cols']}")
    return found


# ---- cameras -----------------------------------------------------------------------------------

def _camera_matrix(root, name):
    K = _numbers_at(root, "camera_matrix", name)
    if len(K) != 9:
        raise FormatError(f"{name}: camera_matrix has {len(K)} numbers, not 9")
    node = root["camera_matrix"]
    for side in ("rows", "cols") if isinstance(node, dict) else ():
        if side in node and _number_at(node, side, f"{name}: camera_matrix") != 3:
            raise FormatError(f"{name}: camera_matrix: {side} is not 3")
    _check_focal(K[0], "fx (camera_matrix[0])", name)
    _check_focal(K[4], "fy (camera_matrix[4])", name)
    if K[1]:
        raise FormatError(f"{name}: camera_matrix[1] is not 0; skew is not supported")
    if K[3] or K[6:] != [0, 0, 1]:
        raise FormatError(f"{name}: camera_matrix is not [fx 0 cx; 0 fy cy; 0 0 1]")
    return K[0], K[4], K[2], K[5]


def _distortion(root, name):
    """Returns (lens model, distortion coefficients) of a parsed camera file."""
    word = root.get("distortion_model")
    if isinstance(word, (list, dict)):
        raise FormatError(f"{name}: distortion_model is not a word")
    if word not in MODELS:
        raise FormatError(f"{name}: distortion_model '{word}' is not one of plumb_bob, "
                          "rational_polynomial, equidistant")
    if root.get("distortion_coefficients") is None or word == "none":
        if word in (None, "", "none"):
            return "pinhole", ()
        raise FormatError(f"{name}: distortion_coefficients is missing")
    k = _numbers_at(root, "distortion_coefficients", name)
    is_fisheye = word == "equidistant"
    if len(k) not in ((4,) if is_fisheye else (0, 4, 5, 8)):
        raise FormatError(f"{name}: distortion_coefficients has {len(k)} numbers, not "
                          + ("4" if is_fisheye else "4, 5 or 8"))
    # An equidistant lens with four zero coefficients is not a pinhole.
    return (MODELS[word], tuple(k)) if is_fisheye or any(k) else ("pinhole", ())


def parse_camera(text, name):
    """Parses the text of a camera file; `name` is used in messages."""
    return _camera_of(_parse_yaml(text, name), name)


def _camera_of(root, name):
    size = [_side_at(root, side, name) for side in ("image_width", "image_height")]
    return Camera(*size, *_camera_matrix(root, name), *_distortion(root, name))


def read_camera(path):
    """Reads one camera in OpenCV's or ROS's format. FormatError names the file; OSError is not
    caught."""
    return parse_camera(_read_text(path, MAX_CAMERA_BYTES), path)


def parse_camera_set(text, name):
    """Parses the text of a cameras.yaml as {entry: Camera}, in the order of the file."""
    return _camera_set_of(_parse_yaml(text, name), name)


def _camera_set_of(root, name):
    cameras = {}
    for entry, values in root.items():
        where = f"{name}: {entry}"
        if not isinstance(values, dict):
            raise FormatError(f"{where} is not a map of names and values")
        size = [_side_at(values, side, where) for side in ("image_width", "image_height")]
        K = [_number_at(values, key, where) for key in ("fx", "fy", "cx", "cy")]
        _check_focal(K[0], "fx", where)
        _check_focal(K[1], "fy", where)
        k = tuple(_number_at(values, key, where) if key in values else 0.0
                  for key in COEFFICIENTS)
        lens = ("brown_conrady", k) if any(k) else ("pinhole", ())
        cameras[entry] = Camera(*size, *K, *lens)
    if not cameras:
        raise FormatError(f"{name}: no camera in it")
    return cameras


def read_camera_set(path):
    """Reads a cameras.yaml as {entry: Camera}. FormatError names the file; OSError is not
    caught."""
    return parse_camera_set(_read_text(path, MAX_CAMERA_BYTES), path)


def read_cameras_of(paths):
    """Reads files that are each a camera file or a cameras.yaml, as {name: Camera}. The name of
    a camera file's camera is its camera_name (ROS), else the name of the file without its
    extension."""
    cameras = {}
    for path in paths:
        root = _parse_yaml(_read_text(path, MAX_CAMERA_BYTES), path)
        if "camera_matrix" in root:
            name = root.get("camera_name") or os.path.splitext(os.path.basename(path))[0]
            cameras[str(name)] = _camera_of(root, path)
        else:
            cameras.update(_camera_set_of(root, path))
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
