"""Camera files: reads OpenCV's YAML and XML, ROS's camera_info, Kalibr's camchain, a data set's
cameras.yaml and COLMAP's cameras.txt, and writes all of them.

The program reads camera files by the same rules (tools/twoview/files/camera_formats.h), and both
are tested on the cases of test/formats. YAML needs the package PyYAML."""

from __future__ import annotations

import contextlib
import importlib
import math
import os
import re
from typing import Any, Callable, Iterator, Mapping, NamedTuple, Optional, Sequence, Union

from .camera import Camera, camera_check
from .enums import CameraModel

MAX_FILE_BYTES = 1 << 20
PathLike = Union[str, "os.PathLike[str]"]
KNOWN = ("; camera files are OpenCV's or ROS's YAML or XML (camera_matrix or K), Kalibr's "
         "(intrinsics), a cameras.yaml (fx fy cx cy) and COLMAP's cameras.txt")

_NUM_MODELLED = 8  # coefficients k1 k2 p1 p2 k3 k4 k5 k6 of a Camera
_OPENCV_COUNTS = (0, 4, 5, 8, 12, 14)
# The names of an entry: of OpenCV's and ROS's files, of ROS 1's message and of ROS 2's.
_MATRIX = ("camera_matrix", "K", "k")
_DISTORTION = ("distortion_coefficients", "D", "d")
_WIDTH, _HEIGHT = ("image_width", "width"), ("image_height", "height")
_COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3")  # of a cameras.yaml
# The lens for each distortion_model of an OpenCV or ROS file. None: there is no such entry; "": it
# is empty.
_LENSES = {None: CameraModel.BROWN_CONRADY, "": CameraModel.BROWN_CONRADY,
           "none": CameraModel.PINHOLE, "plumb_bob": CameraModel.BROWN_CONRADY,
           "rational_polynomial": CameraModel.BROWN_CONRADY,
           "equidistant": CameraModel.KANNALA_BRANDT}
_KALIBR_LENSES = {"radtan": CameraModel.BROWN_CONRADY, "plumb_bob": CameraModel.BROWN_CONRADY,
                  "radial-tangential": CameraModel.BROWN_CONRADY,
                  "equidistant": CameraModel.KANNALA_BRANDT}
# COLMAP's models: the lens, which parameters are fx fy cx cy, and how many coefficients follow.
_COLMAP = {
    "SIMPLE_PINHOLE": (CameraModel.PINHOLE, (0, 0, 1, 2), 0),
    "PINHOLE": (CameraModel.PINHOLE, (0, 1, 2, 3), 0),
    "SIMPLE_RADIAL": (CameraModel.BROWN_CONRADY, (0, 0, 1, 2), 1),
    "RADIAL": (CameraModel.BROWN_CONRADY, (0, 0, 1, 2), 2),
    "OPENCV": (CameraModel.BROWN_CONRADY, (0, 1, 2, 3), 4),
    "FULL_OPENCV": (CameraModel.BROWN_CONRADY, (0, 1, 2, 3), 8),
    "SIMPLE_RADIAL_FISHEYE": (CameraModel.KANNALA_BRANDT, (0, 0, 1, 2), 1),
    "RADIAL_FISHEYE": (CameraModel.KANNALA_BRANDT, (0, 0, 1, 2), 2),
    "OPENCV_FISHEYE": (CameraModel.KANNALA_BRANDT, (0, 1, 2, 3), 4),
}
_COLMAP_HALF_PIXEL = 0.5  # COLMAP's origin is the corner of the first pixel

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?\.?(nan|inf|infinity)", re.IGNORECASE)


class FormatError(ValueError):
    """A file that is refused. The message is one line that names the file and the entry, and the
    formats that are known where none is recognised."""


class CalibrationSigmas(NamedTuple):
    """How sure a calibration is. The fields of EstimateOptions are focal_sigma0, center_sigma0 and
    so on."""

    focal: float  #: relative standard deviation of the focal length
    center: float  #: standard deviation of the principal point, in focal lengths


#: Of a camera file that does not say how sure it is, and of a focal length as for 35 mm film:
#: those of the program (docs/decisions/0024-honest-covariance.md).
PLAIN_FILE, FILM = CalibrationSigmas(0.01, 0.005), CalibrationSigmas(0.1, 0.01)


# ---- text, YAML and XML --------------------------------------------------------------------------

def parse_number(text: str) -> float:
    """A finite number. FormatError gives the reason if `text` is not one."""
    if _NUMBER.fullmatch(text):
        value = float(text)
        is_zero = not re.search("[1-9]", re.split("[eE]", text)[0])
        if math.isfinite(value) and (value != 0 or is_zero):
            return value
    if _NOT_FINITE.fullmatch(text):
        raise FormatError("is not finite")
    raise FormatError("is no number")


def read_text(path: PathLike, most_bytes: int = MAX_FILE_BYTES) -> str:
    """The text of a file. Bytes that are not UTF-8 are preserved, since they may be part of a file
    name."""
    with open(path, "rb") as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise FormatError(f"{os.fspath(path)}: larger than {most_bytes} bytes")
    return data.decode("utf-8", "surrogateescape")


def _value(yaml: Any, node: Any, name: str) -> Any:
    """A YAML node as None, text, a list or a dict. Numbers stay text, since parse_number parses
    them instead of YAML."""
    if isinstance(node, yaml.ScalarNode):
        is_null = node.style is None and node.value in ("", "~", "null", "Null", "NULL")
        return None if is_null else node.value
    if isinstance(node, yaml.SequenceNode):
        return [_value(yaml, item, name) for item in node.value]
    values: dict[str, Any] = {}
    for key, item in node.value:
        text = key.value if isinstance(key, yaml.ScalarNode) else "?"
        if text in values:
            raise FormatError(f"{name}: line {key.start_mark.line + 1}: {text} is given twice")
        values[text] = _value(yaml, item, name)
    return values


def parse_yaml(text: str, name: str) -> dict[str, Any]:
    """The first document of a YAML text; FormatError if it is no map."""
    try:
        yaml: Any = importlib.import_module("yaml")  # needed here only
    except ImportError:
        raise ImportError("reading a camera file needs the package PyYAML (pip install pyyaml, or "
                          "apt install python3-yaml)") from None
    text = text[1:] if text.startswith("\ufeff") else text
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
    values = _value(yaml, root, name)
    assert isinstance(values, dict)
    return values


def _parse_xml(text: str, name: str) -> dict[str, Any]:
    """OpenCV's XML as parse_yaml gives its YAML: a matrix is a map with rows, cols and data."""
    import xml.etree.ElementTree as ElementTree
    if "<!" in re.sub(r"<!--.*?-->", "", text, flags=re.S):
        raise FormatError(f"{name}: declarations of XML are not supported")
    try:
        root = ElementTree.fromstring(text.encode("utf-8", "surrogateescape"))
    except ElementTree.ParseError as error:
        raise FormatError(f"{name}: no XML: {error}") from None
    if root.tag != "opencv_storage":
        raise FormatError(f"{name}: XML of {root.tag[:40]}, not OpenCV's opencv_storage")
    values: dict[str, Any] = {}
    for entry in root:
        if entry.tag in values:
            raise FormatError(f"{name}: {entry.tag} is given twice")
        inner: dict[str, Any] = {part.tag: (part.text or "").strip() for part in entry}
        if "data" in inner:
            inner["data"] = inner["data"].split()
        content = (entry.text or "").strip()
        values[entry.tag] = inner or content.strip('"') or None
    return values


def _finite(value: Any, entry: str, where: str) -> float:
    try:
        return parse_number(value if isinstance(value, str) else "")
    except FormatError as error:
        raise FormatError(f"{where}: {entry} {error}") from None


def _at(values: Mapping[str, Any], entry: str, where: str) -> Any:
    if values.get(entry) is None:
        raise FormatError(f"{where}: {entry} is missing")
    return values[entry]


def _number_at(values: Mapping[str, Any], entry: str, where: str) -> float:
    return _finite(_at(values, entry, where), entry, where)


def _side(value: float, entry: str, where: str) -> int:
    if value == 0:
        raise FormatError(f"{where}: {entry} is 0")
    if value != math.floor(value) or not 1 <= value <= 1e6:
        raise FormatError(f"{where}: {entry} is not a number of pixels")
    return int(value)


def _check_focal(value: float, entry: str, where: str) -> None:
    if value <= 0:
        raise FormatError(f"{where}: {entry} is {'negative' if value < 0 else '0'}")


def _flat(values: list[Any], entry: str, where: str) -> Iterator[float]:
    for i, value in enumerate(values):
        name = f"{entry}[{i}]"
        if isinstance(value, list):
            yield from _flat(value, name, where)
        else:
            yield _finite(value, name, where)


def _numbers_at(values: Mapping[str, Any], entry: str, where: str) -> list[float]:
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


def _word_at(values: Mapping[str, Any], entry: str, where: str) -> Optional[str]:
    word = values.get(entry)
    if isinstance(word, (list, dict)):
        raise FormatError(f"{where}: {entry} is not a word")
    return word


def _counted(values: list[float], count: int, entry: str, where: str) -> list[float]:
    if len(values) != count:
        raise FormatError(f"{where}: {entry} has {len(values)} numbers, not {count}")
    return values


def _camera(width: int, height: int, K: tuple[float, float, float, float], lens: CameraModel,
            k: Sequence[float]) -> Camera:
    # An equidistant lens with four zero coefficients is no pinhole.
    if lens == CameraModel.BROWN_CONRADY and not any(k):
        lens = CameraModel.PINHOLE
    return Camera(width, height, *K, lens, () if lens == CameraModel.PINHOLE else tuple(k))


# ---- OpenCV and ROS ------------------------------------------------------------------------------

def _name_in(root: Mapping[str, Any], names: tuple[str, ...]) -> str:
    """The first of the names that the file has; without any the first, which messages name."""
    return next((name for name in names if root.get(name) is not None), names[0])


def _camera_matrix(root: Mapping[str, Any], where: str) -> tuple[float, float, float, float]:
    entry = _name_in(root, _MATRIX)
    K = _counted(_numbers_at(root, entry, where), 9, entry, where)
    node = root[entry]
    for side in ("rows", "cols") if isinstance(node, dict) else ():
        if side in node and _number_at(node, side, f"{where}: {entry}") != 3:
            raise FormatError(f"{where}: {entry}: {side} is not 3")
    _check_focal(K[0], f"fx ({entry}[0])", where)
    _check_focal(K[4], f"fy ({entry}[4])", where)
    if K[1]:
        raise FormatError(f"{where}: {entry}[1] is not 0; skew is not supported")
    if K[3] or K[6:] != [0, 0, 1]:
        raise FormatError(f"{where}: {entry} is not [fx 0 cx; 0 fy cy; 0 0 1]")
    return K[0], K[4], K[2], K[5]


def _distortion(root: Mapping[str, Any], where: str) -> tuple[CameraModel, list[float]]:
    word = _word_at(root, "distortion_model", where)
    if word not in _LENSES:
        raise FormatError(f"{where}: distortion_model '{word}' is not one of plumb_bob, "
                          "rational_polynomial, equidistant")
    entry = _name_in(root, _DISTORTION)
    if root.get(entry) is None or word == "none":
        if word in (None, "", "none"):
            return CameraModel.PINHOLE, []
        raise FormatError(f"{where}: {entry} is missing")
    k = _numbers_at(root, entry, where)
    is_fisheye = word == "equidistant"
    if len(k) not in ((4,) if is_fisheye else _OPENCV_COUNTS):
        raise FormatError(f"{where}: {entry} has {len(k)} numbers, not "
                          + ("4" if is_fisheye else "4, 5, 8, 12 or 14"))
    for i, value in enumerate(k[_NUM_MODELLED:], _NUM_MODELLED):
        if value:
            raise FormatError(f"{where}: {entry} has {len(k)} numbers, of which {entry}[{i}] is "
                              "not 0: the lens models here end with the first 8 (no thin prism, no "
                              "tilted sensor); calibrate with 5 or 8")
    return _LENSES[word], k[:_NUM_MODELLED]


def camera_of(root: Mapping[str, Any], where: str) -> Camera:
    """The camera of a parsed OpenCV or ROS file. `where` is used in messages."""
    width, height = (_side(_number_at(root, side, where), side, where)
                     for side in (_name_in(root, _WIDTH), _name_in(root, _HEIGHT)))
    K = _camera_matrix(root, where)
    return _camera(width, height, K, *_distortion(root, where))


# ---- Kalibr --------------------------------------------------------------------------------------

def _is_kalibr(node: Any) -> bool:
    return isinstance(node, dict) and "intrinsics" in node


def _kalibr_camera(node: Mapping[str, Any], where: str) -> Camera:
    """A camera of a camchain, and EuRoC's sensor.yaml, which has the same entries."""
    model = _word_at(node, "camera_model", where)
    if model and model != "pinhole":
        raise FormatError(f"{where}: camera_model '{model}' is not pinhole")
    fx, fy, cx, cy = _counted(_numbers_at(node, "intrinsics", where), 4, "intrinsics", where)
    sides = _counted(_numbers_at(node, "resolution", where), 2, "resolution", where)
    width, height = (_side(side, f"resolution[{i}]", where) for i, side in enumerate(sides))
    _check_focal(fx, "fx (intrinsics[0])", where)
    _check_focal(fy, "fy (intrinsics[1])", where)
    word = _word_at(node, "distortion_model", where)
    if not word or word == "none":
        return _camera(width, height, (fx, fy, cx, cy), CameraModel.PINHOLE, ())
    if word not in _KALIBR_LENSES:
        raise FormatError(f"{where}: distortion_model '{word}' is not one of radtan, equidistant, "
                          "none")
    entry = "distortion_coeffs" if "distortion_coeffs" in node else "distortion_coefficients"
    k = _counted(_numbers_at(node, entry, where), 4, entry, where)
    return _camera(width, height, (fx, fy, cx, cy), _KALIBR_LENSES[word], k)


# ---- cameras.yaml --------------------------------------------------------------------------------

def camera_set_of(root: Mapping[str, Any], name: str) -> dict[str, Camera]:
    """The cameras of a parsed cameras.yaml, in the order of the file."""
    cameras = {}
    for entry, values in root.items():
        where = f"{name}: {entry}"
        if not isinstance(values, dict):
            raise FormatError(f"{where} is not a map of names and values")
        width, height = (_side(_number_at(values, side, where), side, where)
                         for side in ("image_width", "image_height"))
        fx, fy, cx, cy = (_number_at(values, key, where) for key in ("fx", "fy", "cx", "cy"))
        _check_focal(fx, "fx", where)
        _check_focal(fy, "fy", where)
        k = [_number_at(values, key, where) if key in values else 0.0 for key in _COEFFICIENTS]
        cameras[entry] = _camera(width, height, (fx, fy, cx, cy), CameraModel.BROWN_CONRADY, k)
    if not cameras:
        raise FormatError(f"{name}: no camera in it")
    return cameras


def _is_camera_set(root: Mapping[str, Any]) -> bool:
    return any(isinstance(item, dict) and {"fx", "fy", "image_width"} & set(item)
               for item in root.values())


# ---- COLMAP --------------------------------------------------------------------------------------

def _colmap_lines(text: str) -> list[tuple[int, list[str]]]:
    """The fields of each line that is neither blank nor a comment, with its number."""
    lines = ((number, line.split()) for number, line in enumerate(text.split("\n"), 1))
    return [(number, fields) for number, fields in lines
            if fields and not fields[0].startswith("#")]


def _is_colmap(text: str) -> bool:
    """Whether the first line with content begins as COLMAP's: a number and a model's name."""
    for _, fields in _colmap_lines(text[1:] if text.startswith("\ufeff") else text)[:1]:
        return (len(fields) >= 3 and re.fullmatch("[0-9]+", fields[0]) is not None
                and re.fullmatch("[A-Z][A-Z0-9_]*", fields[1]) is not None)
    return False


def _colmap_cameras(text: str, name: str) -> dict[str, Camera]:
    cameras = {}
    for number, fields in _colmap_lines(text[1:] if text.startswith("\ufeff") else text):
        where = f"{name}: line {number}"
        if len(fields) < 3:
            raise FormatError(f"{where} is not CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS")
        if fields[1] not in _COLMAP:
            raise FormatError(f"{where}: COLMAP's model {fields[1][:40]} is not one of "
                              + ", ".join(_COLMAP))
        lens, places, num_lens = _COLMAP[fields[1]]
        count = places[3] + 1 + num_lens
        if len(fields) != 4 + count:
            raise FormatError(f"{where}: {fields[1]} has {count} parameters, not "
                              f"{max(len(fields) - 4, 0)}")
        values = []
        for field in fields[2:]:
            try:
                values.append(parse_number(field))
            except FormatError:
                raise FormatError(f"{where}: '{field[:40]}' is no finite number") from None
        fx, fy, cx, cy = (values[2 + place] for place in places)
        _check_focal(fx, "fx", where)
        _check_focal(fy, "fy", where)
        if fields[0] in cameras:
            raise FormatError(f"{where}: camera {fields[0]} is given twice")
        cameras[fields[0]] = _camera(
            _side(values[0], "WIDTH", where), _side(values[1], "HEIGHT", where),
            (fx, fy, cx - _COLMAP_HALF_PIXEL, cy - _COLMAP_HALF_PIXEL), lens,
            values[2 + places[3] + 1:])
    return cameras


# ---- any format ----------------------------------------------------------------------------------

def _root_of(text: str, name: str) -> dict[str, Any]:
    is_xml = text.lstrip("\ufeff \t\r\n").startswith("<")
    try:
        return (_parse_xml if is_xml else parse_yaml)(text, name)
    except FormatError as error:
        raise FormatError(f"{error}{KNOWN}") from None


def parse_cameras(text: str, name: str) -> dict[str, Camera]:
    """The cameras of a text in any of the formats, by their names: those of a camchain or a
    cameras.yaml, COLMAP's numbers, ROS's camera_name; "" for a camera without a name.

    text: what the file holds. name: of the file, for messages.
    Returns {name: Camera}, which the library has not checked.
    Raises FormatError that names the file, the entry and, where no format is recognised, the
    formats that are known; ImportError without PyYAML."""
    if _is_colmap(text):
        return _colmap_cameras(text, name)
    root = _root_of(text, name)
    if any(entry in root for entry in _MATRIX):
        entry = root.get("camera_name")
        return {entry if isinstance(entry, str) else "": camera_of(root, name)}
    cameras = {"": _kalibr_camera(root, name)} if _is_kalibr(root) else {}
    cameras.update({entry: _kalibr_camera(node, f"{name}: {entry}")
                    for entry, node in root.items() if _is_kalibr(node)})
    if cameras:
        return cameras
    if _is_camera_set(root):
        return camera_set_of(root, name)
    raise FormatError(f"{name}: camera_matrix is missing{KNOWN}")


def read_cameras(path: PathLike) -> dict[str, Camera]:
    """The cameras of a file, by their names, in the order of the file. The format is recognised by
    the contents: OpenCV's YAML or XML (4, 5, 8, 12 or 14 coefficients, of which those behind the
    eighth must be 0), ROS's camera_info and its messages (K, D or k, d), Kalibr's camchain and
    EuRoC's sensor.yaml, a data set's cameras.yaml, COLMAP's cameras.txt (its origin is moved by
    half a pixel).

    path: of the file.
    Returns {name: Camera}; the name is "" where the format has none.
    Raises FormatError (a ValueError) that names the file and the entry, and the formats that are
    known where none is recognised; OSError for a file that cannot be read; ImportError without
    PyYAML; TV_ERR_CAMERA for intrinsics that the library refuses."""
    cameras = parse_cameras(read_text(path), os.fspath(path))
    for camera in cameras.values():
        camera_check(camera)
    return cameras


def only_camera(cameras: Mapping[str, Camera], name: Optional[str], path: str) -> Camera:
    """The camera of that name, or the only one. FormatError, which names the file `path`, if there
    is none or, without a name, several."""
    if name is None and len(cameras) == 1:
        return next(iter(cameras.values()))
    if name is not None and name in cameras:
        return cameras[name]
    names = ", ".join(list(cameras)[:8]) + (", ..." if len(cameras) > 8 else "")
    if name is None:
        raise FormatError(f"{path} has {len(cameras)} cameras ({names}): name one")
    raise FormatError(f"{path} has no camera '{name}' but {names or 'one without a name'}")


def read_camera(path: PathLike, name: Optional[str] = None) -> Camera:
    """The camera of a file, or the one of that name in a file with several.

    path: of the file, in any format of read_cameras. name: None where the file has one camera.
    Returns a Camera.
    Raises as read_cameras does, and FormatError that lists the names where none or several fit."""
    return only_camera(read_cameras(path), name, os.fspath(path))


def read_sigmas(path: PathLike) -> CalibrationSigmas:
    """How sure the calibration in a camera file is: its entries focal_sigma (relative) and
    center_sigma (in focal lengths), which `twoview calibrate` writes.

    path: of the file, in any format of read_cameras.
    Returns CalibrationSigmas; those of PLAIN_FILE, 0.01 and 0.005, where the file does not say.
    Raises FormatError where one is not in [0, 0.5]; OSError; ImportError without PyYAML."""
    text, name = read_text(path), os.fspath(path)
    if _is_colmap(text):
        return PLAIN_FILE
    root, found = _root_of(text, name), PLAIN_FILE._asdict()
    for part in found:
        if root.get(part + "_sigma") is not None:
            found[part] = _number_at(root, part + "_sigma", name)
            if not 0 <= found[part] <= 0.5:
                raise FormatError(f"{name}: {part}_sigma is not in [0, 0.5]")
    return CalibrationSigmas(**found)


# ---- writing -------------------------------------------------------------------------------------

def _digits(value: float) -> str:
    """The shortest decimals that read back to the same float."""
    text = repr(float(value))
    return text[:-2] if text.endswith(".0") else text


def _padded(camera: Camera) -> list[float]:
    return [float(k) for k in camera.k] + [0.0] * (8 - len(camera.k))


def _is_fisheye(camera: Camera) -> bool:
    return camera.model == CameraModel.KANNALA_BRANDT


def _coefficients(camera: Camera) -> list[float]:
    """As OpenCV and ROS have them: 4 of a fisheye, else 5, or 8 where these are in use."""
    if camera.model == CameraModel.PINHOLE:
        return [0.0] * 5
    k = _padded(camera)
    return k[:4] if _is_fisheye(camera) else k[:8] if any(k[5:]) else k[:5]


def _matrix_of(camera: Camera) -> list[float]:
    return [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1]


def _sigma_entries(sigmas: Optional[CalibrationSigmas]) -> list[tuple[str, str]]:
    return [] if sigmas is None else [("focal_sigma", _digits(sigmas[0])),
                                      ("center_sigma", _digits(sigmas[1]))]


def _opencv(name: str, camera: Camera, sigmas: Optional[CalibrationSigmas]) -> str:
    def matrix(entry: str, rows: int, values: list[float]) -> str:
        return (f"{entry}: !!opencv-matrix\n   rows: {rows}\n   cols: {len(values) // rows}\n"
                f"   dt: d\n   data: [ {', '.join(map(_digits, values))} ]\n")
    return ("%YAML:1.0\n---\n"
            f"image_width: {camera.width}\nimage_height: {camera.height}\n"
            + matrix("camera_matrix", 3, _matrix_of(camera))
            + ("distortion_model: equidistant\n" if _is_fisheye(camera) else "")
            + matrix("distortion_coefficients", 1, _coefficients(camera))
            + "".join(f"{entry}: {value}\n" for entry, value in _sigma_entries(sigmas)))


def _opencv_xml(name: str, camera: Camera, sigmas: Optional[CalibrationSigmas]) -> str:
    def matrix(entry: str, rows: int, values: list[float]) -> str:
        return (f'<{entry} type_id="opencv-matrix">\n  <rows>{rows}</rows>\n'
                f"  <cols>{len(values) // rows}</cols>\n  <dt>d</dt>\n"
                f"  <data>{' '.join(map(_digits, values))}</data></{entry}>\n")
    return ('<?xml version="1.0"?>\n<opencv_storage>\n'
            f"<image_width>{camera.width}</image_width>\n"
            f"<image_height>{camera.height}</image_height>\n"
            + matrix("camera_matrix", 3, _matrix_of(camera))
            + ("<distortion_model>equidistant</distortion_model>\n" if _is_fisheye(camera) else "")
            + matrix("distortion_coefficients", 1, _coefficients(camera))
            + "".join(f"<{entry}>{value}</{entry}>\n" for entry, value in _sigma_entries(sigmas))
            + "</opencv_storage>\n")


def _ros(name: str, camera: Camera, sigmas: Optional[CalibrationSigmas]) -> str:
    def matrix(entry: str, rows: int, values: list[float]) -> str:
        return (f"{entry}:\n  rows: {rows}\n  cols: {len(values) // rows}\n"
                f"  data: [{', '.join(map(_digits, values))}]\n")
    k = _coefficients(camera)
    lens = {4: "equidistant", 5: "plumb_bob", 8: "rational_polynomial"}[len(k)]
    projection = [camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0]
    return (f"image_width: {camera.width}\nimage_height: {camera.height}\n"
            f"camera_name: {_quoted(name or 'camera')}\n"
            + matrix("camera_matrix", 3, _matrix_of(camera))
            + f"distortion_model: {lens}\n" + matrix("distortion_coefficients", 1, k)
            + matrix("rectification_matrix", 3, [1, 0, 0, 0, 1, 0, 0, 0, 1])
            + matrix("projection_matrix", 3, projection)
            + "".join(f"{entry}: {value}\n" for entry, value in _sigma_entries(sigmas)))


def _quoted(name: str) -> str:
    if re.fullmatch(r"[A-Za-z_][\w./-]*", name) and name.lower() not in ("null", "true", "false",
                                                                         "yes", "no", "on", "off"):
        return name
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _kalibr(name: str, camera: Camera, sigmas: Optional[CalibrationSigmas]) -> str:
    k = _padded(camera)
    if any(k[4:]):
        raise ValueError(f"{name}: Kalibr's radtan has k1 k2 p1 p2, but k[{4 + _first(k[4:])}] of "
                         "this camera is not 0")
    lens = "equidistant" if _is_fisheye(camera) else "radtan"
    intrinsics = [camera.fx, camera.fy, camera.cx, camera.cy]
    return (f"{_quoted(name)}:\n  camera_model: pinhole\n"
            f"  intrinsics: [{', '.join(map(_digits, intrinsics))}]\n"
            f"  distortion_model: {lens}\n"
            f"  distortion_coeffs: [{', '.join(map(_digits, k[:4]))}]\n"
            f"  resolution: [{camera.width}, {camera.height}]\n")


def _first(values: list[float]) -> int:
    return next(i for i, value in enumerate(values) if value)


def _camera_set(name: str, camera: Camera, sigmas: Optional[CalibrationSigmas]) -> str:
    k = _padded(camera)
    if _is_fisheye(camera) or any(k[5:]):
        raise ValueError(f"{name}: a cameras.yaml has k1 k2 p1 p2 k3 and no other lens")
    entries = zip(("fx", "fy", "cx", "cy", *_COEFFICIENTS),
                  (camera.fx, camera.fy, camera.cx, camera.cy, *k[:5]))
    return (f"{_quoted(name)}:\n  image_width: {camera.width}\n  image_height: {camera.height}\n"
            + "".join(f"  {entry}: {_digits(value)}\n" for entry, value in entries))


def _colmap(name: str, camera: Camera, sigmas: Optional[CalibrationSigmas]) -> str:
    k = _padded(camera)
    model, k = (("PINHOLE", []) if camera.model == CameraModel.PINHOLE else
                ("OPENCV_FISHEYE", k[:4]) if _is_fisheye(camera) else
                ("OPENCV", k[:4]) if not any(k[4:]) else ("FULL_OPENCV", k))
    values = [camera.fx, camera.fy, camera.cx + _COLMAP_HALF_PIXEL,
              camera.cy + _COLMAP_HALF_PIXEL, *k]
    return f"{name} {model} {camera.width} {camera.height} {' '.join(map(_digits, values))}\n"


_Writer = Callable[[str, Camera, Optional[CalibrationSigmas]], str]
# {format: (its writer, whether a file holds several cameras, whether it holds sigmas)}
_WRITERS: dict[str, tuple[_Writer, bool, bool]] = {
    "opencv": (_opencv, False, True), "opencv-xml": (_opencv_xml, False, True),
    "ros": (_ros, False, True), "kalibr": (_kalibr, True, False),
    "cameras.yaml": (_camera_set, True, False), "colmap": (_colmap, True, False)}
FORMATS = tuple(_WRITERS)


def format_cameras(cameras: Union[Camera, Mapping[str, Camera]], format: str = "opencv",
                   sigmas: Optional[CalibrationSigmas] = None) -> str:
    """The text of a camera file. Reading it gives the same cameras, bit for bit (COLMAP's cx and cy
    to the last bit or two).

    cameras: a Camera, or {name: Camera} for a format with names; COLMAP's names are numbers, others
    are replaced by 1, 2 and so on. format: "opencv" (YAML), "opencv-xml", "ros" (camera_info),
    "kalibr" (camchain), "cameras.yaml" or "colmap" (cameras.txt). sigmas: None, or how sure the
    calibration is, which "opencv", "opencv-xml" and "ros" have entries for.
    Returns the text.
    Raises ValueError for another format, for a lens or sigmas that the format does not have, and
    for several cameras in a format of one; TV_ERR_CAMERA for a camera that the library refuses."""
    if format not in _WRITERS:
        raise ValueError(f"format '{format}' is not one of {', '.join(FORMATS)}")
    write, has_names, has_sigmas = _WRITERS[format]
    if sigmas is not None and not has_sigmas:
        raise ValueError(f"sigmas: the format {format} has no entry for them")
    named = {"cam0": cameras} if isinstance(cameras, Camera) else dict(cameras)
    if not named or (len(named) > 1 and not has_names):
        raise ValueError(f"{len(named)} cameras: a file of the format {format} holds "
                         + ("at least one" if has_names else "one"))
    for camera in named.values():
        camera_check(camera)
    if format == "colmap" and not all(re.fullmatch("[0-9]+", name) for name in named):
        named = {str(number): camera for number, camera in enumerate(named.values(), 1)}
    head = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS\n" if format == "colmap" else ""
    return head + "".join(write(name, camera, sigmas) for name, camera in named.items())


def write_cameras(path: PathLike, cameras: Union[Camera, Mapping[str, Camera]],
                  format: str = "opencv", sigmas: Optional[CalibrationSigmas] = None) -> None:
    """Writes a camera file, under a temporary name first, so that none stays half written.

    path: of the file; an existing one is replaced. cameras, format, sigmas: as for format_cameras.
    Returns None.
    Raises as format_cameras does, before anything is written, and OSError."""
    text, temporary = format_cameras(cameras, format, sigmas), f"{os.fspath(path)}.{os.getpid()}"
    file = open(temporary, "x", encoding="utf-8")
    try:
        with file:
            file.write(text)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise
