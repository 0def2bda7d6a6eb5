"""The targets of the comparison from images to poses: a sentence for each, and whether it is
reached."""

import numpy as np

from . import datasets, metrics
from .tables import MIN_PAIRS, runs_of

# What the mean over the ten sets before NEW_SETS is to be at least: AUC5, AUC10, AUC20.
TEN_SETS_TARGET = (73.0, 83.0, 89.0)


def set_auc(rows):
    """AUC5, 10 and 20 of one set's rows."""
    runs = runs_of(rows)
    return np.array([metrics.auc_of_runs(runs, t) for t in metrics.THRESHOLDS_DEG])


def group_auc(auc):
    """{group: AUC5, 10, 20, averaged over its sets} from {set: AUC}."""
    return {group: np.mean([auc[name] for name in members], axis=0)
            for group, members in datasets.by_group(list(auc)).items()}


def three(values, digits=1):
    return " / ".join(f"{v:.{digits}f}" for v in values)


def _against_the_best(mine, theirs, difference):
    """(differences to the best peer of each AUC, text). mine: AUC5, 10, 20; theirs: {peer: the
    same}; difference: a function of a peer and "5", "10" or "20" to a summary of the bootstrap."""
    found, parts = [], []
    for i, t in enumerate(metrics.THRESHOLDS_DEG):
        best = max(theirs, key=lambda peer: theirs[peer][i])
        d = difference(best, f"{t:g}")
        found.append(d)
        parts.append(f"AUC{t:g} {mine[i]:.1f}, {d['difference']:+.1f} ± "
                     f"{d['standard_error']:.1f} ({best})")
    return found, "; ".join(parts)


def judge(ours, rivals, comparisons):
    """[(True, False, or None if the line is only shown; sentence)]. ours: {set: rows}; rivals:
    {peer: {set: rows}}; comparisons: {peer: metrics.paired_bootstrap's result with groups}."""
    mine = {name: set_auc(rows) for name, rows in ours.items()}
    theirs = {peer: {name: set_auc(rows) for name, rows in sets.items()}
              for peer, sets in rivals.items()}
    found = []
    for group, value in group_auc(mine).items() if rivals else ():
        differences, text = _against_the_best(
            value, {peer: group_auc(auc)[group] for peer, auc in theirs.items()},
            lambda peer, t, group=group: comparisons[peer]["groups"][group][t])
        found.append((all(d["difference"] > 0 for d in differences),
                      f"group {group} ahead of the best peer: {text}"))
    ten = [name for name in mine if name not in datasets.NEW_SETS]
    if len(ten) == 10:
        value = np.mean([mine[name] for name in ten], axis=0)
        found.append((bool(np.all(value >= TEN_SETS_TARGET)),
                      f"mean over the ten sets as listed before at least "
                      f"{three(TEN_SETS_TARGET, 0)}: {three(value)}"))
        narrow = group_auc(mine)["narrow"]
        found.append((None, f"the other reading of that line, group narrow alone: "
                            f"{three(narrow)}"))
    for name, rows in ours.items() if rivals else ():
        if runs_of(rows).shape[1] < MIN_PAIRS:
            continue
        differences, text = _against_the_best(
            mine[name], {peer: auc[name] for peer, auc in theirs.items()},
            lambda peer, t, name=name: comparisons[peer]["sets"][name][t])
        found.append((not any(d["worse"] for d in differences),
                      f"{name} not worse than the best peer there by two standard errors: {text}"))
    return found
