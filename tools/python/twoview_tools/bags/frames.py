"""The frames of tf_static: how one is turned and placed in another."""

import numpy as np

from ..odometry.poses import rotations_of


def plain(name):
    """A frame's name without the slash that tf 1 put before it."""
    return name.lstrip("/")


def is_rotation(quaternions):
    """Of each row x y z w, whether it is finite and has a length."""
    return np.isfinite(quaternions).all(1) & ((quaternions * quaternions).sum(1) > 1e-6)


class StaticFrames:
    """Poses between frames that do not move against each other."""

    def __init__(self):
        self._known = {}  # {frame: {neighbour: (R, t), frame from neighbour}}

    def add(self, transform):
        """A geometry_msgs/TransformStamped: parent from child."""
        parent, child = plain(transform.header.frame_id), plain(transform.child_frame_id)
        q, t = transform.transform.rotation, transform.transform.translation
        q, t = np.array([[q.x, q.y, q.z, q.w]]), np.array((t.x, t.y, t.z))
        if not is_rotation(q)[0] or not np.isfinite(t).all() or parent == child:
            return
        R = rotations_of(q)[0]
        self._known.setdefault(parent, {})[child] = R, t
        self._known.setdefault(child, {})[parent] = R.T, -R.T @ t

    def between(self, frame, other):
        """(R, t) with x_frame = R x_other + t; None where nothing says it."""
        frame, other = plain(frame), plain(other)
        if not frame or not other:
            return None
        reached, ways = {frame: (np.eye(3), np.zeros(3))}, [frame]
        while ways:
            here = ways.pop(0)
            R, t = reached[here]
            for neighbour, (Rn, tn) in self._known.get(here, {}).items():
                if neighbour not in reached:
                    reached[neighbour] = R @ Rn, R @ tn + t
                    ways.append(neighbour)
        return reached.get(other)
