#!/usr/bin/env python3
"""What the verdict is worth on real pictures: unrelated ones, and pairs with a true pose.

  scripts/accuracy --verdicts --jobs 2
  scripts/python -m twoview_tools.accuracy.verdicts --pairs 1000 --feature levels=4

Unrelated: an image of one set with an image of another, each with its own camera. The pairs are
taken in turn from all pairs of sets, without repetition, in an order drawn with a constant seed. At
most 3 in 10^4 may be "ok". Related: every pair with a true pose, the flagged ones of the accuracy
tables included; at most 1 in 100 of the "ok" may be wrong by more than 10 degrees (the larger of
the rotation's and the direction's angle, the direction with its sign).

--effort auto climbs to rung 3 while a pair is not "ok", as `twoview reconstruct` does; the table of
unrelated pairs then says how many ended on each rung.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import functools
import itertools
import json
import sys

import numpy as np
import twoview

from . import datasets, estimators, metrics, parallel, pipeline, tables, twoview_ctypes

VERDICTS = ("ok", "doubtful", "refused")
BOUNDS_DEG = (1.0, 2.0, 5.0, 10.0)
WRONG_DEG = 10.0
MOST_WRONG = 0.01  # share of the "ok" of related pairs
MOST_OK = 3e-4     # share of unrelated pairs
CHUNK = 200        # pairs of one piece of work


# ---- the choice of unrelated pairs ---------------------------------------------------------------

def choose_unrelated(images, num, seed=1, same_place=()):
    """[((set, image), (set, image))], `num` of them or all there are: images of two different sets,
    from every pair of sets in turn. images: {set: names}. same_place: frozensets of two sets that
    are not combined. Equal input gives equal output."""
    random = np.random.default_rng(seed)
    queues = []
    for a, b in itertools.combinations(sorted(images), 2):
        if frozenset((a, b)) in same_place:
            continue
        crossed = list(itertools.product(images[a], images[b]))
        queues.append([((a, crossed[i][0]), (b, crossed[i][1]))
                       for i in random.permutation(len(crossed))])
    found = []
    for turn in itertools.zip_longest(*queues):
        for pair in turn:
            if pair is not None and len(found) < num:
                found.append(pair if random.integers(2) else pair[::-1])
        if len(found) == num:
            break
    return found


def images_of(data):
    """The names of the images of a set's pairs, each once, in their order."""
    return list(dict.fromkeys(n for p in data.pairs for n in (p.name0, p.name1)))


# ---- evaluation ----------------------------------------------------------------------------------

def row_of(pair, result, num_matches, num_inliers):
    return {"image0": "/".join(pair[0]), "image1": "/".join(pair[1]),
            "verdict": twoview_ctypes.enum_name("verdict", result.verdict),
            "kind": twoview_ctypes.enum_name("kind", result.kind),
            "reasons": int(result.reasons), "num_matches": num_matches,
            "num_inliers": num_inliers, "effort": 0}


class Pictures:
    """The features and cameras of images of several sets, each image extracted once."""

    def __init__(self, folders, library_path, options, flagged, max_effort=0):
        self.library = twoview_ctypes.Library(library_path)
        self.options, self.max_effort = options, max_effort
        self.sets = {os.path.basename(folder): datasets.Set(folder, flagged=flagged)
                     for folder in folders}
        self.pairs = {name: {n: (pair, side) for pair in data.pairs[::-1]
                             for side, n in enumerate((pair.name0, pair.name1))}
                      for name, data in self.sets.items()}
        sizes = [data.max_size() for data in self.sets.values()]
        cap = self.library.feature_options(options[0]).max_keypoints or 2048
        self.context = twoview_ctypes.Context(
            self.library, max_width=max(s[0] for s in sizes), max_height=max(s[1] for s in sizes),
            max_keypoints=max(cap, 1), max_effort=max_effort)
        self.features = {}

    def view(self, name, image):
        """((keypoints, descriptors, ms), grey levels, camera) of an image of a set."""
        data = self.sets[name]
        if (name, image) not in self.features:
            self.features[name, image] = pipeline.extract_images(
                self.context, data, [image], self.options[0])[image]
        return (self.features[name, image], data.gray(image)[0],
                data.camera(*self.pairs[name][image]))

    def climb(self, pair):
        """The same as `run`, by tv_reconstruct alone, with effort."""
        lenses, grays = [], []
        for name, image in pair:
            data = self.sets[name]
            grays.append(data.gray(image)[0])
            K, distortion = data.camera(*self.pairs[name][image])
            lenses.append(twoview_ctypes.make_camera(K, *grays[-1].shape[::-1], distortion))
        result, cloud = self.context.reconstruct(grays[0], lenses[0], grays[1], lenses[1],
                                                 self.options, max_effort=self.max_effort)
        R = np.reshape(result.R, (3, 3)) if result.has_R else None
        t = np.array(result.t) if result.has_R and result.has_t else None
        return R, t, {**row_of(pair, result, len(cloud.matches), int(cloud.inlier_mask.sum())),
                      "effort": cloud.effort}

    def run(self, pair):
        """(R or None, t or None, row) of two (set, image). The pose is that of tv_reconstruct, and
        so is the verdict: tv_reconstruct itself runs where the stages do not refuse, because it
        has reasons for doubt that tv_estimate_two_view does not have."""
        if self.max_effort:
            return self.climb(pair)
        features, grays, cameras = zip(*(self.view(*image) for image in pair))
        sizes = [gray.shape[::-1] for gray in grays]
        size_of_one = self.library.feature_options(self.options[0]).keypoint_size
        keypoints, links, factors, _ = pipeline.match_features(
            self.context, grays, features, self.options[1], size_of_one)
        matches = pipeline.make_matches(*zip(keypoints), links, cameras, sizes, size_of_one,
                                        factors)
        R, t, inliers, result = estimators.run_twoview(self.context, matches, self.options[2])
        if result.verdict != twoview.Verdict.REFUSED:
            lenses = [twoview_ctypes.make_camera(K, *size, distortion)
                      for (K, distortion), size in zip(cameras, sizes)]
            result, _ = self.context.reconstruct(grays[0], lenses[0], grays[1], lenses[1],
                                                 self.options)
        return R, t, row_of(pair, result, len(matches), inliers)


@functools.lru_cache(maxsize=1)
def _pictures(text):
    return Pictures(*json.loads(text))


def _run_unrelated(job):
    text, pairs = job
    pictures = _pictures(text)
    return [pictures.run(tuple(map(tuple, pair)))[2] for pair in pairs]


def _run_related(job):
    text, name = job
    pictures = _pictures(text)
    rows = []
    for pair in pictures.sets[name].pairs:
        R, t, row = pictures.run(((name, pair.name0), (name, pair.name1)))
        errors = metrics.pose_error(R, t, pair.R, pair.t)
        rows.append({**row, "set": name, "error_deg": max(
            errors["rotation_error_deg"], errors["translation_error_signed_deg"])})
    return rows


def gather(function, work, jobs, title, path=None):
    """The rows of all pieces of work; with a path, those of each piece are appended to that file
    as soon as it is done."""
    rows, report = [], tables.progress(title, log=True)
    for done, part in enumerate(parallel.run(function, work, jobs), 1):
        rows += part
        if path:
            with open(path, "a", encoding="utf-8") as file:
                file.writelines(json.dumps(row) + "\n" for row in part)
        report(done, len(work))
    return rows


def kept_rows(path, pairs):
    """(the rows of those pairs that the file of an earlier run has, the pairs that it lacks)."""
    kept = {}
    if path and os.path.isfile(path):
        with open(path, encoding="utf-8") as file:
            kept = {(row["image0"], row["image1"]): row for row in map(json.loads, file)}
    names = [tuple("/".join(image) for image in pair) for pair in pairs]
    return ([kept[name] for name in names if name in kept],
            [pair for pair, name in zip(pairs, names) if name not in kept])


# ---- summaries -----------------------------------------------------------------------------------

def summarise_unrelated(rows):
    """(reached, counts {verdict: number}, sentence)."""
    counts = {v: sum(row["verdict"] == v for row in rows) for v in VERDICTS}
    most = int(MOST_OK * len(rows) + 1e-9)
    return (counts["ok"] <= most, counts,
            f"unrelated pictures: {counts['ok']} \"ok\" of {len(rows)} pairs, at most {most}")


def bin_of(error_deg):
    """The column of an error: the first of BOUNDS_DEG above it, then "more", then "no pose"."""
    if not np.isfinite(error_deg):
        return "no pose"
    return next((f"< {b:g}" for b in BOUNDS_DEG if error_deg < b), f">= {BOUNDS_DEG[-1]:g}")


COLUMNS = [f"< {b:g}" for b in BOUNDS_DEG] + [f">= {BOUNDS_DEG[-1]:g}", "no pose"]


def summarise_related(rows):
    """(reached, {verdict: {column: number}}, the wrong "ok" rows, sentence). An "ok" without a pose
    counts as wrong."""
    table = {v: {c: 0 for c in COLUMNS} for v in VERDICTS}
    for row in rows:
        table[row["verdict"]][bin_of(row["error_deg"])] += 1
    good = [row for row in rows if row["verdict"] == "ok"]
    wrong = [row for row in good if not row["error_deg"] <= WRONG_DEG]
    share = len(wrong) / max(len(good), 1)
    return (share <= MOST_WRONG, table, wrong,
            f"related pairs: {len(wrong)} of {len(good)} \"ok\" are wrong by more than "
            f"{WRONG_DEG:g} degrees ({100 * share:.2f} per cent, at most {100 * MOST_WRONG:g})")


def print_unrelated(rows, counts):
    tables.say(f"\n{len(rows)} pairs of unrelated pictures: "
               + ", ".join(f"{n} {v}" for v, n in counts.items()))
    rungs = sorted({row["effort"] for row in rows})
    if rungs[-1:] > [0]:
        ended = (f"{sum(row['effort'] == rung for row in rows)} on rung {rung}" for rung in rungs)
        tables.say("  ended: " + ", ".join(ended))
    for row in rows:
        if row["verdict"] == "ok":
            tables.say(f"  ok: {row['image0']} {row['image1']}, {row['kind']}, "
                       f"{row['num_inliers']} of {row['num_matches']} matches")


def print_related(rows, table, wrong):
    tables.say(f"\n{len(rows)} pairs with a true pose, verdict against the error [deg]")
    tables.say(f"  {'':<9} {'pairs':>6} " + " ".join(f"{c:>8}" for c in COLUMNS))
    for verdict, line in table.items():
        tables.say(f"  {verdict:<9} {sum(line.values()):>6} "
                   + " ".join(f"{line[c]:>8}" for c in COLUMNS))
    tables.say(f"\n  {'set':<24} {'pairs':>6} {'ok':>6} {'wrong ok':>9}")
    for name in dict.fromkeys(row["set"] for row in rows):
        mine = [row for row in rows if row["set"] == name]
        tables.say(f"  {name:<24} {len(mine):>6} {sum(r['verdict'] == 'ok' for r in mine):>6} "
                   f"{sum(r['set'] == name for r in wrong):>9}")
    for row in wrong:
        tables.say(f"  wrong: {row['image0']} {row['image1']}, {row['kind']}, "
                   f"{row['error_deg']:.1f} degrees, {row['num_inliers']} of "
                   f"{row['num_matches']} matches")


# ---- the command ---------------------------------------------------------------------------------

def main(argv=None):
    parser = argparse.ArgumentParser(prog="accuracy.verdicts", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=10000, metavar="N",
                        help="unrelated pairs (default 10000; 0: none)")
    parser.add_argument("--no-related", dest="related", action="store_false",
                        help="only unrelated pairs")
    for stage in ("feature", "match", "estimate"):
        parser.add_argument("--" + stage, nargs="+", default=[], metavar="KEY=VALUE")
    parser.add_argument("--sets", help="names, separated by commas (default: all)")
    parser.add_argument("--effort", choices=("fixed", "auto"), default="fixed",
                        help="auto: climb to rung 3 while the verdict is not ok (default: fixed)")
    parser.add_argument("--lib", help="libtwoview.so (default: build/release/lib)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--json", metavar="F", help="write every pair")
    parser.add_argument("--rows", metavar="F",
                        help="append each unrelated pair to F, a JSON object a line, as soon as it "
                             "is done; those that F has, of the same library and options, are not "
                             "run again")
    parser.add_argument("--check", action="store_true",
                        help="exit status 1 when a line says NOT REACHED")
    arguments = parser.parse_args(argv)
    try:
        names = datasets.select_sets(arguments.sets)
        options = [dict(word.split("=", 1) for word in getattr(arguments, stage))
                   for stage in ("feature", "match", "estimate")]
    except ValueError as error:
        sys.exit(f"accuracy.verdicts: {error}")
    folders = [os.path.join(datasets.data_dir(), name) for name in names]
    max_effort = twoview_ctypes.MAX_EFFORT if arguments.effort == "auto" else 0
    text = json.dumps([folders, arguments.lib, options, True, max_effort])
    lines, result = [], {"options": options, "effort": arguments.effort}
    if arguments.pairs:
        images = {os.path.basename(f): images_of(datasets.Set(f, flagged=True)) for f in folders}
        pairs = choose_unrelated(images, arguments.pairs)
        kept, missing = kept_rows(arguments.rows, pairs)
        work = [(text, missing[i:i + CHUNK]) for i in range(0, len(missing), CHUNK)]
        rows = kept + gather(_run_unrelated, work, arguments.jobs, "unrelated", arguments.rows)
        reached, counts, sentence = summarise_unrelated(rows)
        print_unrelated(rows, counts)
        lines.append((reached, sentence))
        result["unrelated"] = rows
    if arguments.related:
        rows = gather(_run_related, [(text, name) for name in names], arguments.jobs, "related")
        reached, table, wrong, sentence = summarise_related(rows)
        print_related(rows, table, wrong)
        lines.append((reached, sentence))
        result.update({"related": rows, "table": table})
    tables.say()
    for reached, sentence in lines:
        tables.say(f"{'reached' if reached else 'NOT REACHED':<12}{sentence}")
    result["targets"] = lines
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as f:
            json.dump(metrics.finite(result), f, allow_nan=False)
    if arguments.check and not all(reached for reached, _ in lines):
        sys.exit(1)


if __name__ == "__main__":
    main()
