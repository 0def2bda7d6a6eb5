#!/usr/bin/env python3
"""Pose accuracy against CPU time, ours and the peers': a table and a picture of docs/accuracy.md.

  scripts/accuracy --peers asift,xfeat --peer-options usual --max-pairs 8 --seeds 1 --json A
  scripts/accuracy --effort --max-pairs 8 --json E
  scripts/python -m twoview_tools.accuracy.cost A E --picture docs/images/accuracy_cost.png

The peers' rows are A's; ours are E's, rung 0 and the ladder, on the pairs of A. Times are CPU time
of one thread from the images in memory to the pose: the mean over a set's pairs, then over the sets
of a group, then over both groups, as the AUC is."""

import argparse
import json

import numpy as np

from . import datasets, learned, metrics, tables

OURS = {"0": "twoview, one view", "auto": "twoview, automatic"}


def systems(accuracy, effort):
    """{name: {set: rows}} with "cpu_ms" in each row; the set's pairs are the same for each name."""
    found = {title: {} for title in OURS.values()}
    for name, rows_of in accuracy["pairs"].items():
        pairs = {(row["name0"], row["name1"]) for row in rows_of[tables.OURS]}
        for way, title in OURS.items():
            part = [row for row in effort["pairs"] if row["set"] == name and row["way"] == way
                    and (row["name0"], row["name1"]) in pairs]
            if len(part) != len(pairs):
                raise ValueError(f"{name}: {len(part)} of {len(pairs)} pairs are in the rows of "
                                 "--effort")
            found[title][name] = part
        for peer, rows in rows_of.items():
            if peer != tables.OURS:
                found.setdefault(peer, {})[name] = [{**row, "cpu_ms": sum(row["ms"].values())}
                                                    for row in rows]
    return found


def summarise(rows_of):
    """{group, or "mean": {"5", "10", "20": AUC, "ms"}} of a system's {set: rows}."""
    each = {}
    for name, rows in rows_of.items():
        rows = [{**r, "pose_error_deg": np.inf if r["pose_error_deg"] is None
                 else r["pose_error_deg"]} for r in rows]
        runs = tables.runs_of(rows)
        each[name] = {**{f"{t:g}": metrics.auc_of_runs(runs, t) for t in metrics.THRESHOLDS_DEG},
                      "ms": float(np.mean([r["cpu_ms"] for r in rows]))}
    mean = lambda parts: {key: float(np.mean([p[key] for p in parts])) for key in parts[0]}
    groups = {group: mean([each[name] for name in members])
              for group, members in datasets.by_group(list(each)).items()}
    return {**groups, "mean": mean(list(groups.values()))}


def print_summaries(summaries):
    groups = list(next(iter(summaries.values())))
    tables.say(f"| | {' | '.join(groups)} | CPU time a pair [ms] |\n"
               f"|{' --- |' * (len(groups) + 2)}")
    for name, parts in summaries.items():
        cells = [" / ".join(f"{part[t]:.1f}" for t in ("5", "10", "20")) for part in parts.values()]
        tables.say(f"| {name} | {' | '.join(cells)} | {parts['mean']['ms']:.0f} |")


def label(config):
    """A peer's short name: its front end."""
    if config["front"] == "learned":
        return learned.TITLES[config["kind"]]
    front = {"asift": "ASIFT", "sift": "SIFT", "fast": "FAST + SIFT",
             "pycolmap": "COLMAP"}[config["front"]]
    return f"{front} {config['cap']}" if "cap" in config else front


def draw(summaries, labels, picture):
    """labels: {name of a peer: its name in the picture}."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    figure, axis = pyplot.subplots(figsize=(7.5, 4.2), constrained_layout=True)
    ours = [(parts["mean"]["ms"], parts["mean"]["5"]) for name, parts in summaries.items()
            if name in OURS.values()]
    axis.plot(*zip(*ours), "-", color="tab:blue", alpha=0.5)
    for name, parts in summaries.items():
        x, y = parts["mean"]["ms"], parts["mean"]["5"]
        is_ours = name in OURS.values()
        axis.plot(x, y, "o" if is_ours else "s", color="tab:blue" if is_ours else "tab:red")
        # Ours above and below their line, the others to the left of their points.
        place = {"xytext": (0, -14 if (x, y) == ours[0] else 6), "ha": "center"} if is_ours else {
            "xytext": (-7, 0), "ha": "right", "va": "center"}
        axis.annotate(labels.get(name, name), (x, y), textcoords="offset points", fontsize=8,
                      **place)
    axis.set_xscale("log")
    axis.margins(x=0.18, y=0.12)
    axis.set_xlabel("CPU time of a pair, one thread [ms]")
    axis.set_ylabel("AUC at 5 degrees, mean of the groups")
    axis.grid(alpha=0.3, which="both")
    figure.savefig(picture, dpi=100)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("accuracy", help="of scripts/accuracy --json")
    parser.add_argument("effort", help="of scripts/accuracy --effort --json")
    parser.add_argument("--picture", help="PNG to write")
    arguments = parser.parse_args(argv)
    contents = []
    for path in (arguments.accuracy, arguments.effort):
        with open(path, encoding="utf-8") as f:
            contents.append(json.load(f))
    summaries = {name: summarise(rows) for name, rows in systems(*contents).items()}
    print_summaries(summaries)
    if arguments.picture:
        labels = {name: label(key["config"]) for name, key in contents[0]["peers"].items()}
        draw(summaries, labels, arguments.picture)


if __name__ == "__main__":
    main()
