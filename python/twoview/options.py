"""The options of the stages, with the defaults of C. A function takes either an options object or
its fields as keywords: twoview.detect(context, image, arc=12)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Optional, Sequence

import numpy as np

from . import _abi
from .camera import Calibration
from .enums import Kernels, Loss, Normalisation, Orientation, Refine, Solver


class _Options:
    """Options with arrays among their fields compare and hash like tuples of numbers."""

    def __post_init__(self) -> None:
        for field in fields(self):  # type: ignore[arg-type]  # each subclass is a dataclass
            value = getattr(self, field.name)
            if isinstance(value, (list, np.ndarray)):
                object.__setattr__(self, field.name, tuple(np.asarray(value).tolist()))


@dataclass(frozen=True)
class FeatureOptions:
    """The options of detection, orientation and description, as in tv_feature_options."""

    #: Most descriptors of an image; 0: the smaller of 2048 and the context's limit.
    max_keypoints: int = 0
    arc: int = 12  #: contiguous pixels of the circle of 16 that a corner needs, 9 to 12
    threshold: int = 15  #: contrast that a corner needs, grey levels, [1, 254]
    min_threshold: int = 3  #: lowest value to which the threshold may fall; 0: it is fixed
    levels: int = 4  #: number of pyramid levels, [1, 8]
    scale_factor: float = 1.41  #: ratio of sizes of neighbouring pyramid levels, [1.1, 2]
    #: Side of the grid cells that share out the corners, pixels; 0: the strongest corners anywhere.
    cell_px: int = 48
    subpixel: bool = True  #: positions are refined to a fraction of a pixel
    orientation: int = Orientation.GRADIENT  #: an Orientation: of the patch that is described
    descriptor: int = Normalisation.ROOTSIFT  #: a Normalisation
    keypoint_size: float = 4.0  #: diameter of a keypoint at level 0, pixels
    pooling: bool = False  #: a descriptor is the mean over windows of 0.7 and 1.3 times its size


@dataclass(frozen=True)
class MatchOptions:
    """The options of matching, as in tv_match_options."""

    ratio: float = 0.92  #: upper bound of nearest / second nearest distance, in both directions
    #: Second nearest are only keypoints at least this far from the nearest one, pixels; 0: all.
    neighbourhood_px: float = 10.0
    max_distance: float = 0.0  #: upper bound of the second nearest L2 distance; 0: none


@dataclass(frozen=True)
class GuidedOptions:
    """The options of matching along epipolar lines, as in tv_guided_options."""

    max_error_px: float = 4.0  #: half the width of the band around the epipolar line, pixels
    ratio: float = 0.87  #: upper bound of nearest / second nearest distance within the band
    max_distance: float = 180.0  #: largest L2 distance of the descriptors of a match
    neighbourhood_px: float = 4.0  #: the second nearest is at least this far away, pixels


@dataclass(frozen=True)
class EstimateOptions(_Options):
    """The options of the two-view estimate, as in tv_estimate_options."""

    method: int = Solver.AUTO  #: AUTO: five-point with cameras, else eight-point
    max_error_px: float = 1.0  #: inlier threshold, pixels of the given images
    confidence: float = 0.9999  #: probability of not having missed a better model, [0, 1)
    max_iterations: int = 10000  #: most samples, [1, 1000000]; it bounds the time
    fixed_iterations: int = 0  #: number of iterations; 0: it is adaptive
    seed: Optional[int] = None  #: seed of the sampler; None: the library's constant
    gravity0: Sequence[float] = (0.0, 0.0, 0.0)  #: direction of gravity in camera 0's frame
    gravity1: Sequence[float] = (0.0, 0.0, 0.0)  #: and in camera 1's; of any length
    gravity_sigma_rad: float = 0.0  #: standard deviation of gravity; 0: it is not used
    #: How uncertain camera 0 is. Where both cameras are equal, the larger deviations of both count,
    #: and what either allows may be refined: with a focal_sigma above 0.02 the focal length
    #: (TwoView.focal_scale), else the principal point (TwoView.principal_point_shift).
    calibration0: Calibration = Calibration()
    calibration1: Calibration = Calibration()  #: of camera 1
    #: Standard deviation of a camera's turn while a picture's rows are read, about each axis,
    #: radians; 0: all rows are exposed at once, and no rolling shutter is tested.
    readout_turn_sigma_rad: float = 0.02
    num_trials: int = 0  #: which attempt at the pair this is; 0 means the first


@dataclass(frozen=True)
class BundleOptions:
    """The options of bundle adjustment, as in tv_bundle_options."""

    loss: int = Loss.CAUCHY  #: a Loss
    loss_scale_px: float = 1.0  #: scale of the loss, pixels; a smaller one trusts outliers less
    max_iterations: int = 50  #: most steps, [0, 1000]
    hold_pose: bool = False  #: only the points are adjusted


@dataclass(frozen=True)
class AbsolutePoseOptions(_Options):
    """The options of the absolute pose, as in tv_absolute_pose_options."""

    max_iterations: int = 10000  #: most samples, [1, 1000000]; it bounds the time
    fixed_iterations: int = 0  #: number of iterations; 0: it is adaptive
    max_error_px: float = 4.0  #: inlier threshold, pixels between a pixel and its point's image
    confidence: float = 0.9999  #: probability of not having missed a better model, [0, 1)
    seed: Optional[int] = None  #: seed of the sampler; None: the library's constant
    gravity_in_world: Sequence[float] = (0.0, 0.0, 0.0)  #: direction of gravity, "down"
    gravity_in_camera: Sequence[float] = (0.0, 0.0, 0.0)  #: the same in the camera's frame
    gravity_sigma_rad: float = 0.0  #: standard deviation in the camera; 0: it is not used


@dataclass(frozen=True)
class WindowOptions:
    """The options of adjust_window, as in tv_window_options."""

    loss: int = Loss.CAUCHY  #: a Loss
    loss_scale_px: float = 2.0  #: scale of the loss, pixels; a smaller one trusts outliers less
    noise_px: float = 1.0  #: of an observation of sigma 1, which weighs it against the priors
    tolerance: float = 1e-6  #: share of the cost that may be left to gain
    max_iterations: int = 50  #: most steps, [0, 1000]


@dataclass(frozen=True)
class OdometryOptions:
    """The options of the odometry, as in tv_odometry_options."""

    max_keypoints: int = 1000  #: most keypoints of a frame, [100, 4096]
    max_keyframes: int = 200  #: most keyframes of the map, [8, 2000]
    max_points: int = 20000  #: most points of the map, [500, 200000]
    window: int = 10  #: keyframes that are adjusted together, [3, 20]
    kernels: int = Kernels.AUTO
    seed: Optional[int] = None  #: seed of every sampler; None: the library's constant
    #: A Refine: PRINCIPAL_POINT moves it where many keyframes agree, NOTHING keeps the camera.
    refine: int = Refine.PRINCIPAL_POINT


@dataclass(frozen=True)
class DenseOptions:
    """The options of densify, as in tv_dense_options."""

    max_cells: int = 400000  #: most cells of the grid, [1024, 16777216]
    max_steps: int = 256  #: most steps of parallax, [16, 512]
    min_parallax_rad: float = 0.0  #: least parallax, radians
    max_parallax_rad: float = 0.0  #: largest parallax, radians; 0: the range of the sparse points
    max_relative_sigma: float = 0.05  #: largest sigma of a distance, as a share of it


@dataclass(frozen=True)
class DepthOptions:
    """The options of sweep_depth, as in tv_depth_options."""

    max_pixels: int = 200000  #: most pixels of the map, [1024, 4194304]
    max_planes: int = 96  #: most planes of equal inverse depth, [16, 256]
    max_views: int = 5  #: most views, the reference included, [2, 7]
    near_depth: float = 0.0  #: the range along the optical axis that is searched, in the unit
    far_depth: float = 0.0  #: of the poses; has no default
    max_relative_sigma: float = 0.05  #: largest sigma of a distance, as a share of it


@dataclass(frozen=True)
class RoomOptions:
    """The options of a Room, as in tv_room_options."""

    truncation_voxels: int = 3  #: voxels before and behind a surface that a map is fused into
    voxel: float = 0.03  #: its side, in the unit of the poses
    max_distance: float = 0.0  #: distances above it are not fused; 0: no limit


@dataclass(frozen=True)
class RoomMeshOptions(_Options):
    """The options of Room.mesh, as in tv_room_mesh_options."""

    min_maps: int = 1  #: fewest maps that have seen the surface at a voxel, [1, 255]
    min_piece_triangles: int = 64  #: connected pieces of fewer triangles are left out
    measured_only: bool = False  #: leave out what was inferred
    min: Sequence[float] = (0.0, 0.0, 0.0)  #: only blocks that touch this box; zeros: all
    max: Sequence[float] = (0.0, 0.0, 0.0)
    max_sigma: float = 0.0  #: leave out triangles of vertices with a larger sigma; 0: none


@dataclass(frozen=True)
class RoomPlaneOptions(_Options):
    """The options of Room.find_planes, as in tv_room_plane_options."""

    min_maps_behind: int = 1  #: fewest maps that saw what lies behind a plane, [1, 255]
    min_area: float = 0.0  #: of a plane, in squares of the unit; 0: 640 squares of a voxel's side
    gravity: Sequence[float] = (0.0, 0.0, 0.0)  #: its direction in the world; zeros: not known
    gravity_sigma_rad: float = 0.02  #: standard deviation of that direction


@dataclass(frozen=True)
class RoomInferOptions:
    """The options of Room.infer, as in tv_room_infer_options."""

    max_step: int = 3  #: grey levels between neighbours that count as no texture, [0, 255]


_STRUCTS = {FeatureOptions: _abi.tv_feature_options, MatchOptions: _abi.tv_match_options,
            GuidedOptions: _abi.tv_guided_options, EstimateOptions: _abi.tv_estimate_options,
            BundleOptions: _abi.tv_bundle_options,
            AbsolutePoseOptions: _abi.tv_absolute_pose_options,
            WindowOptions: _abi.tv_window_options, OdometryOptions: _abi.tv_odometry_options,
            DenseOptions: _abi.tv_dense_options,
            DepthOptions: _abi.tv_depth_options, RoomOptions: _abi.tv_room_options,
            RoomMeshOptions: _abi.tv_room_mesh_options,
            RoomPlaneOptions: _abi.tv_room_plane_options,
            RoomInferOptions: _abi.tv_room_infer_options}


def to_struct(library: _abi.Library, kind: type, options: Any, keywords: dict[str, Any]) -> Any:
    """The C struct of an options object, or of options given as keywords."""
    if options is not None and keywords:
        raise TypeError("options are given as an object or as keywords, not both")
    if options is None:
        options = kind(**keywords)
    if not isinstance(options, kind):
        raise TypeError(f"options: {kind.__name__} is expected, not {type(options).__name__}")
    given = {f.name: getattr(options, f.name)
             for f in fields(options)}  # type: ignore[arg-type]  # isinstance has narrowed it
    return library.make(_STRUCTS[kind], {k: v for k, v in given.items() if v is not None})
