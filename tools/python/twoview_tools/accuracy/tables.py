"""Summarises rows and prints them as tables."""

import os
import platform
import sys

import numpy as np

from . import datasets, metrics

OURS = "twoview"
MIN_PAIRS = 15  # a set with fewer pairs counts only in the mean over the sets


def say(text="", end="\n"):
    print(text, end=end, flush=True)


def progress(name, log=False):
    """A function of (done, total) that shows a counter on a terminal. log: where stderr is a file
    it gets a line at every tenth."""
    def report(done, total):
        if sys.stderr.isatty():
            print(f"\r  {name}: {done}/{total}  ", end="" if done < total else "\r\033[K",
                  file=sys.stderr, flush=True)
        elif log and 10 * done // total > 10 * (done - 1) // total:
            print(f"{name}: {done}/{total}", file=sys.stderr, flush=True)
    return report


def time_ms(row):
    return row["time_ms"] if "time_ms" in row else sum(row["ms"].values())


def runs_of(rows):
    """The pose errors of the rows in degrees, as an array of seeds x pairs."""
    seeds = sorted({row["seed"] for row in rows})
    return np.array([[r["pose_error_deg"] for r in rows if r["seed"] == s] for s in seeds])


def summarise(rows):
    runs = runs_of(rows)
    return {"num_pairs": runs.shape[1], "num_seeds": runs.shape[0],
            "auc": {f"{t:g}": metrics.auc_of_runs(runs, t) for t in metrics.THRESHOLDS_DEG},
            "median_error_deg": float(np.median(runs)),
            "failures": float(np.isinf(runs).sum() / runs.shape[0]),
            "num_matches": float(np.mean([r["num_matches"] for r in rows])),
            "precision": float(np.mean([r["precision"] for r in rows])),
            "time_ms": float(np.median([time_ms(r) for r in rows]))}


def mean_summary(summaries):
    """The mean over sets, each set with the same weight."""
    keys = ("median_error_deg", "failures", "num_matches", "precision", "time_ms")
    return {"num_sets": len(summaries),
            "auc": {t: float(np.mean([s["auc"][t] for s in summaries]))
                    for t in summaries[0]["auc"]},
            **{k: float(np.mean([s[k] for s in summaries])) for k in keys}}


def table_line(name, summary, width):
    auc = " ".join(f"{v:6.1f}" for v in summary["auc"].values())
    return (f"  {name:<{width}} {auc} {summary['median_error_deg']:8.2f} "
            f"{summary['failures']:5.1f} {summary['num_matches']:8.0f} "
            f"{100 * summary['precision']:6.1f} {summary['time_ms']:8.1f}")


def print_table(title, summaries):
    width = max(len(name) for name in summaries)
    say(f"\n{title}")
    say(f"  {'':<{width}} {'AUC5':>6} {'AUC10':>6} {'AUC20':>6} {'median':>8} {'fail':>5} "
        f"{'matches':>8} {'prec%':>6} {'ms':>8}")
    for name, summary in summaries.items():
        say(table_line(name, summary, width))


def print_means(summaries, names, note=""):
    """Prints and returns the tables of each group, and that of the mean of the groups.
    summaries: {set: {name: summary}}."""
    groups = datasets.by_group(list(summaries))
    means = {group: {n: mean_summary([summaries[member][n] for member in members])
                     for n in names} for group, members in groups.items()}
    for group, members in groups.items():
        print_table(f"group {group}: mean over {len(members)} sets{note}", means[group])
    means["mean"] = {n: mean_summary([means[group][n] for group in groups]) for n in names}
    if len(groups) > 1:
        print_table(f"mean of the groups {' and '.join(groups)}{note}", means["mean"])
    return means


def machine():
    model = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as f:
            model = next(line.split(":", 1)[1].strip() for line in f
                         if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return {"cpu": model, "cpus": os.cpu_count(), "system": platform.platform(),
            "python": platform.python_version()}
