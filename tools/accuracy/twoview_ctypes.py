"""libtwoview.so through ctypes, for measuring and tuning only (the Python package is elsewhere).

The structs and enums are read from the public headers at import, so that they cannot drift from
them; load() checks every size that the library itself can tell (struct_size).
"""

import ctypes
import os
import re

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
INCLUDE_DIR = os.path.join(ROOT, "lib", "include", "twoview")
DEFAULT_LIBRARY = os.path.join(ROOT, "build", "release", "lib", "libtwoview.so")

_SCALARS = {
    "uint8_t": ctypes.c_uint8, "int32_t": ctypes.c_int32, "uint32_t": ctypes.c_uint32,
    "int64_t": ctypes.c_int64, "uint64_t": ctypes.c_uint64, "size_t": ctypes.c_size_t,
    "float": ctypes.c_float, "double": ctypes.c_double,
}


def _read_headers(folder):
    text = ""
    for name in ("version", "status", "context", "image", "camera", "feature", "match",
                 "two_view", "triangulate", "reconstruct"):
        with open(os.path.join(folder, name + ".h"), encoding="utf-8") as f:
            text += f.read() + "\n"
    return re.sub(r"/\*.*?\*/", " ", text, flags=re.S)


def _parse_enums(text):
    """{type name: {value name: number}}"""
    enums = {}
    for name, body in re.findall(r"typedef enum (\w+)\s*\{(.*?)\}\s*\1\s*;", text, flags=re.S):
        values, following = {}, 0
        for entry in filter(None, (e.strip() for e in body.split(","))):
            key, _, expression = (p.strip() for p in entry.partition("="))
            shift = re.fullmatch(r"(\d+)\s*<<\s*(\d+)", expression)
            if shift:
                following = int(shift[1]) << int(shift[2])
            elif expression:
                following = int(expression, 0)
            values[key] = following
            following += 1
        enums[name] = values
    return enums


def _parse_structs(text, constants):
    """{type name: ctypes.Structure}, with the fields in the headers' order."""
    structs = {}
    for name, body in re.findall(r"typedef struct (\w+)\s*\{(.*?)\}\s*\1\s*;", text, flags=re.S):
        fields = []
        for declaration in filter(None, (d.strip() for d in body.split(";"))):
            declaration = re.sub(r"\bconst\b", " ", declaration).strip()
            base, declarators = re.match(r"(\w+)(.*)", declaration, flags=re.S).groups()
            for declarator in declarators.split(","):
                pointer, field, count = re.fullmatch(
                    r"\s*(\*?)\s*(\w+)\s*(?:\[\s*(\w+)\s*\])?\s*", declarator).groups()
                kind = ctypes.c_void_p if pointer else _SCALARS.get(base) or structs[base]
                if count:
                    kind = kind * (int(count) if count.isdigit() else constants[count])
                fields.append((field, kind))
        structs[name] = type(name, (ctypes.Structure,), {"_fields_": fields})
    return structs


_TEXT = _read_headers(INCLUDE_DIR)
CONSTANTS = {k: int(v) for k, v in re.findall(r"#define (TV_\w+) (\d+)\b", _TEXT)}
ENUMS = _parse_enums(_TEXT)
STRUCTS = _parse_structs(_TEXT, CONSTANTS)

STATUS = {number: name for name, number in ENUMS["tv_status"].items()}
# numpy's view of the array elements, which hold scalars only
KEYPOINT = np.dtype(STRUCTS["tv_keypoint"])
CORRESPONDENCE = np.dtype(STRUCTS["tv_correspondence"])
DESCRIPTOR_BYTES = CONSTANTS["TV_DESCRIPTOR_BYTES"]

# Options that name an enum value: the field, and what the headers' names begin with.
_ENUM_FIELDS = {
    "orientation": "TV_ORIENTATION_", "descriptor": "TV_DESCRIPTOR_", "method": "TV_METHOD_",
    "kernels": "TV_KERNELS_", "verdict": "TV_VERDICT_", "config": "TV_CONFIG_",
}


class TwoviewError(RuntimeError):
    """A status other than TV_OK, or a library whose structs are not the headers'."""


def _enum_value(field, text):
    name = _ENUM_FIELDS[field] + text.upper().replace("-", "_")
    for values in ENUMS.values():
        if name in values:
            return values[name]
    raise TwoviewError(f"{field}: no value named {text!r}")


def enum_name(field, number):
    """'calibrated' for ('config', 1)."""
    prefix = _ENUM_FIELDS[field]
    for values in ENUMS.values():
        for name, value in values.items():
            if value == number and name.startswith(prefix):
                return name[len(prefix):].lower()
    return str(number)


def set_options(struct, options):
    """Writes a dict of field: value (numbers, or strings as on a command line) into a struct."""
    kinds = dict(struct._fields_)
    for key, value in (options or {}).items():
        field = key.replace("-", "_")
        if field not in kinds:
            known = ", ".join(k for k in kinds if k != "struct_size")
            raise TwoviewError(f"{type(struct).__name__} has no {field!r}; it has {known}")
        if isinstance(value, str):
            if field in _ENUM_FIELDS and not value.lstrip("-").isdigit():
                value = _enum_value(field, value)
            elif kinds[field] in (ctypes.c_float, ctypes.c_double):
                value = float(value)
            else:
                value = int(value, 0)
        setattr(struct, field, value)
    return struct


def make_camera(K, width, height, distortion=()):
    """A tv_camera of a 3x3 K and Brown-Conrady coefficients (none: pinhole)."""
    camera = STRUCTS["tv_camera"]()
    camera.width, camera.height = int(width), int(height)
    camera.fx, camera.fy, camera.cx, camera.cy = K[0][0], K[1][1], K[0][2], K[1][2]
    models = ENUMS["tv_camera_model"]
    if any(distortion):
        camera.model = models["TV_CAMERA_BROWN_CONRADY"]
        for i, k in enumerate(distortion):
            camera.k[i] = k
    else:
        camera.model = models["TV_CAMERA_PINHOLE"]
    return camera


class Library:
    """The functions that are measured here. Names as in the headers, without tv_."""

    def __init__(self, path=None):
        self.path = os.path.abspath(path or DEFAULT_LIBRARY)
        self.lib = ctypes.CDLL(self.path)
        self.lib.tv_version_string.restype = ctypes.c_char_p
        for name in ("tv_limits", "tv_feature_options", "tv_match_options",
                     "tv_estimate_options", "tv_two_view"):
            self._init_struct(name)  # checks the size

    def version(self):
        return self.lib.tv_version_string().decode()

    def _init_struct(self, name, options=None):
        struct = STRUCTS[name]()
        init = getattr(self.lib, name + "_init", None)
        if init is None:  # a library that is still being built
            struct.struct_size = ctypes.sizeof(struct)
            return set_options(struct, options)
        init.restype = None
        init(ctypes.byref(struct))
        if struct.struct_size != ctypes.sizeof(struct):
            raise TwoviewError(f"{name}: {struct.struct_size} bytes in {self.path}, "
                               f"{ctypes.sizeof(struct)} in the headers: rebuild the library")
        return set_options(struct, options)

    def feature_options(self, options=None):
        return self._init_struct("tv_feature_options", options)

    def match_options(self, options=None):
        return self._init_struct("tv_match_options", options)

    def estimate_options(self, options=None):
        return self._init_struct("tv_estimate_options", options)

    def call(self, name, *arguments):
        status = getattr(self.lib, name)(*arguments)
        if status != 0:
            raise TwoviewError(f"{name}: {STATUS.get(status, status)}")


class Context:
    """A tv_context in memory that Python owns."""

    def __init__(self, library, **limits):
        self.library = library
        wanted = library._init_struct("tv_limits", limits)
        size = ctypes.c_size_t()
        library.call("tv_context_size", ctypes.byref(wanted), ctypes.byref(size))
        alignment = CONSTANTS["TV_CONTEXT_ALIGNMENT"]
        self._memory = np.zeros(size.value + alignment, np.uint8)
        start = -self._memory.ctypes.data % alignment
        self._pointer = ctypes.c_void_p()
        library.call("tv_context_init", ctypes.byref(self._pointer), ctypes.byref(wanted),
                     ctypes.c_void_p(self._memory.ctypes.data + start), size)
        self.size_bytes = size.value
        self.max_keypoints = wanted.max_keypoints

    def extract(self, gray, options=None, mask=None):
        """(keypoints of dtype KEYPOINT, descriptors n x 128 uint8)"""
        wanted = self.library.feature_options(options)
        views = []
        for pixels in (gray, mask):
            view = None
            if pixels is not None:
                assert pixels.dtype == np.uint8 and pixels.ndim == 2 and pixels.strides[1] == 1
                view = STRUCTS["tv_image"](pixels.ctypes.data, pixels.shape[1], pixels.shape[0],
                                           pixels.strides[0])
            views.append(view)
        capacity = self.max_keypoints
        keypoints = np.zeros(capacity, KEYPOINT)
        descriptors = np.zeros((capacity, DESCRIPTOR_BYTES), np.uint8)
        count = ctypes.c_int32()
        self.library.call("tv_extract", self._pointer, ctypes.byref(views[0]),
                          ctypes.byref(views[1]) if views[1] is not None else None,
                          ctypes.byref(wanted), ctypes.c_void_p(keypoints.ctypes.data),
                          ctypes.c_void_p(descriptors.ctypes.data), ctypes.c_int32(capacity),
                          ctypes.byref(count))
        return keypoints[:count.value], descriptors[:count.value]

    def match(self, descriptors0, descriptors1, options=None):
        """Array of dtype CORRESPONDENCE."""
        wanted = self.library.match_options(options)
        descriptors0, descriptors1 = (np.ascontiguousarray(d, np.uint8)
                                      for d in (descriptors0, descriptors1))
        capacity = min(len(descriptors0), len(descriptors1))
        found = np.zeros(max(capacity, 1), CORRESPONDENCE)
        count = ctypes.c_int32()
        self.library.call("tv_match", self._pointer,
                          ctypes.c_void_p(descriptors0.ctypes.data),
                          ctypes.c_int32(len(descriptors0)),
                          ctypes.c_void_p(descriptors1.ctypes.data),
                          ctypes.c_int32(len(descriptors1)), ctypes.byref(wanted),
                          ctypes.c_void_p(found.ctypes.data), ctypes.c_int32(capacity),
                          ctypes.byref(count))
        return found[:count.value]

    def match_guided(self, camera0, camera1, epipolar, features0, features1, options=None):
        """Array of dtype CORRESPONDENCE; features are (keypoints, descriptors), as extract gives
        them, epipolar E, or F with no cameras."""
        wanted = self.library._init_struct("tv_guided_options", options)
        epipolar = np.ascontiguousarray(epipolar, np.float64)
        sides = []
        for keypoints, descriptors in (features0, features1):
            keypoints = np.ascontiguousarray(keypoints, KEYPOINT)
            descriptors = np.ascontiguousarray(descriptors, np.uint8)
            sides.append((keypoints, descriptors))
        capacity = min(len(keypoints) for keypoints, _ in sides)
        found = np.zeros(max(capacity, 1), CORRESPONDENCE)
        count = ctypes.c_int32()
        self.library.call(
            "tv_match_guided", self._pointer,
            ctypes.byref(camera0) if camera0 is not None else None,
            ctypes.byref(camera1) if camera1 is not None else None,
            ctypes.c_void_p(epipolar.ctypes.data),
            *(argument for keypoints, descriptors in sides
              for argument in (ctypes.c_void_p(keypoints.ctypes.data),
                               ctypes.c_void_p(descriptors.ctypes.data),
                               ctypes.c_int32(len(keypoints)))),
            ctypes.byref(wanted), ctypes.c_void_p(found.ctypes.data), ctypes.c_int32(capacity),
            ctypes.byref(count))
        return found[:count.value]

    def estimate_two_view(self, camera0, camera1, pixels0, pixels1, ratios=None, options=None):
        """(tv_two_view, inlier mask as bools); pixels as the images have them (distorted)."""
        wanted = self.library.estimate_options(options)
        result = self.library._init_struct("tv_two_view")
        pixels0, pixels1 = (np.ascontiguousarray(p, np.float64) for p in (pixels0, pixels1))
        if ratios is not None:
            ratios = np.ascontiguousarray(ratios, np.float32)
        mask = np.zeros(max(len(pixels0), 1), np.uint8)
        self.library.call(
            "tv_estimate_two_view", self._pointer,
            ctypes.byref(camera0) if camera0 is not None else None,
            ctypes.byref(camera1) if camera1 is not None else None,
            ctypes.c_void_p(pixels0.ctypes.data), ctypes.c_void_p(pixels1.ctypes.data),
            ctypes.c_void_p(ratios.ctypes.data) if ratios is not None else None,
            ctypes.c_int32(len(pixels0)), ctypes.byref(wanted), ctypes.byref(result),
            ctypes.c_void_p(mask.ctypes.data))
        return result, mask[:len(pixels0)].astype(bool)
