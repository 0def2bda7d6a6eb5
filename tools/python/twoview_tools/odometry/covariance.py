"""Whether the covariances of relative poses hold the truth.

A covariance is that of cam1_from_cam0 in the parameters of tv_adjust_window: (w, v) with x_true =
exp([w]x) x + v for a point x in the frame of camera 1, radians and units of the map, so that R_true
= exp([w]x) R and t_true = exp([w]x) t + v."""

import numpy as np

LIMIT_95 = {1: 3.841459, 2: 5.991465, 3: 7.814728, 4: 9.487729, 5: 11.070498, 6: 12.591587}


def logarithm(R):
    """The rotation vector of a rotation matrix, radians."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine, cosine = np.linalg.norm(axis) / 2, (np.trace(R) - 1) / 2
    angle = np.arctan2(sine, cosine)
    if sine > 1e-7:
        return axis * angle / (2 * sine)
    if cosine > 0:
        return axis / 2
    # Half a turn: the axis is the largest column of R + I.
    columns = R + np.eye(3)
    best = columns[:, np.linalg.norm(columns, axis=0).argmax()]
    return angle * best / np.linalg.norm(best)


def relative(R0, p0, R1, p1):
    """(R, t) of cam1_from_cam0 from the poses world_from_cam of two cameras."""
    return R1.T @ R0, R1.T @ (p0 - p1)


def distance_sq(covariance, estimate, truth):
    """(the squared Mahalanobis distance of the true relative pose, its degrees of freedom).
    estimate, truth: (R, t) of cam1_from_cam0 in the same unit. Directions of zero variance, such as
    a scale that nothing determines, are left out and take a degree of freedom each."""
    (R, t), (R_true, t_true) = estimate, truth
    dR = R_true @ R.T
    error = np.concatenate([logarithm(dR), t_true - dR @ t])
    # Radians and metres differ in size: each parameter is divided by its own sigma first.
    sigmas = np.sqrt(np.clip(np.diag(covariance), 0, None))
    used = sigmas > 0
    scaled = covariance[np.ix_(used, used)] / np.outer(sigmas[used], sigmas[used])
    values, vectors = np.linalg.eigh(scaled)
    kept = values > 1e-10 * max(values.max(initial=0), 1e-300)
    along = vectors.T[kept] @ (error[used] / sigmas[used])
    return float((along ** 2 / values[kept]).sum()), int(kept.sum())


def coverage(items):
    """The share of items (covariance, estimate, truth) whose truth lies in the 95 per cent
    ellipsoid, and how many there are; (None, 0) without any."""
    inside, count = 0, 0
    for item in items:
        squared, freedom = distance_sq(*item)
        if freedom:
            inside += squared <= LIMIT_95[freedom]
            count += 1
    return (inside / count if count else None), count


def read_covariances(path):
    """[(time0, time1, 6 x 6)] of a file with lines `time0 time1 c00 c01 ... c55`: consecutive
    keyframes, the covariance row-major."""
    table = np.loadtxt(path, comments="#", ndmin=2)
    if table.size and table.shape[1] != 38:
        raise ValueError(f"{path}: {table.shape[1]} numbers a line, not 38")
    return [(row[0], row[1], row[2:].reshape(6, 6)) for row in table]


def of_keyframes(covariances, keyframes, truth, scale):
    """coverage() of consecutive keyframes. `scale` makes the map's unit the truth's; both
    trajectories are looked up by their times."""
    def at(poses, time):
        k = int(np.abs(poses.times - time).argmin())
        is_there = abs(poses.times[k] - time) < 0.01
        return (poses.rotations[k], poses.positions[k]) if is_there else None

    items = []
    for time0, time1, matrix in covariances:
        ours, theirs = ([at(poses, time) for time in (time0, time1)]
                        for poses in (keyframes, truth))
        if any(pose is None for pose in (*ours, *theirs)):
            continue
        unit = np.diag([1, 1, 1, scale, scale, scale])
        (R0, p0), (R1, p1) = ours
        items.append((unit @ matrix @ unit, relative(R0, scale * p0, R1, scale * p1),
                      relative(*theirs[0], *theirs[1])))
    return coverage(items)
