#!/usr/bin/env python3
"""Prints one table line for each set, each group and the mean of the groups, for any options of the
library.

  scripts/python -m twoview_tools.accuracy.tune --sets kitti00_turn,tum_fr3_office \\
      --feature threshold=10 arc=9 --match ratio=0.8 --estimate max_error_px=1 \\
      --estimator twoview --max-pairs 15

Options are the fields of tv_feature_options, tv_match_options, tv_estimate_options; those not named
keep the library's defaults. Of tv_reconstruct_options --match takes align_matches, and --estimate
sigma_by_size, too; with their defaults the poses are those of tv_reconstruct.
Estimators: twoview, magsac, usac, accurate, poselib, pycolmap,
pycolmap_tvg (these read max_error_px only, and get the library's own matches).
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import concurrent.futures
import json
import sys

import numpy as np

from . import datasets, metrics, pipeline

COLUMNS = (("auc5", "AUC5", "6.1f"), ("auc10", "AUC10", "6.1f"), ("auc20", "AUC20", "6.1f"),
           ("median_error_deg", "median", "7.2f"), ("failures", "fail", "5.2f"),
           ("num_keypoints", "kp", "6.0f"), ("num_matches", "match", "6.0f"),
           ("num_inliers", "inlier", "6.0f"), ("precision", "prec", "5.2f"),
           ("extract_ms", "extr ms", "7.1f"), ("match_ms", "mat ms", "6.1f"),
           ("estimate_ms", "est ms", "6.1f"))


def line(name, summary):
    pairs = summary.get("num_pairs")
    return f"{name:<24}{'' if pairs is None else pairs:>4} " + " ".join(
        f"{summary[key]:{spec}}" for key, _, spec in COLUMNS)


def header():
    return f"{'set':<24}{'n':>4} " + " ".join(
        f"{title:>{spec.split('.')[0]}}" for _, title, spec in COLUMNS)


def mean_of(summaries):
    return {key: float(np.mean([s[key] for s in summaries])) for key, _, _ in COLUMNS}


def _options(items):
    return dict(item.split("=", 1) for group in items or [] for item in group)


def _run(job):
    rows = pipeline.evaluate_pairs(**job)
    return pipeline.summarise(rows), rows


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", help="names, separated by commas (default: all)")
    parser.add_argument("--groups", help="only the sets of the group narrow, or wide")
    for name in ("feature", "match", "estimate"):
        parser.add_argument("--" + name, nargs="+", action="append", metavar="KEY=VALUE")
    parser.add_argument("--estimator", default="twoview")
    parser.add_argument("--lib", help="libtwoview.so (default: build/release/lib)")
    parser.add_argument("--max-pairs", type=int, help="of each set, evenly spaced")
    parser.add_argument("--resize", type=int, help="long side; 0 native (default: tables' rule)")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--flagged", action="store_true")
    parser.add_argument("--save", metavar="DIR", help="keep each set's matches there")
    parser.add_argument("--load", metavar="DIR", help="matches of an earlier --save")
    parser.add_argument("--json", help="write summaries and rows")
    arguments = parser.parse_args()

    try:
        names = datasets.select_sets(arguments.sets, arguments.groups)
    except ValueError as error:
        sys.exit(f"tune: {error}")
    if arguments.save:
        os.makedirs(arguments.save, exist_ok=True)

    def stored(folder, name):
        return os.path.join(folder, name + ".matches") if folder else None

    jobs = [{"set_dir": os.path.join(datasets.data_dir(), name),
             "feature_options": _options(arguments.feature),
             "match_options": _options(arguments.match),
             "estimate_options": _options(arguments.estimate),
             "max_pairs": arguments.max_pairs, "resize": arguments.resize,
             "estimator": arguments.estimator, "num_seeds": arguments.seeds,
             "library": arguments.lib, "flagged": arguments.flagged,
             "save": stored(arguments.save, name), "load": stored(arguments.load, name)}
            for name in names]
    print(header(), flush=True)
    summaries, everything = [], []
    if arguments.jobs > 1:
        pool = concurrent.futures.ProcessPoolExecutor(arguments.jobs)
        results = pool.map(_run, jobs)
    else:
        results = map(_run, jobs)
    for name, (summary, rows) in zip(names, results):
        print(line(name, summary), flush=True)
        summaries.append(summary)
        everything += rows
    means = []
    for group, members in datasets.by_group(names).items():
        means.append(mean_of([summaries[names.index(name)] for name in members]))
        print(line(f"group {group}", means[-1]))
    print(line("mean of the groups", mean_of(means)))
    print(line("mean over sets", mean_of(summaries)))
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as f:
            json.dump(metrics.finite({"summaries": dict(zip(names, summaries)),
                                      "rows": everything}), f, allow_nan=False)


if __name__ == "__main__":
    main()
