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

from . import (datasets, effort, estimators, grid, homography, identical, metrics, peers, pipeline,
               robust500, targets, verdicts)
from .tables import (MIN_PAIRS, OURS, machine, mean_summary, print_means, print_table, progress,
                    runs_of, say, summarise)

PROGRAM = os.path.join(datasets.ROOT, "build", "release", "bin", "twoview")
PEERS = "sift,poselib,colmap"
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


def run_library(path, data, extra, cap):
    """Evaluates a set through libtwoview.so. Returns its rows and an empty report. `extra`, options
    of `twoview evaluate`, must be empty."""
    if extra:
        sys.exit("accuracy: --ours library takes no options of the program")
    options = {"max_keypoints": cap} if cap != peers.CAP else None
    rows = pipeline.evaluate_pairs(data.dir, options, library=path, resize=data.resize,
                                   flagged=len(data.pair_files) > 1, max_pairs=data.max_pairs)
    return rows, {}


# ---- the paired comparison ---------------------------------------------------------------------

def print_comparison(peer, compared, sizes):
    say(f"\n{OURS} minus {peer}: difference of AUC, standard error, 95 % interval")
    width = max([len(name) for name in sizes] + [18])

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
    members = datasets.by_group(list(sizes))
    for group, differences in compared["groups"].items():
        row(f"group {group}", len(members[group]), differences, True)
    row("mean of the groups", len(members), compared["group_mean"], True)
    row("all pairs", sum(sizes.values()), compared["pooled"], True)


# ---- whole pipelines ---------------------------------------------------------------------------

def compare_pipelines(arguments, sets):
    families = [name for name in arguments.peers.split(",") if name]
    for name in families:
        if name not in peers.FAMILIES:
            sys.exit(f"accuracy: no peer {name!r}; there are {', '.join(peers.FAMILIES)}")
    use_cache = not arguments.no_cache
    rows = {data.name: {} for data in sets}
    summaries, reports, systems, chosen = {}, {}, [], {}
    for data in sets:
        if arguments.ours == "program":
            capped = ["--max-keypoints", str(arguments.cap)] if arguments.cap != peers.CAP else []
            ours, report = run_program(arguments.program, data, capped + arguments.extra)
        else:
            ours, report = run_library(arguments.lib, data, arguments.extra, arguments.cap)
        rows[data.name][OURS], reports[data.name] = ours, report
        progress("twoview")(len(reports), len(sets))
    for family in families:
        peer, found, text = peers.choose(family, sets, arguments.seeds,
                                         arguments.peer_options == "best", use_cache,
                                         arguments.jobs, arguments.cap)
        systems.append(peer)
        chosen[peer.name] = text
        say(f"{family}: {peer.name}, {text}")
        for name, part in found.items():
            rows[name][peer.name] = part
    for data in sets:
        summaries[data.name] = {name: summarise(r) for name, r in rows[data.name].items()}
        size = f"long side {data.resize}" if data.resize else "native size"
        print_table(f"{data.name} ({datasets.group_of(data.name)}): {len(data.pairs)} pairs, "
                    f"{size}", summaries[data.name])
        if reports[data.name].get("auc"):
            for t, value in summaries[data.name][OURS]["auc"].items():
                if abs(reports[data.name]["auc"][t] - value) > 0.01:
                    say(f"  note: the program's own AUC{t} is "
                        f"{reports[data.name]['auc'][t]:.3f}, from its pairs {value:.3f}")
    names = [OURS] + [peer.name for peer in systems]
    means = print_means(summaries, names)
    say("\nmatches: mean; ms: median of a pair, one thread (peers: CPU time); fail: pairs without "
        "a pose.\n"
        f"Peers: mean over {arguments.seeds} seeds that shuffle the matches; their gradient "
        "orientation and\nmatching run in numpy, so their ms are no measure of OpenCV's speed: "
        "scripts/bench is.")
    sizes = {data.name: len(data.pairs) for data in sets}
    comparisons = {}
    for peer in systems:
        comparisons[peer.name] = metrics.paired_bootstrap(
            {d.name: (runs_of(rows[d.name][OURS]), runs_of(rows[d.name][peer.name]))
             for d in sets}, arguments.resamples, groups=datasets.by_group(list(sizes)))
        print_comparison(peer.name, comparisons[peer.name], sizes)
    if systems:
        say(f"\n*: worse by more than two standard errors (sets of {MIN_PAIRS} pairs or more, and "
            "the last lines)")
    judged = targets.judge({d.name: rows[d.name][OURS] for d in sets},
                           {peer.name: {d.name: rows[d.name][peer.name] for d in sets}
                            for peer in systems}, comparisons)
    say()
    for reached, sentence in judged:
        say(f"{'' if reached is None else 'reached' if reached else 'NOT REACHED':<12}{sentence}")
    return {"mode": "pipelines", "sets": summaries, "means": means,
            "mean": {n: mean_summary([summaries[d.name][n] for d in sets]) for n in names},
            "comparisons": comparisons,
            "targets": judged, "worse": [text for ok, text in judged if ok is False],
            "reports": reports, "pairs": rows, "chosen": chosen,
            "peers": {peer.name: peer.key for peer in systems}}


def write_report(arguments, names, extra):
    """Runs compare_colmap, which writes its report, and returns its exit status."""
    program = os.path.join(datasets.ROOT, "tools", "compare_colmap", "compare_colmap")
    lists = [os.path.join(datasets.data_dir(), name, "pairs.txt") for name in names]
    some = ["--max-pairs", str(arguments.max_pairs)] if arguments.max_pairs else []
    jobs = ["--jobs", str(len(os.sched_getaffinity(0)))]
    return subprocess.run([sys.executable, program, *lists, "-o", arguments.report, *some, *jobs,
                           *extra], check=False).returncode


def main():
    own, extra = sys.argv[1:], []
    # Commands of their own, each with its own --help.
    if "--grid" in own:
        return grid.main(own)
    # --verdicts has an option --effort of its own.
    for flag, command in (("--homography", homography.main), ("--verdicts", verdicts.main),
                          ("--effort", effort.main)):
        if flag in own:
            return command([word for word in own if word != flag])
    if "--" in own:
        own, extra = own[:own.index("--")], own[own.index("--") + 1:]
    parser = argparse.ArgumentParser(
        prog="scripts/accuracy", description=__doc__,
        epilog="Options after -- go to `twoview evaluate`, with --report to compare_colmap. "
               "Commands of their own, each with --help: --grid FILE (options chosen by leaving "
               "one set out), --homography (matches of planar pairs), --verdicts (unrelated "
               "pictures, and the verdict against the error), --effort (the rungs of effort).")
    parser.add_argument("--json", metavar="F", help="write everything, every pair included")
    parser.add_argument("--sets", help="names, separated by commas (default: all with pairs)")
    parser.add_argument("--groups", help="only the sets of the group narrow, or wide")
    parser.add_argument("--quick", action="store_true",
                        help=f"at most {QUICK_PAIRS} pairs a set, evenly spaced")
    parser.add_argument("--max-pairs", type=int, metavar="N",
                        help="at most N pairs a set, evenly spaced (default: all)")
    parser.add_argument("--flagged", action=argparse.BooleanOptionalAction, default=True,
                        help="also pairs_flagged.txt of " + " and ".join(datasets.FLAGGED_SETS)
                        + " (default; --no-flagged leaves them out)")
    parser.add_argument("--peers", default=PEERS,
                        help=f"of {','.join(peers.FAMILIES)} (default: {PEERS}; empty: none)")
    parser.add_argument("--peer-options", choices=("best", "usual"), default="best",
                        help="each peer at its best front end, ratio and threshold over all sets "
                             "(default), or at the usual ones")
    parser.add_argument("--cap", type=int, default=peers.CAP, metavar="N",
                        help=f"descriptors of an image, ours and the peers' (default {peers.CAP})")
    parser.add_argument("--jobs", type=int, default=1, help="processes of the peers (default 1)")
    parser.add_argument("--seeds", type=int, default=5, help="of the peers (default 5)")
    parser.add_argument("--resamples", type=int, help="of the bootstrap (default 2000)")
    parser.add_argument("--no-cache", action="store_true",
                        help="run the peers again (.cache/accuracy keeps their results)")
    parser.add_argument("--check", action="store_true",
                        help="exit status 1 when one of the last lines says NOT REACHED")
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
    if arguments.quick and not arguments.max_pairs:
        arguments.max_pairs = QUICK_PAIRS
    if not arguments.resamples:
        arguments.resamples = QUICK_RESAMPLES if arguments.quick else 2000

    try:
        names = datasets.select_sets(arguments.sets, arguments.groups)
    except ValueError as error:
        sys.exit(f"accuracy: {error}")
    if arguments.report:
        sys.exit(write_report(arguments, names, extra))
    if not arguments.estimators and arguments.ours == "program":
        if not os.access(arguments.program, os.X_OK):
            sys.exit(f"accuracy: {arguments.program} is not built: scripts/test builds it")
    sets = [datasets.Set(os.path.join(datasets.data_dir(), name), flagged=arguments.flagged,
                         max_pairs=arguments.max_pairs) for name in names]
    result = (identical.compare if arguments.estimators else compare_pipelines)(arguments, sets)
    result["machine"] = machine()
    result["protocol"] = {
        "cap": arguments.cap, "peer_options": arguments.peer_options, "seeds": arguments.seeds,
        "resamples": arguments.resamples, "flagged": arguments.flagged,
        "max_pairs": arguments.max_pairs, "resize": {d.name: d.resize for d in sets}}
    if arguments.json:
        with open(arguments.json + ".part", "w", encoding="utf-8") as f:
            json.dump(metrics.finite(result), f, allow_nan=False)
        os.replace(arguments.json + ".part", arguments.json)
    if arguments.check and result.get("worse"):
        sys.exit(1)


if __name__ == "__main__":
    main()
