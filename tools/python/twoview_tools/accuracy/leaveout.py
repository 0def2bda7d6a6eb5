"""Leave-one-set-out: for each set the options are chosen by their scores on the other sets.

A table is {set: array of points x AUC5, AUC10, AUC20}; a point is one choice of all options.
Nothing here reads an image, so that the choice itself can be tested on made-up scores.
"""

import numpy as np

from . import datasets


def mean_of_groups(values):
    """The mean over the groups of the mean over each group's sets. `values`: {set: number or
    array}. A group without a set does not count."""
    groups = datasets.by_group(list(values))
    return np.mean([np.mean([values[name] for name in members], axis=0)
                    for members in groups.values()], axis=0)


def criterion(table, sets=None):
    """What the choice maximises, a number for each point: the mean of AUC5, AUC10 and AUC20,
    averaged by mean_of_groups over `sets` (None: all sets of the table)."""
    names = list(table) if sets is None else list(sets)
    return mean_of_groups({name: np.mean(table[name], axis=1) for name in names})


def choose(table, sets=None):
    """The index of the best point on `sets`; the first one on a tie."""
    return int(np.argmax(criterion(table, sets)))


def leave_one_out(table):
    """Returns {"tuned": the point chosen on all sets,
    "sets": {set: {"point", "left_out", "tuned"}}, "left_out_mean", "tuned_mean": the AUC by
    mean_of_groups, "difference": the mean of the three AUC, left out minus tuned, "worst": the set
    that loses most}. A set's own scores are not read
    when its point is chosen. At least two sets."""
    if len(table) < 2:
        raise ValueError("leave-one-set-out needs at least two sets")
    tuned = choose(table)
    sets = {}
    for name, scores in table.items():
        point = choose(table, [other for other in table if other != name])
        sets[name] = {"point": point, "left_out": np.array(scores[point], float),
                      "tuned": np.array(scores[tuned], float)}
    loss = {name: float(np.mean(s["left_out"] - s["tuned"])) for name, s in sets.items()}
    left_out_mean = mean_of_groups({name: s["left_out"] for name, s in sets.items()})
    tuned_mean = mean_of_groups({name: s["tuned"] for name, s in sets.items()})
    return {"tuned": tuned, "sets": sets, "left_out_mean": left_out_mean,
            "tuned_mean": tuned_mean, "difference": float(np.mean(left_out_mean - tuned_mean)),
            "worst": min(loss, key=loss.get)}
