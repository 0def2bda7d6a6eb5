"""Fits the model of probability_wrong (lib/src/robust/belief.cc) on the rows of
twoview_tools.accuracy.belief, and judges it on sets that were left out of the fit.

The event is: the rotation of a full pose is off by more than 5 degrees plus the truth's stated
error. A logistic model, whose coefficients must have the sign that their evidence has (more
agreement never raises the probability); where the fit gives the other sign, that part is left
out. No set weighs more than MOST_WEIGHT pairs, so that the large sequences do not decide alone;
sets of the same place are left out together. Of rows that climbed the rungs of effort, each rung
that was run is a trial, and multiplies the odds of the model as in belief.cc. A set that is run
with a wrong lens as well ("file-lens") is two sets of one place in the fit: users have wrong
lenses, too. It is judged with the better lens alone."""

import numpy as np

from . import belief_tables, truth

THRESHOLD_PX = 1.0  # max_error_px of the rows
ENOUGH_PLACES = 20
SHIFT_DEG = (0.05, 20.0)
MOST_WEIGHT = 300
RIDGE = 1.0  # on coefficients of standardised parts
MOST_PROBABILITY_WRONG = 0.18  # kMostProbabilityWrong of belief.h
# name: the sign of its coefficient
PARTS = {"disagreement": 1, "noise": 1, "places": -1, "region_shift": 1, "alternative": 1}
# Reasons that the verdict has for other evidence than probability_wrong
CERTAIN = ("two_planar_solutions", "second_motion", "repeated_structure", "low_parallax")
FEW_INLIERS = 15
MOST_SHIFT_DEG = 2.5  # kMostShift of verdict.cc
DOUBTED = 0.5  # probability_wrong where tv_reconstruct doubts a pose for what its descriptors say


def parts_of(row):
    """The numbers that the logit is a weighted sum of; belief.cc computes the same."""
    shift = np.radians(np.clip(np.degrees(row["region_shift_rad"]), *SHIFT_DEG))
    return [np.log(1.02 - np.clip(row["agreement"], 0, 1)),
            np.clip(row["noise_px"] / THRESHOLD_PX, 0, 1),
            np.log(np.clip(row["num_places"], 1, ENOUGH_PLACES)),
            np.log(shift),
            float("two_planar_solutions" in row["reasons"])]


def place_of(name):
    """The name of the place of a set: sets of one place have one."""
    return next((min(group) for group in truth.SAME_PLACE if name in group), name)


def offsets_of(rows):
    """What the trials of each row add to the logit."""
    return np.log([max(1, r.get("num_rungs", 1)) for r in rows])


def fit(X, y, weights, offsets=0.0):
    """[bias, coefficients] of the logistic model: Newton's method on the weighted log-loss with a
    ridge. Parts that the fit would give the wrong sign get the coefficient 0. offsets: added to the
    logits, and not fitted."""
    signs = np.array([0, *PARTS.values()])
    middle, spread = X.mean(axis=0), X.std(axis=0) + 1e-9
    Z = np.column_stack([np.ones(len(X)), (X - middle) / spread])
    active = np.ones(Z.shape[1], bool)
    while True:
        A, b = Z[:, active], np.zeros(active.sum())
        ridge = np.diag(np.where(np.flatnonzero(active) == 0, 1e-6, RIDGE))
        for _ in range(30):
            p = 1 / (1 + np.exp(-(A @ b + offsets)))
            step = np.linalg.solve((A * (weights * p * (1 - p))[:, None]).T @ A + ridge,
                                   A.T @ (weights * (p - y)) + ridge @ b)
            b -= step
            if np.abs(step).max() < 1e-9:
                break
        all_of_them = np.zeros(Z.shape[1])
        all_of_them[active] = b
        if not (signs * all_of_them < 0).any():
            break
        active &= signs * all_of_them >= 0
    coefficients = all_of_them[1:] / spread
    return np.array([all_of_them[0] - coefficients @ middle, *coefficients])


def usable(rows):
    """The rows that count: of a related pair, with a trusted truth and a full pose."""
    return [r for r in belief_tables.related(rows) if r["rotation_error_deg"] is not None]


def fitted_rows(rows):
    """The rows that the model is fitted on: usable ones, and those with a wrong lens."""
    return usable(rows) + [r for r in rows if r["kind"] == "file-lens" and r["trusted"]
                           and r["rotation_error_deg"] is not None]


def name_of(row):
    """The set of a row, by which it is weighed."""
    return row["set"] + (" file-lens" if row["kind"] == "file-lens" else "")


def weights_of(sets):
    names, counts = np.unique(sets, return_counts=True)
    share = dict(zip(names, np.minimum(1, MOST_WEIGHT / counts)))
    return np.array([share[s] for s in sets])


def probabilities(X, coefficients, offsets=0.0):
    return 1 / (1 + np.exp(-(coefficients[0] + X @ coefficients[1:] + offsets)))


def left_out(rows):
    """The probability of each row, from the model that was fitted without its place."""
    X = np.array([parts_of(r) for r in rows])
    y = np.array([bool(r["wrong_rotation"]) for r in rows], float)
    sets = np.array([name_of(r) for r in rows])
    places = np.array([place_of(r["set"]) for r in rows])
    offsets = offsets_of(rows)
    found = np.zeros(len(rows))
    if len(np.unique(places)) < 2:
        raise ValueError("at least two places are needed")
    for place in np.unique(places):
        train, test = places != place, places == place
        model = fit(X[train], y[train], weights_of(sets[train]), offsets[train])
        found[test] = probabilities(X[test], model, offsets[test])
    return found


def believed(row, probability):
    """Whether a row would be "ok" with another probability_wrong: no reason is certain. The reasons
    that the verdict gives for a probability that is too high do not count."""
    certain = (set(CERTAIN) & set(row["reasons"]) or row["num_inliers"] < FEW_INLIERS
               or row["probability_wrong"] == DOUBTED
               or np.degrees(row["region_shift_rad"]) > MOST_SHIFT_DEG)
    return probability <= MOST_PROBABILITY_WRONG and not certain


def constants(rows):
    """The lines of belief.cc: the model that is fitted on all rows, and the medians of its parts
    over the right poses."""
    rows = fitted_rows(rows)
    X = np.array([parts_of(r) for r in rows])
    y = np.array([bool(r["wrong_rotation"]) for r in rows], float)
    bias, *weights = fit(X, y, weights_of(np.array([name_of(r) for r in rows])), offsets_of(rows))
    usual = np.median(X[[bool(r["right"]) and r["kind"] == "related" for r in rows]], axis=0)
    lines = [f"bias {bias:.3f}"]
    return lines + [f"{name} {weight:.3f}, usual {value:.3f}"
                    for name, weight, value in zip(PARTS, weights, usual)]


def left_out_tables(rows):
    """[(title, header, lines)] of the left-out judgement: by set, and by tenths."""
    fitted, rows = fitted_rows(rows), usable(rows)
    p = left_out(fitted)[:len(rows)]
    groups = belief_tables.by_set(rows)
    rungs = belief_tables.by_rung(rows)
    if len(rungs) > 1:
        groups.update({f"rung {rung}": some for rung, some in rungs.items()})
    of_row = {id(r): q for r, q in zip(rows, p)}
    by_set = []
    for name, some in groups.items():
        ok = [r for r in some if believed(r, of_row[id(r)])]
        right = [r for r in some if r["right"]]
        right_ok = [r for r in ok if r["right"]]
        wrong = sum(bool(r["wrong_rotation"]) for r in ok)
        by_set.append([name, len(some), len(ok), wrong, 100 * wrong / max(len(ok), 1), len(right),
                       len(right_ok), 100 * len(right_ok) / len(right) if right else None])
    return [("Left one set out: \"ok\" by the model of the other sets",
             ["set", "poses", "ok", "wrong in rotation", "% wrong", "right", "of these ok", "%"],
             by_set),
            ("Left one set out: probability_wrong in tenths of the poses",
             belief_tables.TENTHS_HEAD, belief_tables.tenths(rows, p))]
