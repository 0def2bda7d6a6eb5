"""Reads and writes TUM trajectories: lines `time tx ty tz qx qy qz qw`, world from camera."""

import os

import numpy as np

from .conventions import quaternion, rotation
from .errors import BadInput

HEADER = "# time tx ty tz qx qy qz qw, world from camera (x right, y down, z forward)\n"


def times_of(names):
    """The times of the images: if each file name is a number (without its extension) and no two are
    equal, these numbers, else 0, 1, ..."""
    try:
        times = [float(os.path.splitext(os.path.basename(name))[0]) for name in names]
    except ValueError:
        times = []
    return (
        times if times and len(set(times)) == len(times) else [float(i) for i in range(len(names))]
    )


def write_trajectory(poses):
    """The text of the trajectory {name: (R, centre)}; R is camera from world."""
    text = HEADER
    for time, (R, centre) in zip(times_of(list(poses)), poses.values()):
        w, x, y, z = quaternion(np.asarray(R).T)
        text += f"{time:.9f} " + " ".join(f"{value:.17g}" for value in (*centre, x, y, z, w)) + "\n"
    return text


def read_trajectory(path):
    """Reads a trajectory as [(time, R, centre)]: x_camera = R (x_world - centre)."""
    poses = []
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            if line.strip() and not line.startswith("#"):
                try:
                    time, *values = map(float, line.split())
                    tx, ty, tz, x, y, z, w = values
                except ValueError:
                    raise BadInput(f"{path}: line {number}: not 8 numbers") from None
                poses.append((time, rotation([w, x, y, z]).T, np.array([tx, ty, tz])))
    return poses
