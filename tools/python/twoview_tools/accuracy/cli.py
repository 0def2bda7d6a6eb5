#!/usr/bin/env python3
"""Pose accuracy of `twoview evaluate` and of peers on the same pairs: tables, and the paired
comparison. See docs/accuracy.md."""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import json
import shutil
import subprocess
import sys
import tempfile

import numpy as np

from . import datasets, estimators, identical, metrics, peers, pipeline, robust500
from .tables import (MIN_PAIRS, OURS, machine, mean_summary, print_table, progress, runs_of, say,
                    summarise)

PROGRAM = os.path.join(datasets.ROOT, "build", "release", "bin", "twoview")
QUICK_PAIRS = 8
QUICK_RESAMPLES = 1000
ERRORS = ("rotation_error_deg", "translation_error_deg", "translation_error_signed_deg",
          "pose_error_deg")


# ---- twoview's own rows ------------------------------------------------------------------------

def run_program(program, data, extra):
    """Runs `twoview evaluate` on a set. Returns its rows, and its report without the pairs."""
    with tempfile.TemporaryDirectory() as folder:
        pairs_file = data.pair_files[0]
        if len(data.pair_files) > 1 or len(data.pairs) != len(datasets.read_measurable(pairs_file)):
            pairs_file = os.path.join(folder, "pairs.txt")
            with open(pairs_file, "w", encoding="utf-8") as f:
                f.writelines(pair.text + "\n" for pair in data.pairs)
            cameras = os.path.join(data.dir, "cameras.yaml")
            if os.path.isfile(cameras):
                shutil.copy(cameras, folder)
        command = [program, "evaluate", pairs_file, "--images", os.path.join(data.dir, "images"),
                   "-o", os.path.join(folder, "report.json"), "--quiet"]
        if data.resize:
            command += ["--resize", str(data.resize)]
        done = subprocess.run(command + extra, check=False)
        if done.returncode != 0:
            sys.exit(f"accuracy: {' '.join(command + extra)}: exit status {done.returncode}")
        with open(os.path.join(folder, "report.json"), encoding="utf-8") as f:
            report = json.load(f)
    listed = {(p["name0"], p["name1"]): p for p in report.pop("pairs")}
    rows = []
    for pair in data.pairs:
        row = listed.get((pair.name0, pair.name1))
        if row is None:
            sys.exit(f"accuracy: {data.name}: {pair.name0} {pair.name1} is not in the report")
        row = {**row, "set": data.name, "seed": 0}
        for key in ERRORS:
            row[key] = np.inf if row.get(key) is None else row[key]
        for key in ("num_matches", "num_inliers", "precision"):
            row[key] = row.get(key) or 0
        rows.append(row)
    return rows, report


def run_library(path, data, extra):
    """Evaluates a set through libtwoview.so. Returns its rows and an empty report. `extra`, options
    of `twoview evaluate`, must be empty."""
    if extra:
        sys.exit("accuracy: --ours library takes no options of the program")
    rows = pipeline.evaluate_pairs(data.dir, library=path, resize=data.resize,
                                   flagged=len(data.pair_files) > 1, max_pairs=data.max_pairs)
    return rows, {}


# ---- the paired comparison ---------------------------------------------------------------------

def print_comparison(peer, compared, sizes):
    say(f"\n{OURS} minus {peer}: difference of AUC, standard error, 95 % interval")
    width = max([len(name) for name in sizes] + [14])

    def row(title, count, differences, counts):
        cells = []
        for d in differences.values():
            flag = "*" if d["worse"] and counts else " "
            cells.append(f"{d['difference']:+6.1f} ±{d['standard_error']:4.1f} "
                         f"[{d['low']:+6.1f},{d['high']:+6.1f}]{flag}")
        say(f"  {title:<{width}} {count:>4}  " + "  ".join(cells))

    say(f"  {'':<{width}} {'n':>4}  {'AUC5':<28}  {'AUC10':<28}  {'AUC20':<28}")
    for name, differences in compared["sets"].items():
        row(name, sizes[name], differences, sizes[name] >= MIN_PAIRS)
    row("mean over sets", len(sizes), compared["mean"], True)
    row("all pairs", sum(sizes.values()), compared["pooled"], True)


def verdicts(peer, compared, sizes):
    """Verdict sentences: where our result is worse by more than two standard errors, or its mean is
    lower."""
    found = []
    for name, differences in compared["sets"].items():
        if sizes[name] >= MIN_PAIRS:
            found += [f"{name}: AUC{t} worse by {-d['difference']:.1f} "
                      f"(standard error {d['standard_error']:.1f}) than {peer}"
                      for t, d in differences.items() if d["worse"]]
    for t, d in compared["mean"].items():
        if d["difference"] < 0:
            found.append(f"mean over sets: AUC{t} lower by {-d['difference']:.1f} "
                         f"(standard error {d['standard_error']:.1f}) than {peer}")
    return found


# ---- whole pipelines ---------------------------------------------------------------------------

def compare_pipelines(arguments, sets):
    groups = [g for g in arguments.peers.split(",") if g]
    for group in groups:
        if group not in peers.GROUPS:
            sys.exit(f"accuracy: no peers {group!r}; there are {', '.join(peers.GROUPS)}")
    systems = [peers.Peer(config, arguments.seeds, use_cache=not arguments.no_cache)
               for group in groups for config in peers.GROUPS[group]]
    rows, summaries, reports = {}, {}, {}
    for data in sets:
        if arguments.ours == "program":
            ours, report = run_program(arguments.program, data, arguments.extra)
        else:
            ours, report = run_library(arguments.lib, data, arguments.extra)
        reports[data.name] = report
        rows[data.name] = {OURS: ours}
        for peer in systems:
            rows[data.name][peer.name] = peer.run(data, progress(f"{data.name}, {peer.name}"))
        summaries[data.name] = {name: summarise(r) for name, r in rows[data.name].items()}
        size = f"long side {data.resize}" if data.resize else "native size"
        print_table(f"{data.name}: {len(data.pairs)} pairs, {size}", summaries[data.name])
        if report.get("auc"):
            for t, value in summaries[data.name][OURS]["auc"].items():
                if abs(report["auc"][t] - value) > 0.01:
                    say(f"  note: the program's own AUC{t} is {report['auc'][t]:.3f}, "
                        f"from its pairs {value:.3f}")
    names = [OURS] + [peer.name for peer in systems]
    mean = {n: mean_summary([summaries[d.name][n] for d in sets]) for n in names}
    print_table(f"mean over {len(sets)} sets", mean)
    say("\nmatches: mean; ms: median of a pair, one thread; fail: pairs without a pose.\n"
        f"Peers: mean over {arguments.seeds} seeds that shuffle the matches; their gradient "
        "orientation and\nmatching run in numpy, so their ms are no measure of OpenCV's speed: "
        "scripts/bench is.")
    sizes = {data.name: len(data.pairs) for data in sets}
    comparisons, sentences = {}, []
    for peer in systems:
        compared = metrics.paired_bootstrap(
            {d.name: (runs_of(rows[d.name][OURS]), runs_of(rows[d.name][peer.name]))
             for d in sets}, arguments.resamples)
        comparisons[peer.name] = compared
        print_comparison(peer.name, compared, sizes)
        sentences += verdicts(peer.name, compared, sizes)
    if systems:
        say(f"\n*: worse by more than two standard errors (sets of {MIN_PAIRS} pairs or more, and "
            "the two last lines)")
        say()
        for name, comparison in comparisons.items():
            differences = comparison["mean"].values()
            reached = all(d["difference"] >= 0 for d in differences)
            say(f"{'reached' if reached else 'NOT REACHED':<12}mean over sets ahead of {name}: "
                + ", ".join(f"{d['difference']:+.1f} ± {d['standard_error']:.1f}"
                            for d in differences))
        say("\n" + ("\n".join(sentences) if sentences else
                    "no mean lower than a peer's, no set worse by more than two standard errors"))
    return {"mode": "pipelines", "sets": summaries, "mean": mean, "comparisons": comparisons,
            "worse": sentences, "reports": reports, "pairs": rows,
            "peers": {peer.name: peer.key for peer in systems}}


def write_report(arguments, names, extra):
    """Runs compare_colmap, which writes its report, and returns its exit status."""
    program = os.path.join(datasets.ROOT, "tools", "compare_colmap", "compare_colmap")
    lists = [os.path.join(datasets.data_dir(), name, "pairs.txt") for name in names]
    some = ["--max-pairs", str(QUICK_PAIRS)] if arguments.quick else []
    jobs = ["--jobs", str(len(os.sched_getaffinity(0)))]
    return subprocess.run([sys.executable, program, *lists, "-o", arguments.report, *some, *jobs,
                           *extra], check=False).returncode


def main():
    own, extra = sys.argv[1:], []
    if "--" in own:
        own, extra = own[:own.index("--")], own[own.index("--") + 1:]
    parser = argparse.ArgumentParser(
        prog="scripts/accuracy", description=__doc__,
        epilog="Options after -- go to `twoview evaluate`, with --report to compare_colmap.")
    parser.add_argument("--json", metavar="F", help="write everything, every pair included")
    parser.add_argument("--sets", help="names, separated by commas (default: all with pairs)")
    parser.add_argument("--quick", action="store_true",
                        help=f"at most {QUICK_PAIRS} pairs a set, evenly spaced")
    parser.add_argument("--flagged", action=argparse.BooleanOptionalAction, default=True,
                        help="also pairs_flagged.txt of " + " and ".join(datasets.FLAGGED_SETS)
                        + " (default; --no-flagged leaves them out)")
    parser.add_argument("--peers", default="fast",
                        help=f"of {','.join(peers.GROUPS)} (default: fast; empty: none)")
    parser.add_argument("--seeds", type=int, default=5, help="of the peers (default 5)")
    parser.add_argument("--resamples", type=int, help="of the bootstrap (default 2000)")
    parser.add_argument("--no-cache", action="store_true",
                        help="run the peers again (.cache/accuracy keeps their results)")
    parser.add_argument("--check", action="store_true",
                        help="exit status 1 when a mean is lower than a peer's or a set is worse "
                             "by more than two standard errors")
    parser.add_argument("--program", default=PROGRAM)
    parser.add_argument("--ours", choices=("program", "library"), default="program")
    parser.add_argument("--lib", help="libtwoview.so (default: of build/release)")
    parser.add_argument("--estimators", action="store_true",
                        help="instead: all estimators on identical matches")
    parser.add_argument("--matches", default="ours,sift",
                        help="with --estimators: whose matches, ours, sift (OpenCV's RootSIFT) or "
                             "both (default)")
    parser.add_argument("--kinds", help="with --estimators: only these peers, of "
                        + ",".join(estimators.PEERS))
    parser.add_argument("--options", nargs="+", metavar="KEY=VALUE",
                        help="with --estimators: fields of tv_estimate_options for ours")
    parser.add_argument("--thresholds", default="0.5,1,2",
                        help="with --estimators: pixels; each peer counts at its best")
    parser.add_argument("--robust500", action="store_true",
                        help="instead: the robust estimate beside PoseLib's on simulated matches")
    parser.add_argument("--report", metavar="DIR",
                        help="instead: every pair through every system, as one page "
                             "(docs/compare.md)")
    arguments = parser.parse_args(own)
    if arguments.robust500:
        sys.exit(0 if robust500.run(arguments.lib) else 1)
    arguments.extra = extra
    arguments.thresholds = [float(t) for t in arguments.thresholds.split(",")]
    if not arguments.resamples:
        arguments.resamples = QUICK_RESAMPLES if arguments.quick else 2000

    names = arguments.sets.split(",") if arguments.sets else datasets.all_sets()
    if not names:
        sys.exit(f"accuracy: no sets with pairs in {datasets.data_dir()}; set TWOVIEW_DATA")
    missing = set(names) - set(datasets.all_sets())
    if missing:
        sys.exit(f"accuracy: no pairs.txt in {', '.join(sorted(missing))}; there are "
                 f"{', '.join(datasets.all_sets())}")
    if arguments.report:
        sys.exit(write_report(arguments, names, extra))
    if not arguments.estimators and arguments.ours == "program":
        if not os.access(arguments.program, os.X_OK):
            sys.exit(f"accuracy: {arguments.program} is not built: scripts/test builds it")
    sets = [datasets.Set(os.path.join(datasets.data_dir(), name), flagged=arguments.flagged,
                         max_pairs=QUICK_PAIRS if arguments.quick else None) for name in names]
    result = (identical.compare if arguments.estimators else compare_pipelines)(arguments, sets)
    result["machine"] = machine()
    result["protocol"] = {
        "cap": peers.CAP, "ratio": peers.RATIO, "seeds": arguments.seeds,
        "resamples": arguments.resamples, "flagged": arguments.flagged,
        "quick": arguments.quick, "resize": {d.name: d.resize for d in sets}}
    if arguments.json:
        with open(arguments.json + ".part", "w", encoding="utf-8") as f:
            json.dump(metrics.finite(result), f, allow_nan=False)
        os.replace(arguments.json + ".part", arguments.json)
    if arguments.check and result.get("worse"):
        sys.exit(1)


if __name__ == "__main__":
    main()
