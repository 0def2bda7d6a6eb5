"""The entries of one camera: those that are understood, those that cannot concern the lens, and
those that are refused because they may. No entry is ignored without a word.

The program's twin is tools/twoview/files/camera_entries.h; both run the cases of test/formats. A
name is compared without its case and without what is neither a letter nor a digit, so that
distCoeffs, dist_coeffs and Dist-Coeffs are one name."""

from __future__ import annotations

import math
import re
from typing import Any, Callable, Iterator, Mapping, NamedTuple, Optional, Sequence

from .camera import FARTHEST_CENTER, SHORTEST_FOCAL, Camera, exchanged
from .enums import CameraModel

NUM_MODELLED = 8  # coefficients k1 k2 p1 p2 k3 k4 k5 k6 of a Camera
OPENCV_COUNTS = (0, 4, 5, 8, 12, 14)

# The names of each entry, the first one for messages.
WIDTH = ("image_width", "width", "img_width", "cols", "w")
HEIGHT = ("image_height", "height", "img_height", "rows", "h")
SIZE = ("resolution", "image_size", "img_size", "image_resolution")
INTRINSICS = ("intrinsics", "intrinsic", "camera_intrinsics", "projection_parameters")
MATRIX = ("camera_matrix", "k", "camera_mat", "cam_matrix", "intrinsic_matrix",
          "intrinsics_matrix", "mtx", *INTRINSICS)
FOCAL = (("fx", "fl_x", "fu"), ("fy", "fl_y", "fv"))
CENTER = (("cx", "ppx", "cu", "u0"), ("cy", "ppy", "cv", "v0"))
DISTORTION = ("distortion_coefficients", "distortion_coefficient", "distortion_coeffs",
              "distortion_coeff", "distortion_coefs", "distortion_coef", "dist_coefficients",
              "dist_coeffs", "dist_coeff", "dist_coefs", "dist_coef", "distortion", "dist", "d",
              "coeffs", "distortion_parameters", "distortion_params", "distortion_vector",
              "lens_distortion", "parameters")
COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")  # of Brown and Conrady
FISHEYE_COEFFICIENTS = ("k1", "k2", "k3", "k4")
MODEL = ("distortion_model", "camera_model", "model_type", "camera_type", "lens_model", "lens_type",
         "distortion_type", "projection_model", "model", "type")
FISHEYE = ("fisheye_model", "fisheye", "is_fisheye", "use_fisheye")
RECTIFICATION, PROJECTION = ("rectification_matrix", "r"), ("projection_matrix", "p")
SIGMAS = ("focal_sigma", "center_sigma")

# What the words of MODEL say of the lens. PINHOLE says nothing of it: Kalibr's camera_model is
# "pinhole" beside any distortion_model.
PINHOLE, NONE, BROWN, FISHEYE_LENS = "pinhole", "none", "brown", "fisheye"
WORDS = {
    **dict.fromkeys(("pinhole", "simplepinhole", "perspective"), PINHOLE),
    **dict.fromkeys(("none", "nodistortion", "distortionnone", "rectified"), NONE),
    **dict.fromkeys(("plumbbob", "rationalpolynomial", "radtan", "radialtangential",
                     "pinholeradtan", "brownconrady", "distortionbrownconrady", "opencv"), BROWN),
    **dict.fromkeys(("equidistant", "equi", "pinholeequi", "fisheye", "opencvfisheye",
                     "kannalabrandt", "kannalabrandt4", "kannalabrandt8",
                     "distortionkannalabrandt4", "kb4", "kb8"), FISHEYE_LENS)}
KNOWN_WORDS = ("pinhole, perspective, plumb_bob, rational_polynomial, fisheye, kannala_brandt, "
               "radtan, equidistant, none")

# Names that cannot concern the lens: dates, the board, the fit's errors, poses, topics.
HARMLESS = frozenset("""
    calibrationtime calibrationdate date time timestamp timestampns header seq stamp frameid
    cameraname name label id uuid serial serialnumber cameraid comment comments description note
    notes author version fileversion typeid nrofframes numframes numimages nframes nimages nviews
    numviews flags calibrationflags aspectratio fixaspectratio avgreprojectionerror
    reprojectionerror reprojectionerrors meanreprojectionerror meanerror rms rmserror error errors
    stddeviations tcamimu timucam tcncnm1 tbs tsb tbc tcb tic bodytcam0 bodytcam1 camoverlaps
    rostopic topic imagetopic timeshiftcamimu td estimatetd estimateextrinsic ratehz rate fps
    framerate sensortype rgb colororder bf thdepth depththreshold depthmapfactor setup mindist
    bodyfromcamera camerainbody rvecs tvecs rotationvectors translationvectors imagepoints
    objectpoints gridpoints newwidth newheight cameraanglex cameraangley frames plyfilepath
    appliedtransform appliedscale aabbscale orientationoverride dorectify
    """.split())
HARMLESS_STARTS = ("board", "square", "marker", "pattern", "checker", "chessboard", "aruco",
                   "charuco", "grid", "perview", "extrinsic", "calibrateusing", "overlapping",
                   "lapping", "imu")
# Names that may concern the lens: what they contain, or the whole of them.
_SUSPECT = re.compile(
    "dist|coef|lens|fish|focal|radial|tangential|skew|binning|roi|sigma|resol|width|height|size|"
    "shape|dimension|intrinsic|principal|scale|crop|zoom|omni|mirror|model|matrix|rectif|prism|"
    "division|project|stretch|optic|pixel|cameratype|cameramat|kappa|lambda|barrel|warp|curv")
_SUSPECT_WHOLE = re.compile(
    "f|fx|fy|cx|cy|fu|fv|cu|cv|u0|v0|mu|mv|ppx|ppy|flx|fly|w|h|k|d|p|r|s|a|b|c|e|m|xi|alpha|beta|"
    "gamma|[kpsbdmarqt][0-9]+|ks|ps|tau[xy]?|tx|ty|poly[0-9]*|invpol.*|[hvd]?fov|cols|rows|mtx|"
    "type")
# Of these a value of 0 says that there is none.
_ZERO_IS_NONE = re.compile("[kpsbqt][0-9]+|[abc]|skew|tau[xy]?|tx|ty|radial|tangential|xi|"
                           "kappa[0-9]*|lambda|barrel")

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?\.?(nan|inf|infinity)", re.IGNORECASE)


class FormatError(ValueError):
    """A file that is refused. The message is one line that names the file and the entry, and the
    formats that are known where none is recognised."""


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


# ---- values --------------------------------------------------------------------------------------

def number_of(value: Any, entry: str, where: str) -> float:
    if value is None:
        raise FormatError(f"{where}: {entry} is missing")
    try:
        return parse_number(value if isinstance(value, str) else "")
    except FormatError as error:
        raise FormatError(f"{where}: {entry} {error}") from None


def side_of(value: float, entry: str, where: str) -> int:
    if value == 0:
        raise FormatError(f"{where}: {entry} is 0")
    if value != math.floor(value) or not 1 <= value <= 1e6:
        raise FormatError(f"{where}: {entry} is not a number of pixels")
    return int(value)


def check_focal(value: float, entry: str, where: str) -> None:
    if value <= 0:
        raise FormatError(f"{where}: {entry} is {'negative' if value < 0 else '0'}")


def _flat(values: list[Any], entry: str, where: str) -> Iterator[float]:
    for i, value in enumerate(values):
        name = f"{entry}[{i}]"
        if isinstance(value, list):
            yield from _flat(value, name, where)
        else:
            yield number_of("" if value is None else value, name, where)


def _shape_of(node: Mapping[str, Any], entry: str, where: str) -> list[float]:
    """The sides of OpenCV's and ROS's matrices (rows, cols) and of OpenCV 5's (sizes); [] where
    there are none."""
    if "sizes" in node:
        sizes = node["sizes"] if isinstance(node["sizes"], list) else [node["sizes"]]
        return list(_flat(sizes, f"{entry}.sizes", where))
    if "rows" in node and "cols" in node:
        return [number_of(node[side], side, f"{where}: {entry}") for side in ("rows", "cols")]
    return []


def numbers_of(node: Any, entry: str, where: str) -> list[float]:
    """The numbers of an entry: a list, a list of lists, or a map with data."""
    listed = node
    if isinstance(node, dict):
        if "data" not in node:
            raise FormatError(f"{where}: {entry} has no data")
        listed = node["data"]
    if not isinstance(listed, list):
        raise FormatError(f"{where}: {entry} is not a list of numbers")
    found = list(_flat(listed, entry, where))
    shape = _shape_of(node, entry, where) if isinstance(node, dict) else []
    # ROS's calibrator writes `cols: 5` above the 8 numbers of a rational_polynomial
    # (image_pipeline's issue 278).
    if shape and math.prod(shape) != len(found) and not (shape == [1, 5] and len(found) == 8):
        what = "sizes" if "sizes" in node else "rows x cols"
        raise FormatError(f"{where}: {entry} has {len(found)} numbers, not {what} = "
                          + " x ".join(f"{side:g}" for side in shape))
    return found


def word_of(value: Any, entry: str, where: str) -> str:
    if isinstance(value, (list, dict)):
        raise FormatError(f"{where}: {entry} is not a word")
    return value or ""


def counted(values: list[float], count: int, entry: str, where: str) -> list[float]:
    if len(values) != count:
        raise FormatError(f"{where}: {entry} has {len(values)} numbers, not {count}")
    return values


def checked_camera(width: int, height: int, K: Sequence[float], lens: CameraModel,
                   k: Sequence[float], where: str) -> Camera:
    """A Camera, after the checks that every format has: numbers that no lens has are most often in
    another unit, or of another picture."""
    for side, focal, center, axis in ((width, K[0], K[2], "x"), (height, K[1], K[3], "y")):
        check_focal(focal, f"f{axis}", where)
        if focal < SHORTEST_FOCAL * side:
            raise FormatError(f"{where}: f{axis} is {focal:g} pixels for an image of {side}: is it "
                              "in another unit?")
        if not -FARTHEST_CENTER * side <= center <= (1 + FARTHEST_CENTER) * side:
            raise FormatError(f"{where}: c{axis} is {center:g}, far outside an image of {side} "
                              "pixels: is this principal point of another picture?")
    question = exchanged((width, height), K)
    if question:
        raise FormatError(f"{where}: {question}")
    # An equidistant lens with four zero coefficients is no pinhole.
    if lens == CameraModel.BROWN_CONRADY and not any(k):
        lens = CameraModel.PINHOLE
    return Camera(width, height, K[0], K[1], K[2], K[3], lens,
                  () if lens == CameraModel.PINHOLE else tuple(k))


# ---- names ---------------------------------------------------------------------------------------

def plain(name: str) -> str:
    """A name without its case and without what is neither a letter nor a digit."""
    return re.sub("[^A-Za-z0-9]", "", name).lower()


def _plain(names: Sequence[str]) -> tuple[str, ...]:
    return tuple(plain(name) for name in names)


def is_harmless(name: str) -> bool:
    return plain(name) in HARMLESS or plain(name).startswith(HARMLESS_STARTS)


def may_concern_lens(name: str) -> bool:
    found = plain(name)
    return bool(_SUSPECT.search(found) or _SUSPECT_WHOLE.fullmatch(found))


def _is_zero(value: Any) -> bool:
    try:
        return (all(map(_is_zero, value)) if isinstance(value, list)
                else isinstance(value, str) and parse_number(value) == 0)
    except FormatError:
        return False


def judge(entry: str, value: Any, refused: list[str], left_out: list[str]) -> None:
    """Adds an entry that no reader understood to `refused` where it may concern the lens, and to
    `left_out` where it may not; to neither where it is empty or known to be harmless."""
    name = entry.rsplit(".", 1)[-1]
    if value is None or is_harmless(name):
        return
    if may_concern_lens(name):
        if not (_ZERO_IS_NONE.fullmatch(plain(name)) and _is_zero(value)):
            refused.append(entry)
        return
    inner: list[str] = []
    for part in value if isinstance(value, list) else [value]:
        for key, item in part.items() if isinstance(part, dict) and "data" not in part else ():
            judge(f"{entry}.{key}", item, refused, inner)
    left_out.append(entry)


def refuse(refused: Sequence[str], where: str) -> None:
    if refused:
        raise FormatError(f"{where}: {refused[0]} is not understood, and may concern the lens or "
                          "the size: see docs/formats.md, or remove it if it does not" +
                          (" (the scale of depth pictures, as Replica's?)"
                           if plain(refused[0]) == "scale" else ""))


class Found(NamedTuple):
    entry: str  #: as the file spells it
    value: Any


class Entries:
    """The entries of one camera, which its reader takes out one by one. Groups (VINS's
    projection_parameters, SVO's distortion) are taken apart."""

    _GROUPS = frozenset(_plain((*MATRIX, *DISTORTION, *SIZE, "roi"))) - {"k", "d"}

    def __init__(self, values: Mapping[str, Any], where: str) -> None:
        self.where = where
        self._left: list[tuple[str, str, Any]] = []  # plain name, name as in the file, value
        for entry, value in values.items():
            is_group = (isinstance(value, dict) and plain(entry) in self._GROUPS
                        and not {"data", "rows", "cols", "sizes"} & set(value))
            if not is_group or not value:
                self._left.append((plain(entry), entry, value))
                continue
            roi = "roi" if plain(entry) == "roi" else ""
            self._left += [(roi + plain(key), f"{entry}.{key}", item)
                           for key, item in value.items()]

    def take_all(self, names: Sequence[str]) -> list[Found]:
        """The entries of these names, in the file's order."""
        wanted = set(_plain(names))
        found = [Found(entry, value) for name, entry, value in self._left if name in wanted]
        self._left = [item for item in self._left if item[0] not in wanted]
        return found

    def take(self, names: Sequence[str],
             read: Callable[[Any, str, str], Any]) -> Optional[Found]:
        """The entry of one of these names, as `read` gives it; None where there is none or it is
        null. Several spellings of one entry must agree."""
        taken: Optional[Found] = None
        for entry, value in self.take_all(names):
            if value is None:
                continue
            again = Found(entry, read(value, entry, self.where))
            if taken is not None and taken.value != again.value:
                raise FormatError(f"{self.where}: {taken.entry} and {entry} contradict each other")
            taken = taken or again
        return taken

    def number(self, names: Sequence[str]) -> Optional[Found]:
        """As take, but a number that is null is an error."""
        for name, entry, value in self._left:
            if value is None and name in _plain(names):
                raise FormatError(f"{self.where}: {entry} is missing")
        return self.take(names, number_of)

    def has(self, names: Sequence[str]) -> bool:
        return any(name in _plain(names) for name, _, _ in self._left)

    def missing(self, entry: str) -> FormatError:
        """An error that says that `entry` is missing, and which entries were not understood."""
        refused = [name for name in self.judged()[0] if plain(name) not in _KNOWN]
        found = f" ({', '.join(refused[:4])}: not understood)" if refused else ""
        return FormatError(f"{self.where}: {entry} is missing{found}")

    def judged(self) -> tuple[list[str], list[str]]:
        refused: list[str] = []
        left_out: list[str] = []
        for _, entry, value in self._left:
            judge(entry, value, refused, left_out)
        return refused, left_out


_KNOWN = frozenset(_plain((
    *WIDTH, *HEIGHT, *SIZE, *MATRIX, *FOCAL[0], *FOCAL[1], *CENTER[0], *CENTER[1], *DISTORTION,
    *COEFFICIENTS, *MODEL, *FISHEYE, *RECTIFICATION, *PROJECTION)))


# ---- the camera of a map -------------------------------------------------------------------------

def _side(value: Any, entry: str, where: str) -> int:
    return side_of(number_of(value, entry, where), entry, where)


def _sides(value: Any, entry: str, where: str) -> tuple[int, int]:
    width, height = counted(numbers_of(value, entry, where), 2, entry, where)
    return side_of(width, f"{entry}[0]", where), side_of(height, f"{entry}[1]", where)


def _size(entries: Entries) -> tuple[int, int]:
    where = entries.where
    is_kalibrs = entries.has(INTRINSICS) and not entries.has(WIDTH + HEIGHT)
    both = entries.take(SIZE, _sides)
    sides = [entries.take(names, _side) for names in (WIDTH, HEIGHT)]
    if both is None:
        for side, names in zip(sides, (WIDTH, HEIGHT)):
            if side is None:
                raise entries.missing("resolution" if is_kalibrs else names[0])
        return sides[0].value, sides[1].value  # type: ignore[union-attr]
    for side, value in zip(sides, both.value):
        if side is not None and side.value != value:
            raise FormatError(f"{where}: {both.entry} and {side.entry} contradict each other")
    return both.value  # type: ignore[no-any-return]


def _four(value: Any, entry: str, where: str) -> tuple[float, ...]:
    """fx fy cx cy of a 3 x 3 matrix, or of the four numbers of Kalibr's intrinsics."""
    K = numbers_of(value, entry, where)
    if plain(entry.rsplit(".", 1)[-1]) in _plain(INTRINSICS) and len(K) != 9:
        counted(K, 4, entry, where)
        check_focal(K[0], f"fx ({entry}[0])", where)
        check_focal(K[1], f"fy ({entry}[1])", where)
        return tuple(K)
    counted(K, 9, entry, where)
    shape = _shape_of(value, entry, where) if isinstance(value, dict) else []
    if shape and shape != [3, 3]:
        side = "rows" if shape[0] != 3 else "cols"
        raise FormatError(f"{where}: {entry}: {side} is not 3")
    check_focal(K[0], f"fx ({entry}[0])", where)
    check_focal(K[4], f"fy ({entry}[4])", where)
    if K[1]:
        raise FormatError(f"{where}: {entry}[1] is not 0; skew is not supported")
    if not K[2] and not K[5] and K[6] and K[7]:
        raise FormatError(f"{where}: {entry} is transposed (Open3D, MATLAB), not "
                          "[fx 0 cx; 0 fy cy; 0 0 1]")
    if K[3] or K[6:] != [0, 0, 1]:
        raise FormatError(f"{where}: {entry} is not [fx 0 cx; 0 fy cy; 0 0 1]")
    return K[0], K[4], K[2], K[5]


def _pinhole(entries: Entries) -> tuple[float, ...]:
    matrix = entries.take(MATRIX, _four)
    numbers = [entries.number(names) for names in (*FOCAL, *CENTER)]
    if not any(numbers):
        if matrix is None:
            raise entries.missing(MATRIX[0])
        return matrix.value  # type: ignore[no-any-return]
    for number, names in zip(numbers, (*FOCAL, *CENTER)):
        if number is None:
            raise entries.missing(names[0])
    for number in numbers[:2]:
        check_focal(number.value, number.entry, entries.where)  # type: ignore[union-attr]
    K = tuple(number.value for number in numbers)  # type: ignore[union-attr]
    if matrix is not None and matrix.value != K:
        raise FormatError(f"{entries.where}: {matrix.entry} and {numbers[0].entry} "  # type: ignore
                          "contradict each other")
    return K


def _lens_word(value: Any, entry: str, where: str) -> str:
    word = word_of(value, entry, where)
    kind = WORDS.get(plain(word)) if word else PINHOLE
    # aslam's and SVO's "fisheye" within `distortion` is the FOV model.
    if kind is None or (plain(word) == "fisheye" and plain(entry) == "distortiontype"):
        raise FormatError(f"{where}: {entry} '{word[:40]}' is not one of {KNOWN_WORDS}")
    return kind


def _flag(value: Any, entry: str, where: str) -> bool:
    word = word_of(value, entry, where).lower()
    if word not in ("0", "1", "true", "false"):
        raise FormatError(f"{where}: {entry} is neither 0 nor 1")
    return word in ("1", "true")


def _model(entries: Entries) -> tuple[str, str]:
    """What the entries say of the lens, and the entry that says it."""
    kind, by = PINHOLE, ""
    for entry, value in entries.take_all(MODEL):
        said = _lens_word(value, entry, entries.where)
        if said == PINHOLE:
            continue
        if kind not in (PINHOLE, said):
            raise FormatError(f"{entries.where}: {by} and {entry} contradict each other")
        kind, by = said, entry
    flag = entries.take(FISHEYE, _flag)
    if flag is not None:
        if kind != PINHOLE and flag.value != (kind == FISHEYE_LENS):
            raise FormatError(f"{entries.where}: {by} and {flag.entry} contradict each other")
        if flag.value:
            kind, by = FISHEYE_LENS, flag.entry
    return kind, by


def _vector(value: Any, entry: str, where: str) -> list[float]:
    return numbers_of(value, entry, where)


def _named_coefficients(entries: Entries, is_fisheye: bool) -> Optional[tuple[str, list[float]]]:
    """The coefficients that are entries of their own, in the lens's order, and the first name."""
    order = FISHEYE_COEFFICIENTS if is_fisheye else COEFFICIENTS
    found = {name: entries.number((name,)) for name in COEFFICIENTS if entries.has((name,))}
    for name, number in found.items():
        if number is not None and number.value and name not in order:
            raise FormatError(f"{entries.where}: {number.entry} is not 0, but an equidistant lens "
                              f"has {' '.join(order)}")
    given = [number for number in found.values() if number is not None]
    if not given:
        return None
    return given[0].entry, [found[name].value if name in found else 0.0  # type: ignore[union-attr]
                            for name in order]


def _padded(values: Sequence[float]) -> list[float]:
    return list(values) + [0.0] * (max(OPENCV_COUNTS) - len(values))


def _distortion(entries: Entries, kind: str, by: str,
                left_out: list[str]) -> tuple[CameraModel, list[float]]:
    """The lens and its coefficients; `by` is the entry that says that the lens is a `kind`."""
    where = entries.where
    is_fisheye = kind == FISHEYE_LENS
    is_kalibrs = entries.has(("distortion_coeffs",))
    vector = entries.take(DISTORTION, _vector)
    named = _named_coefficients(entries, is_fisheye)
    if vector is not None and named and _padded(vector.value) != _padded(named[1]):
        raise FormatError(f"{where}: {vector.entry} and {named[0]} contradict each other")
    if vector is None and named is None:
        if kind in (PINHOLE, NONE):
            return CameraModel.PINHOLE, []
        raise entries.missing("distortion_coeffs" if is_kalibrs else DISTORTION[0])
    k = vector.value if vector is not None else named[1]  # type: ignore[index]
    entry = vector.entry if vector is not None else named[0]  # type: ignore[index]
    if kind == NONE:
        if any(k):
            raise FormatError(f"{where}: {by} says that there is no distortion, but {entry} is "
                              "not 0")
        return CameraModel.PINHOLE, []
    if len(k) not in ((4,) if is_fisheye else OPENCV_COUNTS):
        raise FormatError(f"{where}: {entry} has {len(k)} numbers, not "
                          + ("4" if is_fisheye else "4, 5, 8, 12 or 14"))
    for i, value in enumerate(k[NUM_MODELLED:], NUM_MODELLED):
        if value:
            raise FormatError(f"{where}: {entry} has {len(k)} numbers, of which {entry}[{i}] is "
                              "not 0: the lens models here end with the first 8 (no thin prism, no "
                              "tilted sensor); calibrate with 5 or 8")
    # cv2.fisheye has four coefficients as well, and its users save them without a model's name.
    if kind == PINHOLE and vector is not None and len(k) == 4 and any(k):
        left_out.append(f"{entry} as a fisheye's k1 k2 k3 k4 (4 numbers without a distortion_model "
                        "are k1 k2 p1 p2)")
    return (CameraModel.KANNALA_BRANDT if is_fisheye else CameraModel.BROWN_CONRADY,
            k[:NUM_MODELLED])


def _roi(entries: Entries) -> list[int]:
    """ROS's roi (x, y, width, height) and binning (x, y); 0 where a file has none."""
    def whole(value: Any, entry: str, where: str) -> int:
        number = number_of(value, entry, where)
        if number != math.floor(number) or not 0 <= number <= 1e6:
            raise FormatError(f"{where}: {entry} is not a number of pixels")
        return int(number)
    found = [entries.take((name,), whole)
             for name in ("roi_x_offset", "roi_y_offset", "roi_width", "roi_height", "binning_x",
                          "binning_y")]
    return [0 if number is None else number.value for number in found]


def _part_of_sensor(roi: Sequence[int], camera: Camera, where: str) -> Camera:
    """The camera of ROS's picture, which is the part `roi` of the sensor with binning_x x binning_y
    pixels made one. `camera` is of the whole sensor."""
    x, y, width, height, *bins = roi
    width, height = width or camera.width - x, height or camera.height - y
    if width < 1 or height < 1 or x + width > camera.width or y + height > camera.height:
        raise FormatError(f"{where}: roi is not within the {camera.width}x{camera.height} image")
    bin_x, bin_y = (max(1, value) for value in bins)
    if bin_x > width or bin_y > height:
        raise FormatError(f"{where}: binning is above the image's size")
    return Camera(width // bin_x, height // bin_y, camera.fx / bin_x, camera.fy / bin_y,
                  (camera.cx - x + 0.5) / bin_x - 0.5, (camera.cy - y + 0.5) / bin_y - 0.5,
                  camera.model, camera.k)


def _rectified(entries: Entries, K: Sequence[float]) -> list[str]:
    """The entries of ROS's rectified pictures, where these differ from the camera's own."""
    trivial = {RECTIFICATION: [1, 0, 0, 0, 1, 0, 0, 0, 1],
               PROJECTION: [K[0], 0, K[2], 0, 0, K[1], K[3], 0, 0, 0, 1, 0]}
    found = [(entries.take(names, _vector), same) for names, same in trivial.items()]
    return [f"{entry.entry} (of rectified pictures)" for entry, same in found
            if entry is not None and entry.value != same]


def sigmas_of(entries: Entries) -> dict[str, Any]:
    """The values of focal_sigma and center_sigma, where there are any."""
    found = {}
    for name in SIGMAS:
        number = entries.number((name,))
        if number is None:
            continue
        if not 0 <= number.value <= 0.5:
            raise FormatError(f"{entries.where}: {number.entry} is not in [0, 0.5]")
        found[name] = number.value
    return found


def take_camera(entries: Entries, left_out: list[str]) -> Camera:
    """The camera of these entries. Adds to left_out the names of those that were not needed;
    raises FormatError that names an entry which may concern the lens and is not understood."""
    kind, by = _model(entries)
    size = _size(entries)
    K = _pinhole(entries)
    lens, k = _distortion(entries, kind, by, left_out)
    roi = _roi(entries)
    left_out += _rectified(entries, K)
    refused, more = entries.judged()
    refuse(refused, entries.where)
    left_out += more
    whole = checked_camera(*size, K, lens, k, entries.where)
    return _part_of_sensor(roi, whole, entries.where)


def is_camera(values: Any) -> bool:
    """Whether a map describes a camera of its own."""
    if not isinstance(values, dict):
        return False
    return any(name in _plain((*FOCAL[0], *FOCAL[1]))
               or name in _plain(MATRIX) and not (name == "k" and isinstance(value, dict)
                                                  and "data" not in value)
               for name, value in ((plain(entry), value) for entry, value in values.items()))
