"""Trajectories and the files that hold them.

| form | a line | pose |
| --- | --- | --- |
| TUM | `time tx ty tz qx qy qz qw`, seconds | world from camera |
| EuRoC | `time,px,py,pz,qw,qx,qy,qz[,...]`, nanoseconds | world from body; needs T_BS |
| KITTI | 12 numbers, a row-major 3 x 4; the times are in another file | world from camera |

A comment above TUM's poses that names each column, such as `# timestamp tx ty tz qw qx qy qz`, says
their order, as in the program (tools/twoview/odometry/poses.cc).

In trajectories of `twoview odometry` a comment `# segment N` begins a segment; poses of different
segments do not compare. Lines that begin with # are otherwise skipped.
"""

import re
from dataclasses import dataclass, field

import numpy as np

from ..rotations import made_rotation


class PoseError(ValueError):
    """A file that is refused. The message is one line that names the file and the line."""


def rotations_of(quaternions):
    """Rotation matrices (n x 3 x 3) of quaternions x y z w (n x 4) of any length above 0."""
    q = np.asarray(quaternions, float).reshape(-1, 4)
    x, y, z, w = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    return np.stack([
        np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
        np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
        np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1)], -2)


def quaternions_of(R):
    """Unit quaternions x y z w (n x 4), w >= 0, of rotation matrices (n x 3 x 3)."""
    R = np.asarray(R, float).reshape(-1, 3, 3)
    d = np.diagonal(R, axis1=1, axis2=2)
    trace = d.sum(1)
    # The squares of 2 w, 2 x, 2 y, 2 z; the largest component is computed by a root, the others by
    # division (S. W. Shepperd, "Quaternion from rotation matrix", 1978).
    squares = np.column_stack([1 + trace, 1 + 2 * d - trace[:, None]])
    cross = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], 1)
    out = np.empty((len(R), 4))
    for i, best in enumerate(squares.argmax(1)):
        big = np.sqrt(squares[i, best])
        q = np.empty(4)  # w x y z
        q[best] = big / 2
        if best == 0:
            q[1:] = cross[i] / (2 * big)
        else:
            k = best - 1
            q[0] = cross[i, k] / (2 * big)
            for j in range(3):
                if j != k:
                    q[1 + j] = (R[i, j, k] + R[i, k, j]) / (2 * big)
        q = q / np.linalg.norm(q) * (-1 if q[0] < 0 else 1)
        out[i] = q[1], q[2], q[3], q[0]
    return out


@dataclass
class Trajectory:
    """Poses world_from_cam in the order of their times."""

    times: np.ndarray  # n, seconds
    positions: np.ndarray  # n x 3
    rotations: np.ndarray  # n x 3 x 3
    segments: np.ndarray = field(default=None)  # n, whole numbers

    def __post_init__(self):
        self.times = np.asarray(self.times, float).reshape(-1)
        self.positions = np.asarray(self.positions, float).reshape(-1, 3)
        self.rotations = np.asarray(self.rotations, float).reshape(-1, 3, 3)
        if self.segments is None:
            self.segments = np.zeros(len(self.times), int)
        self.segments = np.asarray(self.segments, int).reshape(-1)

    def __len__(self):
        return len(self.times)

    def __getitem__(self, index):
        return Trajectory(self.times[index], self.positions[index], self.rotations[index],
                          self.segments[index])

    def path_length(self):
        return float(np.linalg.norm(np.diff(self.positions, axis=0), axis=1).sum())

    def moved(self, similarity):
        """These poses through y = scale R x + t."""
        scale, R, t = similarity
        return Trajectory(self.times, scale * self.positions @ R.T + t, R @ self.rotations,
                          self.segments)


def trajectory(times, positions, quaternions, segments=None):
    """A Trajectory from quaternions x y z w."""
    return Trajectory(times, positions, rotations_of(quaternions), segments)


def _numbers(text, separator, path, number):
    try:
        values = [float(value) for value in text.split(separator)]
    except ValueError:
        raise PoseError(f"{path}: line {number}: not a list of numbers") from None
    if not np.isfinite(values).all():
        raise PoseError(f"{path}: line {number}: a number is not finite")
    return values


def _lines(path):
    """(number, text) of each line of a file that is not blank."""
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            if line.strip():
                yield number, line.strip()


def _sorted(rows, path):
    if not len(rows):
        return
    times = np.array([row[0] for row in rows])
    if (np.diff(times) <= 0).any():
        raise PoseError(f"{path}: the times do not increase")


_NAMES = ("timestamp|time|t|stamp|secs?|seconds", "tx|x|px|p_x|pos_x|position_x",
          "ty|y|py|p_y|pos_y|position_y", "tz|z|pz|p_z|pos_z|position_z",
          *(f"q{axis}|q_{axis}|quat_{axis}|rot_{axis}|orientation_{axis}" for axis in "xyzw"))


def _columns_of_comment(comment):
    """The columns of time, position and quaternion x y z w by a comment that names all of them;
    None for another comment."""
    plain = re.sub(r"[\[(][^\])]*[\])]|[#\"',;]", " ", comment.lower())
    words = [re.sub(r"_(s|ms|us|ns)$", "", word) for word in plain.split()][:8]
    found = [next((k for k, word in enumerate(words) if re.fullmatch(names, word)), None)
             for names in _NAMES]
    return None if None in found else found


def read_tum(path):
    """The poses of a TUM file, with the segments of `twoview odometry`. An empty file has none."""
    rows, segments, segment, columns = [], [], 0, list(range(8))
    for number, line in _lines(path):
        if line.startswith("#"):
            named = re.match(r"#\s*segment\s+(\d+)", line)
            segment = int(named.group(1)) if named else segment
            columns = columns if rows else _columns_of_comment(line) or list(range(8))
            continue
        values = _numbers(line.replace(",", " "), None, path, number)
        if len(values) != 8 or not any(values[4:]):
            raise PoseError(f"{path}: line {number}: not time tx ty tz qx qy qz qw")
        rows.append([values[column] for column in columns])
        segments.append(segment)
    _sorted(rows, path)
    rows = np.array(rows).reshape(-1, 8)
    return trajectory(rows[:, 0], rows[:, 1:4], rows[:, 4:8], segments)


def write_tum(path, poses, header="# timestamp tx ty tz qx qy qz qw, world_from_cam"):
    """Writes a trajectory that read_tum reads."""
    text = header + "\n"
    segment = 0
    for time, position, q, own in zip(poses.times, poses.positions,
                                      quaternions_of(poses.rotations), poses.segments):
        if own != segment:
            text += f"# segment {own}\n"
        segment = own
        text += f"{time:.9f} " + " ".join(f"{value:.12g}" for value in (*position, *q)) + "\n"
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def read_euroc(path, body_from_cam=None):
    """The poses of an EuRoC file (state_groundtruth_estimate0/data.csv). body_from_cam (4 x 4) is
    T_BS of the camera's sensor.yaml; without it the poses stay those of the body."""
    rows = []
    for number, line in _lines(path):
        if line.startswith("#"):
            continue
        values = _numbers(line, ",", path, number)
        if len(values) < 8 or not any(values[4:8]):
            raise PoseError(f"{path}: line {number}: not time,px,py,pz,qw,qx,qy,qz")
        rows.append([values[0] * 1e-9, *values[1:4], *values[5:8], values[4]])
    _sorted(rows, path)
    rows = np.array(rows).reshape(-1, 8)
    poses = trajectory(rows[:, 0], rows[:, 1:4], rows[:, 4:8])
    if body_from_cam is not None:
        mount = np.asarray(body_from_cam)
        poses.positions = poses.positions + poses.rotations @ mount[:3, 3]
        poses.rotations = poses.rotations @ made_rotation(mount[:3, :3], "T_BS")
    return poses


def read_kitti(path, times):
    """The poses of a KITTI file; `times` (seconds) has one for each line."""
    rows = []
    for number, line in _lines(path):
        values = _numbers(line, None, path, number)
        if len(values) != 12:
            raise PoseError(f"{path}: line {number}: not 12 numbers")
        matrix = np.array(values).reshape(3, 4)
        try:
            matrix[:, :3] = made_rotation(matrix[:, :3], f"{path}: line {number}")
        except ValueError as error:
            raise PoseError(str(error)) from None
        rows.append(matrix)
    if len(rows) != len(times):
        raise PoseError(f"{path}: {len(rows)} poses, and {len(times)} times")
    matrices = np.array(rows).reshape(-1, 3, 4)
    return Trajectory(times, matrices[:, :, 3], matrices[:, :, :3])


def read_poses(path, times=None, body_from_cam=None):
    """Reads a file of any of the three forms: commas mean EuRoC, 12 numbers a line mean KITTI."""
    first = next((line for _, line in _lines(path) if not line.startswith("#")), "")
    if "," in first and len(first.split(",")) >= 8 and len(first.split(",")[0]) > 15:
        return read_euroc(path, body_from_cam)
    if len(first.split()) == 12:
        if times is None:
            raise PoseError(f"{path}: KITTI's poses need the times of the frames")
        return read_kitti(path, times)
    return read_tum(path)
