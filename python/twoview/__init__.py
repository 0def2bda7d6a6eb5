"""FAST-SIFT matching and two-view geometry: poses with a verdict and a covariance.

The functions have the names of the C API without tv_. Images are read without a copy. Calls release
the interpreter's lock. docs/python.md has an example."""

from ._abi import (CORRESPONDENCE, DESCRIPTOR_BYTES, DISTANCE_PRIOR, GRAVITY_PRIOR, KEYPOINT,
                   MAP_OBSERVATION, MAP_POINT, OBSERVATION, POINT, POSE_PRIOR, TV_ERR_ALIGNMENT,
                   TV_ERR_ARGUMENT,
                   TV_ERR_CAMERA, TV_ERR_CAPACITY, TV_ERR_KERNELS, TV_ERR_LIMITS, TV_ERR_MAP,
                   TV_ERR_MEMORY,
                   TV_ERR_NOT_FINITE, TV_ERR_NULL, TV_ERR_OUTSIDE, TV_ERR_OVERLAP,
                   TV_ERR_STRUCT_SIZE, WINDOW_VIEW, Library, StatusError, default_library)
from .absolute_pose import AbsolutePose, estimate_absolute_pose
from .camera import (Camera, camera_check, camera_project_points, camera_scale,
                     camera_undistort, camera_unproject_points, camera_valid_angle)
from .context import Context
from .enums import (CameraModel, Kernels, Kind, Loss, Normalisation, OdometryStatus, Orientation,
                    PointStatus, Purpose, Reason, ScaleSource, Solver, Stage, Status,
                    Triangulation, Verdict)
from .odometry import Keyframe, Odometry, OdometryState
from .options import (AbsolutePoseOptions, BundleOptions, EstimateOptions, FeatureOptions,
                      GuidedOptions, MatchOptions, OdometryOptions, WindowOptions)
from .stages import (BundleResult, Reconstruction, TwoView, adjust_two_view, correct_matches,
                     corrected_camera, describe, detect, estimate_two_view, extract,
                     keypoint_sigmas, match, match_guided, orient, point_covariances,
                     reconstruct, triangulate)
from .window import WindowResult, adjust_window


def version_string() -> str:
    """The version of the loaded library, from tv_version_string."""
    return default_library().version()


__all__ = [name for name in dir() if not name.startswith("_")]
