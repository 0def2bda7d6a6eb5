"""FAST-SIFT matching and two-view geometry: poses with a verdict and a covariance.

The functions have the names of the C API without tv_. Images are read without a copy. Calls release
the interpreter's lock. docs/python.md has an example.

Arrays of numbers may be of any real dtype, lists, or not contiguous: what has not the dtype that a
function names is converted to it. Images, keypoints, matches and points are taken as they are.
Camera(K) takes a 3x3 matrix; twoview.plot draws matches, epipolar lines and clouds (matplotlib).

Every function raises TypeError for an argument of another type or with numbers that do not fit into
the dtype, and ValueError for another shape, before C is called. A status of C is an exception of
its name, a subclass of StatusError: TV_ERR_ARGUMENT (out of its range), TV_ERR_NOT_FINITE,
TV_ERR_LIMITS (above the limits of the context), TV_ERR_CAMERA, TV_ERR_OUTSIDE (beyond what a lens
model is valid for) and others.
"No geometry" is a result: it is in TwoView.verdict."""

import typing as _typing

from . import plot as plot
from ._abi import (CORRESPONDENCE, DENSE_POINT, DESCRIPTOR_BYTES, DISTANCE_PRIOR,
                   GRAVITY_PRIOR, KEYPOINT,
                   MAP_OBSERVATION, MAP_POINT, OBSERVATION, POINT, POSE_PRIOR,
                   ROOM_PLANE, ROOM_VERTEX,
                   TV_ERR_ALIGNMENT,
                   TV_ERR_ARGUMENT,
                   TV_ERR_CAMERA, TV_ERR_CAPACITY, TV_ERR_EFFORT, TV_ERR_KERNELS,
                   TV_ERR_LIMITS, TV_ERR_MAP, TV_ERR_MASK, TV_ERR_MEMORY,
                   TV_ERR_NOT_FINITE, TV_ERR_NULL, TV_ERR_OUTSIDE, TV_ERR_OVERLAP,
                   TV_ERR_STRIDE, TV_ERR_STRUCT_SIZE, TV_ERR_TIME, WINDOW_VIEW, Library,
                   StatusError, default_library)
from .absolute_pose import AbsolutePose, estimate_absolute_pose
from .camera import (Calibration, Camera, camera_check, camera_project_points, camera_scale,
                     camera_undistort, camera_unproject_points, camera_valid_angle)
from .camera_files import (FILM, PLAIN_FILE, CameraFileWarning, FormatError, format_cameras,
                           parse_cameras, read_calibration, read_camera, read_cameras,
                           write_cameras)
from .context import Context
from .dense import densify
from .depth_map import DepthMap, sweep_depth
from .enums import (CameraModel, Kernels, Kind, Loss, MapReason, Normalisation, OdometryStatus,
                    Orientation, PathOrigin, PointStatus, Purpose, Reason, Refine, RoomPlaneKind,
                    ScaleSource, Solver, Stage, Status, Triangulation, Verdict)
from .odometry import Keyframe, Odometry, OdometryState, integrate_gyro
from .options import (AbsolutePoseOptions, BundleOptions, DenseOptions, DepthOptions,
                      EstimateOptions, FeatureOptions, GuidedOptions, MatchOptions, OdometryOptions,
                      RoomInferOptions, RoomMeshOptions,
                      RoomOptions, RoomPlaneOptions, WindowOptions)
from .path import Path, PathPose
from .room import ROOM_DEFAULT_BYTES, Room, RoomMesh, RoomState
from .stages import (BundleResult, Reconstruction, TwoView, adjust_two_view, align_matches,
                     correct_matches, corrected_camera, describe, detect, estimate_two_view,
                     extract, keypoint_shapes, keypoint_sigmas, match, match_guided, orient,
                     point_covariances, reconstruct, triangulate)
from .window import WindowResult, adjust_window

#: The version of the loaded library, such as "0.2.0": that of version_string().
__version__: str


def version_string() -> str:
    """tv_version_string: returns the version of the loaded library, such as "0.2.0". Raises
    ImportError where there is no library."""
    return default_library().version()


if not _typing.TYPE_CHECKING:  # or a type checker would accept every unknown name
    def __getattr__(name: str) -> str:
        if name == "__version__":  # from the library, which is loaded at its first use
            return version_string()
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


# A type checker reads this list; a test compares it with the imports above.
__all__ = [
    "AbsolutePose", "AbsolutePoseOptions", "BundleOptions", "BundleResult", "CORRESPONDENCE",
    "Calibration", "Camera", "CameraFileWarning", "CameraModel", "Context",
    "DENSE_POINT", "DESCRIPTOR_BYTES", "DISTANCE_PRIOR", "DenseOptions", "DepthMap",
    "DepthOptions", "EstimateOptions", "FILM", "FeatureOptions", "FormatError",
    "GRAVITY_PRIOR", "GuidedOptions", "KEYPOINT", "Kernels", "Keyframe", "Kind", "Library",
    "Loss", "MAP_OBSERVATION", "MAP_POINT", "MapReason", "MatchOptions", "Normalisation",
    "OBSERVATION",
    "Odometry", "OdometryOptions", "OdometryState", "OdometryStatus", "Orientation",
    "PLAIN_FILE", "POINT", "POSE_PRIOR", "Path", "PathOrigin", "PathPose", "PointStatus",
    "Purpose", "ROOM_DEFAULT_BYTES", "ROOM_PLANE", "ROOM_VERTEX", "Reason", "Reconstruction",
    "Refine",
    "Room", "RoomInferOptions",
    "RoomMesh", "RoomMeshOptions", "RoomOptions", "RoomPlaneKind", "RoomPlaneOptions",
    "RoomState", "ScaleSource", "Solver", "Stage", "Status", "StatusError", "TV_ERR_ALIGNMENT",
    "TV_ERR_ARGUMENT", "TV_ERR_CAMERA", "TV_ERR_CAPACITY", "TV_ERR_EFFORT", "TV_ERR_KERNELS",
    "TV_ERR_LIMITS",
    "TV_ERR_MAP", "TV_ERR_MASK", "TV_ERR_MEMORY", "TV_ERR_NOT_FINITE", "TV_ERR_NULL",
    "TV_ERR_OUTSIDE", "TV_ERR_OVERLAP", "TV_ERR_STRIDE", "TV_ERR_STRUCT_SIZE", "TV_ERR_TIME",
    "Triangulation",
    "TwoView", "Verdict",
    "WINDOW_VIEW", "WindowOptions", "WindowResult", "adjust_two_view", "adjust_window",
    "align_matches", "camera_check", "camera_project_points", "camera_scale",
    "camera_undistort", "camera_unproject_points", "camera_valid_angle", "correct_matches",
    "corrected_camera", "default_library", "densify", "describe", "detect",
    "estimate_absolute_pose", "estimate_two_view", "extract", "format_cameras",
    "integrate_gyro", "keypoint_shapes", "keypoint_sigmas", "match", "match_guided", "orient",
    "parse_cameras", "point_covariances",
    "read_calibration", "read_camera", "read_cameras", "reconstruct", "sweep_depth", "triangulate",
    "version_string", "write_cameras"]
