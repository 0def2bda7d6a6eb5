#!/usr/bin/env python3
"""What bad and changed pictures get: the table of docs/verdict.md.

  scripts/python -m twoview_tools.accuracy.bad_input --pairs 10 --jobs 2

Each line is one kind of input: rendered pictures without a pose or with a repeating pattern; the
scenes of scenes.py; a picture of a data set with a change of itself; and pairs of the data sets,
one picture of which is changed. Every pair goes through tv_reconstruct with its defaults. "right"
is a pose within 10 degrees of the truth (the larger of the rotation's and the direction's angle,
the direction with its sign), "wrong" any other. Where there is no true pose, every "ok" is wrong.
The last lines name the pairs that are "ok" and wrong.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import collections
import json
import sys

import numpy as np
import twoview as tv

from .. import DEFAULT_LIBRARY
from . import datasets, metrics, parallel, pictures, scenes, tables

WRONG_DEG = 10.0
SIZES = (1, 0.71, 0.5, 0.35)
SEEDS = 20  # pairs of each rendered line that is drawn
SCENE_SEEDS = 10  # pairs of each scene
PERIODS = (16, 24, 40, 64, 100)  # of the patterns, in pixels of the texture
MOST_REASONS = 3  # that a line of the table names

# Changes of a picture: {line: (function of pictures, its arguments)}. The camera follows the
# picture, so that the pose stays known.
CHANGES = {
    "as it is": (pictures.turned, 0),
    **{f"{size:g} of the size": (pictures.resized, size) for size in SIZES[1:]},
    "turned by 90 degrees": (pictures.turned, 1),
    "turned by 180 degrees": (pictures.turned, 2),
    "inverted": (pictures.inverted,),
    "blurred by 5 px": (pictures.blurred, 5),
    "blurred by 15 px": (pictures.blurred, 15),
    "half the exposure": (pictures.exposed, 0.5),
    "twice the exposure, saturated": (pictures.exposed, 2.0),
    "gamma 0.5": (pictures.exposed, 1.0, 0.5),
}
# Changes after which no pose explains the pair: {line: (function, its arguments)}.
MIRRORS = {"mirrored, left and right": (pictures.mirrored, 1),
           "mirrored, top and bottom": (pictures.mirrored, 0)}
# The caller's mistake: the picture is smaller, and the camera is not. In the second line the camera
# states the picture's size, but its focal length is that of the full size.
MISTAKES = {"0.5 of the size, the camera of the full size": (pictures.resized, 0.5, False, True),
            "0.5 of the size, only the camera's width and height with it":
                (pictures.resized, 0.5, False)}


def _drawn(function, *arguments):
    return [function(*arguments, seed) for seed in range(1, SEEDS + 1)]


def rendered_lines():
    """{line: Pairs} of rendered pictures."""
    room = pictures.room()
    white = pictures.changed(room, pictures.exposed, 300.0)
    lines = {
        "blank": [pictures.blank(*greys) for greys in ((0, 0), (128, 128), (255, 255), (0, 255))],
        "one blank, one with texture": [pictures.without_truth(
            pictures.blank(128, 128).views[0].luma, room.views[1].luma)],
        "one saturated": [pictures.without_truth(*(view.luma for view in white.views))],
        "noise of 2 grey levels": [pictures.without_truth(*pictures.noise(2, s))
                                   for s in range(1, SEEDS + 1)],
        "noise of 40 grey levels": [pictures.without_truth(*pictures.noise(40, s))
                                    for s in range(1, SEEDS + 1)],
        "one strong corner among noise": _drawn(pictures.corner_in_noise, 2),
    }
    for name in pictures.PATTERNS:
        lines[name] = [pair for period in PERIODS
                       for pair in _drawn(pictures.patterned, name, period)]
    return lines


def scene_lines():
    """{line: Pairs} of rendered scenes that mislead."""
    return {name: [make(seed) for seed in range(1, SCENE_SEEDS + 1)]
            for name, make in scenes.SCENES.items()}


def lines_of_picture(view):
    """{line: Pair} of a picture with a change of itself. There is no motion, so "ok" is wrong."""
    both = pictures.with_itself(view)
    return {name: pictures.changed(both, *change)
            for name, change in {**CHANGES, **MIRRORS, **MISTAKES}.items()}


def lines_of_pair(pair):
    """{line: Pair} of a pair with one picture changed, or both where the line says so."""
    lines = {name: pictures.changed(pair, *change) for name, change in CHANGES.items()}
    for name, change in {**MIRRORS, **MISTAKES}.items():
        found = pictures.changed(pair, *change)
        lines[name] = pictures.Pair(found.views, found.R, None if name in MIRRORS else found.t)
    lines["both mirrored"] = pictures.mirrored_both(pair)
    lines["a moving person before half of both"] = scenes.before_person(pair, 1)
    return lines


# ---- the estimate --------------------------------------------------------------------------------

def camera_of(view):
    width, height = view.stated or view.luma.shape[::-1]
    K, lens = view.K, tuple(float(k) for k in view.lens)
    model = tv.CameraModel.BROWN_CONRADY if any(lens) else tv.CameraModel.PINHOLE
    return tv.Camera(width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2], model,
                     lens if any(lens) else ())


def context_for(pairs):
    shapes = [view.luma.shape for pair in pairs for view in pair.views]
    return tv.Context(max_width=max(s[1] for s in shapes), max_height=max(s[0] for s in shapes))


def run(context, pair):
    """(twoview.TwoView, the row of the table) of a Pair. A picture that is not of its camera's size
    is an error: (None, a row that is "refused" for TV_ERR_CAMERA)."""
    (view0, view1) = pair.views
    try:
        found, cloud = tv.reconstruct(context, view0.luma, camera_of(view0), view1.luma,
                                      camera_of(view1))
    except tv.TV_ERR_CAMERA:
        return None, {"verdict": "refused", "kind": "error", "reasons": ["TV_ERR_CAMERA"],
                      "has_pose": pair.t is not None, "error_deg": np.inf, "num_iterations": 0,
                      "num_keypoints": [0, 0], "num_matches": 0, "num_inliers": 0}
    error = np.inf
    if pair.t is not None:
        errors = metrics.pose_error(found.R, found.t, pair.R, pair.t)
        error = max(errors["rotation_error_deg"], errors["translation_error_signed_deg"])
    return found, {
        "verdict": found.verdict.name.lower(), "kind": found.kind.name.lower(),
        "reasons": [r.name.lower() for r in tv.Reason if r in found.reasons],
        "has_pose": pair.t is not None, "error_deg": float(error),
        "num_iterations": found.num_iterations,
        "num_keypoints": [len(k) for k in cloud.keypoints],
        "num_matches": found.num_matches, "num_inliers": found.num_inliers}


def is_wrong(row):
    """True for a row whose pose is off by more than WRONG_DEG, or that has none."""
    return not row["error_deg"] <= WRONG_DEG


def _rows(context, group, where, lines):
    return [{"group": group, "line": line, "where": where, **run(context, pair)[1]}
            for line, pair in lines.items()]


def _run_set(job):
    name, num_pairs = job
    data = datasets.Set(os.path.join(datasets.data_dir(), name), max_pairs=num_pairs)
    rows = []
    for entry in data.pairs:
        pair = pictures.of_set(data, entry)
        first, second = lines_of_picture(pair.views[0]), lines_of_pair(pair)
        with context_for([*first.values(), *second.values()]) as context:
            rows += _rows(context, "picture", f"{name}/{entry.name0}", first)
            rows += _rows(context, "pair", f"{name}/{entry.name0} {entry.name1}", second)
    return rows


RENDERED = {"rendered": rendered_lines, "scene": scene_lines}


def _run_rendered(group):
    lines = RENDERED[group]()
    with context_for([pair for pairs in lines.values() for pair in pairs]) as context:
        return [row for line, pairs in lines.items() for i, pair in enumerate(pairs)
                for row in _rows(context, group, str(i), {line: pair})]


def _run(job):
    return _run_rendered(job) if job in RENDERED else _run_set(job)


# ---- the table -----------------------------------------------------------------------------------

COLUMNS = ("ok, right", "ok, wrong", "doubtful, right", "doubtful, wrong", "refused")
NO_POSE_COLUMNS = ("ok", "doubtful", "refused")
TITLES = {"rendered": "rendered pictures", "scene": "rendered scenes",
          "picture": "a picture with itself, one of the two",
          "pair": "two pictures of a scene, one of the two"}


def column_of(row):
    """A member of COLUMNS, or of NO_POSE_COLUMNS where the pair has no true pose."""
    verdict = row["verdict"]
    if verdict == "refused" or not row["has_pose"]:
        return verdict
    return f"{verdict}, {'wrong' if is_wrong(row) else 'right'}"


def summarise(rows):
    """{(group, line): (number of pairs, {column: number}, {reason: number})}."""
    found = {}
    for row in rows:
        num, counts, reasons = found.get((row["group"], row["line"]),
                                         (0, collections.Counter(), collections.Counter()))
        counts[column_of(row)] += 1
        reasons.update(row["reasons"])
        found[row["group"], row["line"]] = num + 1, counts, reasons
    return found


def markdown(rows):
    """The tables of docs/verdict.md, one for the lines of each group with a true pose and one for
    those without."""
    tables_of = {}
    has_pose = {(row["group"], row["line"]): row["has_pose"] for row in rows}
    for (group, line), (num, counts, reasons) in summarise(rows).items():
        known = has_pose[group, line]
        columns = COLUMNS if known else NO_POSE_COLUMNS
        text = tables_of.setdefault((group, known), [
            f"| {TITLES[group]} | pairs | " + " | ".join(columns)
            + " | the most frequent reasons |", "| --- " * (len(columns) + 3) + "|"])
        most = ", ".join(f"`{name}` {n}" for name, n in reasons.most_common(MOST_REASONS))
        text.append(f"| {line} | {num} | " + " | ".join(str(counts[c]) for c in columns)
                    + f" | {most} |")
    return "\n\n".join("\n".join(text) for text in tables_of.values())


def main(argv=None):
    parser = argparse.ArgumentParser(prog="accuracy.bad_input", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=10, metavar="N",
                        help="of each set, evenly spaced (default 10; 0: rendered pictures only)")
    parser.add_argument("--sets", help="names, separated by commas (default: all)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--json", metavar="F", help="write every pair")
    arguments = parser.parse_args(argv)
    os.environ.setdefault("TWOVIEW_LIBRARY", DEFAULT_LIBRARY)
    work = list(RENDERED)
    if arguments.pairs:
        try:
            work += [(name, arguments.pairs) for name in datasets.select_sets(arguments.sets)]
        except ValueError as error:
            sys.exit(f"accuracy.bad_input: {error}")
    rows, report = [], tables.progress("bad input", log=True)
    for done, part in enumerate(parallel.run(_run, work, arguments.jobs), 1):
        rows += part
        report(done, len(work))
    rows.sort(key=lambda row: list(TITLES).index(row["group"]))
    tables.say(markdown(rows))
    wrong = [row for row in rows if row["verdict"] == "ok" and is_wrong(row)]
    for row in wrong:
        tables.say(f"wrong: {row['group']} {row['where']}, {row['line']}: {row['kind']}, "
                   f"{row['num_inliers']} of {row['num_matches']} matches")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as f:
            json.dump(metrics.finite(rows), f, allow_nan=False)


if __name__ == "__main__":
    main()
