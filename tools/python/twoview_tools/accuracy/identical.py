"""Compares estimators on identical matches: ours with its defaults, each peer with its best
threshold among those given. Verdict lines say whether the project's targets are reached. See
docs/accuracy.md."""

import hashlib
import json
import os
import time

import numpy as np

from . import (datasets, estimators, leaveout, metrics, peers, pipeline, system_python, tables,
               twoview_ctypes)
from .tables import MIN_PAIRS, OURS, say

CACHE_FORMAT = 1  # increase it if a change here or in estimators.py changes results
COLUMNS = ("num_inliers", "ms", "rotation_error_deg", "translation_error_deg",
           "translation_error_signed_deg", "pose_error_deg")
MATCHES_TITLE = {"ours": "our matches", "sift": "OpenCV's RootSIFT matches"}


class Estimator:
    """A peer that runs in this Python or in the system's Python."""

    def __init__(self, kind, version, system):
        self.kind, self.version, self.system = kind, version, system
        title, self.module, _ = estimators.PEERS[kind]
        library, rest = title.split(" ", 1)
        self.name = f"{library} {version} {rest}"
        # Only the best row of each family counts in the verdict; OpenGV's rows are shown but do not
        # count.
        self.counts = self.module != "pyopengv"

    def run(self, list_of_matches, threshold_px, num_seeds):
        if self.system:
            return system_python.run(self.kind, list_of_matches, threshold_px, num_seeds)
        found = []
        for matches in list_of_matches:
            found.append([])
            for seed in range(num_seeds):
                start = time.perf_counter()
                pose = estimators.run_peer(self.kind, matches, threshold_px, seed)
                ms = 1e3 * (time.perf_counter() - start)
                found[-1].append((*pose, ms) if pose else (None, None, 0, ms))
        return found


def available(kinds=None):
    """(estimators that are installed, a line of text about each one that is not)."""
    have, absent = [], []
    system = system_python.versions()
    for kind, (title, module, _) in estimators.PEERS.items():
        if kinds and kind not in kinds:
            continue
        here = None
        if module != "pyopengv":
            try:
                here = estimators.module_version(module)
                have.append(Estimator(kind, here, system=False))
            except ImportError:
                absent.append(f"{title}: not installed (scripts/bootstrap bench)")
        if module in ("cv2", "pyopengv"):
            package = {"cv2": "python3-opencv", "pyopengv": "python3-opengv"}[module]
            if module not in system:
                absent.append(f"{title} of the system's Python: not installed "
                              f"(Debian's {package})")
            elif system[module] != here:
                have.append(Estimator(kind, system[module], system=True))
    return have, absent


def _key(matches, pair):
    text = hashlib.sha256()
    for array in (matches.pixels0, matches.pixels1, pair.R, pair.t,
                  *(np.asarray(part, float) for camera in matches.cameras for part in camera)):
        text.update(np.ascontiguousarray(array, float).tobytes())
    text.update(repr([tuple(int(x) for x in size) for size in matches.sizes]).encode())
    return text.hexdigest()


def peer_rows(estimator, data, matched, thresholds, num_seeds, use_cache=True):
    """{threshold: rows}, read from .cache/accuracy if they are stored there."""
    key = {"kind": estimator.kind, "version": estimator.version, "format": CACHE_FORMAT,
           "confidence": estimators.CONFIDENCE, "max_iterations": estimators.MAX_ITERATIONS}
    name = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:16]
    path = os.path.join(peers.CACHE_DIR, f"identical-{data.name}-{name}.json")
    stored = {}
    if use_cache and os.path.isfile(path):
        with open(path, encoding="utf-8") as f:
            stored = json.load(f)
    keys = [_key(matches, pair) for pair, (matches, _) in zip(data.pairs, matched)]
    result = {}
    for threshold in thresholds:
        label = f"{threshold:g}"
        todo = [i for i, k in enumerate(keys) if len(stored.get(k, {}).get(label, [])) < num_seeds]
        if todo:
            found = estimator.run([matched[i][0] for i in todo], threshold, num_seeds)
            for i, seeds in zip(todo, found):
                pair, lines = data.pairs[i], []
                for R, t, inliers, ms in seeds:
                    row = {"num_inliers": inliers, "ms": ms,
                           **metrics.pose_error(R, t, pair.R, pair.t)}
                    lines.append([row[c] for c in COLUMNS])
                stored.setdefault(keys[i], {})[label] = metrics.finite(lines)
            if use_cache:
                os.makedirs(peers.CACHE_DIR, exist_ok=True)
                with open(path + ".part", "w", encoding="utf-8") as f:
                    json.dump(stored, f, allow_nan=False)
                os.replace(path + ".part", path)
        result[threshold] = [
            _row(data, pair, matches, seed, stored[k][label][seed])
            for k, pair, (matches, _) in zip(keys, data.pairs, matched)
            for seed in range(num_seeds)]
    return result


def _row(data, pair, matches, seed, line):
    values = {c: np.inf if v is None else v for c, v in zip(COLUMNS, line)}
    return {"set": data.name, "name0": pair.name0, "name1": pair.name1, "seed": seed,
            "num_matches": len(matches), "time_ms": values.pop("ms"),
            "precision": metrics.precision(matches.rays0, matches.rays1, pair.R, pair.t), **values}


def sift_matches(data, use_cache=True):
    """OpenCV's RootSIFT matches of a set, in the form of pipeline.match_pairs."""
    peer = peers.Peer({**peers.SIFT, "estimator": "poselib"}, use_cache=False)
    keys = [peer.pair_key(data, pair) for pair in data.pairs]
    name = hashlib.sha256("".join(keys).encode()).hexdigest()[:16]
    path = os.path.join(peers.CACHE_DIR, f"matches-{data.name}-{name}.npz")
    if not (use_cache and os.path.isfile(path)):
        arrays, shared = {}, {}
        for i, pair in enumerate(data.pairs):
            m, extract_ms, match_ms, keypoints = peer.matches(data, pair, shared)
            arrays.update({f"{i}_0": m.pixels0, f"{i}_1": m.pixels1, f"{i}_ratios": m.ratios,
                           f"{i}_stage": np.array([extract_ms, match_ms, keypoints])})
        os.makedirs(peers.CACHE_DIR, exist_ok=True)
        np.savez(path + ".part.npz", **arrays)
        os.replace(path + ".part.npz", path)
    found = []
    with np.load(path) as arrays:
        for i, pair in enumerate(data.pairs):
            sizes = [data.gray(n)[0].shape[::-1] for n in (pair.name0, pair.name1)]
            matches = estimators.Matches(
                arrays[f"{i}_0"], arrays[f"{i}_1"],
                (data.camera(pair, 0), data.camera(pair, 1)), sizes, arrays[f"{i}_ratios"])
            found.append((matches, dict(zip(("extract", "match", "keypoints"),
                                            arrays[f"{i}_stage"]))))
    return found


def our_rows(library, data, matched, options, num_seeds):
    most = max([len(m) for m, _ in matched] + [1])
    context = twoview_ctypes.Context(library, max_width=64, max_height=64, max_matches=most)
    rows = pipeline.evaluate_matches(data, matched, options, "twoview", context, num_seeds)
    for row in rows:
        row["time_ms"] = row["ms"]["estimate"]
    return rows


# ---- verdicts ------------------------------------------------------------------------------------

def mean_auc(rows_of_sets):
    """{threshold in degrees: AUC, averaged over the sets of each group, then over the groups}."""
    return {f"{t:g}": float(leaveout.mean_of_groups(
        {s: metrics.auc_of_runs(tables.runs_of(rows), t) for s, rows in rows_of_sets.items()}))
            for t in metrics.THRESHOLDS_DEG}


def best_threshold(by_threshold):
    """The threshold with the largest mean of AUC5, 10 and 20 over all sets; the lower one on a tie.
    by_threshold: {threshold: {set: rows}}."""
    return max(sorted(by_threshold), key=lambda t: sum(mean_auc(by_threshold[t]).values()))


def medians(rows_of_sets, field):
    """(median over all pairs and seeds, mean over the sets of each set's median)."""
    values = {s: [r[field] for r in rows] for s, rows in rows_of_sets.items()}
    return (float(np.median([v for part in values.values() for v in part])),
            float(np.mean([np.median(v) for v in values.values()])))


def judge(ours, rivals, poselib, resamples):
    """Returns [(reached, sentence)]. ours: {set: rows}. rivals: {name: {set: rows}}. poselib: the
    name of PoseLib's row among them, or None."""
    found = []
    runs = lambda rows_of_sets: {s: tables.runs_of(rows) for s, rows in rows_of_sets.items()}
    mine = runs(ours)
    compared = {}
    for name, theirs in rivals.items():
        other = runs(theirs)
        compared[name] = metrics.paired_bootstrap({s: (mine[s], other[s]) for s in mine},
                                                  resamples,
                                                  groups=datasets.by_group(list(mine)))
    groups = datasets.by_group(list(ours))
    for group, members in groups.items():
        within = lambda rows_of_sets, members=members: {s: rows_of_sets[s] for s in members}
        for t in metrics.THRESHOLDS_DEG:
            key = f"{t:g}"
            value = {name: mean_auc(within(rows))[key] for name, rows in rivals.items()}
            best = max(value, key=value.get)
            d = compared[best]["groups"][group][key]
            found.append((d["difference"] >= 0,
                          f"group {group}, mean AUC{key} {mean_auc(within(ours))[key]:.1f}, the "
                          f"best peer {value[best]:.1f} ({best}): {d['difference']:+.2f} "
                          f"± {d['standard_error']:.2f}"))
    for s in ours:
        if mine[s].shape[1] < MIN_PAIRS:
            continue
        reached, parts = True, []
        for t in metrics.THRESHOLDS_DEG:
            key = f"{t:g}"
            auc = {name: metrics.auc_of_runs(tables.runs_of(rows[s]), t)
                   for name, rows in rivals.items()}
            best = max(auc, key=auc.get)
            d = compared[best]["sets"][s][key]
            reached = reached and not d["worse"]
            parts.append(f"AUC{key} {d['difference']:+.1f} ± {d['standard_error']:.1f} ({best})")
        found.append((reached, f"{s}: against the best there: " + ", ".join(parts)))
    if poselib:
        for field, title in (("rotation_error_deg", "rotation"),
                             ("translation_error_deg", "translation")):
            pooled, mean = medians(ours, field)
            their_pooled, their_mean = medians(rivals[poselib], field)
            found.append((pooled <= their_pooled and mean <= their_mean,
                          f"median {title} error [deg]: all pairs {pooled:.3f} (PoseLib "
                          f"{their_pooled:.3f}), mean of the sets' medians {mean:.3f} "
                          f"({their_mean:.3f})"))
    return found, compared


# ---- the whole comparison ------------------------------------------------------------------------

def compare(arguments, sets):
    library = twoview_ctypes.Library(arguments.lib)
    kinds = arguments.kinds.split(",") if arguments.kinds else None
    systems, absent = available(kinds)
    result = {"mode": "estimators", "matches": {}, "absent": absent, "worse": []}
    for source in arguments.matches.split(","):
        result["matches"][source] = compare_source(arguments, sets, library, systems, source)
    for line in absent:
        say(f"absent: {line}")
    say("\nms: median of the estimator alone, one thread; rows from the cache keep the time of the "
        f"run that made\nthem. Peers see the matches shuffled, {arguments.seeds} seeds; ours the "
        "same order, another seed each time.")
    say(f"Every peer at its best of {', '.join(f'{t:g}' for t in arguments.thresholds)} px over "
        "all sets together; ours at its default.\n")
    for source, part in result["matches"].items():
        for reached, sentence in part["verdicts"]:
            line = f"{source}: {sentence}"
            say(f"{'reached' if reached else 'NOT REACHED':<12}{line}")
            if not reached:
                result["worse"].append(line)
    return result


def compare_source(arguments, sets, library, systems, source):
    ours, theirs = {}, {}  # {set: rows}; {system: {threshold: {set: rows}}}
    options = dict(item.split("=", 1) for item in arguments.options or [])
    for data in sets:
        if source == "ours":
            matched = pipeline.match_pairs(pipeline.make_context(library, data), data)
        else:
            matched = sift_matches(data, not arguments.no_cache)
        ours[data.name] = our_rows(library, data, matched, options, arguments.seeds)
        for done, system in enumerate(systems):
            report = tables.progress(f"{source}, {data.name}, {system.name}")
            report(done, len(systems) + 1)
            rows = peer_rows(system, data, matched, arguments.thresholds, arguments.seeds,
                             not arguments.no_cache)
            for threshold, part in rows.items():
                theirs.setdefault(system.name, {}).setdefault(threshold, {})[data.name] = part
        tables.progress("")(1, 1)
    best = {name: best_threshold(part) for name, part in theirs.items()}
    title = {name: f"{name} {best[name]:g} px" for name in theirs}
    chosen = {name: theirs[name][best[name]] for name in theirs}
    for data in sets:
        tables.print_table(
            f"{data.name}: {len(data.pairs)} pairs, {MATCHES_TITLE[source]}",
            {OURS: tables.summarise(ours[data.name]),
             **{title[n]: tables.summarise(rows[data.name]) for n, rows in chosen.items()}})
    summaries = {data.name: {OURS: tables.summarise(ours[data.name])} for data in sets}
    for name, parts in theirs.items():
        for threshold, rows in parts.items():
            label = f"{name} {threshold:g} px{' *' if threshold == best[name] else ''}"
            for data in sets:
                summaries[data.name][label] = tables.summarise(rows[data.name])
    means = tables.print_means(summaries, list(summaries[sets[0].name]),
                               f", {MATCHES_TITLE[source]} (*: the best of that peer)")
    counting = {title[s.name]: chosen[s.name] for s in systems if s.counts}
    poselib = next((title[s.name] for s in systems if s.module == "poselib"), None)
    verdicts, compared = [], {}
    if counting:
        verdicts, compared = judge(ours, counting, poselib, arguments.resamples)
    if compared:
        say(f"\n{OURS} minus each peer at its best, mean of the groups: AUC5, AUC10, AUC20")
        for name, c in compared.items():
            say(f"  {name:<58} " + "  ".join(
                f"{d['difference']:+6.2f} ±{d['standard_error']:5.2f}"
                for d in c["group_mean"].values()))
    mean = {n: tables.mean_summary([part[n] for part in summaries.values()])
            for n in summaries[sets[0].name]}
    return {"mean": mean, "means": means, "best_px": best, "verdicts": verdicts,
            "comparisons": compared}
