"""The C ABI: struct layouts and the loading of the library. A test in python/tests compiles the
headers and compares the layouts.

ctypes releases the interpreter's lock around every call.
"""

from __future__ import annotations

import ctypes
import operator
import os
from ctypes import (Structure, c_char_p, c_double, c_float, c_int32, c_int64, c_size_t, c_uint8,
                    c_uint32, c_uint64, c_void_p)
from typing import Any, Optional, Union

import numpy as np

from .enums import Status

# The library of this ABI where it is installed in the system, as Debian's libtwoview0.2 does it.
SONAME = "libtwoview.so.0.2"
DESCRIPTOR_BYTES = 128
CONTEXT_ALIGNMENT = 64


class tv_limits(Structure):
    _fields_ = [("struct_size", c_uint32), ("max_width", c_int32), ("max_height", c_int32),
                ("max_keypoints", c_int32), ("max_matches", c_int32), ("kernels", c_int32),
                ("purposes", c_uint32), ("max_effort", c_int32)]


class tv_image(Structure):
    _fields_ = [("data", c_void_p), ("width", c_int32), ("height", c_int32),
                ("stride_bytes", c_int64)]


class tv_camera(Structure):
    _fields_ = [("model", c_int32), ("width", c_int32), ("height", c_int32), ("reserved", c_int32),
                ("fx", c_double), ("fy", c_double), ("cx", c_double), ("cy", c_double),
                ("k", c_double * 8)]


class tv_calibration(Structure):
    _fields_ = [("focal_sigma", c_double), ("center_sigma", c_double), ("refine", c_uint32),
                ("reserved", c_uint32)]


class tv_camera_pair(Structure):
    _fields_ = [("camera0", tv_camera), ("camera1", tv_camera),
                ("cam1_from_cam0_R", c_double * 9), ("cam1_from_cam0_t", c_double * 3)]


class tv_keypoint(Structure):
    _fields_ = [("x", c_float), ("y", c_float), ("size", c_float), ("angle_rad", c_float),
                ("score", c_float), ("level", c_int32)]


class tv_features(Structure):
    _fields_ = [("struct_size", c_uint32), ("num", c_int32), ("keypoints", c_void_p),
                ("descriptors", c_void_p)]


class tv_feature_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("max_keypoints", c_int32), ("arc", c_int32),
                ("threshold", c_int32), ("min_threshold", c_int32), ("levels", c_int32),
                ("scale_factor", c_float), ("cell_px", c_int32), ("subpixel", c_int32),
                ("orientation", c_int32), ("descriptor", c_int32), ("keypoint_size", c_float),
                ("pooling", c_int32), ("reserved", c_int32)]


class tv_correspondence(Structure):
    _fields_ = [("idx0", c_int32), ("idx1", c_int32), ("dist_sq", c_uint32), ("ratio", c_float)]


class tv_match_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("ratio", c_float), ("neighbourhood_px", c_float),
                ("max_distance", c_float)]


class tv_guided_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("max_error_px", c_float), ("ratio", c_float),
                ("max_distance", c_float), ("neighbourhood_px", c_float)]


class tv_epipolar(Structure):
    _fields_ = [("camera0", c_void_p), ("camera1", c_void_p), ("matrix", c_double * 9)]


class tv_pixel_pairs(Structure):
    _fields_ = [("struct_size", c_uint32), ("num", c_int32), ("pixels0", c_void_p),
                ("pixels1", c_void_p), ("ratios", c_void_p), ("sigmas0", c_void_p),
                ("sigmas1", c_void_p)]


class tv_estimate_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("method", c_int32), ("max_error_px", c_double),
                ("confidence", c_double), ("max_iterations", c_int32),
                ("fixed_iterations", c_int32), ("seed", c_uint64), ("gravity0", c_double * 3),
                ("gravity1", c_double * 3), ("gravity_sigma_rad", c_double),
                ("calibration0", tv_calibration), ("calibration1", tv_calibration),
                ("readout_turn_sigma_rad", c_double), ("num_trials", c_int32),
                ("reserved", c_int32)]


class tv_two_view(Structure):
    _fields_ = [("struct_size", c_uint32), ("kind", c_int32), ("verdict", c_int32),
                ("reasons", c_uint32), ("num_matches", c_int32), ("num_inliers", c_int32),
                ("has_R", c_uint8), ("has_t", c_uint8), ("has_E", c_uint8), ("has_F", c_uint8),
                ("has_H", c_uint8), ("has_alternative", c_uint8), ("has_covariance", c_uint8),
                ("has_alternative_covariance", c_uint8), ("num_iterations", c_int32),
                ("num_still", c_int32),
                ("R", c_double * 9), ("t", c_double * 3), ("E", c_double * 9), ("F", c_double * 9),
                ("H", c_double * 9), ("alternative_R", c_double * 9),
                ("alternative_t", c_double * 3), ("covariance", c_double * 25),
                ("alternative_covariance", c_double * 25), ("median_parallax_rad", c_double),
                ("rms_error_px", c_double), ("noise_px", c_double), ("seed", c_uint64),
                ("principal_point_shift", c_double * 2), ("probability_wrong", c_double),
                ("focal_scale", c_double), ("focal_sigma", c_double)]


class tv_evidence(Structure):
    _fields_ = [("struct_size", c_uint32), ("num_places", c_int32),
                ("essential_inliers", c_int32), ("fundamental_inliers", c_int32),
                ("homography_inliers", c_int32), ("rotation_inliers", c_int32),
                ("coverage", c_double), ("agreement", c_double), ("region_shift_rad", c_double),
                ("principal_point_chi2", c_double), ("principal_point_asked_px", c_double * 2),
                ("principal_point_asked_covariance", c_double * 3), ("camera_chi2", c_double),
                ("camera_turn_rad", c_double), ("camera_direction_rad", c_double)]


class tv_point(Structure):
    _fields_ = [("position", c_double * 3), ("angle_rad", c_float), ("error_px", c_float),
                ("status", c_int32), ("reserved", c_int32)]


class tv_view(Structure):
    _fields_ = [("struct_size", c_uint32), ("reserved", c_uint32), ("image", tv_image),
                ("camera", c_void_p), ("mask", c_void_p)]


class tv_reconstruct_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("triangulation", c_int32), ("feature", c_void_p),
                ("match", c_void_p), ("estimate", c_void_p), ("guided_matching", c_int32),
                ("bundle_adjustment", c_int32), ("sigma_by_size", c_double),
                ("align_matches", c_int32), ("reserved", c_int32), ("effort", c_int32),
                ("max_effort", c_int32)]


class tv_reconstruction(Structure):
    _fields_ = [("struct_size", c_uint32), ("num_keypoints", c_int32 * 2),
                ("num_matches_left_out", c_int32),
                ("keypoints", c_void_p * 2), ("descriptors", c_void_p * 2),
                ("num_matches", c_int32), ("num_points", c_int32), ("matches", c_void_p),
                ("inlier_mask", c_void_p), ("points", c_void_p), ("effort", c_int32),
                ("num_rungs", c_int32), ("tilts", c_void_p * 2), ("rung_ns", c_uint64 * 4)]


class tv_bundle_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("loss", c_int32), ("loss_scale_px", c_double),
                ("max_iterations", c_int32), ("hold_pose", c_int32)]


class tv_bundle_result(Structure):
    _fields_ = [("struct_size", c_uint32), ("num_points", c_int32), ("num_iterations", c_int32),
                ("converged", c_uint8), ("has_covariance", c_uint8), ("reserved", c_uint8 * 2),
                ("initial_cost", c_double), ("final_cost", c_double),
                ("initial_rms_px", c_double), ("rms_px", c_double), ("covariance", c_double * 25),
                ("noise_px", c_double)]


class tv_pixel_points(Structure):
    _fields_ = [("struct_size", c_uint32), ("num", c_int32), ("pixels", c_void_p),
                ("points", c_void_p), ("ratios", c_void_p), ("sigmas", c_void_p)]


class tv_absolute_pose_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("max_iterations", c_int32),
                ("fixed_iterations", c_int32), ("reserved", c_int32), ("max_error_px", c_double),
                ("confidence", c_double), ("seed", c_uint64), ("gravity_in_world", c_double * 3),
                ("gravity_in_camera", c_double * 3), ("gravity_sigma_rad", c_double)]


class tv_absolute_pose(Structure):
    _fields_ = [("struct_size", c_uint32), ("verdict", c_int32), ("reasons", c_uint32),
                ("num_matches", c_int32), ("num_inliers", c_int32), ("num_iterations", c_int32),
                ("has_pose", c_uint8), ("has_covariance", c_uint8), ("has_alternative", c_uint8),
                ("reserved", c_uint8 * 5), ("R", c_double * 9), ("t", c_double * 3),
                ("alternative_R", c_double * 9), ("alternative_t", c_double * 3),
                ("covariance", c_double * 36), ("coverage", c_double), ("rms_error_px", c_double),
                ("noise_px", c_double), ("seed", c_uint64)]


class tv_window_view(Structure):
    _fields_ = [("R", c_double * 9), ("t", c_double * 3), ("idx_camera", c_int32),
                ("fixed", c_int32)]


class tv_observation(Structure):
    _fields_ = [("idx_view", c_int32), ("idx_point", c_int32), ("pixel", c_double * 2),
                ("sigma", c_float), ("reserved", c_int32)]


class tv_pose_prior(Structure):
    _fields_ = [("idx_view", c_int32), ("reserved", c_int32), ("R", c_double * 9),
                ("t", c_double * 3), ("information", c_double * 36)]


class tv_gravity_prior(Structure):
    _fields_ = [("idx_view", c_int32), ("reserved", c_int32), ("down", c_double * 3),
                ("sigma_rad", c_double)]


class tv_distance_prior(Structure):
    _fields_ = [("idx_view0", c_int32), ("idx_view1", c_int32), ("distance", c_double),
                ("sigma", c_double)]


class tv_window(Structure):
    _fields_ = [("struct_size", c_uint32), ("num_cameras", c_int32), ("num_views", c_int32),
                ("num_points", c_int32), ("num_observations", c_int32),
                ("num_pose_priors", c_int32), ("num_gravity_priors", c_int32),
                ("num_distance_priors", c_int32), ("cameras", c_void_p), ("views", c_void_p),
                ("points", c_void_p), ("observations", c_void_p), ("pose_priors", c_void_p),
                ("gravity_priors", c_void_p), ("distance_priors", c_void_p),
                ("world_down", c_double * 3)]


class tv_window_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("loss", c_int32), ("loss_scale_px", c_double),
                ("noise_px", c_double), ("tolerance", c_double), ("max_iterations", c_int32),
                ("reserved", c_int32)]


class tv_window_result(Structure):
    _fields_ = [("struct_size", c_uint32), ("num_views", c_int32), ("num_points", c_int32),
                ("num_observations", c_int32), ("num_behind", c_int32), ("num_invalid", c_int32),
                ("num_single", c_int32), ("num_iterations", c_int32), ("converged", c_uint8),
                ("has_covariance", c_uint8), ("held_first_view", c_uint8),
                ("scale_is_free", c_uint8), ("reserved", c_uint8 * 4), ("initial_cost", c_double),
                ("final_cost", c_double), ("initial_rms_px", c_double), ("rms_px", c_double),
                ("noise_px", c_double)]


class tv_odometry_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("max_keypoints", c_int32), ("max_keyframes", c_int32),
                ("max_points", c_int32), ("window", c_int32), ("kernels", c_int32),
                ("seed", c_uint64), ("refine", c_uint32), ("reserved", c_int32)]


class tv_gyro_sample(Structure):
    _fields_ = [("time_s", c_double), ("rate_rad_s", c_double * 3)]


class tv_odometry_frame(Structure):
    _fields_ = [("struct_size", c_uint32), ("gap", c_int32), ("image", tv_image),
                ("time_s", c_double), ("world_from_cam", c_double * 9),
                ("attitude_sigma_rad", c_double), ("height_m", c_double),
                ("height_sigma_m", c_double), ("velocity_m_s", c_double * 3),
                ("velocity_sigma_m_s", c_double), ("mask", tv_image),
                ("previous_from_cam", c_double * 9), ("turn_sigma_rad", c_double)]


class tv_odometry_state(Structure):
    _fields_ = [("struct_size", c_uint32), ("status", c_int32), ("reasons", c_uint32),
                ("segment", c_int32), ("is_keyframe", c_uint8), ("relocated", c_uint8),
                ("loop_closed", c_uint8), ("has_pose", c_uint8), ("has_covariance", c_uint8),
                ("attitude_ignored", c_uint8), ("reserved", c_uint8 * 2),
                ("num_frames", c_int32), ("num_keypoints", c_int32),
                ("num_matches", c_int32), ("num_inliers", c_int32), ("num_keyframes", c_int32),
                ("num_points", c_int32), ("num_segments", c_int32), ("num_relocations", c_int32),
                ("num_loops", c_int32), ("reference_id", c_int32),
                ("reference_from_cam_R", c_double * 9), ("reference_from_cam_t", c_double * 3),
                ("world_from_cam_R", c_double * 9), ("world_from_cam_t", c_double * 3),
                ("cam_from_world_covariance", c_double * 36),
                ("noise_px", c_double), ("scale_source", c_int32),
                ("scale_contradicted", c_int32), ("scale_sigma", c_double),
                ("principal_point_shift_px", c_double * 2), ("height_scale", c_double),
                ("height_scale_sigma", c_double), ("velocity_scale", c_double),
                ("velocity_scale_sigma", c_double), ("still_share", c_double),
                ("map_reasons", c_uint32), ("reserved_end", c_uint32)]


class tv_keyframe(Structure):
    _fields_ = [("struct_size", c_uint32), ("id", c_int32), ("segment", c_int32),
                ("frame", c_int32), ("time_s", c_double), ("world_from_cam_R", c_double * 9),
                ("world_from_cam_t", c_double * 3), ("num_keypoints", c_int32),
                ("num_observations", c_int32)]


class tv_path_frame(Structure):
    _fields_ = [("time_s", c_double), ("frame", c_int32), ("origin", c_int32),
                ("reference_id", c_int32), ("reserved", c_int32),
                ("reference_from_cam_R", c_double * 9), ("reference_from_cam_t", c_double * 3)]


class tv_path_pose(Structure):
    _fields_ = [("origin", c_int32), ("segment", c_int32), ("world_from_cam_R", c_double * 9),
                ("world_from_cam_t", c_double * 3)]


class tv_map_point(Structure):
    _fields_ = [("id", c_int32), ("segment", c_int32), ("num_observations", c_int32),
                ("grey", c_int32), ("position", c_double * 3), ("covariance", c_double * 9)]


class tv_map_observation(Structure):
    _fields_ = [("idx_point", c_int32), ("idx_keypoint", c_int32), ("x", c_float), ("y", c_float),
                ("sigma", c_float), ("reserved", c_int32)]


class tv_dense_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("max_cells", c_int32), ("max_steps", c_int32),
                ("num_sparse", c_int32), ("sparse", c_void_p), ("min_parallax_rad", c_double),
                ("max_parallax_rad", c_double), ("max_relative_sigma", c_double)]


class tv_dense_point(Structure):
    _fields_ = [("position", c_float * 3), ("pixel0", c_float * 2), ("pixel1", c_float * 2),
                ("sigma", c_float), ("similarity", c_float), ("grey", c_int32)]


class tv_depth_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("max_pixels", c_int32), ("max_planes", c_int32),
                ("max_views", c_int32), ("near_depth", c_double), ("far_depth", c_double),
                ("max_relative_sigma", c_double)]


class tv_depth_view(Structure):
    _fields_ = [("image", tv_image), ("camera", c_void_p),
                ("world_from_cam_R", c_double * 9), ("world_from_cam_t", c_double * 3)]


class tv_depth_arrays(Structure):
    _fields_ = [("distance", c_void_p), ("sigma", c_void_p), ("witnesses", c_void_p),
                ("grey", c_void_p)]


class tv_room_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("truncation_voxels", c_int32), ("voxel", c_double),
                ("max_distance", c_double)]


class tv_depth_map(Structure):
    _fields_ = [("struct_size", c_uint32), ("width", c_int32), ("height", c_int32),
                ("stride", c_int32), ("camera", c_void_p), ("world_from_cam_R", c_double * 9),
                ("world_from_cam_t", c_double * 3), ("distance", c_void_p), ("sigma", c_void_p),
                ("witnesses", c_void_p), ("pixels", c_void_p), ("pixel_stride_bytes", c_int64),
                ("channels", c_int32), ("inferred", c_int32), ("mask", c_void_p),
                ("mask_stride_bytes", c_int64)]


class tv_room_state(Structure):
    _fields_ = [("struct_size", c_uint32), ("num_maps", c_int32), ("num_blocks", c_int32),
                ("cap_blocks", c_int32), ("voxel", c_double), ("min", c_double * 3),
                ("max", c_double * 3)]


class tv_room_vertex(Structure):
    _fields_ = [("position", c_float * 3), ("normal", c_float * 3), ("sigma", c_float),
                ("rgb", c_uint8 * 3), ("inferred", c_uint8), ("num_maps", c_int32),
                ("reserved", c_int32)]


class tv_room_triangle(Structure):
    _fields_ = [("idx_vertex", c_int32 * 3)]


class tv_room_mesh_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("min_maps", c_int32),
                ("min_piece_triangles", c_int32), ("measured_only", c_int32),
                ("min", c_double * 3), ("max", c_double * 3), ("planes", c_void_p),
                ("num_planes", c_int32), ("reserved", c_int32), ("max_sigma", c_double)]


class tv_room_plane(Structure):
    _fields_ = [("normal", c_double * 3), ("offset", c_double), ("centre", c_double * 3),
                ("area", c_double), ("sigma", c_double), ("share_behind", c_double),
                ("kind", c_int32), ("reserved", c_int32)]


class tv_room_plane_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("min_maps_behind", c_int32), ("min_area", c_double),
                ("gravity", c_double * 3), ("gravity_sigma_rad", c_double)]


class tv_room_infer_options(Structure):
    _fields_ = [("struct_size", c_uint32), ("max_step", c_int32), ("planes", c_void_p),
                ("num_planes", c_int32), ("reserved", c_int32)]


STRUCTS = [tv_limits, tv_image, tv_camera, tv_calibration, tv_camera_pair, tv_epipolar, tv_keypoint,
           tv_features, tv_feature_options, tv_correspondence, tv_match_options, tv_guided_options,
           tv_pixel_pairs, tv_estimate_options, tv_two_view, tv_evidence, tv_point, tv_view,
           tv_reconstruct_options, tv_reconstruction, tv_bundle_options, tv_bundle_result,
           tv_pixel_points, tv_absolute_pose_options, tv_absolute_pose, tv_window_view,
           tv_observation, tv_pose_prior, tv_gravity_prior, tv_distance_prior, tv_window,
           tv_window_options, tv_window_result, tv_odometry_options, tv_odometry_frame,
           tv_gyro_sample, tv_odometry_state, tv_keyframe, tv_path_frame, tv_path_pose,
           tv_map_point, tv_map_observation, tv_dense_options, tv_dense_point, tv_depth_options,
           tv_depth_view, tv_depth_arrays, tv_room_options, tv_depth_map, tv_room_state,
           tv_room_vertex, tv_room_triangle, tv_room_mesh_options, tv_room_plane,
           tv_room_plane_options, tv_room_infer_options]

KEYPOINT = np.dtype(tv_keypoint)
CORRESPONDENCE = np.dtype(tv_correspondence)
POINT = np.dtype(tv_point)
DENSE_POINT = np.dtype(tv_dense_point)
ROOM_VERTEX = np.dtype(tv_room_vertex)
ROOM_PLANE = np.dtype(tv_room_plane)
WINDOW_VIEW = np.dtype(tv_window_view)
OBSERVATION = np.dtype(tv_observation)
POSE_PRIOR = np.dtype(tv_pose_prior)
GRAVITY_PRIOR = np.dtype(tv_gravity_prior)
DISTANCE_PRIOR = np.dtype(tv_distance_prior)
MAP_POINT = np.dtype(tv_map_point)
MAP_OBSERVATION = np.dtype(tv_map_observation)


class StatusError(RuntimeError):
    """A C status other than TV_OK. `status` is the Status, and `function` is the name of the C
    function. Each status has a subclass with its C name, for example `except
    twoview.TV_ERR_LIMITS`."""

    status: Status = Status.OK
    function: str = ""


class TV_ERR_NULL(StatusError):
    status = Status.ERR_NULL


class TV_ERR_ARGUMENT(StatusError, ValueError):
    status = Status.ERR_ARGUMENT


class TV_ERR_NOT_FINITE(StatusError, ValueError):
    status = Status.ERR_NOT_FINITE


class TV_ERR_STRUCT_SIZE(StatusError):
    status = Status.ERR_STRUCT_SIZE


class TV_ERR_ALIGNMENT(StatusError):
    status = Status.ERR_ALIGNMENT


class TV_ERR_MEMORY(StatusError, MemoryError):
    status = Status.ERR_MEMORY


class TV_ERR_LIMITS(StatusError, ValueError):
    status = Status.ERR_LIMITS


class TV_ERR_CAPACITY(StatusError):
    status = Status.ERR_CAPACITY


class TV_ERR_OVERLAP(StatusError, ValueError):
    status = Status.ERR_OVERLAP


class TV_ERR_CAMERA(StatusError, ValueError):
    status = Status.ERR_CAMERA


class TV_ERR_OUTSIDE(StatusError, ValueError):
    status = Status.ERR_OUTSIDE


class TV_ERR_KERNELS(StatusError):
    status = Status.ERR_KERNELS


class TV_ERR_MAP(StatusError, ValueError):
    status = Status.ERR_MAP


class TV_ERR_TIME(StatusError, ValueError):
    status = Status.ERR_TIME


class TV_ERR_STRIDE(StatusError, ValueError):
    status = Status.ERR_STRIDE


class TV_ERR_MASK(StatusError, ValueError):
    status = Status.ERR_MASK


class TV_ERR_EFFORT(StatusError, ValueError):
    status = Status.ERR_EFFORT


ERRORS = {int(kind.status): kind for kind in StatusError.__subclasses__()}


class Library:
    """A loaded libtwoview.so. Programs do not need this class, since by default the functions use
    the library inside the package."""

    def __init__(self, path: Union[str, os.PathLike[str]]):
        # As dlopen does, a name without a folder is looked for in the system's folders.
        self.path = os.path.abspath(path) if os.path.dirname(path) else os.fspath(path)
        self.lib = ctypes.CDLL(self.path)
        for name in ("tv_version_string", "tv_status_string"):
            getattr(self.lib, name).restype = c_char_p
        self.lib.tv_context_high_water.restype = c_size_t
        for struct in STRUCTS:
            if struct._fields_[0][0] == "struct_size":
                init = getattr(self.lib, struct.__name__ + "_init_sized", None)
                if init is not None:  # a library without a part lacks its structs
                    init.restype, init.argtypes = None, [c_void_p, c_size_t]

    def function(self, name: str) -> Any:
        """The C function of that name; NotImplementedError where the library was built without."""
        try:
            return getattr(self.lib, name)
        except AttributeError:
            part = ("TWOVIEW_DENSE" if "dens" in name or "depth" in name else
                    "TWOVIEW_ROOM" if "room" in name else "TWOVIEW_ODOMETRY")
            raise NotImplementedError(f"{self.path} has no {name}: it was built with {part}=OFF, "
                                      "or is of an older release") from None

    def make(self, struct: Any, fields: Optional[dict[str, Any]] = None) -> Any:
        """Returns a struct with the defaults of its tv_..._init_sized; `fields` then replaces some
        of them. The library may be of another release whose structs are shorter or longer."""
        made = struct()
        init = self.function(struct.__name__ + "_init_sized")
        init(ctypes.byref(made), ctypes.sizeof(struct))
        for name, value in (fields or {}).items():
            set_field(made, name, value)
        return made

    def call(self, function: str, *arguments: Any) -> None:
        status = self.function(function)(*arguments)
        if status != 0:
            kind = ERRORS.get(status, StatusError)
            text = self.lib.tv_status_string(status).decode()
            error = kind(f"{function}: {kind.__name__}: {text}")
            error.function = function
            raise error

    def version(self) -> str:
        return str(self.lib.tv_version_string().decode())


def set_field(struct: Any, name: str, value: Any) -> None:
    """Sets a field to a number, to three numbers, or, a struct, to a named tuple. The exception
    names a wrong field or type."""
    kinds = dict(struct._fields_)
    if name not in kinds or name == "struct_size":
        known = ", ".join(k for k in kinds if k != "struct_size")
        raise TypeError(f"{type(struct).__name__} has no option {name!r}; it has {known}")
    kind, given = kinds[name], value
    try:
        if issubclass(kind, Structure):
            parts, value = value._asdict(), kind()
            for part, number in parts.items():
                set_field(value, part, number)
        elif issubclass(kind, ctypes.Array):
            value = kind(*small_array(name, value, kind._length_))
        elif kind in (c_float, c_double):
            value = float(value + 0.0)  # adding 0.0 raises TypeError for a string
        else:
            value = operator.index(value)
    except (AttributeError, TypeError):
        raise TypeError(f"option {name}: {given!r} is not what it takes") from None
    if kind in (c_int32, c_uint32, c_uint64) and kind(value).value != value:
        raise ValueError(f"option {name}: {value} is out of range")
    setattr(struct, name, value)


_default: Optional[Library] = None


def default_library() -> Library:
    """Returns the Library that TWOVIEW_LIBRARY names, else the one inside the package, else the
    system's. Raises ImportError where there is none."""
    global _default
    if _default is None:
        beside = os.path.join(os.path.dirname(os.path.abspath(__file__)), "libtwoview.so")
        path = os.environ.get("TWOVIEW_LIBRARY") or beside
        if os.path.isfile(path):
            _default = Library(path)
        else:
            try:
                if path != beside:
                    raise OSError(path)
                _default = Library(SONAME)
            except OSError:
                raise ImportError(
                    f"no library at {path}: install the package (pip install ./python, or Debian's "
                    "python3-twoview), or name a libtwoview.so by TWOVIEW_LIBRARY") from None
    return _default


def pointer(array: Optional[np.ndarray]) -> Optional[c_void_p]:
    return None if array is None else c_void_p(array.ctypes.data)


def camera_pair(camera0: tv_camera, camera1: tv_camera, R: np.ndarray,
                t: np.ndarray) -> tv_camera_pair:
    """The struct of two cameras and cam1_from_cam0."""
    pair = tv_camera_pair(camera0, camera1)
    pair.cam1_from_cam0_R[:] = R.ravel().tolist()
    pair.cam1_from_cam0_t[:] = t.tolist()
    return pair


def _numbers(name: str, values: Any, dtype: np.dtype) -> np.ndarray:
    """An array of any real numbers, or a list of them, as an array of this dtype. Raises TypeError
    for what is none, and for numbers that the dtype would cut off."""
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        array = np.asarray(values, object)
    if array.size == 0 and array.dtype == np.float64:
        return array.astype(dtype)
    if array.dtype.kind not in "fiu":
        given = array.dtype if isinstance(values, np.ndarray) else type(values).__name__
        raise TypeError(f"{name}: dtype {dtype} is expected, or numbers that become it, not "
                        f"{given}")
    # What overflows, or is no whole number of a byte, shows in the comparison.
    with np.errstate(invalid="ignore", over="ignore"):
        converted = array.astype(dtype)
        is_same = (np.array_equal(converted, array) if dtype.kind in "iu" else
                   np.array_equal(np.isfinite(converted), np.isfinite(array)))
    if not is_same:
        raise TypeError(f"{name}: dtype {dtype} is expected, and these numbers of {array.dtype} do "
                        "not fit into it")
    return converted


def check_array(name: str, array: Any, dtype: Any, *columns: int) -> np.ndarray:
    """Returns the caller's array as C reads it: without a copy where it has this dtype and is
    contiguous, else converted. Raises TypeError or ValueError if that cannot be. The caller keeps
    the result for as long as C reads it."""
    dtype = np.dtype(dtype)
    if not isinstance(array, np.ndarray) and dtype.names:
        raise TypeError(f"{name}: a numpy array is expected, not {type(array).__name__}")
    if not isinstance(array, np.ndarray) or (array.dtype != dtype and not dtype.names):
        array = _numbers(name, array, dtype)
        if array.shape == (0,):  # an empty list
            array = array.reshape(0, *columns)
    if array.dtype != dtype:
        raise TypeError(f"{name}: dtype {dtype} is expected, not {array.dtype}")
    if array.ndim != 1 + len(columns) or array.shape[1:] != columns:
        shape = "(n" + "".join(f", {c}" for c in columns) + ("," if not columns else "") + ")"
        raise ValueError(f"{name}: shape {shape} is expected, not {array.shape}")
    if len(array) > 2**31 - 1:
        raise ValueError(f"{name}: too long")
    return np.require(array, requirements=("C", "A"))


def small_array(name: str, values: Any, *shape: int) -> np.ndarray:
    """A contiguous float64 copy of a few numbers, which may be given in any form."""
    array = np.ascontiguousarray(values, np.float64)
    if array.shape != shape:
        raise ValueError(f"{name}: shape {shape} is expected, not {array.shape}")
    return array


def check_image(name: str, pixels: Any) -> tv_image:
    """A view of the caller's pixels without a copy; the rows need not be adjacent."""
    if not isinstance(pixels, np.ndarray):
        raise TypeError(f"{name}: a numpy array is expected, not {type(pixels).__name__}")
    if pixels.dtype != np.uint8:
        raise TypeError(f"{name}: dtype uint8 is expected, not {pixels.dtype}")
    if pixels.ndim != 2 or 0 in pixels.shape or max(pixels.shape) > 2**31 - 1:
        raise ValueError(f"{name}: shape (height, width) is expected, not {pixels.shape}")
    if pixels.strides[1] != 1 and pixels.shape[1] > 1:
        raise ValueError(f"{name}: the pixels of a row must lie side by side (a grey image, not a "
                         "channel of a colour one; numpy.ascontiguousarray makes a copy)")
    if pixels.strides[0] < pixels.shape[1] and pixels.shape[0] > 1:
        raise ValueError(f"{name}: rows that overlap or run upwards")
    return tv_image(pixels.ctypes.data, pixels.shape[1], pixels.shape[0],
                    max(pixels.strides[0], pixels.shape[1]))


def mask_bytes(mask: Any) -> Any:
    """A bool mask as uint8, without a copy; others as they are."""
    is_bool = isinstance(mask, np.ndarray) and mask.dtype == np.bool_
    return mask.view(np.uint8) if is_bool else mask


def check_mask(name: str, mask: Any, image: np.ndarray) -> tv_image:
    """A view of a mask of the image's shape, uint8 or bool, without a copy."""
    mask = mask_bytes(mask)
    view = check_image(name, mask)
    if mask.shape != image.shape:
        raise ValueError(f"{name}: the image's shape {image.shape} is expected, not {mask.shape}")
    return view
