"""Errors of a pose, the area under the recall curve, and the paired bootstrap.

The formulas are SuperGlue's (P.-E. Sarlin et al., CVPR 2020, evaluation code's definitions); a pair
that fails has an infinite error.
"""

import numpy as np

THRESHOLDS_DEG = (5.0, 10.0, 20.0)
EPIPOLAR_LIMIT = 5e-4  # of a correct match: largest squared symmetric distance, normalised


def rotation_error_deg(R_est, R_true):
    """The angle of R_est R_true^T, computed from the chord: precise also near 0, where the cosine
    loses its digits."""
    chord = np.linalg.norm(np.asarray(R_est) - np.asarray(R_true))  # 2 sqrt(2) sin(angle / 2)
    return float(np.degrees(2.0 * np.arcsin(np.clip(chord / np.sqrt(8.0), 0.0, 1.0))))


def direction_error_deg(t_est, t_true):
    """The angle between two directions in degrees, [0, 180]."""
    t_est, t_true = np.asarray(t_est, float), np.asarray(t_true, float)
    sine = np.linalg.norm(np.cross(t_est, t_true))
    return float(np.degrees(np.arctan2(sine, float(np.dot(t_est, t_true)))))


def pose_error(R_est, t_est, R_true, t_true):
    """{rotation_error_deg, translation_error_deg (sign ignored), .._signed_deg, pose_error_deg};
    all infinite without an estimate."""
    if R_est is None or t_est is None:
        rotation = signed = free = np.inf
    else:
        rotation = rotation_error_deg(R_est, R_true)
        signed = direction_error_deg(t_est, t_true)
        free = min(signed, 180.0 - signed)
    return {"rotation_error_deg": rotation, "translation_error_deg": free,
            "translation_error_signed_deg": signed, "pose_error_deg": max(rotation, free)}


def auc_rows(errors, threshold):
    """For each row, the area below recall as a function of the error, from 0 to `threshold`,
    divided by `threshold`, in per cent.

    Recall is linear between (0, 0) and the points (e_i, i/n), and constant after the last error
    below the threshold: SuperGlue's trapezoids.
    """
    errors = np.sort(np.atleast_2d(np.asarray(errors, float)), axis=1)
    rows, num = errors.shape
    if num == 0:
        return np.full(rows, np.nan)
    inside = errors < threshold
    e = np.where(inside, errors, 0.0)
    before = np.concatenate([np.zeros((rows, 1)), e[:, :-1]], axis=1)
    middle = (np.arange(num) + 0.5) / num  # mean recall between two neighbouring errors
    area = np.sum(np.where(inside, (e - before) * middle, 0.0), axis=1)
    count = inside.sum(axis=1)
    last = e.max(axis=1)
    return 100.0 * (area + (threshold - last) * count / num) / threshold


def auc(errors, threshold):
    """The area under the recall curve (auc_rows) of one list of errors, in per cent."""
    return float(auc_rows(errors, threshold)[0])


def auc_of_runs(runs, threshold):
    """The mean AUC over the seeds; `runs` is an array of seeds x pairs."""
    return float(np.mean(auc_rows(runs, threshold)))


def precision(points0, points1, R, t):
    """The share of matches (normalised, undistorted, n x 2) whose squared symmetric epipolar
    distance under the true pose is below EPIPOLAR_LIMIT; 0 without matches."""
    if len(points0) == 0:
        return 0.0
    tx, ty, tz = t
    E = np.array([[0, -tz, ty], [tz, 0, -tx], [-ty, tx, 0]]) @ R
    p0, p1 = (np.column_stack([p, np.ones(len(p))]) for p in (points0, points1))
    line1, line0 = p0 @ E.T, p1 @ E
    product = np.sum(p1 * line1, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = product**2 * (1.0 / np.sum(line1[:, :2] ** 2, axis=1)
                                 + 1.0 / np.sum(line0[:, :2] ** 2, axis=1))
    # NaN, for a pixel without a ray, counts as wrong
    return float(np.mean(distance < EPIPOLAR_LIMIT))


def _summary(value, samples):
    low, high = np.percentile(samples, (2.5, 97.5))
    error = float(np.std(samples, ddof=1))
    return {"difference": float(value), "standard_error": error, "low": float(low),
            "high": float(high), "worse": bool(value < -2.0 * error)}


def paired_bootstrap(sets, resamples=2000, seed=1, groups=None):
    """The difference of AUC, first minus second, and its spread when the pairs are resampled.

    sets: {name: (first, second)}, each an array of seeds x pairs with the same pairs in the same
    columns. Returns {"sets": {name: {"5": summary, ..}}, "mean": {..}, "pooled": {..}}: for each
    set; for the mean over the sets, with pairs resampled within each set; and for all pairs as one
    set. `worse` means by more than two standard errors. groups: {group: names of sets} adds
    "groups": {group: {"5": summary, ..}}, the mean over each group's sets, and "group_mean", the
    mean of the groups.
    """
    random = np.random.default_rng(seed)
    result = {"sets": {}, "mean": {}, "pooled": {}}
    per_set = {}

    def difference(first, second, indices, threshold):
        return (np.mean([auc_rows(run[indices], threshold) for run in first], axis=0)
                - np.mean([auc_rows(run[indices], threshold) for run in second], axis=0))

    def measure(first, second):
        num = first.shape[1]
        everything = np.arange(num)[None]
        indices = random.integers(0, num, (resamples, num))
        return {threshold: (difference(first, second, everything, threshold)[0],
                            difference(first, second, indices, threshold))
                for threshold in THRESHOLDS_DEG}

    arrays = {name: tuple(np.atleast_2d(np.asarray(run, float)) for run in runs)
              for name, runs in sets.items()}
    for name, (first, second) in arrays.items():
        per_set[name] = measure(first, second)
        result["sets"][name] = {f"{t:g}": _summary(*per_set[name][t]) for t in THRESHOLDS_DEG}
    if not arrays:
        return result
    for t in THRESHOLDS_DEG:
        result["mean"][f"{t:g}"] = _summary(np.mean([m[t][0] for m in per_set.values()]),
                                            np.mean([m[t][1] for m in per_set.values()], axis=0))
    if groups:
        result["groups"], result["group_mean"] = {group: {} for group in groups}, {}
    for t in THRESHOLDS_DEG if groups else ():
        means = {group: [np.mean([per_set[name][t][part] for name in members], axis=0)
                         for part in (0, 1)] for group, members in groups.items()}
        for group, mean in means.items():
            result["groups"][group][f"{t:g}"] = _summary(*mean)
        result["group_mean"][f"{t:g}"] = _summary(
            *(np.mean([mean[part] for mean in means.values()], axis=0) for part in (0, 1)))
    pooled = measure(*(np.concatenate([runs[side] for runs in arrays.values()], axis=1)
                       for side in (0, 1)))
    result["pooled"] = {f"{t:g}": _summary(*pooled[t]) for t in THRESHOLDS_DEG}
    return result


def finite(value):
    """The same data with null for each infinite or missing number, which JSON cannot express."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return value
