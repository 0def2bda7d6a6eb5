#!/usr/bin/env python3
"""What the rungs of effort find and take on pairs with a true pose.

  scripts/accuracy --effort --jobs 2
  scripts/python -m twoview_tools.accuracy.effort --sets fox_wall,tankard --json F

Each pair goes through tv_reconstruct with its defaults, the set's camera as given: on each rung
alone ("0" to "3"), and from rung 0 to 3 while the verdict is not "ok" ("auto", the program's
default). A pose is wrong where the larger of the rotation's and the direction's angle (with its
sign) is above 5 degrees, and right where it is at most 2. ms: CPU time of a pair, the mean.

The last table asks whether a climb despite an "ok" would pay: where probability_wrong of rung 0 is
above a threshold, rung 2 is run as well (and 3, where 2 is not "ok"), and its pose is taken where
it is "ok", too. The threshold of each set is the one of the best mean AUC over all other sets
("left out").
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import json
import sys
import time

import numpy as np

from . import datasets, metrics, parallel, reliability, tables, twoview_ctypes

RUNGS = tuple(range(twoview_ctypes.MAX_EFFORT + 1))
# {way: fields of tv_reconstruct_options}
WAYS = {**{str(rung): {"effort": rung} for rung in RUNGS},
        "auto": {"max_effort": RUNGS[-1]}}
# As if rung 0 had been run before without an "ok": the second trial.
AGAIN = "again"
WRONG_DEG, RIGHT_DEG = 5.0, 2.0
NEVER = 1.0
THRESHOLDS = (NEVER, 0.15, 0.1, 0.05, 0.02, 0.01, 0.005, 0.0)


# ---- running -------------------------------------------------------------------------------------

def run_pair(context, data, pair, way):
    """The row of one pair and one way."""
    grays = [data.gray(name)[0] for name in (pair.name0, pair.name1)]
    cameras = [data.camera(pair, side) for side in (0, 1)]
    lenses = [twoview_ctypes.make_camera(K, *gray.shape[::-1], distortion)
              for (K, distortion), gray in zip(cameras, grays)]
    fields, estimate = WAYS.get(way), {}
    if way == AGAIN:
        fields, estimate = {"effort": 2, "max_effort": RUNGS[-1]}, {"num_trials": 2}
    start = time.process_time()
    result, cloud = context.reconstruct(grays[0], lenses[0], grays[1], lenses[1],
                                        ({}, {}, estimate), **fields)
    cpu_ms = 1e3 * (time.process_time() - start)
    R = np.reshape(result.R, (3, 3)) if result.has_R else None
    t = np.array(result.t) if result.has_R and result.has_t else None
    errors = metrics.pose_error(R, t, pair.R, pair.t)
    error = max(errors["rotation_error_deg"], errors["translation_error_signed_deg"])
    row = {"set": data.name, "name0": pair.name0, "name1": pair.name1, "way": way, "seed": 0,
           **errors, "error_deg": error, "effort": cloud.effort, "num_rungs": cloud.num_rungs,
           "verdict": twoview_ctypes.enum_name("verdict", result.verdict), "cpu_ms": cpu_ms,
           "probability_wrong": result.probability_wrong, "inside": None}
    if t is not None and result.has_covariance:
        x = reliability.deviation(R, t, pair.R, pair.t / np.linalg.norm(pair.t))
        C = np.reshape(result.covariance, (5, 5))
        row["inside"] = x is not None and reliability.chi2(x, C) <= reliability.CHI2_95[5]
    return row


def run_set(work):
    """The rows of a set, every way."""
    folder, library, flagged, max_pairs = work
    data = datasets.load(folder, flagged, max_pairs)
    width, height = data.max_size()
    context = twoview_ctypes.Context(twoview_ctypes.Library(library), max_width=width,
                                     max_height=height, max_effort=RUNGS[-1])
    return [run_pair(context, data, pair, way) for pair in data.pairs for way in (*WAYS, AGAIN)]


# ---- counting ------------------------------------------------------------------------------------

def summarise(rows):
    """The numbers of the rows of one way: AUC, "ok", wrong "ok", right, right and "ok", pairs above
    rung 0, the share of the "ok" whose ellipsoid holds the truth, mean CPU time."""
    good = [r for r in rows if r["verdict"] == "ok"]
    right = [r for r in rows if r["error_deg"] <= RIGHT_DEG]
    told = [r for r in good if r["inside"] is not None]
    return {"pairs": len(rows),
            "auc": [metrics.auc([r["pose_error_deg"] for r in rows], t) for t in
                    metrics.THRESHOLDS_DEG],
            "ok": len(good), "wrong_ok": sum(not r["error_deg"] <= WRONG_DEG for r in good),
            "stated": float(sum(r["probability_wrong"] for r in good)), "right": len(right),
            "right_ok": sum(r["verdict"] == "ok" for r in right),
            "above": sum(r["effort"] > 0 for r in rows),
            "inside": float(np.mean([r["inside"] for r in told])) if told else np.nan,
            "cpu_ms": float(np.mean([r["cpu_ms"] for r in rows]))}


def mean_of(summaries):
    """The mean of AUC and time over sets, the sums of the counts."""
    found = {key: sum(s[key] for s in summaries) for key in
             ("pairs", "ok", "wrong_ok", "stated", "right", "right_ok", "above")}
    found["auc"] = [float(np.mean(column)) for column in zip(*(s["auc"] for s in summaries))]
    for key in ("inside", "cpu_ms"):
        found[key] = float(np.nanmean([s[key] for s in summaries]))
    return found


def by_pair(rows):
    """[{way: row}], a dict for each pair."""
    found = {}
    for row in rows:
        found.setdefault((row["set"], row["name0"], row["name1"]), {})[row["way"]] = row
    return list(found.values())


def with_threshold(ways, threshold):
    """The row of a pair where an "ok" of rung 0 above this probability_wrong climbs, too."""
    first, again = ways["auto"], ways[AGAIN]
    if first["num_rungs"] > 1 or first["verdict"] != "ok" or (
            first["probability_wrong"] <= threshold):
        return first
    return again if again["verdict"] == "ok" else first


def left_out(pairs):
    """[(set, threshold, AUC of "auto", AUC with the threshold)]; the threshold is that of the best
    mean AUC at 5, 10 and 20 degrees over the other sets, the highest of equal ones."""
    names = sorted({ways["auto"]["set"] for ways in pairs})
    scores = {}
    for name in names:
        mine = [ways for ways in pairs if ways["auto"]["set"] == name]
        scores[name] = {threshold: summarise([with_threshold(w, threshold) for w in mine])["auc"]
                        for threshold in THRESHOLDS}
    lines = []
    for name in names:
        others = [scores[n] for n in names if n != name]
        best = max(THRESHOLDS, key=lambda t: (round(float(np.mean([s[t] for s in others])), 9), t)
                   ) if others else NEVER
        lines.append((name, best, scores[name][NEVER], scores[name][best]))
    return lines


# ---- text ----------------------------------------------------------------------------------------

def print_summaries(title, summaries):
    tables.say(f"\n{title}")
    tables.say(f"  {'':<6} {'AUC5':>6} {'AUC10':>6} {'AUC20':>6} {'ok':>5} {'wrong':>5} "
               f"{'stated':>6} {'right':>5} {'ok':>5} {'inside%':>7} {'above 0':>7} {'ms':>7}")
    for way, s in summaries.items():
        auc = " ".join(f"{v:6.1f}" for v in s["auc"])
        tables.say(f"  {way:<6} {auc} {s['ok']:>5} {s['wrong_ok']:>5} {s['stated']:>6.2f} "
                   f"{s['right']:>5} {s['right_ok']:>5} {100 * s['inside']:>7.1f} "
                   f"{s['above']:>7} {s['cpu_ms']:>7.1f}")


def print_tables(rows):
    names = list(dict.fromkeys(row["set"] for row in rows))
    found = {name: {way: summarise([r for r in rows if r["set"] == name and r["way"] == way])
                    for way in WAYS} for name in names}
    for name, summaries in found.items():
        print_summaries(f"{name} ({datasets.group_of(name)}): {summaries['0']['pairs']} pairs",
                        summaries)
    for group, members in datasets.by_group(names).items():
        print_summaries(f"group {group}: mean of AUC, time and inside over {len(members)} sets, "
                        "sums of the counts",
                        {way: mean_of([found[name][way] for name in members]) for way in WAYS})
    auto = [r for r in rows if r["way"] == "auto"]
    print_summaries("\"auto\" by the rung of the result",
                    {str(rung): summarise(some) for rung in RUNGS
                     if (some := [r for r in auto if r["effort"] == rung])})
    tables.say("\nok, wrong: the \"ok\", and of these off by more than 5 degrees; stated: the sum "
               "of their probability_wrong;\nright, ok: poses off by at most 2 degrees, and of "
               "these the \"ok\"; inside: \"ok\" whose ellipsoid holds the truth")
    tables.say("\na climb despite an \"ok\" above a probability_wrong, which is chosen on the "
               "other sets; AUC5/10/20 without and with it")
    for name, threshold, before, after in left_out(by_pair(rows)):
        chosen = "never" if threshold == NEVER else f"{threshold:g}"
        tables.say(f"  {name:<24} {chosen:>6}  " + "/".join(f"{v:.1f}" for v in before) + "  "
                   + "/".join(f"{v:.1f}" for v in after))
    return found


def main(argv=None):
    parser = argparse.ArgumentParser(prog="scripts/accuracy --effort", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", help="names, separated by commas (default: all with pairs)")
    parser.add_argument("--groups", help="only the sets of the group narrow, or wide")
    parser.add_argument("--max-pairs", type=int, metavar="N",
                        help="at most N pairs a set, evenly spaced (default: all)")
    parser.add_argument("--flagged", action=argparse.BooleanOptionalAction, default=True,
                        help="also pairs_flagged.txt of " + " and ".join(datasets.FLAGGED_SETS))
    parser.add_argument("--lib", help="libtwoview.so (default: build/release/lib)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--json", metavar="F", help="write every pair")
    parser.add_argument("--from", dest="read", metavar="F",
                        help="print the tables of an earlier --json; nothing is run")
    arguments = parser.parse_args(argv)
    if arguments.read:
        with open(arguments.read, encoding="utf-8") as f:
            rows = json.load(f)["pairs"]
        for row in rows:  # JSON has no infinity
            for key, value in row.items():
                if key.endswith("_deg") and value is None:
                    row[key] = np.inf
        print_tables(rows)
        return
    try:
        names = datasets.select_sets(arguments.sets, arguments.groups)
    except ValueError as error:
        sys.exit(f"accuracy --effort: {error}")
    work = [(os.path.join(datasets.data_dir(), name), arguments.lib, arguments.flagged,
             arguments.max_pairs) for name in names]
    rows, report = [], tables.progress("effort", log=True)
    for done, part in enumerate(parallel.run(run_set, work, arguments.jobs), 1):
        rows += part
        report(done, len(work))
    found = print_tables(rows)
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as f:
            json.dump(metrics.finite({"sets": found, "machine": tables.machine(), "pairs": rows}),
                      f, allow_nan=False)


if __name__ == "__main__":
    main()
