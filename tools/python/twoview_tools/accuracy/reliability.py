"""A pose and its stated covariance against the true pose: errors, wrong or right, and whether the
95 per cent ellipsoid holds the truth. docs/accuracy.md has the definitions."""

import numpy as np

from . import metrics

WRONG_ROTATION_DEG, WRONG_DIRECTION_DEG = 5.0, 10.0  # plus the truth's stated error
RIGHT_DEG = 2.0  # plus the truth's stated error
MOST_DIRECTION_ERROR_DEG = 5.0  # of the truth, where a direction counts
# 95 per cent of chi-square with 2, 3 and 5 degrees of freedom.
CHI2_95 = {2: 5.991464547107979, 3: 7.814727903251179, 5: 11.070497693516351}


def direction_basis(t):
    """b1 and b2 of the covariance's parameters a and b, as two_view.h defines them."""
    b1 = np.cross(np.eye(3)[np.argmin(np.abs(t))], t)
    b1 /= np.linalg.norm(b1)
    return b1, np.cross(t, b1)


def rotation_vector(R):
    """w with R = exp([w]x), |w| in [0, pi]."""
    sine = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    s, c = np.linalg.norm(sine), 0.5 * (np.trace(R) - 1)
    angle = np.arctan2(s, c)
    if s > 1e-7:
        return sine * (angle / s)
    if c > 0:
        return sine
    axis = np.sqrt(np.maximum((np.diag(R) + 1) / 2, 0))  # half a turn: only the axis' line is known
    k = int(np.argmax(axis))
    return angle * (R[:, k] + np.eye(3)[k]) / np.linalg.norm(R[:, k] + np.eye(3)[k])


def deviation(R, t, R_true, t_true):
    """The five parameters (w0 w1 w2 a b) of the truth seen from an estimate; None if the true
    direction is 90 degrees or more from the estimated one, where a and b do not exist."""
    w = rotation_vector(np.asarray(R_true) @ np.asarray(R).T)
    along = float(np.dot(t_true, t))
    if not along > 0:
        return None
    b1, b2 = direction_basis(np.asarray(t, float))
    return np.array([*w, np.dot(t_true, b1) / along, np.dot(t_true, b2) / along])


def chi2(x, covariance):
    """x^T C^-1 x, infinite where C is not positive definite."""
    try:
        L = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        return np.inf
    return float(np.sum(np.linalg.solve(L, x) ** 2))


def sigmas(covariance):
    """The stated standard deviations in degrees of the rotation and of the direction (root of the
    trace of their blocks), and the largest along any of the five axes."""
    if covariance is None:
        return {"sigma_rotation_deg": None, "sigma_direction_deg": None, "sigma_largest_deg": None}
    C = np.reshape(covariance, (5, 5))
    largest = [np.linalg.eigvalsh(block)[-1] for block in (C[:3, :3], C[3:, 3:])]
    values = np.trace(C[:3, :3]), np.trace(C[3:, 3:]), max(largest)
    return dict(zip(("sigma_rotation_deg", "sigma_direction_deg", "sigma_largest_deg"),
                    (float(np.degrees(np.sqrt(max(v, 0)))) for v in values)))


def truth_covariance(rotation_deg, direction_deg):
    """The covariance of a truth whose errors have these root mean squares."""
    rotation, direction = np.radians((rotation_deg, direction_deg))
    return np.diag([rotation ** 2 / 3] * 3 + [direction ** 2 / 2] * 2)


def judge(R, t, covariance, R_true, t_true, stated, gap=0):
    """The errors of a pose, as a dict for JSON. R, t: None without a pose; t_true: in the set's
    unit; stated: a truth.Stated. "wrong" and the like are None without a pose."""
    baseline = float(np.linalg.norm(t_true))
    truth_direction = stated.direction_error_deg(baseline)
    counts = truth_direction <= MOST_DIRECTION_ERROR_DEG
    found = {"R_true": [float(v) for v in np.ravel(R_true)], "t_true": [float(v) for v in t_true],
             "gap": gap, "truth_rotation_deg": stated.rotation_deg,
             "truth_direction_deg": min(truth_direction, 180.0), "direction_counts": bool(counts),
             "trusted": bool(gap <= stated.trusted_gap),
             "true_rotation_deg": metrics.rotation_error_deg(R_true, np.eye(3)),
             "rotation_error_deg": None, "direction_error_deg": None, "wrong": None,
             "wrong_rotation": None, "right": None, "right_rotation": None, "chi2": None,
             "chi2_with_truth": None, "chi2_freedom": None, "inside": None,
             "inside_with_truth": None}
    if R is None or t is None:
        return found
    rotation = metrics.rotation_error_deg(R, R_true)
    direction = metrics.direction_error_deg(t, t_true) if baseline > 0 else None
    wrong_rotation = rotation > WRONG_ROTATION_DEG + stated.rotation_deg
    right_rotation = rotation <= RIGHT_DEG + stated.rotation_deg
    found.update({
        "rotation_error_deg": rotation, "direction_error_deg": direction,
        "wrong_rotation": bool(wrong_rotation), "right_rotation": bool(right_rotation),
        "wrong": bool(wrong_rotation or (
            counts and direction > WRONG_DIRECTION_DEG + truth_direction)),
        "right": bool(right_rotation and direction <= RIGHT_DEG + truth_direction)
        if counts else None})
    if covariance is None:
        return found
    C = np.reshape(covariance, (5, 5))
    size = 5 if counts else 3
    x = np.append(rotation_vector(R_true @ np.asarray(R).T), [0.0, 0.0])
    if counts:
        x = deviation(R, t, R_true, t_true / baseline)
    T = truth_covariance(stated.rotation_deg, truth_direction)
    for name, total in (("", C), ("_with_truth", C + T)):
        value = np.inf if x is None else chi2(x[:size], total[:size, :size])
        found["chi2" + name] = value
        found["inside" + name] = bool(value <= CHI2_95[size])
    found["chi2_freedom"] = size
    return found


def judge_impossible(verdict):
    """The same for a pair that has no translation to be known: an "ok" is wrong."""
    wrong = verdict == "ok"
    return {"wrong": wrong, "wrong_rotation": wrong, "right": None, "trusted": True}
