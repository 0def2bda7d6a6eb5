#!/usr/bin/env python3
"""The verdict, its reasons and the covariance on real pictures, against the true pose.

  scripts/belief --jobs 2
  scripts/belief --sets kitti00_turn,fox_wall --pairs 200 --rows rows.jsonl
  scripts/belief --from rows.jsonl --table

Pairs. Every set and sequence of $TWOVIEW_DATA with true poses and an entry in truth.py, whether or
not anything can be matched. --pairs is shared out: a set with few images gives all its pairs, the
others equal shares, half of a share at the gaps 1, 2, 4, 8 .. in turn, half at random.
Each pair goes from the images to the pose by tv_reconstruct with its defaults, the set's camera and
the standard deviations that the program takes for a plain camera file: 0.01 of the focal length,
0.005 focal lengths of the principal point. The verdict does not read these. The library's own
default, an exact camera: --estimate calibration0.focal_sigma=0 calibration0.center_sigma=0 and the
same of calibration1.
--effort auto climbs as `twoview reconstruct` does while a pair is not "ok", to rung 3; the default
is the library's, rung 0. One table more then has the "ok" and the covariance by the rung of the
result.

A pose is WRONG IN ROTATION when its rotation is off by more than 5 degrees plus the truth's stated
error, and WRONG when that is so or its direction is off by more than 10 degrees plus the truth's
stated error. The direction (with its sign) counts only where the truth's direction is good to 5
degrees, as the set's README.md and the length of the baseline say. A pose is RIGHT when rotation
and direction are off by at most 2 degrees plus the truth's stated errors, and the direction counts.
Pairs whose truth is not trusted (images too far apart for it) are run and written, but not counted.

The other kinds of pairs, --others of each:
  unrelated    an image of one set with one of another, each with its own camera
  mirrored     an image with its own mirror picture, or with that of an image of the same set
  self-zoomed  an image with itself, enlarged by 1.25, 1.5 or 2 about its middle
  zoomed       an image with another of its set, enlarged so; the camera stays as given, so that the
               focal length is wrong by this factor
  file-lens    the pairs of the sets of truth.LENSES once more, with the lens of the set's camera
               file, which is wrong
Of the first three kinds every "ok" is wrong, since there is no translation to be known; the other
two are judged as the pairs above are.

Reliability. sigma of the rotation: the square root of the trace of its 3x3 block of the covariance,
of the direction: of its 2x2 block. Where the covariance is right, the median of error / sigma is
0.7 to 0.9, and the truth lies in 95 of 100 ellipsoids. "+ truth" adds the truth's stated errors to
the covariance.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import itertools
import json
import sys

import numpy as np
import twoview

from . import (belief_fit, belief_tables, datasets, match_evidence, metrics, parallel, pipeline,
               reliability, tables, truth, twoview_ctypes, verdicts)

ZOOMS = (1.25, 1.5, 2.0)
PLAIN_CAMERA = {f"calibration{i}.{part}": value for i in (0, 1)
                for part, value in twoview.PLAIN_FILE._asdict().items()}
UNRELATED_IMAGES = 15  # of each set, evenly spaced
CHUNK = 250  # unrelated pairs of one piece of work


# ---- the choice of pairs -------------------------------------------------------------------------

def share_out(available, num):
    """{name: number} of at most `num` in all: equal shares, but never more than there are."""
    left, shares = num, {}
    for i, name in enumerate(sorted(available, key=lambda n: (available[n], n))):
        shares[name] = min(available[name], left // (len(available) - i))
        left -= shares[name]
    return shares


def _at_gaps(num_images, num, random):
    """`num` different pairs (i, j), i < j, taken in turn from the gaps 1, 2, 4 .. of a sequence."""
    queues = []
    gap = 1
    while gap < num_images:
        queues.append([(int(i), int(i) + gap) for i in random.permutation(num_images - gap)])
        gap *= 2
    turns = itertools.chain.from_iterable(itertools.zip_longest(*queues))
    return list(itertools.islice((pair for pair in turns if pair is not None), num))


def choose_pairs(images, num, random):
    """[(image0, image1)]: every pair if `num` allows it, otherwise half at gaps and half at random.
    No pair is chosen twice, in either order; which of two images comes first is drawn."""
    total = len(images) * (len(images) - 1) // 2
    if num >= total:
        chosen = list(itertools.combinations(range(len(images)), 2))
    else:
        chosen = dict.fromkeys(_at_gaps(len(images), num // 2, random))
        while len(chosen) < num:
            i, j = sorted(int(k) for k in random.choice(len(images), 2, replace=False))
            chosen[i, j] = None
    flips = random.integers(0, 2, len(chosen))
    return [(images[j], images[i]) if flip else (images[i], images[j])
            for (i, j), flip in zip(chosen, flips)]


def plan(sets, num_pairs, num_others, seed):
    """[(kind, set0, image0, set1, image1, zoom)] for {name: truth.PosedSet}."""
    available = {name: len(s.images) * (len(s.images) - 1) // 2 + len(s.separate_pairs())
                 for name, s in sets.items()}
    shares = share_out(available, num_pairs)
    jobs = []
    for number, (name, data) in enumerate(sets.items()):
        random = np.random.default_rng((seed, number))
        separate = data.separate_pairs()[:shares[name]]
        pairs = separate + choose_pairs(data.images, shares[name] - len(separate), random)
        jobs += [("related", name, a, name, b, 1.0) for a, b in pairs]
        if name in truth.LENSES:
            jobs += [("file-lens", name, a, name, b, 1.0) for a, b in pairs]
        if not pairs:
            continue
        for kind in ("mirrored", "self-zoomed", "zoomed"):
            few = num_others // len(sets) + (number < num_others % len(sets))
            for k, i in enumerate(random.choice(len(pairs), min(few, len(pairs)), replace=False)):
                a, b = pairs[i]
                if kind == "self-zoomed" or (kind == "mirrored" and k % 2):
                    b = a
                zoom = ZOOMS[k % len(ZOOMS)] if "zoomed" in kind else 1.0
                jobs.append((kind, name, a, name, b, zoom))
    spread = {}
    for name, data in sets.items():
        names = data.images + sorted({n for p in data.separate_pairs() for n in p})
        some = np.linspace(0, len(names) - 1, min(UNRELATED_IMAGES, len(names)))
        spread[name] = [names[int(i)] for i in some]
    for (a, x), (b, y) in verdicts.choose_unrelated(spread, num_others, seed, truth.SAME_PLACE):
        jobs.append(("unrelated", a, x, b, y, 1.0))
    return jobs


def pieces_of(jobs):
    """Lists of jobs that each need the images of few sets: a set's own pairs, and chunks of
    unrelated pairs."""
    by_set = {}
    for job in jobs:
        if job[0] != "unrelated":
            by_set.setdefault(job[1], []).append(job)
    unrelated = [job for job in jobs if job[0] == "unrelated"]
    chunks = [unrelated[i:i + CHUNK] for i in range(0, len(unrelated), CHUNK)]
    return sorted(by_set.values(), key=len, reverse=True) + chunks


# ---- the images ----------------------------------------------------------------------------------

def mirrored(gray):
    return np.ascontiguousarray(gray[:, ::-1])


def enlarged(gray, zoom):
    """The picture enlarged about its middle, of the same size."""
    import cv2
    height, width = gray.shape
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    back = np.column_stack([np.eye(2) / zoom, middle - middle / zoom])
    return cv2.warpAffine(gray, back, (width, height),
                          flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP)


class Views:
    """The pixels and cameras of images, each image read once."""

    def __init__(self, sets, library, options, max_effort=0):
        self.sets, self.library, self.options = sets, library, options
        self.max_effort = max_effort
        cap = library.feature_options(options[0]).max_keypoints or 2048
        side = datasets.MAX_NATIVE_SIDE
        self.context = twoview_ctypes.Context(library, max_width=side, max_height=side,
                                              max_keypoints=max(cap, 1), max_effort=max_effort)
        self.size_of_one = library.feature_options(options[0]).keypoint_size
        self.found = {}

    def view(self, name, image, change=("", 1.0)):
        """(pixels, camera) of an image, after the change (kind, factor); ("", 1.0): none."""
        key = name, image, change
        if key not in self.found:
            gray, camera = self.sets[name].view(image, change[0] == "file-lens")
            if change[0] == "mirrored":
                gray = mirrored(gray)
            elif "zoomed" in change[0]:
                gray = enlarged(gray, change[1])
            self.found[key] = np.ascontiguousarray(gray), camera
        return self.found[key]


# ---- one pair ------------------------------------------------------------------------------------

def _plain(values):
    return [float(v) for v in values]


def row_of_result(result):
    """tv_two_view and its evidence as a dict for JSON; what was not estimated is None."""
    name = twoview_ctypes.enum_name
    evidence = result.evidence
    row = {"config": name("kind", result.kind), "verdict": name("verdict", result.verdict),
           "reasons": [r.name.lower() for r in twoview_ctypes.enums.Reason
                       if r & result.reasons],
           "num_matches": result.num_matches, "num_inliers": result.num_inliers,
           "inlier_share": result.num_inliers / max(result.num_matches, 1),
           "num_iterations": result.num_iterations}
    for field in ("R", "t", "E", "F", "H", "alternative_R", "alternative_t", "covariance",
                  "alternative_covariance"):
        has = getattr(result, "has_" + field.replace("alternative_R", "alternative")
                      .replace("alternative_t", "alternative"))
        row[field] = _plain(getattr(result, field)) if has else None
    for model in ("essential", "fundamental", "homography", "rotation"):
        count = getattr(evidence, model + "_inliers")
        row[model + "_inliers"] = count if count >= 0 else None
    asked = evidence.principal_point_asked_covariance[0] > 0
    row.update({"coverage": evidence.coverage,
                "median_parallax_deg": float(np.degrees(result.median_parallax_rad)),
                "rms_error_px": result.rms_error_px, "noise_px": result.noise_px,
                "probability_wrong": result.probability_wrong,
                "principal_point_chi2": evidence.principal_point_chi2 if asked else None,
                "principal_point_asked_px":
                    _plain(evidence.principal_point_asked_px) if asked else None,
                "principal_point_asked_covariance":
                    _plain(evidence.principal_point_asked_covariance) if asked else None})
    for field in ("agreement", "region_shift_rad", "num_places",
                  "camera_chi2", "camera_turn_rad", "camera_direction_rad"):
        row[field] = getattr(evidence, field)
    return row


def run_pair(views, job):
    """The row of one job, and the matches with their inlier mask."""
    kind, name0, image0, name1, image1, zoom = job
    plain = "file-lens" if kind == "file-lens" else "", 1.0
    change = (kind, zoom) if kind in ("mirrored", "zoomed", "self-zoomed") else plain
    (gray0, camera0), (gray1, camera1) = (views.view(name0, image0, plain),
                                          views.view(name1, image1, change))
    sizes = gray0.shape[::-1], gray1.shape[::-1]
    lenses = [twoview_ctypes.make_camera(K, *size, distortion)
              for (K, distortion), size in zip((camera0, camera1), sizes)]
    result, cloud = views.context.reconstruct(gray0, lenses[0], gray1, lenses[1], views.options,
                                              max_effort=views.max_effort)
    f0, f1 = zip(cloud.keypoints, cloud.descriptors)
    links, inliers = cloud.matches, cloud.inlier_mask
    matches = pipeline.make_matches(f0, f1, links, (camera0, camera1), sizes, views.size_of_one)
    R = np.array(result.R).reshape(3, 3) if result.has_R else None
    t = np.array(result.t) if result.has_R and result.has_t else None
    row = {"kind": kind, "set": name0, "image0": image0, "image1": image1, "zoom": zoom,
           "num_keypoints": [len(f0[0]), len(f1[0])], "effort": cloud.effort,
           "num_rungs": cloud.num_rungs, **row_of_result(result)}
    if kind == "unrelated":
        row["set1"] = name1
    keypoints = f0[0][links["idx0"]], f1[0][links["idx1"]]
    row.update(match_evidence.of_matches(matches, links, inliers))
    row.update(match_evidence.of_keypoints(*keypoints, inliers))
    if t is not None:
        row.update(match_evidence.of_pose(matches, *keypoints, inliers, R, t))
    row.update(reliability.sigmas(row["covariance"]))
    if kind in ("related", "zoomed", "file-lens"):
        data = views.sets[name0]
        R_true, t_true = data.motion(image0, image1)
        row.update(reliability.judge(R, t, row["covariance"], R_true, t_true, data.stated,
                                     data.gap(image0, image1)))
        if R is not None and t is None:
            row["rotation_alone_error_deg"] = metrics.rotation_error_deg(R, R_true)
    else:
        row.update(reliability.judge_impossible(row["verdict"]))
    kept = {"links": links, "keypoints0": keypoints[0], "keypoints1": keypoints[1],
            "inliers": inliers, "rays0": matches.rays0, "rays1": matches.rays1}
    return row, kept


def _run_piece(work):
    """The rows of a list of jobs; with a folder, their matches are written there as well."""
    jobs, library, options, folder, number, max_effort = work
    names = sorted({name for job in jobs for name in (job[1], job[3])})
    sets = {n: truth.PosedSet(os.path.join(datasets.data_dir(), n)) for n in names}
    views = Views(sets, twoview_ctypes.Library(library), options, max_effort)
    rows, kept = [], {}
    for i, job in enumerate(jobs):
        row, matches = run_pair(views, job)
        rows.append(row)
        if folder:
            row["matches"] = [f"{number:03d}.npz", i]
            kept.update({f"{key}_{i}": value for key, value in matches.items()})
    if folder:
        np.savez(os.path.join(folder, f"{number:03d}.npz"), **kept)
    return rows


def run(names, num_pairs, num_others, seed=1, jobs=1, library=None, options=({}, {}, {}),
        folder=None, max_effort=0):
    """The rows of the pairs of the sets, as the module describes them."""
    sets = {n: truth.PosedSet(os.path.join(datasets.data_dir(), n)) for n in names}
    pieces = pieces_of(plan(sets, num_pairs, num_others, seed))
    rows, done, report = [], 0, tables.progress("belief", log=True)
    total = sum(map(len, pieces))
    work = [(piece, library, options, folder, i, max_effort) for i, piece in enumerate(pieces)]
    for part in parallel.run(_run_piece, work, jobs):
        rows += part
        done += len(part)
        report(done, total)
    return rows


# ---- the command ---------------------------------------------------------------------------------

def read_rows(path):
    with open(path, encoding="utf-8") as file:
        return [json.loads(line) for line in file]


def main(argv=None):
    parser = argparse.ArgumentParser(prog="scripts/belief", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", help="names, separated by commas (default: all)")
    parser.add_argument("--pairs", type=int, default=10000, metavar="N",
                        help="pairs with a true pose, of all sets (default 10000)")
    parser.add_argument("--others", type=int, default=1000, metavar="N",
                        help="pairs of each other kind (default 1000)")
    parser.add_argument("--seed", type=int, default=1, help="of the choice of pairs (default 1)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--rows", metavar="FILE",
                        help="write a JSON object a line for each pair: all of tv_two_view, the "
                             "numbers of match_evidence.py, the truth and the errors")
    parser.add_argument("--matches", metavar="DIR",
                        help="write the matches of each pair as numpy arrays; a row names its file")
    parser.add_argument("--from", dest="read", metavar="FILE",
                        help="print the tables of an earlier --rows; nothing is run")
    parser.add_argument("--table", action="store_true",
                        help="print the Markdown tables of docs/accuracy.md instead")
    parser.add_argument("--fit", action="store_true",
                        help="fit the model of probability_wrong on the rows: print the constants "
                             "of lib/src/robust/belief.cc, and what \"ok\" would be worth on sets "
                             "left out of the fit")
    parser.add_argument("--wrong", type=int, default=0, metavar="N",
                        help="list at most N wrong \"ok\" pairs, the worst first")
    parser.add_argument("--check", type=float, metavar="SHARE",
                        help="exit status 1 when more than this share of the \"ok\" with a true "
                             "pose is wrong, for example 0.005")
    parser.add_argument("--check-rotation", type=float, metavar="SHARE",
                        help="the same for those wrong in rotation")
    parser.add_argument("--effort", choices=("fixed", "auto"), default="fixed",
                        help="auto: climb to rung 3 while the verdict is not ok (default: fixed)")
    parser.add_argument("--lib", help="libtwoview.so (default: build/release/lib)")
    for stage in ("feature", "match", "estimate"):
        parser.add_argument("--" + stage, nargs="+", default=[], metavar="KEY=VALUE",
                            help=f"fields of tv_{stage}_options other than the defaults")
    arguments = parser.parse_args(argv)
    if arguments.read:
        rows = read_rows(arguments.read)
    else:
        have = truth.posed_sets()
        names = arguments.sets.split(",") if arguments.sets else have
        missing = sorted(set(names) - set(have))
        if missing or not names:
            sys.exit(f"belief: no true poses of {', '.join(missing) or 'any set'} in "
                     f"{datasets.data_dir()}; there are {', '.join(have)}")
        try:
            options = [dict(word.split("=", 1) for word in getattr(arguments, stage))
                       for stage in ("feature", "match", "estimate")]
            options[2] = {**PLAIN_CAMERA, **options[2]}
        except ValueError:
            sys.exit("belief: options have the form KEY=VALUE")
        if arguments.matches:
            os.makedirs(arguments.matches, exist_ok=True)
        rows = run(names, arguments.pairs, arguments.others, arguments.seed, arguments.jobs,
                   arguments.lib, options, arguments.matches,
                   twoview_ctypes.MAX_EFFORT if arguments.effort == "auto" else 0)
    if arguments.rows:
        with open(arguments.rows, "w", encoding="utf-8") as file:
            for row in rows:
                file.write(json.dumps(metrics.finite(row), allow_nan=False) + "\n")
    if arguments.fit:
        left_out = belief_fit.left_out_tables(rows)
        tables.say(belief_tables.fitted(belief_fit.constants(rows), left_out, arguments.table))
        return
    tables.say(belief_tables.markdown(rows) if arguments.table else belief_tables.text(rows))
    if arguments.wrong:
        tables.say(belief_tables.wrong_pairs(rows, arguments.wrong))
    failed = False
    for key, limit in (("wrong", arguments.check), ("wrong_rotation", arguments.check_rotation)):
        if limit is not None:
            reached, sentence = belief_tables.check(rows, key, limit)
            tables.say(f"{'reached' if reached else 'NOT REACHED':<12}{sentence}")
            failed |= not reached
    if failed:
        sys.exit(1)


if __name__ == "__main__":
    main()
