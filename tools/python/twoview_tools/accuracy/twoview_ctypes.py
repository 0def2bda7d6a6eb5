"""The package python/twoview in the form that measuring and tuning need: a library by its path,
options as text as on a command line, C structs as results."""

import ctypes

import numpy as np
import twoview
from twoview import CORRESPONDENCE, DESCRIPTOR_BYTES, KEYPOINT, _abi, enums, stages  # noqa: F401

from .. import DEFAULT_LIBRARY

STRUCTS = {struct.__name__: struct for struct in _abi.STRUCTS}
TwoviewError = twoview.StatusError

# Options whose value is the name of an enum value.
_ENUM_FIELDS = {
    "orientation": enums.Orientation, "descriptor": enums.Normalisation, "method": enums.Solver,
    "kernels": enums.Kernels, "verdict": enums.Verdict, "kind": enums.Kind,
}


def enum_name(field, number):
    """The name of an enum value: 'calibrated' for ('kind', 1)."""
    return _ENUM_FIELDS[field](number).name.lower()


def _number(struct, field, text):
    if field in _ENUM_FIELDS and not text.lstrip("-").isdigit():
        name = text.upper().replace("-", "_")
        if name not in _ENUM_FIELDS[field].__members__:
            raise TwoviewError(f"{field}: no value named {text!r}")
        return _ENUM_FIELDS[field][name]
    kind = dict(struct._fields_).get(field)
    return float(text) if kind in (ctypes.c_float, ctypes.c_double) else int(text, 0)


def set_options(struct, options):
    """Writes a dict {field: value} into a struct; a value is a number, or text as on a command
    line. "calibration0.refine" is a field of the field calibration0."""
    for key, value in (options or {}).items():
        *outer, field = key.replace("-", "_").split(".")
        try:
            part = struct
            for name in outer:
                part = getattr(part, name)
            if isinstance(value, str):
                value = _number(part, field, value)
            _abi.set_field(part, field, value)
        except (AttributeError, TypeError, ValueError) as error:
            raise TwoviewError(str(error)) from error
    return struct


def make_camera(K, width, height, distortion=()):
    """A tv_camera from a 3x3 K and Brown-Conrady coefficients; without coefficients a pinhole."""
    models = enums.CameraModel
    return twoview.Camera(width, height, K[0][0], K[1][1], K[0][2], K[1][2],
                          models.BROWN_CONRADY if any(distortion) else models.PINHOLE,
                          distortion if any(distortion) else ())._struct()


class Library(twoview.Library):
    def __init__(self, path=None):
        super().__init__(path or DEFAULT_LIBRARY)

    def _init_struct(self, name, options=None):
        return set_options(self.make(STRUCTS[name]), options)

    def feature_options(self, options=None):
        return self._init_struct("tv_feature_options", options)

    def match_options(self, options=None):
        return self._init_struct("tv_match_options", options)

    def estimate_options(self, options=None):
        return self._init_struct("tv_estimate_options", options)

    def take_sigma_by_size(self, options):
        """Removes tv_reconstruct_options.sigma_by_size from a dict of tv_estimate_options, with
        which tuning gives it; returns it, or the library's default."""
        default = self._init_struct("tv_reconstruct_options").sigma_by_size
        return float(options.pop("sigma_by_size", default))

    def take_align_matches(self, options):
        """Removes tv_reconstruct_options.align_matches from a dict of tv_match_options, with which
        tuning gives it; returns it, or the library's default."""
        default = self._init_struct("tv_reconstruct_options").align_matches
        return int(options.pop("align_matches", default))


MAX_EFFORT = 3  # the highest rung of tv_reconstruct_options.max_effort


def plain(value):
    """A field's value: of an array a list, of a calibration a Calibration, else as it is."""
    if isinstance(value, _abi.tv_calibration):
        return twoview.Calibration(value.focal_sigma, value.center_sigma, value.refine)
    return list(value) if hasattr(value, "_length_") else value


def _keywords(struct):
    """The fields of an options struct as keywords for the package's functions."""
    return {name: plain(getattr(struct, name)) for name, _ in struct._fields_[1:]
            if name != "reserved"}


class Context(twoview.Context):
    def __init__(self, library, **limits):
        super().__init__(library=library, **_keywords(library._init_struct("tv_limits", limits)))

    def extract(self, gray, options=None, mask=None):
        """(keypoints of dtype KEYPOINT, descriptors n x 128 uint8) of an image."""
        return twoview.extract(self, gray, mask,
                               **_keywords(self.library.feature_options(options)))

    def match(self, descriptors0, descriptors1, options=None, keypoints0=None, keypoints1=None):
        """Matches two sets of descriptors; keypoints are required where the options have a
        neighbourhood. Returns an array of dtype CORRESPONDENCE."""
        return twoview.match(self, np.ascontiguousarray(descriptors0, np.uint8),
                             np.ascontiguousarray(descriptors1, np.uint8),
                             keypoints0=keypoints0, keypoints1=keypoints1,
                             **_keywords(self.library.match_options(options)))

    def align_matches(self, gray0, gray1, keypoints0, keypoints1, links, size_of_one):
        """(keypoints 0, keypoints 1, factors of each match's sigmas) of tv_align_matches."""
        moved0, moved1, _, factors = twoview.align_matches(self, gray0, gray1, keypoints0,
                                                           keypoints1, links, size_of_one)
        return moved0, moved1, factors

    def keypoint_sigmas(self, relative_sizes, exponent):
        """tv_keypoint_sigmas, from the sizes over that of a keypoint of the full image."""
        keypoints = np.zeros(len(relative_sizes), KEYPOINT)
        keypoints["size"] = relative_sizes
        sigmas = np.empty(len(keypoints), np.float32)
        self.library.call("tv_keypoint_sigmas", _abi.pointer(keypoints),
                          ctypes.c_int32(len(keypoints)), ctypes.c_float(1),
                          ctypes.c_double(exponent), _abi.pointer(sigmas))
        return sigmas

    def match_guided(self, camera0, camera1, epipolar, features0, features1, options=None):
        """The matches as an array of dtype CORRESPONDENCE. Features are (keypoints, descriptors) as
        extract returns them; `epipolar` is E, or F without cameras."""
        wanted = _keywords(self.library._init_struct("tv_guided_options", options))
        return twoview.match_guided(self, camera0, camera1, epipolar, *features0, *features1,
                                    **wanted)

    def estimate_two_view(self, camera0, camera1, pixels0, pixels1, ratios=None, options=None,
                          sigmas=(None, None)):
        """(tv_two_view, inlier mask as bools); pixels are as in the images (distorted). sigmas: of
        the pixels of both views, or None for each."""
        values = {name: None if array is None else np.ascontiguousarray(array, np.float32)
                  for name, array in zip(("ratios", "sigmas0", "sigmas1"), (ratios, *sigmas))}
        return stages._estimate(self, camera0, camera1, np.ascontiguousarray(pixels0, np.float64),
                                np.ascontiguousarray(pixels1, np.float64),
                                self.library.estimate_options(options), **values)

    def reconstruct(self, gray0, camera0, gray1, camera1, options=({}, {}, {}), **fields):
        """(tv_two_view, twoview.Reconstruction) of two images. options: dicts of the features',
        matching's and estimate's options, of which the second may hold align_matches and the last
        sigma_by_size; fields: of tv_reconstruct_options."""
        feature, match, estimate = map(dict, options)
        fields["align_matches"] = self.library.take_align_matches(match)
        fields["sigma_by_size"] = self.library.take_sigma_by_size(estimate)
        structs = (self.library.feature_options(feature), self.library.match_options(match),
                   self.library.estimate_options(estimate))
        kinds = (twoview.FeatureOptions, twoview.MatchOptions, twoview.EstimateOptions)
        return stages._reconstruct(self, gray0, camera0, gray1, camera1, (None, None),
                                   [kind(**_keywords(s)) for kind, s in zip(kinds, structs)],
                                   **fields)
