"""The least-squares similarity between two sets of points, and which poses belong together.

S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns", PAMI
13(4), 1991. The numbers are those of evo (evo.core.geometry, evo.core.sync), but for points on one
straight line: evo refuses them, because the rotation about the line is not determined. Here one of
the equally good rotations is taken; the errors of the positions are the same for all of them."""

import numpy as np

MAX_DIFFERENCE = 0.01  # seconds between two poses that belong together, evo's default


def umeyama(x, y, with_scale=True):
    """(scale, R, t) that minimise the sum of |y - scale R x - t|^2 for points x, y (n x 3). Without
    with_scale, scale is 1. Equal points x give scale 1 and R the identity."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    if x.shape != y.shape or x.ndim != 2 or x.shape[1] != 3 or not len(x):
        raise ValueError("umeyama needs two n x 3 arrays of the same n above 0")
    mean_x, mean_y = x.mean(0), y.mean(0)
    variance = ((x - mean_x) ** 2).sum() / len(x)
    if variance == 0:
        return 1.0, np.eye(3), mean_y - mean_x
    covariance = (y - mean_y).T @ (x - mean_x) / len(x)
    U, D, Vt = np.linalg.svd(covariance)
    signs = np.array([1, 1, -1.0 if np.linalg.det(U) * np.linalg.det(Vt) < 0 else 1])
    R = U * signs @ Vt
    scale = float((D * signs).sum() / variance) if with_scale else 1.0
    return scale, R, mean_y - scale * R @ mean_x


def mean_rotation(rotations):
    """The rotation nearest to the sum of rotations (n x 3 x 3): the chordal mean (R. Hartley et
    al., "Rotation averaging", IJCV 103, 2013)."""
    U, _, Vt = np.linalg.svd(np.asarray(rotations).sum(0))
    return U * np.array([1, 1, np.sign(np.linalg.det(U) * np.linalg.det(Vt))]) @ Vt


def angles_deg(rotations):
    """The angle in degrees of each rotation matrix (n x 3 x 3), exact for small angles too."""
    R = np.asarray(rotations, float).reshape(-1, 3, 3)
    axis = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], 1)
    return np.degrees(np.arctan2(np.linalg.norm(axis, axis=1),
                                 np.trace(R, axis1=1, axis2=2) - 1))


def nearest_in_time(times, others, max_difference=MAX_DIFFERENCE):
    """Index pairs (i, j): for each of `times` the nearest of the increasing `others`, where they
    are at most max_difference apart; the earlier one on a tie."""
    pairs = []
    others = np.asarray(others, float)
    for i, time in enumerate(times):
        after = int(np.searchsorted(others, time, side="right"))
        near = [j for j in (after - 1, after) if 0 <= j < len(others)]
        if near:
            j = min(near, key=lambda k: abs(others[k] - time))
            if abs(others[j] - time) <= max_difference:
                pairs.append((i, j))
    return pairs


def associate(estimate, truth, max_difference=MAX_DIFFERENCE):
    """The poses of two trajectories that belong together, as two trajectories of equal length. Each
    pose of the shorter one is joined with the nearest of the other, as evo does."""
    if len(truth) > len(estimate):
        pairs = nearest_in_time(estimate.times, truth.times, max_difference)
    else:
        pairs = [(i, j) for j, i in nearest_in_time(truth.times, estimate.times, max_difference)]
    index = np.array(pairs, int).reshape(-1, 2)
    return estimate[index[:, 0]], truth[index[:, 1]]
