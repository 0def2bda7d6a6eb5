#!/usr/bin/env python3
"""Pose accuracy against the inlier threshold and against the ratio: the picture of
docs/accuracy.md.

  scripts/python -m twoview_tools.accuracy.curves --picture docs/images/accuracy_curves.png
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import json
import sys

import numpy as np

from . import datasets, identical, pipeline, tables, twoview_ctypes

THRESHOLDS_PX = (0.5, 0.7, 1.0, 1.4, 2.0, 3.0)
RATIOS = (0.75, 0.8, 0.85, 0.87, 0.9, 0.92, 0.95, 0.98)


def matches_by_ratio(context, data, ratios):
    """{ratio: result of pipeline.match_pairs}; the features of each image are computed once."""
    names = dict.fromkeys(n for p in data.pairs for n in (p.name0, p.name1))
    features = pipeline.extract_images(context, data, names)
    return {r: pipeline.match_pairs(context, data, None, {"ratio": r}, features) for r in ratios}


def measure(names, library, flagged, max_pairs):
    """Evaluates the sets at each inlier threshold and at each ratio. Returns
    {"max_error_px": {threshold: {set: rows}}, "ratio": {ratio: {set: rows}}}."""
    default = library.match_options().ratio
    nearest = min(RATIOS, key=lambda r: abs(r - default))
    found = {"max_error_px": {t: {} for t in THRESHOLDS_PX}, "ratio": {r: {} for r in RATIOS}}
    for name in names:
        data = datasets.Set(os.path.join(datasets.data_dir(), name), flagged=flagged,
                            max_pairs=max_pairs)
        context = pipeline.make_context(library, data)
        matched = matches_by_ratio(context, data, RATIOS)
        for ratio in RATIOS:
            found["ratio"][ratio][name] = pipeline.evaluate_matches(data, matched[ratio], None,
                                                                    "twoview", context)
        for threshold in THRESHOLDS_PX:
            found["max_error_px"][threshold][name] = pipeline.evaluate_matches(
                data, matched[nearest], {"max_error_px": threshold}, "twoview", context)
        print(f"{name}: {len(data.pairs)} pairs", file=sys.stderr, flush=True)
    return found


def means(found):
    return {option: {value: {**identical.mean_auc(rows), "matches": float(np.mean(
        [np.mean([r["num_matches"] for r in part]) for part in rows.values()]))}
                     for value, rows in values.items()} for option, values in found.items()}


def draw(summary, picture):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    titles = {"max_error_px": "inlier threshold [px]", "ratio": "ratio"}
    figure, axes = pyplot.subplots(1, 2, figsize=(9, 3.6), sharey=True, constrained_layout=True)
    for axis, (option, values) in zip(axes, summary.items()):
        for key, style in (("20", "^-"), ("10", "s-"), ("5", "o-")):
            axis.plot(list(values), [v[key] for v in values.values()], style,
                      label=f"AUC at {key} degrees")
        axis.set_xlabel(titles[option])
        axis.grid(alpha=0.3)
        if option == "max_error_px":
            axis.set_xscale("log")
            axis.set_xticks(list(values), [f"{v:g}" for v in values])
            axis.minorticks_off()
        else:
            axis.set_xticks([0.75, 0.8, 0.85, 0.9, 0.95])
    axes[0].set_ylabel("mean of the groups")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    figure.savefig(picture, dpi=120)


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", help="names, separated by commas (default: all)")
    parser.add_argument("--lib", help="libtwoview.so (default: build/release/lib)")
    parser.add_argument("--max-pairs", type=int, help="of each set, evenly spaced")
    parser.add_argument("--picture", help="PNG to write")
    parser.add_argument("--json", help="write the means")
    arguments = parser.parse_args()
    names = arguments.sets.split(",") if arguments.sets else datasets.all_sets()
    if not names:
        sys.exit(f"no sets in {datasets.data_dir()}: set TWOVIEW_DATA")
    library = twoview_ctypes.Library(arguments.lib)
    summary = means(measure(names, library, True, arguments.max_pairs))
    for option, values in summary.items():
        tables.say(
            f"\n| {option} | AUC5 | AUC10 | AUC20 | matches |\n| --- | --- | --- | --- | --- |"
        )
        for value, v in values.items():
            tables.say(f"| {value:g} | {v['5']:.1f} | {v['10']:.1f} | {v['20']:.1f} | "
                       f"{v['matches']:.0f} |")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as f:
            json.dump(summary, f)
    if arguments.picture:
        draw(summary, arguments.picture)


if __name__ == "__main__":
    main()
