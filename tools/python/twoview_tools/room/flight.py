"""What a room is made from: the frames of a set folder with the poses that `twoview odometry` gave
them, and the depths of the map's points in its keyframes."""

from dataclasses import dataclass

import numpy as np
import twoview as tv

from .. import formats
from ..odometry import alignment, errors, poses, sets

# The range of depth that is searched: the points' 1st and 99th per cent, with room for what has no
# corner, near and far.
NEAR_SHARE, FAR_SHARE = 0.7, 1.6


@dataclass
class Flight:
    """Frames with poses world_from_cam, in the order of their times."""

    folder: str
    names: list  # of the pictures, relative to folder
    camera: tv.Camera
    R: np.ndarray  # (n, 3, 3)
    centres: np.ndarray  # (n, 3)
    keyframes: list  # indices of frames
    points: np.ndarray  # (m, 3), of the map, in the world

    def depth_range(self, index):
        """near, median and far depth of the map's points that the picture shows; None with fewer
        than twenty of them."""
        in_camera = (self.points - self.centres[index]) @ self.R[index]
        ahead = in_camera[in_camera[:, 2] > 0]
        pixels, inside = tv.camera_project_points(self.camera, np.ascontiguousarray(ahead))
        shown = ahead[(inside != 0) & (pixels >= 0).all(1) &
                      (pixels < [self.camera.width, self.camera.height]).all(1), 2]
        if len(shown) < 20:
            return None
        low, middle, high = np.percentile(shown, [1, 50, 99])
        return NEAR_SHARE * low, middle, FAR_SHARE * high


def read_flight(folder, out, true_poses=False):
    """folder: a set folder; out: what `twoview odometry` wrote of it. The longest segment serves.
    With true_poses the truth's poses take the place of the odometry's, and the map's points are
    moved into their frame."""
    found = sets.read_set(folder)
    entry = next(iter(formats.read_camera_set(found.file("cameras.yaml")).values()))
    model = tv.CameraModel[entry.model.upper()]
    camera = tv.Camera(entry.width, entry.height, entry.fx, entry.fy, entry.cx, entry.cy, model,
                       entry.k)
    trajectory = longest(poses.read_tum(f"{out}/trajectory.txt"))
    keyframes = longest(poses.read_tum(f"{out}/keyframes.txt"))
    points = read_points(f"{out}/colmap/points3D.txt")
    if true_poses:
        scale, R, t = world_from_map(trajectory, found.truth())
        points = scale * points @ R.T + t
        trajectory = found.truth()
    pairs = alignment.nearest_in_time(found.times, trajectory.times)
    times = np.asarray(found.times)[[i for i, _ in pairs]]
    posed = trajectory[[j for _, j in pairs]]
    chosen = {i for _, i in alignment.nearest_in_time(keyframes.times, times)}
    return Flight(folder, [found.names[i] for i, _ in pairs], camera, posed.rotations,
                  posed.positions, sorted(chosen), points)


def longest(trajectory):
    """The poses of the segment that has most of them."""
    return trajectory[trajectory.segments == errors.longest_segment(trajectory)]


def world_from_map(trajectory, truth):
    """(scale, R, t) from the frame of the odometry's map to that of the truth, by the path alone:
    aligning surfaces would hide what is wrong with them."""
    estimate, true = alignment.associate(trajectory, truth)
    return alignment.umeyama(estimate.positions, true.positions)


def read_points(path):
    """The positions in COLMAP's points3D.txt."""
    with open(path, encoding="utf-8") as file:
        return np.array([[float(v) for v in line.split()[1:4]] for line in file
                         if line.strip() and not line.startswith("#")])
