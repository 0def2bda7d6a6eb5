"""The path of a flight, in the last state of the map (path.h)."""

from __future__ import annotations

from ctypes import byref, c_int32
from dataclasses import dataclass
from typing import Optional

import numpy as np

from . import _abi
from .enums import OdometryStatus, PathOrigin
from .odometry import Odometry, OdometryState, _matrix


@dataclass(frozen=True)
class PathPose:
    """tv_path_pose: the pose of a frame in the last state of the map; None: it is not known."""

    origin: PathOrigin  #: how the pose is known
    segment: Optional[int]  #: poses of different segments do not compare
    R: Optional[np.ndarray]  #: (3, 3), world_from_cam
    t: Optional[np.ndarray]  #: (3,)


class Path:
    """The frames of a flight in their order: add() after each track(), then poses() whenever the
    path as the map has it now is wanted, and locate() for frames without a pose."""

    def __init__(self, odometry: Odometry):
        self._odometry = odometry
        self._frames: list[_abi.tv_path_frame] = []

    def __len__(self) -> int:
        return len(self._frames)

    def add(self, state: OdometryState, time_s: float) -> None:
        """What track() said of a frame, and the time that was given with it, in seconds. Raises
        ValueError where frames are not in their order."""
        if self._frames and state.num_frames - 1 <= self._frames[-1].frame:
            raise ValueError(f"add: frame {state.num_frames - 1} comes after "
                             f"{self._frames[-1].frame}")
        frame = _abi.tv_path_frame(float(time_s), state.num_frames - 1, PathOrigin.UNKNOWN, -1)
        if state.reference_id is not None:
            is_turned = state.status == OdometryStatus.ROTATION
            frame.origin = PathOrigin.TURNED if is_turned else PathOrigin.TRACKED
            frame.reference_id = state.reference_id
            R = _abi.small_array("reference_R", state.reference_R, 3, 3)
            t = _abi.small_array("reference_t", state.reference_t, 3)
            frame.reference_from_cam_R[:] = R.ravel().tolist()
            frame.reference_from_cam_t[:] = t.tolist()
        self._frames.append(frame)

    def poses(self) -> list[PathPose]:
        """tv_path_poses: the pose of each frame, that as well of a frame that became a keyframe
        only when a later one completed a start."""
        num = len(self._frames)
        poses = (_abi.tv_path_pose * num)()
        self._odometry._call("tv_path_poses", (_abi.tv_path_frame * num)(*self._frames),
                             c_int32(num), poses)
        return [_pose(pose) for pose in poses]

    def locate(self, idx: int, image: np.ndarray, mask: Optional[np.ndarray] = None) -> bool:
        """tv_path_locate: looks for frame number idx of this path in the finished map, by its
        picture, where the camera can have flown. True: poses() has it from now on."""
        view = _abi.check_image("image", image)
        used = None if mask is None else byref(_abi.check_mask("mask", mask, image))
        num, found = len(self._frames), c_int32()
        frames = (_abi.tv_path_frame * num)(*self._frames)
        self._odometry._call("tv_path_locate", frames, c_int32(num), c_int32(idx), byref(view),
                             used, byref(found))
        if found.value:
            self._frames[idx] = frames[idx]
        return bool(found.value)


def _pose(pose: _abi.tv_path_pose) -> PathPose:
    if pose.segment < 0:
        return PathPose(PathOrigin(pose.origin), None, None, None)
    return PathPose(PathOrigin(pose.origin), pose.segment, _matrix(pose.world_from_cam_R, 3, 3),
                    _matrix(pose.world_from_cam_t, 3))
