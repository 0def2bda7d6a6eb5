"""Camera files: reads OpenCV's YAML, JSON and XML, ROS's camera_info, Kalibr's camchain,
ORB-SLAM's, stella_vslam's and VINS's settings, nerfstudio's transforms.json, a data set's
cameras.yaml and COLMAP's cameras.txt, and writes OpenCV's, ROS's, Kalibr's, cameras.yaml and
COLMAP's.

The program reads camera files by the same rules (tools/twoview/files/camera_formats.h), and both
are tested on the cases of test/formats. YAML needs the package PyYAML. _camera_entries has the
names of the entries, and says which of them are refused."""

from __future__ import annotations

import contextlib
import importlib
import math
import os
import re
import warnings
from typing import Any, Callable, Mapping, Optional, Sequence, Union

from ._camera_entries import (COEFFICIENTS, FISHEYE_COEFFICIENTS, NUM_MODELLED, Entries,
                              checked_camera, is_camera, number_of, plain, refuse, side_of,
                              sigmas_of, take_camera, word_of)
from ._camera_entries import FormatError as FormatError
from ._camera_entries import parse_number as parse_number
from .camera import Calibration, Camera, camera_check
from .enums import CameraModel, Refine

MAX_FILE_BYTES = 1 << 20
PathLike = Union[str, "os.PathLike[str]"]
KNOWN = ("; camera files are OpenCV's or ROS's YAML, JSON or XML (camera_matrix or K), Kalibr's "
         "(intrinsics), ORB-SLAM's (Camera.fx), VINS's (projection_parameters), nerfstudio's "
         "(fl_x), a cameras.yaml (fx fy cx cy) and COLMAP's cameras.txt")
_WRITE_OURS = ("write its numbers as OpenCV's YAML: image_width, image_height, camera_matrix, "
               "distortion_coefficients (docs/formats.md)")
HALF_PIXEL = 0.5  # the origin of COLMAP and nerfstudio is the corner of the first pixel


class CameraFileWarning(UserWarning):
    """Entries of a camera file that were left out, since they cannot concern the lens."""


#: Of a camera file that does not say how sure it is, and of a focal length as for 35 mm film:
#: those of the program (docs/decisions/0024-honest-covariance.md).
PLAIN_FILE = Calibration(0.01, 0.005, Refine.FOCAL_LENGTH)
FILM = Calibration(0.1, 0.01, Refine.FOCAL_LENGTH)


# ---- text, YAML and XML --------------------------------------------------------------------------

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
    """The document of a YAML or JSON text; FormatError if it is no map, or if several say different
    things. Messages of ROS as they are printed, one document each, differ in their headers."""
    try:
        yaml: Any = importlib.import_module("yaml")  # needed here only
    except ImportError:
        raise ImportError("reading a camera file needs the package PyYAML (pip install pyyaml, or "
                          "apt install python3-yaml)") from None
    text = text[1:] if text.startswith("\ufeff") else text
    # OpenCV's first line, '%YAML:1.0', is no valid YAML; OpenCV 5's, '%YAML 1.2', is.
    if text.startswith("%YAML"):
        text = "#" + text[1:]
    if text.lstrip().startswith("{"):  # JSON may be indented by tabs, YAML may not
        text = text.replace("\t", " ")
    try:
        for event in yaml.parse(text, yaml.BaseLoader):
            if isinstance(event, yaml.AliasEvent):
                line = event.start_mark.line + 1
                raise FormatError(f"{name}: line {line}: aliases are not supported")
        documents = list(yaml.compose_all(text, yaml.BaseLoader)) or [None]
    except yaml.YAMLError as error:
        raise FormatError(f"{name}: no YAML: {' '.join(str(error).split())}") from None
    values = [_value(yaml, node, name) if node else None for node in documents]
    root = values[0]
    if not isinstance(root, dict):
        raise FormatError(f"{name}: no YAML map of names and values")

    def says(value: Any) -> Any:
        return ({entry: item for entry, item in value.items() if entry != "header"}
                if isinstance(value, dict) else value)
    if any(value is not None and says(value) != says(root) for value in values[1:]):
        raise FormatError(f"{name}: {len(values)} documents (---) that say different things: keep "
                          "one")
    return root


def _xml_value(element: Any, name: str) -> Any:
    """An element of OpenCV's XML as YAML would give it: a map, a list or a word."""
    content = (element.text or "").strip()
    if len(element) == 0:
        is_list = not content.startswith('"') and (
            element.tag in ("data", "sizes") or len(content.split()) > 1)
        return content.split() if is_list else content.strip('"') or None
    if all(part.tag == "_" for part in element):
        return [_xml_value(part, name) for part in element]
    values: dict[str, Any] = {}
    for part in element:
        if part.tag in values:
            raise FormatError(f"{name}: {part.tag} is given twice")
        values[part.tag] = _xml_value(part, name)
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
        raise FormatError(f"{name}: XML of {root.tag[:40]}, not OpenCV's opencv_storage (Metashape "
                          "saves this as OpenCV Calibration)")
    values = _xml_value(root, name)
    return values if isinstance(values, dict) else {}


# ---- COLMAP --------------------------------------------------------------------------------------

_PINHOLE, _BROWN, _FISHEYE = (CameraModel.PINHOLE, CameraModel.BROWN_CONRADY,
                              CameraModel.KANNALA_BRANDT)
_ONE, _TWO = (0, 0, 1, 2), (0, 1, 2, 3)  # places of fx fy cx cy among the parameters
#: COLMAP's models: the lens, the places of fx fy cx cy, and for each parameter behind them its
#: place in Camera.k, or its name where no model here has it, so that it must be 0.
COLMAP_MODELS: dict[str, tuple[CameraModel, tuple[int, ...], tuple[Union[int, str], ...]]] = {
    "SIMPLE_PINHOLE": (_PINHOLE, _ONE, ()),
    "PINHOLE": (_PINHOLE, _TWO, ()),
    "SIMPLE_RADIAL": (_BROWN, _ONE, (0,)),
    "RADIAL": (_BROWN, _ONE, (0, 1)),
    "OPENCV": (_BROWN, _TWO, (0, 1, 2, 3)),
    "FULL_OPENCV": (_BROWN, _TWO, (0, 1, 2, 3, 4, 5, 6, 7)),
    "SIMPLE_FISHEYE": (_FISHEYE, _ONE, ()),
    "FISHEYE": (_FISHEYE, _TWO, ()),
    "SIMPLE_RADIAL_FISHEYE": (_FISHEYE, _ONE, (0,)),
    "RADIAL_FISHEYE": (_FISHEYE, _ONE, (0, 1)),
    "OPENCV_FISHEYE": (_FISHEYE, _TWO, (0, 1, 2, 3)),
    "THIN_PRISM_FISHEYE": (_FISHEYE, _TWO, (0, 1, "p1", "p2", 2, 3, "sx1", "sy1")),
    "RAD_TAN_THIN_PRISM_FISHEYE": (_FISHEYE, _TWO, (0, 1, 2, 3, "k4", "k5", "p0", "p1", "s0", "s1",
                                                    "s2", "s3")),
    "SIMPLE_DIVISION": (_PINHOLE, _ONE, ("k",)),
    "DIVISION": (_PINHOLE, _TWO, ("k",)),
}


def colmap_camera(model: str, width: int, height: int, params: Sequence[float],
                  where: str) -> Camera:
    """The camera of one of COLMAP's models. FormatError, which begins with `where`, names a model
    or a parameter that no lens here has."""
    if model not in COLMAP_MODELS:
        raise FormatError(f"{where}: COLMAP's model {model[:40]} is not one of "
                          + ", ".join(COLMAP_MODELS))
    lens, places, tail = COLMAP_MODELS[model]
    first = places[3] + 1
    if len(params) != first + len(tail):
        raise FormatError(f"{where}: {model} has {first + len(tail)} parameters, not {len(params)}")
    k = [0.0] * NUM_MODELLED
    for place, value in zip(tail, params[first:]):
        if isinstance(place, int):
            k[place] = float(value)
        elif value:
            raise FormatError(f"{where}: {model}'s {place} is not 0, and no lens here has it")
    fx, fy, cx, cy = (float(params[place]) for place in places)
    return checked_camera(int(width), int(height), (fx, fy, cx - HALF_PIXEL, cy - HALF_PIXEL), lens,
                          k, where)


def _colmap_lines(text: str) -> list[tuple[int, list[str]]]:
    """The fields of each line that is neither blank nor a comment, with its number."""
    lines = ((number, line.split()) for number, line in enumerate(text.split("\n"), 1))
    return [(number, fields) for number, fields in lines
            if fields and not fields[0].startswith("#")]


def _is_colmap(text: str) -> bool:
    """Whether the first line with content begins as COLMAP's: a number and a model's name."""
    for _, fields in _colmap_lines(text)[:1]:
        return (len(fields) >= 3 and re.fullmatch("[0-9]+", fields[0]) is not None
                and re.fullmatch("[A-Z][A-Z0-9_]*", fields[1]) is not None)
    return False


def _colmap_cameras(text: str, name: str) -> dict[str, Camera]:
    cameras = {}
    for number, fields in _colmap_lines(text):
        where = f"{name}: line {number}"
        if len(fields) < 3:
            raise FormatError(f"{where} is not CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS")
        values = []
        for field in fields[2:]:
            try:
                values.append(parse_number(field))
            except FormatError:
                raise FormatError(f"{where}: '{field[:40]}' is no finite number") from None
        if fields[0] in cameras:
            raise FormatError(f"{where}: camera {fields[0]} is given twice")
        if len(values) < 2:
            raise FormatError(f"{where} is not CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS")
        cameras[fields[0]] = colmap_camera(
            fields[1], side_of(values[0], "WIDTH", where), side_of(values[1], "HEIGHT", where),
            values[2:], where)
    return cameras


# ---- formats of entries --------------------------------------------------------------------------

class _Read:
    """What a file holds, as it is read."""

    def __init__(self) -> None:
        self.cameras: dict[str, Camera] = {}
        self.calibration = PLAIN_FILE
        self.left_out: list[str] = []

    def add(self, name: str, values: Mapping[str, Any], where: str) -> None:
        self.cameras[name] = take_camera(Entries(values, where), self.left_out)

    def judge(self, root: Mapping[str, Any], where: str) -> None:
        """Judges the entries beside the cameras; how sure the calibration is may be among them."""
        rest = Entries(root, where)
        self.calibration = PLAIN_FILE._replace(**sigmas_of(rest))
        refused, left_out = rest.judged()
        refuse(refused, where)
        self.left_out += left_out


def camera_set_of(root: Mapping[str, Any], name: str,
                  left_out: Optional[list[str]] = None) -> dict[str, Camera]:
    """The cameras of a parsed cameras.yaml, in the order of the file."""
    cameras, more = {}, [] if left_out is None else left_out
    for entry, values in root.items():
        where = f"{name}: {entry}"
        if not isinstance(values, dict):
            raise FormatError(f"{where} is not a map of names and values")
        cameras[entry] = take_camera(Entries(values, where), more)
    if not cameras:
        raise FormatError(f"{name}: no camera in it")
    return cameras


_ORB_SLAM = re.compile(r"(Camera[0-9]*)\.(.+)")
# Of ORB-SLAM's, stella_vslam's and VINS's settings: the parts that are not of the camera.
_OTHER_SETTINGS = re.compile(
    r"(IMU|Viewer|ORBextractor|System|Stereo|RGBD|Tracking|Mapping|Feature|Initializer"
    r"|PangolinViewer|SocketPublisher|Preprocessing|KeyframeInserter|Relocalizer|LoopDetector"
    r"|LoopBundleAdjuster|GraphOptimizer|MarkerModel|loopClosing)(\..*)?")


def _orb_slam(root: Mapping[str, Any], name: str, read: _Read) -> bool:
    """ORB-SLAM's settings: Camera.fx, or Camera1.fx and Camera2.fx beside Camera.width."""
    parts: dict[str, dict[str, Any]] = {}
    rest = {}
    for entry, value in root.items():
        found = _ORB_SLAM.fullmatch(entry)
        if found:
            parts.setdefault(found[1], {})[found[2]] = value
        elif not _OTHER_SETTINGS.fullmatch(entry):
            rest[entry] = value
    shared = parts.pop("Camera", {})
    lenses = {part: values for part, values in parts.items() if is_camera(values)}
    for part in parts.keys() - lenses.keys():
        rest[part] = parts[part]
    common = {entry: value for entry, value in shared.items()
              if entry not in ("fx", "fy", "cx", "cy", *COEFFICIENTS)}
    if is_camera(shared):
        lenses = {"Camera": {}, **lenses}
    for part, values in lenses.items():
        mine = shared if part == "Camera" else {**common, **values}
        read.add("" if len(lenses) == 1 else part, mine, f"{name}: {part}")
    if lenses:
        read.judge(rest, name)
    return bool(lenses)


def _vins(root: Mapping[str, Any], name: str, read: _Read) -> bool:
    """VINS's camera files (camodocal): the model's name, and maps of its parameters."""
    if "model_type" not in root or not {"projection_parameters", "mirror_parameters",
                                        "poly_parameters"} & set(root):
        return False
    word = word_of(root["model_type"], "model_type", name)
    values = {entry: value for entry, value in root.items()
              if entry != "fisheye" and not _OTHER_SETTINGS.fullmatch(entry)}
    if plain(word) == "kannalabrandt":  # its k2 to k5 are of theta^3 to theta^9; mu, mv are fx, fy
        names = {"k2": "k1", "k3": "k2", "k4": "k3", "k5": "k4", "mu": "fx", "mv": "fy", "u0": "cx",
                 "v0": "cy"}
        inner = values.get("projection_parameters")
        if isinstance(inner, dict):
            values["projection_parameters"] = {names.get(key, f"?{key}"): item
                                               for key, item in inner.items()}
    elif plain(word) in ("pinhole", "pinholefull"):
        del values["model_type"]  # PINHOLE_FULL has k4, k5, k6
    else:
        raise FormatError(f"{name}: VINS's model_type '{word[:40]}' is not one of PINHOLE, "
                          "PINHOLE_FULL, KANNALA_BRANDT: no lens here is that")
    read.add("", values, name)
    return True


def _nerfstudio(root: Mapping[str, Any], name: str, read: _Read) -> bool:
    """nerfstudio's and instant-ngp's transforms.json: COLMAP's numbers with names of their own."""
    frames = root.get("frames")
    of_lens = {"fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "k4", "p1", "p2", "w", "h",
               "distortion_params", "camera_model", "is_fisheye"}
    own = next((key for frame in frames if isinstance(frame, dict) for key in frame
                if key in of_lens), None) if isinstance(frames, list) else None
    if own:
        raise FormatError(f"{name}: a frame has {own} of its own (one camera for each picture); "
                          + _WRITE_OURS)
    if "fl_x" not in root:
        return False
    if "fl_y" not in root:
        root = {**root, "fl_y": root["fl_x"]}
    flag = word_of(root.get("is_fisheye"), "is_fisheye", name)  # instant-ngp's
    if (root.get("camera_model") not in ("OPENCV_FISHEYE", "FISHEYE")
            and plain(flag) not in ("true", "1")):
        k4 = root.get("k4")
        if k4 is not None and number_of(k4, "k4", name) != 0:
            raise FormatError(f"{name}: k4 is not 0, and no lens here has nerfstudio's k4")
    read.add("", {key: value for key, value in root.items() if key != "scale"}, name)
    camera = read.cameras[""]
    read.cameras[""] = Camera(camera.width, camera.height, camera.fx, camera.fy,
                              camera.cx - HALF_PIXEL, camera.cy - HALF_PIXEL, camera.model,
                              camera.k)
    return True


_STEREO = re.compile("(m|k|cameramatrix|matrix|mtx|intrinsics?)(1|2|l|r|left|right)|"
                     "(left|right)(k|cameramatrix|matrix|mtx|intrinsics?)|"
                     "(1|2|l|r)(cameramatrix|mtx)")


def _refuse_by_name(root: Mapping[str, Any], name: str) -> None:
    """Refuses the files of other programs whose cameras are not read, with what to do."""
    pair = [entry for entry, value in root.items()
            if _STEREO.fullmatch(plain(entry)) and isinstance(value, (dict, list))]
    if pair:
        raise FormatError(f"{name}: a file of several cameras ({', '.join(pair[:4])}), which are "
                          "read one a file: for each, " + _WRITE_OURS)
    items = [item for item in root.values() if isinstance(item, dict)]
    intrinsics = root.get("intrinsics")
    other = (
        "Basalt's calibration" if "value0" in root else
        "Gyroflow's lens profile" if "fisheye_params" in root else
        "OpenSfM's camera_models.json, whose focal length is relative to the picture's size"
        if any("projection_type" in item for item in items) else
        "OpenMVG's or AliceVision's scene" if "sfm_data_version" in root or (
            isinstance(intrinsics, list) and any(isinstance(i, dict) for i in intrinsics)) else
        "KITTI's calibration" if {"P0", "K_00", "P_rect_00"} & set(root) else
        "DepthAI's calibration of an OAK, each of whose cameras has an intrinsicMatrix, a "
        "distortionCoeff, a width and a height" if "cameraData" in root else
        "Project Aria's calibration, whose lens models are not ours: undistort its pictures with "
        "its own tools, as of a pinhole" if {"ModelName", "Params"} <= set(root) else
        "MATLAB's camera, whose ImageSize is [rows, columns] and whose first pixel is (1, 1), not "
        "(0, 0); RadialDistortion is k1 k2 (k3), TangentialDistortion p1 p2"
        if "RadialDistortion" in root else "")
    if other:
        raise FormatError(f"{name}: {other}; {_WRITE_OURS}")


def _refuse_binary(text: str, name: str) -> None:
    """Refuses what is no text: archives of numpy, databases, pickles, COLMAP's .bin."""
    what = ("a zip archive, as numpy's .npz" if text.startswith("PK\x03\x04") else
            "a database, as COLMAP's" if text.startswith("SQLite format 3") else
            "text in UTF-16: save it as UTF-8"
            if text.startswith(("\udcff\udcfe", "\udcfe\udcff")) else
            "compressed: unpack it" if text.startswith("\x1f\udc8b") else
            "a binary file, no text" if "\0" in text else "")
    if what:
        raise FormatError(f"{name}: {what}{KNOWN}")


def _refuse_text_by_name(text: str, name: str) -> None:
    """Refuses the text files of other programs, with what to do."""
    first = next((line.split() for line in text.split("\n") if line.strip()), [])
    if text.startswith("# oST") or first == ["[image]"]:
        raise FormatError(f"{name}: ROS's INI (oST); convert it: rosrun camera_calibration_parsers "
                          "convert camera.ini camera.yaml")
    if first and re.fullmatch(r"\[[A-Z0-9_]+\]", first[0]):
        raise FormatError(f"{name}: an INI file, as ZED's cameras have; {_WRITE_OURS}")
    if text.startswith("Pix4D"):
        raise FormatError(f"{name}: Pix4D's camera; {_WRITE_OURS}")
    is_dso = bool(first) and first[0] in ("Pinhole", "RadTan", "FOV", "EquiDistant", "ATAN",
                                          "KannalaBrandt")
    numbers = [word for word in first if re.fullmatch(r"[-+0-9.eE]+", word)]
    unnumbered = re.match(r"(?:(?!\d+ )\S+ )?([A-Z]+(?:_[A-Z0-9]+)* \d+ \d+) \S+ \S",
                          " ".join(first))
    if unnumbered:
        raise FormatError(f"{name}: a line of COLMAP's cameras.txt begins with the camera's "
                          f"number: 1 {unnumbered[1]} ...")
    is_dso = is_dso and len(first) > 1
    if not is_dso and (len(first) < 3 or len(numbers) < len(first)):
        return
    what = ("a camera of DSO, whose numbers may be relative to the picture's size" if is_dso else
            "a matrix alone (ScanNet's intrinsics?), without the picture's size"
            if len(first) in (3, 4) else
            "width, height, fx, fy, cx, cy, as of ARKitScenes' .pincam?" if len(first) == 6 else
            "a camera of DSO, LSD-SLAM or PTAM (tum_ardrone)? Their numbers may be relative to "
            "the picture's size")
    raise FormatError(f"{name}: numbers without names: {what}; {_WRITE_OURS}")


def _svo(root: Mapping[str, Any], name: str, read: _Read) -> bool:
    """SVO's and maplab's calibration: a list `cameras` of maps `camera`."""
    cameras = root.get("cameras")
    if not isinstance(cameras, list):
        return False
    for i, item in enumerate(cameras):
        inner = item.get("camera", item) if isinstance(item, dict) else None
        where = f"{name}: cameras[{i}]"
        if not isinstance(inner, dict) or not is_camera(inner):
            raise FormatError(f"{where} is no camera with intrinsics (OKVIS's are not read); "
                              + _WRITE_OURS)
        label = inner.get("label")
        camera_name = label if isinstance(label, str) else f"cam{i}"
        if camera_name in read.cameras:
            raise FormatError(f"{where}: {camera_name} is given twice")
        read.add(camera_name, inner, where)
    read.judge({key: item for key, item in root.items() if key != "cameras"}, name)
    return bool(cameras)


def _named(root: Mapping[str, Any], name: str, read: _Read) -> bool:
    """Kalibr's camchain, a data set's cameras.yaml, stella_vslam's settings: maps by name."""
    rest = {}
    for entry, values in root.items():
        if is_camera(values):
            read.add(entry, values, f"{name}: {entry}")
        elif not _OTHER_SETTINGS.fullmatch(entry):
            rest[entry] = values
    if read.cameras:
        read.judge(rest, name)
    return bool(read.cameras)


def _root_of(text: str, name: str) -> dict[str, Any]:
    is_xml = text.lstrip(" \t\r\n").startswith("<")
    try:
        return (_parse_xml if is_xml else parse_yaml)(text, name)
    except FormatError as error:
        raise FormatError(f"{error}{KNOWN}") from None


def _read_file(text: str, name: str) -> _Read:
    read = _Read()
    text = text[1:] if text.startswith("\ufeff") else text
    if _is_colmap(text):
        read.cameras = _colmap_cameras(text, name)
        return read
    _refuse_binary(text, name)
    _refuse_text_by_name(text, name)
    root = _root_of(text, name)
    if is_camera(root) and "fl_x" not in root and "model_type" not in root:
        _refuse_by_name(root, name)
        entries = Entries(root, name)
        read.calibration = PLAIN_FILE._replace(**sigmas_of(entries))
        entry = root.get("camera_name")
        read.cameras[entry if isinstance(entry, str) else ""] = take_camera(entries, read.left_out)
        return read
    if any(known(root, name, read) for known in (_orb_slam, _vins, _nerfstudio, _svo)):
        return read
    _refuse_by_name(root, name)
    if "cam0_calib" in root:
        file = word_of(root["cam0_calib"], "cam0_calib", name)
        raise FormatError(f"{name}: VINS's settings, whose cameras are in files of their own: give "
                          f"{file[:80]} (cam0_calib)")
    if _named(root, name, read):
        return read
    refused = Entries(root, name).missing("camera_matrix")
    raise FormatError(f"{refused}{KNOWN}")


def parse_cameras(text: str, name: str) -> dict[str, Camera]:
    """The cameras of a text in any of the formats, by their names: those of a camchain or a
    cameras.yaml, COLMAP's numbers, ROS's camera_name; "" for a camera without a name.

    text: what the file holds. name: of the file, for messages.
    Returns {name: Camera}, which the library has not checked. Gives a CameraFileWarning that lists
    the entries that were left out, since they cannot concern the lens.
    Raises FormatError that names the file, the entry and, where no format is recognised, the
    formats that are known; ImportError without PyYAML."""
    read = _read_file(text, name)
    if read.left_out:
        shown = ", ".join(read.left_out[:8]) + (", ..." if len(read.left_out) > 8 else "")
        warnings.warn(f"{name}: left out: {shown}", CameraFileWarning, stacklevel=3)
    return read.cameras


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


def read_camera(path: PathLike, name: Optional[str] = None,
                scale_to: Optional[tuple[int, int]] = None) -> Camera:
    """The camera of a file, or the one of that name in a file with several.

    path: of the file, in any format of read_cameras. name: None where the file has one camera.
    scale_to: None, or (width, height) of the picture, whose camera Camera.scaled makes.
    Returns a Camera.
    Raises as read_cameras does, FormatError that lists the names where none or several fit, and
    ValueError where scale_to has another shape."""
    camera = only_camera(read_cameras(path), name, os.fspath(path))
    return camera if scale_to is None else camera.scaled(*scale_to)


def read_calibration(path: PathLike) -> Calibration:
    """How uncertain the calibration in a camera file is: its entries focal_sigma (relative) and
    center_sigma (in focal lengths), which `twoview calibrate` writes.

    path: of the file, in any format of read_cameras.
    Returns a Calibration whose focal length may be refined; its deviations are those of PLAIN_FILE,
    0.01 and 0.005, where the file does not say.
    Raises FormatError for a file that read_cameras refuses, and where one is not in [0, 0.5];
    OSError; ImportError without PyYAML."""
    return _read_file(read_text(path), os.fspath(path)).calibration


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


def _sigma_entries(calibration: Optional[Calibration]) -> list[tuple[str, str]]:
    return [] if calibration is None else [("focal_sigma", _digits(calibration.focal_sigma)),
                                           ("center_sigma", _digits(calibration.center_sigma))]


def _opencv(name: str, camera: Camera, calibration: Optional[Calibration]) -> str:
    def matrix(entry: str, rows: int, values: list[float]) -> str:
        return (f"{entry}: !!opencv-matrix\n   rows: {rows}\n   cols: {len(values) // rows}\n"
                f"   dt: d\n   data: [ {', '.join(map(_digits, values))} ]\n")
    return ("%YAML:1.0\n---\n"
            f"image_width: {camera.width}\nimage_height: {camera.height}\n"
            + matrix("camera_matrix", 3, _matrix_of(camera))
            + ("distortion_model: equidistant\n" if _is_fisheye(camera) else "")
            + matrix("distortion_coefficients", 1, _coefficients(camera))
            + "".join(f"{entry}: {value}\n" for entry, value in _sigma_entries(calibration)))


def _opencv_xml(name: str, camera: Camera, calibration: Optional[Calibration]) -> str:
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
            + "".join(f"<{entry}>{value}</{entry}>\n"
                      for entry, value in _sigma_entries(calibration))
            + "</opencv_storage>\n")


def _ros(name: str, camera: Camera, calibration: Optional[Calibration]) -> str:
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
            + "".join(f"{entry}: {value}\n" for entry, value in _sigma_entries(calibration)))


def _quoted(name: str) -> str:
    if re.fullmatch(r"[A-Za-z_][\w./-]*", name) and name.lower() not in ("null", "true", "false",
                                                                         "yes", "no", "on", "off"):
        return name
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _kalibr(name: str, camera: Camera, calibration: Optional[Calibration]) -> str:
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


def _camera_set(name: str, camera: Camera, calibration: Optional[Calibration]) -> str:
    k = _padded(camera)
    num = 4 if _is_fisheye(camera) else 8 if any(k[5:]) else 5
    names = (FISHEYE_COEFFICIENTS if _is_fisheye(camera) else COEFFICIENTS)[:num]
    entries = zip(("fx", "fy", "cx", "cy", *names),
                  (camera.fx, camera.fy, camera.cx, camera.cy, *k[:num]))
    return (f"{_quoted(name)}:\n  image_width: {camera.width}\n  image_height: {camera.height}\n"
            + ("  distortion_model: equidistant\n" if _is_fisheye(camera) else "")
            + "".join(f"  {entry}: {_digits(value)}\n" for entry, value in entries))


def _colmap(name: str, camera: Camera, calibration: Optional[Calibration]) -> str:
    k = _padded(camera)
    model, k = (("PINHOLE", []) if camera.model == CameraModel.PINHOLE else
                ("OPENCV_FISHEYE", k[:4]) if _is_fisheye(camera) else
                ("OPENCV", k[:4]) if not any(k[4:]) else ("FULL_OPENCV", k))
    values = [camera.fx, camera.fy, camera.cx + HALF_PIXEL,
              camera.cy + HALF_PIXEL, *k]
    return f"{name} {model} {camera.width} {camera.height} {' '.join(map(_digits, values))}\n"


_Writer = Callable[[str, Camera, Optional[Calibration]], str]
# {format: (its writer, whether a file holds several cameras, whether it holds deviations)}
_WRITERS: dict[str, tuple[_Writer, bool, bool]] = {
    "opencv": (_opencv, False, True), "opencv-xml": (_opencv_xml, False, True),
    "ros": (_ros, False, True), "kalibr": (_kalibr, True, False),
    "cameras.yaml": (_camera_set, True, False), "colmap": (_colmap, True, False)}
FORMATS = tuple(_WRITERS)


def format_cameras(cameras: Union[Camera, Mapping[str, Camera]], format: str = "opencv",
                   calibration: Optional[Calibration] = None) -> str:
    """The text of a camera file. Reading it gives the same cameras, bit for bit (COLMAP's cx and cy
    to the last bit or two).

    cameras: a Camera, or {name: Camera} for a format with names; COLMAP's names are numbers, others
    are replaced by 1, 2 and so on. format: "opencv" (YAML), "opencv-xml", "ros" (camera_info),
    "kalibr" (camchain), "cameras.yaml" or "colmap" (cameras.txt). calibration: None, or its
    standard deviations, which "opencv", "opencv-xml" and "ros" have entries for.
    Returns the text.
    Raises ValueError for another format, for a lens or a calibration that the format does not have,
    for several cameras in a format of one, and for numbers that read_cameras refuses; TV_ERR_CAMERA
    for a camera that the library refuses."""
    if format not in _WRITERS:
        raise ValueError(f"format '{format}' is not one of {', '.join(FORMATS)}")
    write, has_names, has_deviations = _WRITERS[format]
    if calibration is not None and not has_deviations:
        raise ValueError(f"calibration: the format {format} has no entry for it")
    named = {"cam0": cameras} if isinstance(cameras, Camera) else dict(cameras)
    if not named or (len(named) > 1 and not has_names):
        raise ValueError(f"{len(named)} cameras: a file of the format {format} holds "
                         + ("at least one" if has_names else "one"))
    for name, camera in named.items():
        camera_check(camera)
        checked_camera(camera.width, camera.height, (camera.fx, camera.fy, camera.cx, camera.cy),
                       CameraModel(camera.model), camera.k, name)
    if format == "colmap" and not all(re.fullmatch("[0-9]+", name) for name in named):
        named = {str(number): camera for number, camera in enumerate(named.values(), 1)}
    head = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS\n" if format == "colmap" else ""
    return head + "".join(write(name, camera, calibration) for name, camera in named.items())


def write_cameras(path: PathLike, cameras: Union[Camera, Mapping[str, Camera]],
                  format: str = "opencv", calibration: Optional[Calibration] = None) -> None:
    """Writes a camera file, under a temporary name first, so that none stays half written.

    path: of the file; an existing one is replaced. cameras, format, calibration: as for
    format_cameras.
    Returns None.
    Raises as format_cameras does, before anything is written, and OSError."""
    text = format_cameras(cameras, format, calibration)
    temporary = f"{os.fspath(path)}.{os.getpid()}"
    file = open(temporary, "x", encoding="utf-8")
    try:
        with file:
            file.write(text)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise
