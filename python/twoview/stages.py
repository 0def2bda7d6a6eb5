"""The stages under their C names. Arrays are numpy arrays, and the caller's images are read without
a copy."""

from __future__ import annotations

import ctypes
from ctypes import byref, c_int32
from dataclasses import dataclass, replace
from typing import Any, Optional, Sequence

import numpy as np

from . import _abi
from .camera import Camera, camera_struct
from .context import Context, check_context
from .enums import Kind, Reason, Triangulation, Verdict
from .options import (BundleOptions, EstimateOptions, FeatureOptions, GuidedOptions, MatchOptions,
                      to_struct)


def _images(image: np.ndarray, mask: Optional[np.ndarray]) -> list[Any]:
    views = [byref(_abi.check_image("image", image)), None]
    if mask is not None:
        views[1] = byref(_abi.check_image("mask", mask))
        if mask.shape != image.shape:
            raise ValueError(f"mask: the image's shape {image.shape} is expected, not {mask.shape}")
    return views


def _room(context: Context, wanted: Any) -> int:
    """The largest number of keypoints that a call can return."""
    return max(wanted.max_keypoints or context.max_keypoints, 0)


def detect(context: Context, image: np.ndarray, mask: Optional[np.ndarray] = None,
           options: Optional[FeatureOptions] = None, **keywords: Any) -> np.ndarray:
    """tv_detect: FAST corners, strongest first.

    image: (height, width) uint8; the rows need not be adjacent. mask: the same shape, 0 where no
    corner is wanted. Returns (n,) of twoview.KEYPOINT: x, y (pixels), size, angle_rad, score,
    level."""
    wanted = to_struct(check_context(context).library, FeatureOptions, options, keywords)
    keypoints = np.empty(_room(context, wanted), _abi.KEYPOINT)
    count = c_int32()
    context.call("tv_detect", *_images(image, mask), byref(wanted), _abi.pointer(keypoints),
                 c_int32(len(keypoints)), byref(count))
    return keypoints[: count.value].copy()


def orient(context: Context, image: np.ndarray, keypoints: np.ndarray,
           options: Optional[FeatureOptions] = None, **keywords: Any) -> np.ndarray:
    """tv_orient: keypoints with their angles. A keypoint with a second orientation appears
    twice."""
    wanted = to_struct(check_context(context).library, FeatureOptions, options, keywords)
    keypoints = _abi.check_array("keypoints", keypoints, _abi.KEYPOINT)
    oriented = np.empty(2 * len(keypoints), _abi.KEYPOINT)
    count = c_int32()
    context.call("tv_orient", _images(image, None)[0], byref(wanted), _abi.pointer(keypoints),
                 c_int32(len(keypoints)), _abi.pointer(oriented), c_int32(len(oriented)),
                 byref(count))
    return oriented[: count.value].copy()


def describe(context: Context, image: np.ndarray, keypoints: np.ndarray,
             options: Optional[FeatureOptions] = None, **keywords: Any) -> np.ndarray:
    """tv_describe: descriptors (n, 128) uint8, one row for each keypoint, in the byte order that
    OpenCV and COLMAP use (UBC order)."""
    wanted = to_struct(check_context(context).library, FeatureOptions, options, keywords)
    keypoints = _abi.check_array("keypoints", keypoints, _abi.KEYPOINT)
    descriptors = np.empty((len(keypoints), _abi.DESCRIPTOR_BYTES), np.uint8)
    context.call("tv_describe", _images(image, None)[0], byref(wanted), _abi.pointer(keypoints),
                 c_int32(len(keypoints)), _abi.pointer(descriptors))
    return descriptors


def extract(context: Context, image: np.ndarray, mask: Optional[np.ndarray] = None,
            options: Optional[FeatureOptions] = None,
            **keywords: Any) -> tuple[np.ndarray, np.ndarray]:
    """tv_extract: keypoints (n,) and descriptors (n, 128), the same as from detect, orient and
    describe."""
    wanted = to_struct(check_context(context).library, FeatureOptions, options, keywords)
    capacity = _room(context, wanted)
    keypoints = np.empty(capacity, _abi.KEYPOINT)
    descriptors = np.empty((capacity, _abi.DESCRIPTOR_BYTES), np.uint8)
    count = c_int32()
    context.call("tv_extract", *_images(image, mask), byref(wanted), _abi.pointer(keypoints),
                 _abi.pointer(descriptors), c_int32(capacity), byref(count))
    return keypoints[: count.value].copy(), descriptors[: count.value].copy()


def _descriptors(name: str, array: np.ndarray) -> np.ndarray:
    return _abi.check_array(name, array, np.uint8, _abi.DESCRIPTOR_BYTES)


def _features(context: Context, keypoints: Optional[np.ndarray], descriptors: np.ndarray) -> Any:
    features = context.library.make(_abi.tv_features)
    features.num = len(descriptors)
    features.keypoints, features.descriptors = _abi.pointer(keypoints), _abi.pointer(descriptors)
    return features


def keypoint_sigmas(keypoints: np.ndarray, exponent: float,
                    size_of_one: float = FeatureOptions.keypoint_size) -> np.ndarray:
    """tv_keypoint_sigmas: (n,) float32, (size / size_of_one)^exponent of each keypoint. Gather
    them by a match's indices for estimate_two_view."""
    keypoints = _abi.check_array("keypoints", keypoints, _abi.KEYPOINT)
    sigmas = np.empty(len(keypoints), np.float32)
    _abi.default_library().call(
        "tv_keypoint_sigmas", _abi.pointer(keypoints), c_int32(len(keypoints)),
        ctypes.c_float(size_of_one), ctypes.c_double(exponent), _abi.pointer(sigmas))
    return sigmas


def _pairs(context: Context, pixels0: np.ndarray, pixels1: np.ndarray,
           **values: Optional[np.ndarray]) -> Any:
    """A tv_pixel_pairs; values: ratios, sigmas0, sigmas1, each (n,) float32 or None."""
    pairs = context.library.make(_abi.tv_pixel_pairs)
    pairs.num = len(pixels0)
    pairs.pixels0, pairs.pixels1 = _abi.pointer(pixels0), _abi.pointer(pixels1)
    for name, array in values.items():
        if array is None:
            continue
        array = _abi.check_array(name, array, np.float32)
        if len(array) != len(pixels0):
            raise ValueError(f"{len(array)} {name} and {len(pixels0)} matches")
        setattr(pairs, name, _abi.pointer(array))
    return pairs


def match(context: Context, descriptors0: np.ndarray, descriptors1: np.ndarray,
          options: Optional[MatchOptions] = None, keypoints0: Optional[np.ndarray] = None,
          keypoints1: Optional[np.ndarray] = None, **keywords: Any) -> np.ndarray:
    """tv_match: mutual nearest neighbours that pass the ratio test in both directions.

    descriptors: (n, 128) uint8; keypoints: (n,) of twoview.KEYPOINT, without any, as for
    descriptors of other programs, neighbourhood_px counts as 0. Returns (m,) of
    twoview.CORRESPONDENCE: idx0, idx1, dist_sq, ratio."""
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


def _two_cameras(camera0: Optional[Camera], camera1: Optional[Camera]) -> list[Any]:
    if camera0 is None and camera1 is None:
        return [None, None]
    return [byref(camera_struct("camera0", camera0)), byref(camera_struct("camera1", camera1))]


def match_guided(context: Context, camera0: Optional[Camera], camera1: Optional[Camera],
                 epipolar: Sequence[Sequence[float]], keypoints0: np.ndarray,
                 descriptors0: np.ndarray, keypoints1: np.ndarray, descriptors1: np.ndarray,
                 options: Optional[GuidedOptions] = None, **keywords: Any) -> np.ndarray:
    """tv_match_guided: matches along epipolar lines. `epipolar` is a 3x3 matrix: E with cameras, F
    without."""
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
    context.call("tv_match_guided", *_two_cameras(camera0, camera1), _abi.pointer(matrix),
                 *arguments, byref(wanted), _abi.pointer(found), c_int32(len(found)), byref(count))
    return found[: count.value].copy()


@dataclass(frozen=True)
class TwoView:
    """tv_two_view, with the pose cam1_from_cam0: x1 = R x0 + t, |t| = 1. A value that was not
    estimated is None."""

    kind: Kind
    verdict: Verdict
    reasons: Reason
    num_matches: int
    num_inliers: int
    num_iterations: int
    R: Optional[np.ndarray]  #: (3, 3), rotation
    t: Optional[np.ndarray]  #: (3,), unit translation
    E: Optional[np.ndarray]  #: (3, 3), essential matrix, Frobenius norm 1
    F: Optional[np.ndarray]  #: (3, 3), fundamental matrix for undistorted pixels
    H: Optional[np.ndarray]  #: (3, 3), maps undistorted pixels of image 0 to image 1
    alternative_R: Optional[np.ndarray]  #: the second pose that a planar scene permits
    alternative_t: Optional[np.ndarray]
    covariance: Optional[np.ndarray]  #: (5, 5), radians squared: w0 w1 w2 a b of two_view.h
    alternative_covariance: Optional[np.ndarray]
    essential_inliers: Optional[int]  #: the number of inliers of each model, as evidence for it
    fundamental_inliers: Optional[int]
    homography_inliers: Optional[int]
    rotation_inliers: Optional[int]
    coverage: float  #: share of 8x8 cells with an inlier, the larger of the two images'
    median_parallax_rad: float
    rms_error_px: float
    noise_px: float
    seed: int
    #: (2,), pixels to add to cx and cy; all results refer to the cameras with this shift
    principal_point_shift: np.ndarray
    #: Chi-square (2 degrees of freedom) against the given cx and cy; above 13.8 in one pair of a
    #: thousand where they are right. None where one camera did not take both views, the kind is
    #: not CALIBRATED, or the matches do not determine a shift; so are the next two.
    principal_point_chi2: Optional[float]
    #: (2,), the shift in pixels that the matches ask for, which is not applied
    principal_point_asked_px: Optional[np.ndarray]
    principal_point_asked_covariance: Optional[np.ndarray]  #: (2, 2), pixels squared
    #: [0, 1], that the rotation is off by more than 5 degrees; calibrated on real pairs. 1 where
    #: there is no full pose. The next three are the evidence for it.
    probability_wrong: float
    agreement: float  #: share of matches that are inliers, each weighted by (1 - ratio)^2
    #: how far the rotation turns without the inliers of the image region that turns it most
    region_shift_rad: float
    num_places: int  #: cells of 32 pixels with an inlier, in the image with fewer of them
    #: What fx and fy are multiplied by, where the focal length was refined with the pose; all
    #: results then refer to the cameras with it. 0: as given.
    focal_scale: float
    #: Relative standard deviation of the focal length that the covariance contains. 0: exact.
    focal_sigma: float


def _two_view(found: Any) -> TwoView:
    def matrix(field: str, has: int, *shape: int) -> Optional[np.ndarray]:
        return np.array(getattr(found, field)).reshape(shape) if has else None

    def inliers(count: int) -> Optional[int]:
        return count if count >= 0 else None

    xx, xy, yy = found.principal_point_asked_covariance
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
        inliers(found.essential_inliers), inliers(found.fundamental_inliers),
        inliers(found.homography_inliers), inliers(found.rotation_inliers), found.coverage,
        found.median_parallax_rad, found.rms_error_px, found.noise_px, found.seed,
        np.array(found.principal_point_shift), found.principal_point_chi2 if asked else None,
        matrix("principal_point_asked_px", asked, 2), covariance, found.probability_wrong,
        found.agreement, found.region_shift_rad, found.num_places, found.focal_scale,
        found.focal_sigma)


def corrected_camera(found: TwoView, camera: Camera) -> Camera:
    """tv_corrected_camera: the camera that the results in `found` refer to. Use it in calls after
    the estimate."""
    shift = found.principal_point_shift
    scale = found.focal_scale if found.focal_scale > 0 else 1.0
    return replace(camera, fx=camera.fx * scale, fy=camera.fy * scale,
                   cx=camera.cx + float(shift[0]), cy=camera.cy + float(shift[1]))


def _pixels(pixels0: np.ndarray, pixels1: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    pixels0 = _abi.check_array("pixels0", pixels0, np.float64, 2)
    pixels1 = _abi.check_array("pixels1", pixels1, np.float64, 2)
    if len(pixels0) != len(pixels1):
        raise ValueError(f"{len(pixels0)} pixels0 and {len(pixels1)} pixels1")
    return pixels0, pixels1


def _estimate(context: Context, camera0: Optional[Camera], camera1: Optional[Camera],
              pixels0: np.ndarray, pixels1: np.ndarray, wanted: Any,
              **values: Optional[np.ndarray]) -> tuple[Any, np.ndarray]:
    pixels0, pixels1 = _pixels(pixels0, pixels1)
    pairs = _pairs(context, pixels0, pixels1, **values)
    found = context.library.make(_abi.tv_two_view)
    inliers = np.zeros(len(pixels0), np.uint8)
    context.call("tv_estimate_two_view", *_two_cameras(camera0, camera1),
                 byref(pairs), byref(wanted), byref(found), _abi.pointer(inliers))
    return found, inliers.view(bool)


def estimate_two_view(context: Context, camera0: Optional[Camera], camera1: Optional[Camera],
                      pixels0: np.ndarray, pixels1: np.ndarray,
                      ratios: Optional[np.ndarray] = None,
                      options: Optional[EstimateOptions] = None,
                      sigmas0: Optional[np.ndarray] = None, sigmas1: Optional[np.ndarray] = None,
                      **keywords: Any) -> tuple[TwoView, np.ndarray]:
    """tv_estimate_two_view: returns the geometry and the inlier mask, (n,) bool.

    pixels: (n, 2) float64, as in the images (distorted). ratios: (n,) float32; lower means more
    reliable. sigmas: (n,) float32, the standard deviations of the pixels in units of that of the
    most precise ones (keypoint_sigmas); None: 1 for all.
    A pixel that is not finite is never an inlier. Without cameras only F and H are estimated, and
    the method must be AUTO, EIGHT_POINT or SEVEN_POINT."""
    found, inliers = _estimate(context, camera0, camera1, pixels0, pixels1,
                               to_struct(check_context(context).library, EstimateOptions, options,
                                         keywords),
                               ratios=ratios, sigmas0=sigmas0, sigmas1=sigmas1)
    return _two_view(found), inliers


def triangulate(camera0: Camera, camera1: Camera, R: Sequence[Sequence[float]],
                t: Sequence[float], pixels0: np.ndarray, pixels1: np.ndarray,
                method: int = Triangulation.ITERATIVE_LS) -> np.ndarray:
    """tv_triangulate: (n,) of twoview.POINT: position (in camera 0's frame, in the unit of t),
    angle_rad, error_px, status (a PointStatus). R is 3x3, t has 3 numbers, pixels are (n, 2)
    float64."""
    pixels0, pixels1 = _pixels(pixels0, pixels1)
    rotation, translation = _abi.small_array("R", R, 3, 3), _abi.small_array("t", t, 3)
    points = np.zeros(len(pixels0), _abi.POINT)
    _abi.default_library().call(
        "tv_triangulate", c_int32(int(method)), *_two_cameras(camera0, camera1),
        _abi.pointer(rotation), _abi.pointer(translation), _abi.pointer(pixels0),
        _abi.pointer(pixels1), c_int32(len(pixels0)), _abi.pointer(points))
    return points


def correct_matches(camera0: Camera, camera1: Camera, R: Sequence[Sequence[float]],
                    t: Sequence[float], pixels0: np.ndarray, pixels1: np.ndarray,
                    cost: int = Triangulation.POLY) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """tv_correct_matches: both pixels (n, 2) moved so that their rays meet, and a (n,) bool array
    that says which were moved."""
    pixels0, pixels1 = _pixels(pixels0, pixels1)
    rotation, translation = _abi.small_array("R", R, 3, 3), _abi.small_array("t", t, 3)
    corrected0, corrected1 = np.empty_like(pixels0), np.empty_like(pixels1)
    valid = np.empty(len(pixels0), np.uint8)
    _abi.default_library().call(
        "tv_correct_matches", c_int32(int(cost)), *_two_cameras(camera0, camera1),
        _abi.pointer(rotation), _abi.pointer(translation), _abi.pointer(pixels0),
        _abi.pointer(pixels1), c_int32(len(pixels0)), _abi.pointer(corrected0),
        _abi.pointer(corrected1), _abi.pointer(valid))
    return corrected0, corrected1, valid.view(bool)


@dataclass(frozen=True)
class BundleResult:
    """The result of bundle adjustment: tv_bundle_result with the adjusted pose and points."""

    R: np.ndarray
    t: np.ndarray
    points: np.ndarray
    num_points: int
    num_iterations: int
    converged: bool
    initial_cost: float
    final_cost: float
    initial_rms_px: float
    rms_px: float
    covariance: Optional[np.ndarray]  #: (5, 5) of the pose, radians squared
    noise_px: float


def adjust_two_view(context: Context, camera0: Camera, camera1: Camera, pixels0: np.ndarray,
                    pixels1: np.ndarray, R: Sequence[Sequence[float]], t: Sequence[float],
                    points: np.ndarray, options: Optional[BundleOptions] = None,
                    sigmas0: Optional[np.ndarray] = None, sigmas1: Optional[np.ndarray] = None,
                    **keywords: Any) -> BundleResult:
    """tv_adjust_two_view: bundle adjustment from a given start, which is not modified. `points` are
    those of triangulate; sigmas as for estimate_two_view."""
    wanted = to_struct(check_context(context).library, BundleOptions, options, keywords)
    pixels0, pixels1 = _pixels(pixels0, pixels1)
    rotation, translation = (
        _abi.small_array("R", R, 3, 3).copy(),
        _abi.small_array("t", t, 3).copy(),
    )
    points = _abi.check_array("points", points, _abi.POINT).copy()
    if len(points) != len(pixels0):
        raise ValueError(f"{len(points)} points and {len(pixels0)} matches")
    result = context.library.make(_abi.tv_bundle_result)
    pairs = _pairs(context, pixels0, pixels1, sigmas0=sigmas0, sigmas1=sigmas1)
    context.call("tv_adjust_two_view", *_two_cameras(camera0, camera1),
                 byref(pairs), byref(wanted), _abi.pointer(rotation),
                 _abi.pointer(translation), _abi.pointer(points), byref(result))
    covariance = np.array(result.covariance).reshape(5, 5) if result.has_covariance else None
    return BundleResult(rotation, translation, points, result.num_points, result.num_iterations,
                        bool(result.converged), result.initial_cost, result.final_cost,
                        result.initial_rms_px, result.rms_px, covariance, result.noise_px)


def point_covariances(camera0: Camera, camera1: Camera, R: Sequence[Sequence[float]],
                      t: Sequence[float], points: np.ndarray, noise_px: float,
                      pose_covariance: Optional[Sequence[Sequence[float]]] = None) -> np.ndarray:
    """tv_point_covariances: (n, 3, 3) in camera 0's frame, in the unit of t squared; zeros where
    unknown."""
    rotation, translation = _abi.small_array("R", R, 3, 3), _abi.small_array("t", t, 3)
    points = _abi.check_array("points", points, _abi.POINT)
    given = pose_covariance
    pose = None if given is None else _abi.small_array("pose_covariance", given, 5, 5)
    covariances = np.zeros((len(points), 3, 3))
    _abi.default_library().call(
        "tv_point_covariances", *_two_cameras(camera0, camera1), _abi.pointer(rotation),
        _abi.pointer(translation), _abi.pointer(pose), ctypes.c_double(noise_px),
        _abi.pointer(points), c_int32(len(points)), _abi.pointer(covariances))
    return covariances


@dataclass(frozen=True)
class Reconstruction:
    """tv_reconstruction: the features of both views, the matches, and one point for each match."""

    keypoints: tuple[np.ndarray, np.ndarray]
    descriptors: tuple[np.ndarray, np.ndarray]
    matches: np.ndarray  #: (m,) of dtype CORRESPONDENCE
    inlier_mask: np.ndarray  #: (m,) bool, True for an inlier
    points: np.ndarray  #: (m,) of POINT; INVALID where the match is no inlier
    num_points: int
    #: Matches that exceed the context's max_matches; those with the highest ratios are left out.
    num_matches_left_out: int


def _copied(address: Optional[int], count: int, dtype: Any) -> np.ndarray:
    if not count or not address:
        return np.empty(0, dtype)
    size = count * np.dtype(dtype).itemsize
    return np.frombuffer(ctypes.string_at(address, size), dtype).copy()


def reconstruct(context: Context, image0: np.ndarray, camera0: Camera, image1: np.ndarray,
                camera1: Camera, *, mask0: Optional[np.ndarray] = None,
                mask1: Optional[np.ndarray] = None, feature: Optional[FeatureOptions] = None,
                match: Optional[MatchOptions] = None, estimate: Optional[EstimateOptions] = None,
                triangulation: int = Triangulation.ITERATIVE_LS, guided_matching: bool = False,
                bundle_adjustment: bool = False,
                sigma_by_size: float = 1.0,
                align_matches: bool = False) -> tuple[TwoView, Reconstruction]:
    """tv_reconstruct: from two images to a pose and points. Images are (height, width) uint8 and
    are read without a copy; TV_ERR_CAMERA is raised for one that is not of its camera's size.
    feature, match and estimate are the options of the stages; sigma_by_size is the exponent of
    keypoint_sigmas; align_matches moves the keypoints of each match by the pixels around them."""
    library = check_context(context).library
    kept = [to_struct(library, kind, options, {}) for kind, options in
            ((FeatureOptions, feature), (MatchOptions, match), (EstimateOptions, estimate))]
    wanted = library.make(_abi.tv_reconstruct_options, {
        "triangulation": triangulation, "guided_matching": guided_matching,
        "bundle_adjustment": bundle_adjustment, "sigma_by_size": sigma_by_size,
        "align_matches": align_matches})
    wanted.feature, wanted.match, wanted.estimate = map(ctypes.addressof, kept)
    views = []
    for name, image, camera, mask in (("0", image0, camera0, mask0), ("1", image1, camera1, mask1)):
        kept.append(camera_struct("camera" + name, camera))
        view = library.make(_abi.tv_view)
        view.image, view.camera = _abi.check_image("image" + name, image), ctypes.addressof(
            kept[-1]
        )
        if (kept[-1].height, kept[-1].width) != image.shape:
            raise _abi.TV_ERR_CAMERA(
                f"image{name} is {image.shape[1]}x{image.shape[0]}, but camera{name} is for "
                f"{kept[-1].width}x{kept[-1].height}: resize the image, or its camera by "
                "twoview.camera_scale")
        if mask is not None:
            kept.append(_abi.check_image("mask" + name, mask))
            view.mask = ctypes.addressof(kept[-1])
        views.append(view)
    found = library.make(_abi.tv_two_view)
    cloud = library.make(_abi.tv_reconstruction)
    with context.lock:  # the context's next call overwrites the arrays, so copy here
        context.call("tv_reconstruct", byref(views[0]), byref(views[1]), byref(wanted),
                     byref(found), byref(cloud))
        del kept  # the call pointed into `kept`, which may be freed only now
        n, m = tuple(cloud.num_keypoints), cloud.num_matches
        first, second = (_copied(cloud.keypoints[v], n[v], _abi.KEYPOINT) for v in range(2))
        bytes0, bytes1 = (_copied(cloud.descriptors[v], n[v] * _abi.DESCRIPTOR_BYTES, np.uint8)
                          .reshape(-1, _abi.DESCRIPTOR_BYTES) for v in range(2))
        result = Reconstruction((first, second), (bytes0, bytes1),
                                _copied(cloud.matches, m, _abi.CORRESPONDENCE),
                                _copied(cloud.inlier_mask, m, np.uint8).view(bool),
                                _copied(cloud.points, m, _abi.POINT), cloud.num_points,
                                cloud.num_matches_left_out)
    return _two_view(found), result
