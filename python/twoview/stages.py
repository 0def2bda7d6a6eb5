"""The stages under their C names. Arrays are numpy arrays, and the caller's images are read without
a copy. What every stage raises stands in the package's own text, help(twoview)."""

from __future__ import annotations

import ctypes
from ctypes import byref, c_int32
from dataclasses import dataclass, replace
from typing import Any, Optional, Sequence

import numpy as np
from numpy.typing import ArrayLike

from . import _abi
from ._record import Record, judged, largest_sigma, rotation, table, vector
from .camera import Camera, camera_struct
from .context import Context, check_context
from .enums import Kind, Reason, Triangulation, Verdict
from .options import (BundleOptions, EstimateOptions, FeatureOptions, GuidedOptions, MatchOptions,
                      to_struct)


def _images(image: np.ndarray, mask: Optional[np.ndarray]) -> list[Any]:
    views = [byref(_abi.check_image("image", image)), None]
    if mask is not None:
        views[1] = byref(_abi.check_mask("mask", mask, image))
    return views


def _room(context: Context, wanted: Any) -> int:
    """The largest number of keypoints that a call can return."""
    return max(wanted.max_keypoints or context.max_keypoints, 0)


def detect(context: Context, image: np.ndarray, mask: Optional[np.ndarray] = None,
           options: Optional[FeatureOptions] = None, **keywords: Any) -> np.ndarray:
    """tv_detect: FAST corners, strongest first.

    context: as large as the image. image: (height, width) uint8; the rows need not be adjacent.
    mask: None, or uint8 or bool of the same shape, 0 where no corner is wanted. options: a
    FeatureOptions, or its fields as keywords.
    Returns (n,) of twoview.KEYPOINT: x, y (pixels), size (pixels), angle_rad, score (grey levels),
    level.
    Raises TypeError or ValueError for an array that C could not read, TV_ERR_LIMITS for an image or
    a count above the context's, TV_ERR_ARGUMENT for an option out of its range."""
    wanted = to_struct(check_context(context).library, FeatureOptions, options, keywords)
    keypoints = np.empty(_room(context, wanted), _abi.KEYPOINT)
    count = c_int32()
    context.call("tv_detect", *_images(image, mask), byref(wanted), _abi.pointer(keypoints),
                 c_int32(len(keypoints)), byref(count))
    return keypoints[: count.value].copy()


def orient(context: Context, image: np.ndarray, keypoints: np.ndarray,
           options: Optional[FeatureOptions] = None, **keywords: Any) -> np.ndarray:
    """tv_orient: keypoints with their angles. A keypoint with a second orientation appears twice.

    context: as large as the image. image: (height, width) uint8. keypoints: (n,) of
    twoview.KEYPOINT, of detect. options: a FeatureOptions, or its fields as keywords.
    Returns (m,) of twoview.KEYPOINT, n <= m <= 2n, with angle_rad in radians from x towards y.
    Raises as detect does, and TV_ERR_NOT_FINITE for a keypoint that is not finite."""
    wanted = to_struct(check_context(context).library, FeatureOptions, options, keywords)
    keypoints = _abi.check_array("keypoints", keypoints, _abi.KEYPOINT)
    oriented = np.empty(2 * len(keypoints), _abi.KEYPOINT)
    count = c_int32()
    context.call("tv_orient", _images(image, None)[0], _abi.pointer(keypoints),
                 c_int32(len(keypoints)), byref(wanted), _abi.pointer(oriented),
                 c_int32(len(oriented)), byref(count))
    return oriented[: count.value].copy()


def describe(context: Context, image: np.ndarray, keypoints: np.ndarray,
             options: Optional[FeatureOptions] = None, **keywords: Any) -> np.ndarray:
    """tv_describe: a descriptor for each keypoint, in the byte order that OpenCV and COLMAP use
    (UBC order).

    context: as large as the image. image: (height, width) uint8. keypoints: (n,) of
    twoview.KEYPOINT, of orient. options: a FeatureOptions, or its fields as keywords.
    Returns (n, 128) uint8, a row for each keypoint.
    Raises as orient does."""
    wanted = to_struct(check_context(context).library, FeatureOptions, options, keywords)
    keypoints = _abi.check_array("keypoints", keypoints, _abi.KEYPOINT)
    descriptors = np.empty((len(keypoints), _abi.DESCRIPTOR_BYTES), np.uint8)
    context.call("tv_describe", _images(image, None)[0], _abi.pointer(keypoints),
                 c_int32(len(keypoints)), byref(wanted), _abi.pointer(descriptors))
    return descriptors


def extract(context: Context, image: np.ndarray, mask: Optional[np.ndarray] = None,
            options: Optional[FeatureOptions] = None,
            **keywords: Any) -> tuple[np.ndarray, np.ndarray]:
    """tv_extract: keypoints and descriptors, the same as from detect, orient and describe.

    context: as large as the image. image: (height, width) uint8. mask: None, or uint8 or bool
    of the same shape, 0 where no corner is wanted. options: a FeatureOptions, or its fields as
    keywords.
    Returns keypoints (n,) of twoview.KEYPOINT and descriptors (n, 128) uint8.
    Raises as detect does."""
    wanted = to_struct(check_context(context).library, FeatureOptions, options, keywords)
    capacity = _room(context, wanted)
    keypoints = np.empty(capacity, _abi.KEYPOINT)
    descriptors = np.empty((capacity, _abi.DESCRIPTOR_BYTES), np.uint8)
    count = c_int32()
    context.call("tv_extract", *_images(image, mask), byref(wanted), _abi.pointer(keypoints),
                 _abi.pointer(descriptors), c_int32(capacity), byref(count))
    return keypoints[: count.value].copy(), descriptors[: count.value].copy()


def _descriptors(name: str, array: ArrayLike) -> np.ndarray:
    return _abi.check_array(name, array, np.uint8, _abi.DESCRIPTOR_BYTES)


def _features(context: Context, keypoints: Optional[np.ndarray], descriptors: np.ndarray) -> Any:
    features = context.library.make(_abi.tv_features)
    features.kept = keypoints, descriptors  # the struct only points to them
    features.num = len(descriptors)
    features.keypoints, features.descriptors = _abi.pointer(keypoints), _abi.pointer(descriptors)
    return features


def keypoint_sigmas(keypoints: np.ndarray, exponent: float,
                    size_of_one: float = FeatureOptions.keypoint_size) -> np.ndarray:
    """tv_keypoint_sigmas: (size / size_of_one)^exponent of each keypoint: the standard deviation of
    its position in units of that of a keypoint of `size_of_one`. Gather them by a match's indices
    for estimate_two_view.

    keypoints: (n,) of twoview.KEYPOINT. exponent: [0, 2]; 1 is in proportion to the size.
    size_of_one: pixels, above 0.
    Returns (n,) float32, without a unit.
    Raises TV_ERR_ARGUMENT or TV_ERR_NOT_FINITE for a number out of its range, TypeError for another
    dtype."""
    keypoints = _abi.check_array("keypoints", keypoints, _abi.KEYPOINT)
    sigmas = np.empty(len(keypoints), np.float32)
    _abi.default_library().call(
        "tv_keypoint_sigmas", _abi.pointer(keypoints), c_int32(len(keypoints)),
        ctypes.c_float(size_of_one), ctypes.c_double(exponent), _abi.pointer(sigmas))
    return sigmas


def _pairs(library: _abi.Library, pixels0: np.ndarray, pixels1: np.ndarray,
           **values: Any) -> Any:
    """A tv_pixel_pairs; values: ratios, sigmas0, sigmas1, each (n,) float32 or None."""
    pairs = library.make(_abi.tv_pixel_pairs)
    pairs.kept = [pixels0, pixels1]  # the struct only points to them
    pairs.num = len(pixels0)
    pairs.pixels0, pairs.pixels1 = _abi.pointer(pixels0), _abi.pointer(pixels1)
    for name, array in values.items():
        if array is None:
            continue
        array = _abi.check_array(name, array, np.float32)
        if len(array) != len(pixels0):
            raise ValueError(f"{len(array)} {name} and {len(pixels0)} matches")
        pairs.kept.append(array)
        setattr(pairs, name, _abi.pointer(array))
    return pairs


def keypoint_shapes(keypoints: np.ndarray, tilts: Optional[ArrayLike] = None) -> np.ndarray:
    """tv_keypoint_shapes: how the patches of keypoints lie in the image.

    keypoints: (n,) of twoview.KEYPOINT. tilts: None, or (n,) uint8 of a Reconstruction.
    Returns (n, 2, 2) float64, whose columns are the patch's x and y axis in pixels, as long as the
    keypoint's size is in its view.
    Raises TypeError for another dtype, ValueError for counts that differ, TV_ERR_ARGUMENT or
    TV_ERR_NOT_FINITE for a number out of its range."""
    keypoints = _abi.check_array("keypoints", keypoints, _abi.KEYPOINT)
    of_views = None if tilts is None else _abi.check_array("tilts", tilts, np.uint8)
    if of_views is not None and len(of_views) != len(keypoints):
        raise ValueError(f"{len(of_views)} tilts and {len(keypoints)} keypoints")
    shapes = np.empty((len(keypoints), 2, 2))
    _abi.default_library().call(
        "tv_keypoint_shapes", _abi.pointer(keypoints), _abi.pointer(of_views),
        c_int32(len(keypoints)), _abi.pointer(shapes))
    return shapes


def match(context: Context, descriptors0: ArrayLike, descriptors1: ArrayLike,
          options: Optional[MatchOptions] = None, keypoints0: Optional[np.ndarray] = None,
          keypoints1: Optional[np.ndarray] = None, **keywords: Any) -> np.ndarray:
    """tv_match: mutual nearest neighbours that pass the ratio test in both directions.

    context: of enough keypoints. descriptors0, descriptors1: (n0, 128) and (n1, 128) uint8.
    options: a MatchOptions, or its fields as keywords. keypoints0, keypoints1: (n0,) and (n1,) of
    twoview.KEYPOINT; None, as for descriptors of other programs: neighbourhood_px counts as 0.
    Returns (m,) of twoview.CORRESPONDENCE: idx0, idx1 (rows of the descriptors), dist_sq (squared
    L2 distance), ratio (nearest to second nearest distance, lower is surer).
    Raises TypeError or ValueError for an array that C could not read, TV_ERR_LIMITS for more
    descriptors than the context has room for, TV_ERR_ARGUMENT for an option out of its range,
    TV_ERR_NULL for one of the keypoints without the other."""
    wanted = to_struct(check_context(context).library, MatchOptions, options, keywords)
    descriptors0 = _descriptors("descriptors0", descriptors0)
    descriptors1 = _descriptors("descriptors1", descriptors1)
    found = np.empty(min(len(descriptors0), len(descriptors1)), _abi.CORRESPONDENCE)
    count = c_int32()
    features = []
    for view, keypoints, rows in ((0, keypoints0, descriptors0), (1, keypoints1, descriptors1)):
        if keypoints is not None:
            keypoints = _abi.check_array(f"keypoints{view}", keypoints, _abi.KEYPOINT)
            if len(keypoints) != len(rows):
                raise ValueError(f"{len(keypoints)} keypoints and {len(rows)} descriptors")
        features.append(_features(context, keypoints, rows))
    context.call("tv_match", byref(features[0]), byref(features[1]), byref(wanted),
                 _abi.pointer(found), c_int32(len(found)), byref(count))
    return found[: count.value].copy()


def align_matches(context: Context, image0: np.ndarray, image1: np.ndarray, keypoints0: np.ndarray,
                  keypoints1: np.ndarray, matches: np.ndarray,
                  size_of_one: float = FeatureOptions.keypoint_size,
                  ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """tv_align_matches: one keypoint of each match is moved by the pixels around both.

    context: as large as the images. image0, image1: (height, width) uint8, of the keypoints.
    keypoints0, keypoints1: (n0,) and (n1,) of twoview.KEYPOINT, of extract. matches: (m,) of
    twoview.CORRESPONDENCE, of match. size_of_one: the option keypoint_size of extract, pixels.
    Returns both keypoints, copies in which x and y of the moved ones are new, which matches were
    aligned, (m,) bool, and the factors by which reconstruct multiplies both sigmas
    (keypoint_sigmas) of each match, (m,) float32: 1 where it was not aligned, else the standard
    deviation of the aligned position over that of its keypoints.
    Raises TypeError or ValueError for an array that C could not read, TV_ERR_LIMITS for an image
    above the context's limits, TV_ERR_ARGUMENT for an index or a size out of its range,
    TV_ERR_NOT_FINITE for a keypoint that is not finite."""
    check_context(context)
    views = (_abi.tv_image * 2)(*(_abi.check_image("image", i) for i in (image0, image1)))
    moved = [_abi.check_array(name, array, _abi.KEYPOINT).copy()
             for name, array in (("keypoints0", keypoints0), ("keypoints1", keypoints1))]
    matches = _abi.check_array("matches", matches, _abi.CORRESPONDENCE)
    aligned = np.zeros(len(matches), np.uint8)
    context.call("tv_align_matches", views, _abi.pointer(matches), c_int32(len(matches)),
                 ctypes.c_float(size_of_one), (ctypes.c_void_p * 2)(*map(_abi.pointer, moved)),
                 (c_int32 * 2)(*map(len, moved)), _abi.pointer(aligned))
    factors = aligned.astype(np.float32) / 128
    factors[aligned == 0] = 1
    return moved[0], moved[1], aligned != 0, factors


def _are_uncalibrated(camera0: Optional[Camera], camera1: Optional[Camera]) -> bool:
    """Whether both cameras are None. One camera alone serves nothing, as in C."""
    for name, camera, other in (("0", camera0, "1"), ("1", camera1, "0")):
        if camera is None and (camera0 is not None or camera1 is not None):
            raise TypeError(f"camera{name} is None, but camera{other} is given: give both cameras, "
                            "or None for both, which finds F or H and no pose")
    return camera0 is None


def _two_cameras(camera0: Optional[Camera], camera1: Optional[Camera]) -> list[Any]:
    if _are_uncalibrated(camera0, camera1):
        return [None, None]
    return [byref(camera_struct("camera0", camera0)), byref(camera_struct("camera1", camera1))]


def _pair(camera0: Optional[Camera], camera1: Optional[Camera], R: Sequence[Sequence[float]],
          t: Sequence[float]) -> Any:
    """A tv_camera_pair; None where both cameras are, which C refuses."""
    rotation, translation = _abi.small_array("R", R, 3, 3), _abi.small_array("t", t, 3)
    if _are_uncalibrated(camera0, camera1):
        return None
    return _abi.camera_pair(camera_struct("camera0", camera0), camera_struct("camera1", camera1),
                            rotation, translation)


def _by_reference(struct: Any) -> Any:
    return None if struct is None else byref(struct)


def match_guided(context: Context, camera0: Optional[Camera], camera1: Optional[Camera],
                 epipolar: Sequence[Sequence[float]], keypoints0: np.ndarray,
                 descriptors0: ArrayLike, keypoints1: np.ndarray, descriptors1: ArrayLike,
                 options: Optional[GuidedOptions] = None, **keywords: Any) -> np.ndarray:
    """tv_match_guided: matches along epipolar lines.

    context: of enough keypoints. camera0, camera1: both Cameras, or None for both. epipolar: 3x3, E
    with cameras, F (of the pixels as they are) without. keypoints0, keypoints1: (n0,) and (n1,) of
    twoview.KEYPOINT. descriptors0, descriptors1: (n0, 128) and (n1, 128) uint8. options: a
    GuidedOptions, or its fields as keywords.
    Returns (m,) of twoview.CORRESPONDENCE, as match does.
    Raises as match does, TypeError for one camera alone, TV_ERR_CAMERA, TV_ERR_NOT_FINITE for a
    matrix that is not finite."""
    wanted = to_struct(check_context(context).library, GuidedOptions, options, keywords)
    matrix = _abi.small_array("epipolar", epipolar, 3, 3)
    arguments: list[Any] = []
    for view, (keypoints, descriptors) in enumerate(((keypoints0, descriptors0),
                                                     (keypoints1, descriptors1))):
        keypoints = _abi.check_array(f"keypoints{view}", keypoints, _abi.KEYPOINT)
        descriptors = _descriptors(f"descriptors{view}", descriptors)
        if len(keypoints) != len(descriptors):
            raise ValueError(f"{len(keypoints)} keypoints{view} and {len(descriptors)} descriptors")
        arguments.append(byref(_features(context, keypoints, descriptors)))
    found = np.empty(min(len(keypoints0), len(keypoints1)), _abi.CORRESPONDENCE)
    count = c_int32()
    cameras = [None if _are_uncalibrated(camera0, camera1) else camera_struct(name, camera)
               for name, camera in (("camera0", camera0), ("camera1", camera1))]
    known = _abi.tv_epipolar(*(None if c is None else ctypes.addressof(c) for c in cameras))
    known.matrix[:] = matrix.ravel().tolist()
    context.call("tv_match_guided", byref(known), *arguments, byref(wanted), _abi.pointer(found),
                 c_int32(len(found)), byref(count))
    return found[: count.value].copy()


@dataclass(frozen=True, eq=False, repr=False)
class TwoView(Record):
    """tv_two_view and its tv_evidence, with the pose cam1_from_cam0: x1 = R x0 + t, |t| = 1. A
    value that was not estimated is None. print shows the pose and the verdict in a few lines; two
    results are equal (==) when all their fields are."""

    kind: Kind  #: the model that explains the matches
    verdict: Verdict  #: whether the result can be relied on
    reasons: Reason  #: why the verdict is not OK; Reason(0) where it is
    num_matches: int  #: how many matches were given
    num_inliers: int  #: how many of them agree with the model that `kind` names
    num_iterations: int  #: samples that were drawn
    R: Optional[np.ndarray]  #: (3, 3), rotation
    t: Optional[np.ndarray]  #: (3,), unit translation
    E: Optional[np.ndarray]  #: (3, 3), essential matrix, Frobenius norm 1
    F: Optional[np.ndarray]  #: (3, 3), fundamental matrix for undistorted pixels
    H: Optional[np.ndarray]  #: (3, 3), maps undistorted pixels of image 0 to image 1
    alternative_R: Optional[np.ndarray]  #: the second pose that a planar scene permits
    alternative_t: Optional[np.ndarray]  #: (3,), unit translation of that pose
    covariance: Optional[np.ndarray]  #: (5, 5), radians squared: w0 w1 w2 a b of two_view.h
    alternative_covariance: Optional[np.ndarray]  #: (5, 5), of that pose
    essential_inliers: Optional[int]  #: how many matches agree with an essential matrix,
    fundamental_inliers: Optional[int]  #: a fundamental matrix,
    homography_inliers: Optional[int]  #: a homography,
    rotation_inliers: Optional[int]  #: a rotation alone; None: that model was not estimated
    coverage: float  #: share of 8x8 cells with an inlier, the larger of the two images'
    median_parallax_rad: float  #: median angle between the two rays of an inlier, radians
    rms_error_px: float  #: root mean square of the inliers' residuals, pixels
    noise_px: float  #: standard deviation of a matched pixel along one axis, pixels
    seed: int  #: of the sampler, as it was used
    #: (2,), pixels to add to cx and cy; all results refer to the cameras with this shift
    principal_point_shift: np.ndarray
    #: Chi-square (2 degrees of freedom) against the given cx and cy; above 13.8 in one pair of a
    #: thousand where they are right. None where one camera did not take both views, the kind is
    #: not CALIBRATED, or the matches do not determine a shift; so are the next two.
    principal_point_chi2: Optional[float]
    #: (2,), the shift in pixels with which the residuals are least; it is not applied
    principal_point_asked_px: Optional[np.ndarray]
    principal_point_asked_covariance: Optional[np.ndarray]  #: (2, 2), pixels squared
    #: [0, 1], that the rotation is off by more than 5 degrees; calibrated on real pairs. 1 where
    #: there is no full pose. The next three are the evidence for it.
    probability_wrong: float
    agreement: float  #: share of matches that are inliers, each weighted by (1 - ratio)^2
    #: how far the rotation turns without the inliers of the image region that turns it most
    region_shift_rad: float
    num_places: int  #: cells of 32 pixels with an inlier, in the image with fewer of them
    num_still: int  #: matches that keep their pixel where no point of the scene can: left out
    #: What fx and fy are multiplied by, where the focal length was refined with the pose; all
    #: results then refer to the cameras with it. 0: as given.
    focal_scale: float
    #: Relative standard deviation of the focal length that the covariance contains. 0: exact.
    focal_sigma: float
    #: Evidence of the matches against the cameras as given, such as a rolling shutter: above 26.1
    #: (22.5 with two cameras) they are contradicted. 0: not tested.
    camera_chi2: float
    camera_turn_rad: float  #: by how much the rotation would then turn; 0: not contradicted
    camera_direction_rad: float  #: and the direction move

    def __str__(self) -> str:
        verdict = self.verdict.name.lower()
        if self.verdict == Verdict.OK and self.R is None:
            verdict = "matches ok, no pose"
        elif self.verdict == Verdict.OK and self.t is None:
            verdict = "rotation ok, no full pose"
        rows = [("", f"{judged(self.kind.name.lower(), verdict, self.reasons)}: "
                 f"{self.num_inliers} of {self.num_matches} matches agree")]
        if self.R is not None:
            rows.append(("rotation", rotation(self.R)))
        if self.t is not None:
            rows.append(("t", vector(self.t) + ", x1 = R x0 + t"))
            rows.append(("wrong", f"with probability {100 * self.probability_wrong:.2g} %"))
        if self.covariance is not None:
            turn, direction = (np.degrees(largest_sigma(part)) for part in
                               (self.covariance[:3, :3], self.covariance[3:, 3:]))
            rows.append(("sigma", f"rotation {turn:.2g} deg, direction {direction:.2g} deg"))
        if self.R is not None and self.t is not None:
            rows.append(("parallax", f"{np.degrees(self.median_parallax_rad):.2f} deg (median), "
                         f"noise {self.noise_px:.2f} px"))
        if self.alternative_R is not None:
            rows.append(("alternative", f"rotation {rotation(self.alternative_R)}, "
                         f"t {vector(self.alternative_t)}"))
        return table(rows)


def _result(library: Any) -> Any:
    """A tv_two_view for a call to fill, with the tv_evidence as an attribute, `evidence`."""
    found = library.make(_abi.tv_two_view)
    found.evidence = library.make(_abi.tv_evidence)
    return found


def _two_view(found: Any) -> TwoView:
    """found: of _result."""
    evidence = found.evidence

    def matrix(field: str, has: int, *shape: int) -> Optional[np.ndarray]:
        return np.array(getattr(found, field)).reshape(shape) if has else None

    def inliers(count: int) -> Optional[int]:
        return count if count >= 0 else None

    xx, xy, yy = evidence.principal_point_asked_covariance
    asked = xx > 0
    covariance = np.array([[xx, xy], [xy, yy]]) if asked else None
    return TwoView(
        Kind(found.kind), Verdict(found.verdict), Reason(found.reasons), found.num_matches,
        found.num_inliers, found.num_iterations, matrix("R", found.has_R, 3, 3),
        matrix("t", found.has_t, 3), matrix("E", found.has_E, 3, 3),
        matrix("F", found.has_F, 3, 3), matrix("H", found.has_H, 3, 3),
        matrix("alternative_R", found.has_alternative, 3, 3),
        matrix("alternative_t", found.has_alternative, 3),
        matrix("covariance", found.has_covariance, 5, 5),
        matrix("alternative_covariance", found.has_alternative_covariance, 5, 5),
        inliers(evidence.essential_inliers), inliers(evidence.fundamental_inliers),
        inliers(evidence.homography_inliers), inliers(evidence.rotation_inliers),
        evidence.coverage,
        found.median_parallax_rad, found.rms_error_px, found.noise_px, found.seed,
        np.array(found.principal_point_shift), evidence.principal_point_chi2 if asked else None,
        np.array(evidence.principal_point_asked_px) if asked else None, covariance,
        found.probability_wrong, evidence.agreement, evidence.region_shift_rad,
        evidence.num_places, found.num_still, found.focal_scale, found.focal_sigma,
        evidence.camera_chi2, evidence.camera_turn_rad, evidence.camera_direction_rad)


def corrected_camera(found: TwoView, camera: Camera) -> Camera:
    """tv_corrected_pair, of one camera. Returns the Camera that the results in `found` refer to:
    `camera` with principal_point_shift (pixels) added and multiplied by focal_scale. Use it in
    calls after the estimate. It is `camera` itself unless an option let the estimate move it.

    found: of estimate_two_view or reconstruct. camera: one of its two cameras.
    Raises TypeError or AttributeError for other objects."""
    shift = found.principal_point_shift
    scale = found.focal_scale if found.focal_scale > 0 else 1.0
    return replace(camera, fx=camera.fx * scale, fy=camera.fy * scale,
                   cx=camera.cx + float(shift[0]), cy=camera.cy + float(shift[1]))


def _pixels(pixels0: ArrayLike, pixels1: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    pixels0 = _abi.check_array("pixels0", pixels0, np.float64, 2)
    pixels1 = _abi.check_array("pixels1", pixels1, np.float64, 2)
    if len(pixels0) != len(pixels1):
        raise ValueError(f"{len(pixels0)} pixels0 and {len(pixels1)} pixels1")
    return pixels0, pixels1


def _estimate(context: Context, camera0: Optional[Camera], camera1: Optional[Camera],
              pixels0: ArrayLike, pixels1: ArrayLike, wanted: Any,
              **values: Optional[ArrayLike]) -> tuple[Any, np.ndarray]:
    pixels0, pixels1 = _pixels(pixels0, pixels1)
    pairs = _pairs(context.library, pixels0, pixels1, **values)
    found = _result(context.library)
    inliers = np.zeros(len(pixels0), np.uint8)
    context.call("tv_estimate_two_view", *_two_cameras(camera0, camera1),
                 byref(pairs), byref(wanted), byref(found), byref(found.evidence),
                 _abi.pointer(inliers))
    return found, inliers.view(bool)


def estimate_two_view(context: Context, camera0: Optional[Camera], camera1: Optional[Camera],
                      pixels0: ArrayLike, pixels1: ArrayLike,
                      ratios: Optional[ArrayLike] = None,
                      options: Optional[EstimateOptions] = None,
                      sigmas0: Optional[ArrayLike] = None, sigmas1: Optional[ArrayLike] = None,
                      **keywords: Any) -> tuple[TwoView, np.ndarray]:
    """tv_estimate_two_view: the geometry of matched pixels.

    context: of enough matches. camera0, camera1: both Cameras, or None for both: then F or H is
    found and no pose, and the method is AUTO, EIGHT_POINT or SEVEN_POINT. pixels0, pixels1: (n, 2)
    float64, as in the images (distorted); a pixel that is not finite is never an inlier. ratios:
    None, or (n,) float32; lower means more reliable. options: an EstimateOptions, or its fields as
    keywords. sigmas0, sigmas1: None (1 for all), or (n,) float32, the standard deviations of the
    pixels in units of that of the most precise ones (keypoint_sigmas).
    Returns a TwoView, and the inlier mask (n,) bool. "No geometry" is a result, not an exception:
    see TwoView.verdict.
    Raises TypeError or ValueError for an array that C could not read and for one camera alone,
    TV_ERR_LIMITS for more matches than the context's max_matches, TV_ERR_CAMERA, TV_ERR_ARGUMENT
    and TV_ERR_NOT_FINITE for an option or a sigma out of its range."""
    found, inliers = _estimate(context, camera0, camera1, pixels0, pixels1,
                               to_struct(check_context(context).library, EstimateOptions, options,
                                         keywords),
                               ratios=ratios, sigmas0=sigmas0, sigmas1=sigmas1)
    return _two_view(found), inliers


def triangulate(camera0: Camera, camera1: Camera, R: Sequence[Sequence[float]],
                t: Sequence[float], pixels0: ArrayLike, pixels1: ArrayLike,
                method: int = Triangulation.ITERATIVE_LS) -> np.ndarray:
    """tv_triangulate: the points that two cameras see.

    camera0, camera1: Cameras; None for both is TV_ERR_NULL. R: 3x3, a rotation, and t: 3 numbers,
    not zero, of x1 = R x0 + t. pixels0, pixels1: (n, 2) float64, as in the images (distorted).
    method: a Triangulation.
    Returns (n,) of twoview.POINT: position (in camera 0's frame, in the unit of t), angle_rad
    (between the rays), error_px, status (a PointStatus).
    Raises TypeError or ValueError for an array that C could not read, TV_ERR_ARGUMENT where R is no
    rotation or t is zero, TV_ERR_NOT_FINITE for R or t, TV_ERR_CAMERA."""
    library = _abi.default_library()
    pixels0, pixels1 = _pixels(pixels0, pixels1)
    pairs, pair = _pairs(library, pixels0, pixels1), _pair(camera0, camera1, R, t)
    points = np.zeros(len(pixels0), _abi.POINT)
    library.call("tv_triangulate", _by_reference(pair), byref(pairs), c_int32(int(method)),
                 _abi.pointer(points))
    return points


def correct_matches(camera0: Camera, camera1: Camera, R: Sequence[Sequence[float]],
                    t: Sequence[float], pixels0: ArrayLike, pixels1: ArrayLike,
                    cost: int = Triangulation.POLY) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """tv_correct_matches: pixels moved as little as possible so that their rays meet.

    camera0, camera1, R, t, pixels0, pixels1: as for triangulate. cost: Triangulation.POLY (least
    squares) or POLY_ABS (least sum of distances).
    Returns both pixels (n, 2) float64, distorted as they were, and a (n,) bool array that is True
    for a match that was moved; the pixels of others are zeros.
    Raises as triangulate does."""
    library = _abi.default_library()
    pixels0, pixels1 = _pixels(pixels0, pixels1)
    pairs, pair = _pairs(library, pixels0, pixels1), _pair(camera0, camera1, R, t)
    corrected0, corrected1 = np.empty_like(pixels0), np.empty_like(pixels1)
    valid = np.empty(len(pixels0), np.uint8)
    library.call("tv_correct_matches", _by_reference(pair), byref(pairs), c_int32(int(cost)),
                 _abi.pointer(corrected0), _abi.pointer(corrected1), _abi.pointer(valid))
    return corrected0, corrected1, valid.view(bool)


@dataclass(frozen=True, eq=False, repr=False)
class BundleResult(Record):
    """The result of bundle adjustment: tv_bundle_result with the adjusted pose and points."""

    R: np.ndarray  #: (3, 3), rotation of cam1_from_cam0
    t: np.ndarray  #: (3,), translation, of the length that it had at the start
    points: np.ndarray  #: (n,) of POINT, adjusted, in camera 0's frame and in the unit of t
    num_points: int  #: how many points took part
    num_iterations: int  #: steps that were tried
    converged: bool  #: False where max_iterations ended it
    initial_cost: float  #: sum of the losses over the observations, pixels squared, at the start
    final_cost: float  #: and at the end
    initial_rms_px: float  #: root mean square of the reprojection errors in pixels, at the start
    rms_px: float  #: and at the end
    covariance: Optional[np.ndarray]  #: (5, 5) of the pose, radians squared, as in TwoView
    noise_px: float  #: standard deviation of a pixel's coordinate, from the residuals

    def __str__(self) -> str:
        ended = "converged" if self.converged else "not converged"
        return table([("", f"{self.num_points} points, {ended} after {self.num_iterations} "
                           f"iterations: {self.initial_rms_px:.3f} to {self.rms_px:.3f} px rms"),
                      ("rotation", rotation(self.R)), ("t", vector(self.t))])


def adjust_two_view(context: Context, camera0: Camera, camera1: Camera, pixels0: ArrayLike,
                    pixels1: ArrayLike, R: Sequence[Sequence[float]], t: Sequence[float],
                    points: np.ndarray, options: Optional[BundleOptions] = None,
                    sigmas0: Optional[ArrayLike] = None, sigmas1: Optional[ArrayLike] = None,
                    **keywords: Any) -> BundleResult:
    """tv_adjust_two_view: bundle adjustment of a pose and its points from a given start, which is
    not modified.

    context: of enough matches. camera0, camera1: Cameras; None for both is TV_ERR_NULL. pixels0,
    pixels1: (n, 2) float64, as in the images. R: 3x3 and t: 3 numbers, the start; the length of t
    is kept. points: (n,) of twoview.POINT, of triangulate, in the unit of t. options: a
    BundleOptions, or its fields as keywords. sigmas0, sigmas1: as for estimate_two_view.
    Returns a BundleResult.
    Raises as triangulate does, ValueError for counts that differ, TV_ERR_LIMITS for more points
    than the context's max_matches."""
    wanted = to_struct(check_context(context).library, BundleOptions, options, keywords)
    pixels0, pixels1 = _pixels(pixels0, pixels1)
    pair = _pair(camera0, camera1, R, t)
    points = _abi.check_array("points", points, _abi.POINT).copy()
    if len(points) != len(pixels0):
        raise ValueError(f"{len(points)} points and {len(pixels0)} matches")
    result = context.library.make(_abi.tv_bundle_result)
    pairs = _pairs(context.library, pixels0, pixels1, sigmas0=sigmas0, sigmas1=sigmas1)
    context.call("tv_adjust_two_view", byref(pairs), byref(wanted), _by_reference(pair),
                 _abi.pointer(points), byref(result))
    covariance = np.array(result.covariance).reshape(5, 5) if result.has_covariance else None
    return BundleResult(np.array(pair.cam1_from_cam0_R).reshape(3, 3),
                        np.array(pair.cam1_from_cam0_t), points, result.num_points,
                        result.num_iterations, bool(result.converged), result.initial_cost,
                        result.final_cost, result.initial_rms_px, result.rms_px, covariance,
                        result.noise_px)


def point_covariances(camera0: Camera, camera1: Camera, R: Sequence[Sequence[float]],
                      t: Sequence[float], points: np.ndarray, noise_px: float,
                      pose_covariance: Optional[Sequence[Sequence[float]]] = None) -> np.ndarray:
    """tv_point_covariances: how sure each point's position is, to first order.

    camera0, camera1: Cameras; None for both is TV_ERR_NULL. R: 3x3 and t: 3 numbers, the pose.
    points: (n,) of twoview.POINT. noise_px: standard deviation of a pixel's coordinate (TwoView and
    BundleResult have it). pose_covariance: None (the pose is exact), or 5x5, radians squared, of a
    TwoView or BundleResult.
    Returns (n, 3, 3) float64 in camera 0's frame, in the unit of t squared; zeros where unknown.
    Raises as triangulate does."""
    pair = _pair(camera0, camera1, R, t)
    points = _abi.check_array("points", points, _abi.POINT)
    given = pose_covariance
    pose = None if given is None else _abi.small_array("pose_covariance", given, 5, 5)
    covariances = np.zeros((len(points), 3, 3))
    _abi.default_library().call(
        "tv_point_covariances", _by_reference(pair), _abi.pointer(points), c_int32(len(points)),
        ctypes.c_double(noise_px), _abi.pointer(pose), _abi.pointer(covariances))
    return covariances


@dataclass(frozen=True, eq=False, repr=False)
class Reconstruction(Record):
    """tv_reconstruction: the features of both views, the matches, and one point for each match."""

    keypoints: tuple[np.ndarray, np.ndarray]  #: (n0,) and (n1,) of KEYPOINT
    descriptors: tuple[np.ndarray, np.ndarray]  #: (n0, 128) and (n1, 128) uint8
    matches: np.ndarray  #: (m,) of dtype CORRESPONDENCE
    inlier_mask: np.ndarray  #: (m,) bool, True for an inlier
    points: np.ndarray  #: (m,) of POINT; INVALID where the match is no inlier
    num_points: int  #: how many of the points have the status OK
    #: Matches that exceed the context's max_matches; those with the highest ratios are left out.
    num_matches_left_out: int
    effort: int = 0  #: the rung of effort whose result this is
    num_rungs: int = 1  #: how many rungs were run; that of `effort` is the last
    #: (n0,) and (n1,) uint8: the tilt of each keypoint's view, for keypoint_shapes; 0: not squeezed
    tilts: tuple[np.ndarray, ...] = ()

    def __str__(self) -> str:
        return (f"{self.num_points} points of {int(self.inlier_mask.sum())} inliers among "
                f"{len(self.matches)} matches; {len(self.keypoints[0])} and "
                f"{len(self.keypoints[1])} keypoints")


def _copied(address: Optional[int], count: int, dtype: Any) -> np.ndarray:
    if not count or not address:
        return np.empty(0, dtype)
    size = count * np.dtype(dtype).itemsize
    return np.frombuffer(ctypes.string_at(address, size), dtype).copy()


def reconstruct(context: Context, image0: np.ndarray, camera0: Optional[Camera],
                image1: np.ndarray, camera1: Optional[Camera], *,
                mask0: Optional[np.ndarray] = None, mask1: Optional[np.ndarray] = None,
                feature: Optional[FeatureOptions] = None,
                match: Optional[MatchOptions] = None, estimate: Optional[EstimateOptions] = None,
                triangulation: int = Triangulation.ITERATIVE_LS, guided_matching: bool = False,
                bundle_adjustment: bool = False,
                sigma_by_size: float = 1.0, align_matches: bool = True, effort: int = 0,
                max_effort: Optional[int] = None) -> tuple[TwoView, Reconstruction]:
    """tv_reconstruct: from two images to a pose and points.

    context: as large as both images. image0, image1: (height, width) uint8, read without a copy.
    camera0, camera1: a Camera of each image's size; or None for both, which finds the fundamental
    matrix F or a homography H, and no pose or points. mask0, mask1: None, or uint8 or bool of the
    image's shape, 0 where no corner is wanted. feature, match, estimate: the options of the stages,
    None for the defaults. triangulation: a Triangulation. guided_matching: whether a second
    matching follows along the epipolar lines. bundle_adjustment: whether pose and points are
    adjusted together. sigma_by_size: the exponent of keypoint_sigmas, [0, 2]. align_matches:
    whether one keypoint of each match is moved by the pixels around both. effort: the rung of
    effort to begin with, 0 to the context's max_effort; max_effort: the highest rung, which is
    climbed to while the verdict is not OK and the evidence says that more could help. None: with
    effort 0 that of the context, else the rung `effort` alone.
    Returns a TwoView and a Reconstruction. "No geometry" is a result, not an exception: see
    TwoView.verdict.
    Raises TypeError or ValueError for an array that C could not read and for one camera alone,
    TV_ERR_CAMERA for an image that is not of its camera's size, TV_ERR_LIMITS for an image above
    the context's limits, TV_ERR_ARGUMENT for an option out of its range."""
    if max_effort is None:
        max_effort = check_context(context).max_effort if effort == 0 else effort
    found, cloud = _reconstruct(
        context, image0, camera0, image1, camera1, (mask0, mask1), (feature, match, estimate),
        triangulation=triangulation, guided_matching=guided_matching,
        bundle_adjustment=bundle_adjustment, sigma_by_size=sigma_by_size,
        align_matches=align_matches, effort=effort, max_effort=max_effort)
    return _two_view(found), cloud


def _reconstruct(context: Context, image0: np.ndarray, camera0: Optional[Camera],
                 image1: np.ndarray, camera1: Optional[Camera], masks: Sequence[Any],
                 options: Sequence[Any],
                 **fields: Any) -> tuple[Any, Reconstruction]:
    """The tv_two_view, as ctypes has it, and the Reconstruction of tv_reconstruct. options: of
    features, matching and estimate; fields: of tv_reconstruct_options."""
    library = check_context(context).library
    kept = [to_struct(library, kind, options, {}) for kind, options in
            zip((FeatureOptions, MatchOptions, EstimateOptions), options)]
    wanted = library.make(_abi.tv_reconstruct_options, fields)
    wanted.feature, wanted.match, wanted.estimate = map(ctypes.addressof, kept)
    views = []
    is_calibrated = not _are_uncalibrated(camera0, camera1)
    for name, image, camera, mask in (("0", image0, camera0, masks[0]),
                                      ("1", image1, camera1, masks[1])):
        view = library.make(_abi.tv_view)
        view.image = _abi.check_image("image" + name, image)
        if is_calibrated:
            lens = camera_struct("camera" + name, camera)
            kept.append(lens)
            view.camera = ctypes.addressof(lens)
            if (lens.height, lens.width) != image.shape:
                raise _abi.TV_ERR_CAMERA(
                    f"image{name} is {image.shape[1]}x{image.shape[0]}, but camera{name} is for "
                    f"{lens.width}x{lens.height}: resize the image, or its camera by "
                    "twoview.camera_scale")
        if mask is not None:
            kept.append(_abi.check_mask("mask" + name, mask, image))
            view.mask = ctypes.addressof(kept[-1])
        views.append(view)
    found = _result(library)
    cloud = library.make(_abi.tv_reconstruction)
    with context.lock:  # the context's next call overwrites the arrays, so copy here
        context.call("tv_reconstruct", byref(views[0]), byref(views[1]), byref(wanted),
                     byref(found), byref(found.evidence), byref(cloud))
        del kept  # the call pointed into `kept`, which may be freed only now
        n, m = tuple(cloud.num_keypoints), cloud.num_matches
        first, second = (_copied(cloud.keypoints[v], n[v], _abi.KEYPOINT) for v in range(2))
        bytes0, bytes1 = (_copied(cloud.descriptors[v], n[v] * _abi.DESCRIPTOR_BYTES, np.uint8)
                          .reshape(-1, _abi.DESCRIPTOR_BYTES) for v in range(2))
        result = Reconstruction((first, second), (bytes0, bytes1),
                                _copied(cloud.matches, m, _abi.CORRESPONDENCE),
                                _copied(cloud.inlier_mask, m, np.uint8).view(bool),
                                _copied(cloud.points, m, _abi.POINT), cloud.num_points,
                                cloud.num_matches_left_out, cloud.effort,
                                cloud.num_rungs,
                                tuple(_copied(cloud.tilts[v], n[v], np.uint8)
                                      if cloud.tilts[v] else np.zeros(n[v], np.uint8)
                                      for v in range(2)))
    return found, result
