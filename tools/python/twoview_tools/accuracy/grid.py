#!/usr/bin/env python3
"""Evaluates a grid of options on every set once, and chooses options by leaving one set out.

  scripts/accuracy --grid FILE --jobs 2
  scripts/python -m twoview_tools.accuracy.grid --feature levels=1,4 scale_factor=1.41,2 \\
      --feature threshold=5 --match ratio=0.87,0.92 --estimate calibration0.focal_sigma=0,0.01

--feature, --match and --estimate may be repeated. Each one is an alternative: KEY=VALUE,VALUE..
words, of which every combination is taken; the grid is every feature alternative with every match
alternative with every estimate alternative. FILE holds the same, one alternative a line:

  # comment
  feature levels=4 scale_factor=1.41 cell_px=0,24
  feature                                 # no words: the library's defaults
  match ratio=0.87,0.92
  estimate calibration0.focal_sigma=0,0.01
  point feature.levels=4 match.ratio=0.9  # besides the product: this point (commas work here, too)

--lib A.so --lib B.so takes every point with each of these builds: so constants are varied that are
no options.

For each set, the point is chosen that is best on all other sets: the largest mean of AUC5, 10 and
20, averaged within the groups narrow and wide, then over both. Its score on the set itself is the
left-out score. The tuned score is that of the point chosen on all sets. Results are kept in
.cache/accuracy by the library's bytes, the options, and each pair's images and cameras.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import functools
import hashlib
import itertools
import json
import sys

import numpy as np

from . import (datasets, leaveout, metrics, parallel, peers, pipeline, tables,
               twoview_ctypes)

STAGES = ("feature", "match", "estimate")
CACHE_FORMAT = 2  # increase it if a change here or in pipeline.py changes results
COLUMNS = ("rotation_error_deg", "translation_error_deg", "pose_error_deg", "num_matches",
           "num_inliers", "precision", "verdict")
LIMIT = 0.7  # points: the left-out mean is to be within this of the tuned mean


# ---- the grid ----------------------------------------------------------------------------------

def combinations(words):
    """[{key: value}]: every combination of KEY=VALUE,VALUE.. words; [{}] for none."""
    keys, values = [], []
    for word in words:
        key, equals, text = word.partition("=")
        if not equals or not key or not all(text.split(",")):
            raise ValueError(f"{word!r} is not KEY=VALUE,VALUE..")
        keys.append(key)
        values.append(text.split(","))
    return [dict(zip(keys, chosen)) for chosen in itertools.product(*values)]


def read_grid(lines):
    """The points of a grid file: [(feature, match, estimate)], each a dict of options."""
    alternatives, single, wanted = {stage: [] for stage in STAGES}, [], False
    for number, line in enumerate(lines, 1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        try:
            if words[0] in STAGES:
                alternatives[words[0]] += combinations(words[1:])
                wanted = True
            elif words[0] == "point":
                for combination in combinations(words[1:]):
                    point = tuple({} for _ in STAGES)
                    for key, value in combination.items():
                        stage, _, field = key.partition(".")
                        if stage not in STAGES or not field:
                            raise ValueError(f"{key!r} begins with none of "
                                             + ", ".join(s + "." for s in STAGES))
                        point[STAGES.index(stage)][field] = value
                    single.append(point)
            else:
                raise ValueError(f"a line begins with {', '.join(STAGES)} or point, "
                                 f"not {words[0]!r}")
        except ValueError as error:
            raise ValueError(f"line {number}: {error}") from None
    product = list(itertools.product(*(alternatives[s] or [{}] for s in STAGES))) if wanted else []
    return product + single


def canonical(library, point):
    """The point's options as JSON texts, one a stage, with every field of the struct: equal texts
    mean equal options."""
    texts = []
    for stage, options in zip(STAGES, point):
        fields, options = {}, dict(options)
        if stage == "match":
            fields["align_matches"] = library.take_align_matches(options)
        if stage == "estimate":
            fields["sigma_by_size"] = library.take_sigma_by_size(options)
        struct = getattr(library, stage + "_options")(options)
        for name, _ in struct._fields_[1:]:
            fields[name] = twoview_ctypes.plain(getattr(struct, name))
        texts.append(json.dumps(fields, sort_keys=True))
    return tuple(texts)


def distinct(library, points):
    """The points without those that are equal to an earlier one."""
    found = {}
    for point in points:
        found.setdefault(canonical(library, point), point)
    return list(found.values())


def title(point):
    """A point in words, as on the command line."""
    parts = [" ".join(f"{k}={v}" for k, v in options.items()) for options in point]
    return (" | ".join(f"{stage} {part}" for stage, part in zip((*STAGES, "with"), parts) if part)
            or "defaults")


# ---- evaluation ----------------------------------------------------------------------------------

def file_hash(path):
    with open(path, "rb") as f:
        return hashlib.sha256(f.read()).hexdigest()


@functools.lru_cache(maxsize=1)
def _library(path):
    library = twoview_ctypes.Library(path)
    return library, file_hash(path or twoview_ctypes.DEFAULT_LIBRARY)


def pair_key(data, pair):
    """A hash of all that a pair's result depends on besides library and options."""
    cameras = [data.camera(pair, side) for side in (0, 1)]
    text = json.dumps([pair.text, data.pixel_hash(pair.name0), data.pixel_hash(pair.name1),
                       [[K.tolist(), list(d)] for K, d in cameras]])
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _line(row):
    return metrics.finite([row[c] for c in COLUMNS])


def _row(line):
    row = dict(zip(COLUMNS, line))
    for key in COLUMNS[:3]:
        row[key] = np.inf if row[key] is None else row[key]
    return row


class Cache:
    """The results of one set at one choice of feature options:
    {match and estimate options: {pair: line}}."""

    def __init__(self, folder, data, library_hash, feature_text, use=True):
        key = hashlib.sha256(json.dumps([CACHE_FORMAT, library_hash, feature_text,
                                         data.resize]).encode()).hexdigest()[:24]
        self.path = os.path.join(folder, f"grid-{data.name}-{key}.json")
        self.use, self.lines = use, {}
        if use and os.path.isfile(self.path):
            with open(self.path, encoding="utf-8") as f:
                self.lines = json.load(f)

    def save(self):
        if not self.use:
            return
        os.makedirs(os.path.dirname(self.path), exist_ok=True)
        part = f"{self.path}.{os.getpid()}.part"
        with open(part, "w", encoding="utf-8") as f:
            json.dump(self.lines, f, allow_nan=False)
        os.replace(part, self.path)


def evaluate_points(data, library, library_hash, points, folder, use_cache=True):
    """{index: rows} of points (of which all have the same feature options) on a set. Features are
    computed once, matches once for each choice of match options, and none of both if every result
    is in the cache."""
    texts = {i: canonical(library, point) for i, point in points.items()}
    feature_options = next(iter(points.values()))[0]
    cache = Cache(folder, data, library_hash, next(iter(texts.values()))[0], use_cache)
    keys = [pair_key(data, pair) for pair in data.pairs]
    rest = {i: text[1] + text[2] for i, text in texts.items()}
    todo = {}  # {match options as text: indices}
    for i, key in rest.items():
        if any(k not in cache.lines.get(key, {}) for k in keys):
            todo.setdefault(texts[i][1], []).append(i)
    if todo:
        context = pipeline.make_context(library, data, feature_options)
        names = dict.fromkeys(n for p in data.pairs for n in (p.name0, p.name1))
        features = pipeline.extract_images(context, data, names, feature_options)
        for indices in todo.values():
            matched = pipeline.match_pairs(context, data, feature_options, points[indices[0]][1],
                                           features)
            for i in indices:
                rows = pipeline.evaluate_matches(data, matched, points[i][2], "twoview", context)
                cache.lines.setdefault(rest[i], {}).update(
                    (k, _line(row)) for k, row in zip(keys, rows))
        cache.save()
    return {i: [_row(cache.lines[key][k]) for k in keys] for i, key in rest.items()}


def _run(job):
    path, flagged, max_pairs, library_path, points, folder, use_cache = job
    data = datasets.load(path, flagged, max_pairs)
    library, library_hash = _library(library_path)
    try:
        rows = evaluate_points(data, library, library_hash, points, folder, use_cache)
    except twoview_ctypes.TwoviewError as error:
        raise RuntimeError(f"{data.name}: {title(next(iter(points.values())))}: {error}") from error
    return data.name, rows


def evaluate(names, points, library_path=None, flagged=True, max_pairs=None, jobs=1,
             use_cache=True, folder=None):
    """{set: [rows of each point]}; every pair of a set at every point, once."""
    folder = folder or peers.CACHE_DIR
    library, _ = _library(library_path)
    by_feature = {}
    for i, point in enumerate(points):
        by_feature.setdefault(canonical(library, point)[0], {})[i] = point
    work = [(os.path.join(datasets.data_dir(), name), flagged, max_pairs, library_path, part,
             folder, use_cache) for name in names for part in by_feature.values()]
    found = {name: [None] * len(points) for name in names}
    report = tables.progress("grid", log=True)

    def collect(results):
        for done, (name, rows) in enumerate(results, 1):
            for i, part in rows.items():
                found[name][i] = part
            report(done, len(work))

    collect(parallel.run(_run, work, jobs))
    return found


def score_table(rows):
    """{set: array of points x AUC5, 10, 20} from evaluate's result."""
    return {name: np.array([[metrics.auc([r["pose_error_deg"] for r in part], t)
                             for t in metrics.THRESHOLDS_DEG] for part in points])
            for name, points in rows.items()}


# ---- printing ------------------------------------------------------------------------------------

def three(values):
    return " / ".join(f"{v:4.1f}" for v in values)


def group_means(table, point):
    """[(title, AUC)] of each group and of their mean."""
    found = [(f"group {group} ({len(members)} sets)",
              np.mean([table[name][point] for name in members], axis=0))
             for group, members in datasets.by_group(list(table)).items()]
    return found + [("mean of the groups", leaveout.mean_of_groups(
        {name: scores[point] for name, scores in table.items()}))]


def print_points(points, table, top):
    score = leaveout.criterion(table)
    order = np.argsort(-score, kind="stable")
    say = tables.say
    say(f"\n{len(points)} points, the best {min(top, len(points))} by the mean of AUC5, 10 and 20 "
        "over both groups (tuned):")
    titles = [t for t, _ in group_means(table, 0)]
    say(f"  {'point':>5} {'score':>6}  " + "  ".join(f"{t:<20}" for t in titles))
    for i in order[:top]:
        say(f"  {i:>5} {score[i]:6.2f}  " + "  ".join(
            f"{three(auc):<20}" for _, auc in group_means(table, i)) + f"  {title(points[i])}")


def print_left_out(points, table, sizes, found):
    say = tables.say
    width = max([len(name) for name in table] + [18])
    say("\nleave one set out: AUC5 / 10 / 20")
    say(f"  {'':<{width}} {'n':>4}  {'left out':<18}  {'tuned':<18}  {'change':>6}  "
        "point chosen on the other sets")
    for name, s in found["sets"].items():
        change = float(np.mean(s["left_out"] - s["tuned"]))
        say(f"  {name:<{width}} {sizes[name]:>4}  {three(s['left_out'])}  {three(s['tuned'])}  "
            f"{change:+6.2f}  {s['point']:>3} {title(points[s['point']])}")
    for group, members in datasets.by_group(list(table)).items():
        out, tuned = (np.mean([found["sets"][n][k] for n in members], axis=0)
                      for k in ("left_out", "tuned"))
        say(f"  {'group ' + group:<{width}} {len(members):>4}  {three(out)}  {three(tuned)}  "
            f"{np.mean(out - tuned):+6.2f}")
    say(f"  {'mean of the groups':<{width}} {len(table):>4}  {three(found['left_out_mean'])}  "
        f"{three(found['tuned_mean'])}  {found['difference']:+6.2f}")
    say(f"\nchosen on all sets: {found['tuned']} {title(points[found['tuned']])}")
    worst = found["sets"][found["worst"]]
    loss = float(np.mean(worst["left_out"] - worst["tuned"]))
    say(f"worst set: {found['worst']}, {loss:+.2f} points" if loss < 0 else "no set loses")
    reached = found["difference"] >= -LIMIT
    say(f"{'reached' if reached else 'NOT REACHED':<12}left-out mean within {LIMIT} points of the "
        f"tuned mean: {found['difference']:+.2f}")
    return reached


def print_gain(points, rows, chosen):
    """Prints the chosen point minus the first one, with the standard error of a paired
    bootstrap. These are tuned scores."""
    errors = lambda name, point: [[r["pose_error_deg"] for r in rows[name][point]]]
    compared = metrics.paired_bootstrap(
        {name: (errors(name, chosen), errors(name, 0)) for name in rows},
        groups=datasets.by_group(list(rows)))
    tables.say(f"\npoint {chosen} minus point 0 ({title(points[0])}), tuned: AUC5, AUC10, AUC20")
    for name, differences in [*compared["groups"].items(), ("mean", compared["group_mean"])]:
        tables.say(f"  {name:<8} " + "  ".join(
            f"{d['difference']:+6.2f} ±{d['standard_error']:5.2f}" for d in differences.values()))


# ---- the command ---------------------------------------------------------------------------------

def main(argv=None):
    parser = argparse.ArgumentParser(prog="accuracy.grid", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--grid", metavar="FILE", help="alternatives, one a line")
    for stage in STAGES:
        parser.add_argument("--" + stage, nargs="*", action="append", metavar="KEY=VALUE,VALUE..")
    parser.add_argument("--sets", help="names, separated by commas (default: all)")
    parser.add_argument("--groups", help="only the sets of narrow or wide")
    parser.add_argument("--lib", action="append",
                        help="libtwoview.so (default: build/release/lib); may be repeated")
    parser.add_argument("--max-pairs", type=int, help="of each set, evenly spaced")
    parser.add_argument("--no-flagged", dest="flagged", action="store_false",
                        help="without pairs_flagged.txt of " + " and ".join(datasets.FLAGGED_SETS))
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--top", type=int, default=10, help="points listed (default 10)")
    parser.add_argument("--no-cache", action="store_true", help="evaluate everything again")
    parser.add_argument("--json", metavar="F", help="write points, scores and choices")
    parser.add_argument("--check", action="store_true",
                        help=f"exit status 1 when the left-out mean is more than {LIMIT} points "
                             "below the tuned mean")
    arguments = parser.parse_args(argv)
    lines = []
    if arguments.grid:
        with open(arguments.grid, encoding="utf-8") as f:
            lines = f.read().splitlines()
    for stage in STAGES:
        lines += [" ".join([stage, *words]) for words in getattr(arguments, stage) or []]
    try:
        points = read_grid(lines)
        if not points:
            parser.error("no grid: give --grid FILE, or --feature, --match, --estimate")
        libraries = arguments.lib or [None]
        points = distinct(_library(libraries[0])[0], points)
        names = datasets.select_sets(arguments.sets, arguments.groups)
    except (ValueError, OSError, twoview_ctypes.TwoviewError) as error:
        sys.exit(f"accuracy.grid: {error}")
    try:
        parts = [evaluate(names, points, path, arguments.flagged, arguments.max_pairs,
                          arguments.jobs, not arguments.no_cache) for path in libraries]
    except RuntimeError as error:
        sys.exit(f"accuracy.grid: {error}")
    rows = {name: [row for part in parts for row in part[name]] for name in names}
    if len(libraries) > 1:
        points = [(*point, {"lib": path}) for path in libraries for point in points]
    table = score_table(rows)
    sizes = {name: len(parts[0]) for name, parts in rows.items()}
    print_points(points, table, arguments.top)
    result = {"points": [dict(zip((*STAGES, "library"), p)) for p in points], "sizes": sizes,
              "auc": {name: scores.tolist() for name, scores in table.items()}}
    reached = True
    if len(names) > 1:
        found = leaveout.leave_one_out(table)
        reached = print_left_out(points, table, sizes, found)
        if found["tuned"]:
            print_gain(points, rows, found["tuned"])
        result["left_out"] = {
            **found, "left_out_mean": found["left_out_mean"].tolist(),
            "tuned_mean": found["tuned_mean"].tolist(),
            "sets": {n: {"point": s["point"], "left_out": s["left_out"].tolist(),
                         "tuned": s["tuned"].tolist()} for n, s in found["sets"].items()}}
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as f:
            json.dump(result, f)
    if arguments.check and not reached:
        sys.exit(1)


if __name__ == "__main__":
    main()
