"""Visual odometry: the frames of one camera to its path and a map of points (odometry.h)."""

from __future__ import annotations

import threading
from ctypes import byref, c_double, c_int32, c_size_t, c_void_p
from dataclasses import dataclass, replace
from typing import Any, Optional

import numpy as np

from . import _abi
from .camera import Camera, camera_struct
from .enums import MapReason, OdometryStatus, Reason, ScaleSource
from .options import OdometryOptions, to_struct


def integrate_gyro(times_s: Any, rates_rad_s: Any, sigma_rad_s: float, begin_s: float,
                   end_s: float) -> tuple[np.ndarray, float]:
    """tv_integrate_gyro: a gyro's rates to the turn of the camera from begin_s to end_s. Returns
    (previous_from_cam, turn_sigma_rad), which Odometry.track takes. Raises ValueError for samples
    that do not reach from begin_s to end_s, or are of another shape.
    times_s: (n,), rising. rates_rad_s: (n, 3), about the camera's axes. sigma_rad_s: the standard
    deviation of the noise of each rate."""
    times = np.asarray(times_s, np.float64).reshape(-1)
    rates = _abi.small_array("rates_rad_s", rates_rad_s, len(times), 3)
    samples = np.ascontiguousarray(np.column_stack([times, rates]))
    R, sigma = (c_double * 9)(), c_double()
    _abi.default_library().call("tv_integrate_gyro", c_void_p(samples.ctypes.data),
                                c_int32(len(times)), c_double(sigma_rad_s), c_double(begin_s),
                                c_double(end_s), R, byref(sigma))
    return np.array(R).reshape(3, 3), sigma.value


@dataclass(frozen=True)
class OdometryState:
    """tv_odometry_state: what is known after a frame. A value that is not known is None."""

    status: OdometryStatus  #: what is known of the frame's pose
    reasons: Reason  #: why the frame is weak, or the map does not start
    segment: Optional[int]  #: poses of different segments do not compare; None without a pose
    is_keyframe: bool  #: the frame became a keyframe
    relocated: bool  #: the pose was found again after frames without one
    loop_closed: bool  #: a loop was closed: the keyframes moved
    attitude_ignored: bool  #: the frame's attitude contradicts the map's vertical
    num_frames: int  #: given so far, this one included
    num_keypoints: int  #: of the frame
    num_matches: int  #: keypoints that were matched with points of the map
    num_inliers: int  #: of them, those that fit the pose
    num_keyframes: int  #: of the map, over all segments
    num_points: int  #: of the map, over all segments
    num_segments: int  #: begun so far
    num_relocations: int  #: poses found again so far
    num_loops: int  #: closed so far
    reference_id: Optional[int]  #: id of the keyframe of reference_R and reference_t
    reference_R: Optional[np.ndarray]  #: (3, 3), reference_from_cam
    reference_t: Optional[np.ndarray]  #: (3,)
    R: Optional[np.ndarray]  #: (3, 3), world_from_cam
    t: Optional[np.ndarray]  #: (3,), the camera's position in the unit of the map
    covariance: Optional[np.ndarray]  #: (6, 6), of cam_from_world: w0 w1 w2 d0 d1 d2
    noise_px: float  #: of a pixel of sigma 1, one standard deviation
    scale_source: ScaleSource  #: where the unit of lengths comes from
    scale_sigma: Optional[float]  #: relative; None where the unit is not the metre
    principal_point_shift_px: np.ndarray  #: (2,), x and y; zeros: it was not moved
    scale_contradicted: bool  #: heights and velocities contradict each other: there is no metre
    height_scale: Optional[tuple[float, float]]  #: metres per unit, and sigma, by heights alone
    velocity_scale: Optional[tuple[float, float]]  #: the same by velocities alone
    still_share: float  #: of the picture: stands still while the scene moves, and is left out
    map_reasons: MapReason  #: what the odometry has against its own map


@dataclass(frozen=True)
class Keyframe:
    """tv_keyframe: a keyframe of the map."""

    id: int  #: counts all keyframes, those included that were removed
    segment: int  #: poses of different segments do not compare
    frame: int  #: how many frames were given before it
    time_s: float  #: of its frame, in seconds
    R: np.ndarray  #: (3, 3), world_from_cam
    t: np.ndarray  #: (3,)
    num_keypoints: int  #: of its frame
    num_observations: int  #: keypoints that see points of the map


def _matrix(values: Any, *shape: int) -> np.ndarray:
    return np.array(values, np.float64).reshape(shape)


class Odometry:
    """tv_odometry in memory that Python owns: the tracker and the map of one camera.

    Calls from several threads wait for each other. close() or a with statement frees the memory;
    later calls raise ValueError."""

    def __init__(self, camera: Camera, options: Optional[OdometryOptions] = None, *,
                 library: Optional[_abi.Library] = None, **keywords: Any):
        self.library = library or _abi.default_library()
        if not hasattr(self.library.lib, "tv_odometry_track"):
            raise NotImplementedError("this library was built without odometry")
        wanted = to_struct(self.library, OdometryOptions, options, keywords)
        struct, size = camera_struct("camera", camera), c_size_t()
        self.library.call("tv_odometry_size", byref(struct), byref(wanted), byref(size))
        self._memory: Optional[np.ndarray] = np.empty(size.value + _abi.CONTEXT_ALIGNMENT, np.uint8)
        start = -self._memory.ctypes.data % _abi.CONTEXT_ALIGNMENT
        self._pointer = c_void_p()
        self.library.call("tv_odometry_init", byref(self._pointer), byref(struct), byref(wanted),
                          c_void_p(self._memory.ctypes.data + start), size)
        self._given_camera, self.size_bytes = camera, size.value
        self.max_keypoints, self.max_points = int(wanted.max_keypoints), int(wanted.max_points)
        self._lock = threading.RLock()

    def __enter__(self) -> Odometry:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        with self._lock:
            self._memory = None
            self._pointer = c_void_p()

    def _call(self, function: str, *arguments: Any) -> None:
        with self._lock:
            if self._memory is None:
                raise ValueError(f"{function}: the odometry is closed")
            self.library.call(function, self._pointer, *arguments)

    def reset(self) -> None:
        """tv_odometry_reset: forgets the map and every frame."""
        self._call("tv_odometry_reset")

    def track(self, image: np.ndarray, time_s: float, *, gap: bool = False,
              world_from_cam: Optional[np.ndarray] = None, attitude_sigma_rad: float = 0.0,
              height_m: float = 0.0, height_sigma_m: float = 0.0,
              velocity_m_s: Any = (0.0, 0.0, 0.0),
              velocity_sigma_m_s: float = 0.0,
              mask: Optional[np.ndarray] = None,
              previous_from_cam: Optional[np.ndarray] = None,
              turn_sigma_rad: float = 0.0) -> OdometryState:
        """tv_odometry_track: tracks a frame, and extends and adjusts the map.

        image: (height, width) uint8, of the camera's size. time_s: later than that of the frame
        before; with gap any time. gap: frames are missing before this one, or the stream began
        anew. world_from_cam: (3, 3), the vehicle's
        attitude in a world whose z axis points down. Measurements with a sigma of 0 do not
        exist. mask: None, or uint8 or bool of the image's shape, 0 where the picture is left
        out. previous_from_cam: (3, 3), the turn since the frame before as a gyro measured it
        (integrate_gyro)."""
        frame = self.library.make(_abi.tv_odometry_frame, {
            "gap": int(gap), "time_s": time_s, "attitude_sigma_rad": attitude_sigma_rad,
            "height_m": height_m, "height_sigma_m": height_sigma_m, "velocity_m_s": velocity_m_s,
            "velocity_sigma_m_s": velocity_sigma_m_s, "turn_sigma_rad": turn_sigma_rad})
        frame.image = _abi.check_image("image", image)
        if mask is not None:
            frame.mask = _abi.check_mask("mask", mask, image)
        if world_from_cam is not None:
            R = _abi.small_array("world_from_cam", world_from_cam, 3, 3)
            frame.world_from_cam[:] = R.ravel().tolist()
        if previous_from_cam is not None:
            R = _abi.small_array("previous_from_cam", previous_from_cam, 3, 3)
            frame.previous_from_cam[:] = R.ravel().tolist()
        state = self.library.make(_abi.tv_odometry_state)
        self._call("tv_odometry_track", byref(frame), byref(state))
        return _state(state)

    @property
    def camera(self) -> Camera:
        """tv_odometry_camera: the camera as it is used now: the one that was given, with another
        principal point where it was moved."""
        struct = _abi.tv_camera()
        self._call("tv_odometry_camera", byref(struct))
        return replace(self._given_camera, cx=struct.cx, cy=struct.cy)

    def still_mask(self) -> np.ndarray:
        """tv_odometry_still_mask: (height, width) bool, False where the picture was found to stand
        still while the scene moves, and is left out."""
        mask = np.empty((self._given_camera.height, self._given_camera.width), np.uint8)
        self._call("tv_odometry_still_mask", _abi.pointer(mask), c_size_t(mask.size))
        return mask.astype(np.bool_)

    def finish(self) -> None:
        """tv_odometry_finish: does what tracking left for the frames to come. To be called after
        the last frame, before poses, keyframes, points or the map's bytes are read."""
        self._call("tv_odometry_finish")

    def locate(self, image: np.ndarray, near_id: int = -1,
               mask: Optional[np.ndarray] = None) -> OdometryState:
        """tv_odometry_locate: the pose of a frame in the map as it is. near_id: a keyframe
        whose surroundings are searched first. mask: as for track."""
        view = _abi.check_image("image", image)
        used = None if mask is None else byref(_abi.check_mask("mask", mask, image))
        state = self.library.make(_abi.tv_odometry_state)
        self._call("tv_odometry_locate", byref(view), used, c_int32(near_id), byref(state))
        return _state(state)

    def pose_of(self, state: OdometryState) -> tuple[np.ndarray, np.ndarray, int]:
        """tv_odometry_pose_of: R (3, 3), t (3,) and the segment of a frame in the last state of the
        map, from what track returned. Raises ValueError for a state without a pose."""
        if state.reference_id is None:
            raise ValueError("pose_of: the state has no pose")
        R0 = _abi.small_array("reference_R", state.reference_R, 3, 3)
        t0 = _abi.small_array("reference_t", state.reference_t, 3)
        R, t, segment = np.empty((3, 3)), np.empty(3), c_int32()
        self._call("tv_odometry_pose_of", c_int32(state.reference_id), _abi.pointer(R0),
                   _abi.pointer(t0), _abi.pointer(R), _abi.pointer(t), byref(segment))
        return R, t, segment.value

    def keyframe(self, idx: int) -> Keyframe:
        """tv_odometry_keyframe: the keyframe number idx of the map, [0, num_keyframes)."""
        k = self.library.make(_abi.tv_keyframe)
        self._call("tv_odometry_keyframe", c_int32(idx), byref(k))
        return Keyframe(k.id, k.segment, k.frame, k.time_s, _matrix(k.world_from_cam_R, 3, 3),
                        _matrix(k.world_from_cam_t, 3), k.num_keypoints, k.num_observations)

    def covariance(self, idx: int) -> Optional[np.ndarray]:
        """tv_odometry_covariance: (6, 6), of the pose of keyframe number idx relative to that of
        the one before; None where it is not known."""
        covariance, is_known = np.zeros((6, 6)), c_int32()
        self._call("tv_odometry_covariance", c_int32(idx), _abi.pointer(covariance),
                   byref(is_known))
        return covariance if is_known.value else None

    def points(self) -> np.ndarray:
        """tv_odometry_points: the points of the map, of dtype twoview.MAP_POINT."""
        return self._array("tv_odometry_points", _abi.MAP_POINT, self.max_points)

    def observations(self, idx: int) -> np.ndarray:
        """tv_odometry_observations: what the keyframe number idx sees, of dtype
        twoview.MAP_OBSERVATION; idx_point is an index into points()."""
        return self._array("tv_odometry_observations", _abi.MAP_OBSERVATION, self.max_keypoints,
                           c_int32(idx))

    def last_frame(self) -> np.ndarray:
        """tv_odometry_last_frame: the keypoints of the last frame, of dtype
        twoview.MAP_OBSERVATION; idx_point is -1 where one sees no point."""
        return self._array("tv_odometry_last_frame", _abi.MAP_OBSERVATION, self.max_keypoints)

    def _array(self, function: str, dtype: np.dtype, capacity: int, *first: Any) -> np.ndarray:
        array, count = np.zeros(capacity, dtype), c_int32()
        self._call(function, *first, _abi.pointer(array), c_int32(capacity), byref(count))
        return array[:count.value].copy()

    def save(self) -> bytes:
        """tv_odometry_save: the map as bytes, equal on every CPU."""
        size = c_size_t()
        with self._lock:
            self._call("tv_odometry_save_size", byref(size))
            array = np.empty(size.value, np.uint8)
            self._call("tv_odometry_save", _abi.pointer(array), size, byref(size))
        return array[:size.value].tobytes()

    def load(self, data: bytes) -> None:
        """tv_odometry_load: replaces the map by one that save returned, of the same camera."""
        array = np.frombuffer(data, np.uint8)
        self._call("tv_odometry_load", _abi.pointer(array), c_size_t(array.size))

    def add(self, data: bytes) -> int:
        """tv_odometry_add: adds a map that save returned, of the same camera, and looks for its
        segments in the map that was there. Returns how many were found."""
        array = np.frombuffer(data, np.uint8)
        joined = c_int32()
        self._call("tv_odometry_add", _abi.pointer(array), c_size_t(array.size), byref(joined))
        return joined.value


def _state(s: Any) -> OdometryState:
    posed = bool(s.has_pose)
    scale = ScaleSource(s.scale_source)
    return OdometryState(
        OdometryStatus(s.status), Reason(s.reasons), s.segment if posed else None,
        bool(s.is_keyframe), bool(s.relocated), bool(s.loop_closed),
        bool(s.attitude_ignored), s.num_frames, s.num_keypoints, s.num_matches, s.num_inliers,
        s.num_keyframes, s.num_points, s.num_segments, s.num_relocations, s.num_loops,
        s.reference_id if posed and s.reference_id >= 0 else None,
        _matrix(s.reference_from_cam_R, 3, 3) if posed else None,
        _matrix(s.reference_from_cam_t, 3) if posed else None,
        _matrix(s.world_from_cam_R, 3, 3) if posed else None,
        _matrix(s.world_from_cam_t, 3) if posed else None,
        _matrix(s.cam_from_world_covariance, 6, 6) if s.has_covariance else None, s.noise_px, scale,
        s.scale_sigma if scale != ScaleSource.UNIT else None,
        _matrix(s.principal_point_shift_px, 2), bool(s.scale_contradicted),
        (s.height_scale, s.height_scale_sigma) if s.height_scale_sigma > 0 else None,
        (s.velocity_scale, s.velocity_scale_sigma) if s.velocity_scale_sigma > 0 else None,
        s.still_share, MapReason(s.map_reasons))
