#!/usr/bin/env python3
"""Pose accuracy of `twoview evaluate` and of peers on the same pairs: tables, and the paired
comparison. See docs/accuracy.md."""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # before numpy: one thread
    os.environ.setdefault(_name, "1")

import argparse
import json
import platform
import shutil
import subprocess
import sys
import tempfile

import numpy as np

import datasets
import estimators
import metrics
import peers
import pipeline

PROGRAM = os.path.join(datasets.ROOT, "build", "release", "bin", "twoview")
OURS = "twoview"
MIN_PAIRS = 15      # sets of at least so many pairs count by themselves
QUICK_PAIRS = 8
QUICK_RESAMPLES = 1000
ERRORS = ("rotation_error_deg", "translation_error_deg", "translation_error_signed_deg",
          "pose_error_deg")


def say(text="", end="\n"):
    print(text, end=end, flush=True)


def progress(name):
    def report(done, total):
        if sys.stderr.isatty():
            print(f"\r  {name}: {done}/{total}  ", end="" if done < total else "\r\033[K",
                  file=sys.stderr, flush=True)
    return report


# ---- ours --------------------------------------------------------------------------------------

def run_program(program, data, extra):
    """Rows of `twoview evaluate` on a set, and the report without its pairs."""
    with tempfile.TemporaryDirectory() as folder:
        pairs_file = data.pair_files[0]
        if len(data.pair_files) > 1 or len(data.pairs) != len(datasets.read_pairs(pairs_file)):
            pairs_file = os.path.join(folder, "pairs.txt")
            with open(pairs_file, "w", encoding="utf-8") as f:
                f.writelines(pair.line + "\n" for pair in data.pairs)
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
    """The same through libtwoview.so, without the program (options of the command line do not
    apply)."""
    if extra:
        sys.exit("accuracy: --ours library takes no options of the program")
    rows = pipeline.evaluate_pairs(data.dir, library=path, resize=data.resize,
                                   flagged=len(data.pair_files) > 1, max_pairs=data.max_pairs)
    return rows, {}


# ---- numbers -----------------------------------------------------------------------------------

def time_ms(row):
    return row["time_ms"] if "time_ms" in row else sum(row["ms"].values())


def runs_of(rows):
    """Pose errors, seeds x pairs."""
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
    """Mean over sets, each set with the same weight."""
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
    """Sentences: where ours is worse by more than two standard errors, or its mean is lower."""
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


# ---- estimators on identical matches -----------------------------------------------------------

def compare_estimators(arguments, sets):
    """Every estimator at every threshold on the same matches, ours and the peers'."""
    import time

    import twoview_ctypes
    library = twoview_ctypes.Library(arguments.lib)
    kinds = [OURS] + [k for k, (_, module, _) in estimators.PEERS.items() if has_module(module)]
    table = {}
    per_set = {}
    for data in sets:
        if arguments.matches == "ours":
            context = pipeline.make_context(library, data)
            matched = pipeline.match_pairs(context, data)
        else:
            peer = peers.Peer(peers.GROUPS["poselib"][0], use_cache=False)
            features = {}
            matched = [(m, {"extract": e, "match": f, "keypoints": n}) for m, e, f, n in
                       (peer.matches(data, pair, features) for pair in data.pairs)]
            context = pipeline.make_context(library, data)
        summaries = {}
        for kind in kinds:
            for threshold in arguments.thresholds:
                rows = pipeline.evaluate_matches(
                    data, matched, {"max_error_px": threshold},
                    "twoview" if kind == OURS else kind, context, arguments.seeds)
                for row in rows:
                    row["time_ms"] = row["ms"]["estimate"]
                title = OURS if kind == OURS else estimators.PEERS[kind][0]
                name = f"{title} {threshold:g} px"
                summaries[name] = summarise(rows)
                table.setdefault(name, {})[data.name] = rows
        per_set[data.name] = summaries
        print_table(f"{data.name}: {len(data.pairs)} pairs, identical matches "
                    f"({arguments.matches})", summaries)
    mean = {name: mean_summary([per_set[d.name][name] for d in sets]) for name in table}
    print_table(f"mean over {len(sets)} sets, identical matches ({arguments.matches})", mean)
    say("\nms: median of the estimator alone. Peers see the matches shuffled, "
        f"{arguments.seeds} seeds; ours another seed each time.")
    comparisons = {}
    for threshold in arguments.thresholds:
        first = f"{OURS} {threshold:g} px"
        for name in table:
            if not name.startswith(OURS) and name.endswith(f" {threshold:g} px"):
                compared = metrics.paired_bootstrap(
                    {s: (runs_of(table[first][s]), runs_of(table[name][s])) for s in table[name]},
                    arguments.resamples)
                comparisons[name] = compared
                m = compared["mean"]
                say(f"  {first} minus {name:<48} " + "  ".join(
                    f"AUC{t} {d['difference']:+5.1f} ±{d['standard_error']:.1f}"
                    for t, d in m.items()))
    return {"mode": "estimators", "matches": arguments.matches, "sets": per_set, "mean": mean,
            "comparisons": comparisons}


def has_module(module):
    try:
        estimators.module_version(module)
    except ImportError:
        return False
    return True


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
        say("\n" + ("\n".join(sentences) if sentences else
                    "no mean lower than a peer's, no set worse by more than two standard errors"))
    return {"mode": "pipelines", "sets": summaries, "mean": mean, "comparisons": comparisons,
            "worse": sentences, "reports": reports, "pairs": rows,
            "peers": {peer.name: peer.key for peer in systems}}


def main():
    own, extra = sys.argv[1:], []
    if "--" in own:
        own, extra = own[:own.index("--")], own[own.index("--") + 1:]
    parser = argparse.ArgumentParser(
        prog="scripts/accuracy", description=__doc__,
        epilog="Options after -- go to `twoview evaluate`.")
    parser.add_argument("--json", metavar="F", help="write everything, every pair included")
    parser.add_argument("--sets", help="names, separated by commas (default: all with pairs)")
    parser.add_argument("--quick", action="store_true",
                        help=f"at most {QUICK_PAIRS} pairs a set, evenly spaced")
    parser.add_argument("--flagged", action="store_true",
                        help="also pairs_flagged.txt of " + " and ".join(datasets.FLAGGED_SETS))
    parser.add_argument("--peers", default="fast",
                        help=f"of {','.join(peers.GROUPS)} (default: fast; empty: none)")
    parser.add_argument("--seeds", type=int, default=3, help="of the peers (default 3)")
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
    parser.add_argument("--matches", choices=("ours", "sift"), default="ours",
                        help="with --estimators: whose matches (sift: OpenCV's RootSIFT)")
    parser.add_argument("--thresholds", default="0.5,1,2", help="with --estimators: pixels")
    arguments = parser.parse_args(own)
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
    if not arguments.estimators and arguments.ours == "program":
        if not os.access(arguments.program, os.X_OK):
            sys.exit(f"accuracy: {arguments.program} is not built: scripts/test builds it")
    sets = [datasets.Set(os.path.join(datasets.data_dir(), name), flagged=arguments.flagged,
                         max_pairs=QUICK_PAIRS if arguments.quick else None) for name in names]
    result = (compare_estimators if arguments.estimators else compare_pipelines)(arguments, sets)
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
