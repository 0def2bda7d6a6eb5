#!/usr/bin/env python3
"""Matches of planar pairs whose true homography is known: ours beside OpenCV's SIFT.

  scripts/accuracy --homography
  scripts/accuracy --homography --feature levels=4 scale_factor=1.41 --match ratio=0.9

For each pair: the share of matches whose transfer error |H x0 - x1|, in pixels of image 1, is below
1, 3 and 5 px, and the number of matches below 3 px. A pair with a side of more than 1241 px is
scaled by one factor so that its longest side is 640 px, and H with it.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import json
import sys

import numpy as np

from . import datasets, peers, pipeline, tables, twoview_ctypes

LIMITS_PX = (1.0, 3.0, 5.0)
CORRECT_PX = 3.0
ZOOM = "zoom and rotation"
# By folder; every other folder shows a change of viewpoint.
KINDS = {"homogr_city": "light", "homogr_boat": ZOOM,
         "homogr_WhiteBoard": ZOOM, "homogr_CapitalRegion": ZOOM}
REST = "all but " + ZOOM


def kind_of(name):
    return KINDS.get(name.split("/")[0], "viewpoint")


def read_pairs(path):
    """[(name0, name1, H)] of a pairs_h.txt."""
    pairs = []
    with open(path, encoding="utf-8") as f:
        for line in f:
            words = line.split("#", 1)[0].split()
            if not words:
                continue
            if len(words) != 11:
                raise ValueError(f"{path}: {line.strip()!r} is not image0 image1 H(9)")
            pairs.append((*words[:2], np.array(words[2:], float).reshape(3, 3)))
    return pairs


def scale_homography(H, scale0, scale1):
    """H of resized images; scale0 and scale1: (in x, in y) of either image. Pixel (0, 0) is the
    centre of a pixel."""
    S0, S1 = (np.array([[x, 0, 0.5 * x - 0.5], [0, y, 0.5 * y - 0.5], [0, 0, 1]])
              for x, y in (scale0, scale1))
    return S1 @ H @ np.linalg.inv(S0)


def transfer_errors(H, pixels0, pixels1):
    """|H x0 - x1| in pixels of image 1; infinite where H maps x0 behind the image or to infinity,
    as seen from the side on which most of the points lie."""
    mapped = np.column_stack([pixels0, np.ones(len(pixels0))]) @ np.asarray(H, float).T
    w = mapped[:, 2] * (1.0 if np.median(mapped[:, 2]) >= 0 else -1.0) if len(mapped) else []
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = np.hypot(*(mapped[:, :2] / mapped[:, 2:] - pixels1).T)
    return np.where(np.asarray(w) > 0, errors, np.inf)


def measure(errors):
    """{"accuracy": shares below LIMITS_PX, "correct": number below CORRECT_PX, "matches"}; without
    matches the shares are 0."""
    count = len(errors)
    return {"accuracy": [float(np.count_nonzero(errors < px)) / max(count, 1) for px in LIMITS_PX],
            "correct": int(np.count_nonzero(errors < CORRECT_PX)), "matches": count}


def load(folder, pair):
    """(luma 0, luma 1, H of the images in use) of a pair of read_pairs."""
    name0, name1, H = pair
    paths = [os.path.join(folder, name) for name in (name0, name1)]
    shapes = [datasets.read_luma(path).shape for path in paths]
    longest = max(side for shape in shapes for side in shape)
    factor = datasets.default_resize(longest, 0) / longest or 1.0
    views = [datasets.resized_luma(path, int(max(shape) * factor + 0.5))
             for path, shape in zip(paths, shapes)]
    return views[0][0], views[1][0], scale_homography(H, views[0][1:], views[1][1:])


def our_matches(library, gray0, gray1, feature_options, match_options):
    """(pixels0, pixels1) of our matches."""
    cap = library.feature_options(feature_options).max_keypoints or peers.CAP
    context = twoview_ctypes.Context(
        library, max_width=max(g.shape[1] for g in (gray0, gray1)),
        max_height=max(g.shape[0] for g in (gray0, gray1)), max_keypoints=cap)
    features = [(*context.extract(gray, feature_options), 0.0) for gray in (gray0, gray1)]
    keypoints, links, _, _ = pipeline.match_features(
        context, (gray0, gray1), features, match_options,
        library.feature_options(feature_options).keypoint_size)
    return [np.column_stack([k["x"], k["y"]])[links[i]].astype(float)
            for k, i in zip(keypoints, ("idx0", "idx1"))]


def opencv_matches(gray0, gray1, contrast, ratios, cap):
    """{ratio: (pixels0, pixels1)}: OpenCV's SIFT, mutual nearest neighbours and ratio."""
    config = {**peers.SIFT, "descriptor": "sift", "contrast": contrast, "cap": cap}
    (points0, d0), (points1, d1) = (peers.extract(gray, config) for gray in (gray0, gray1))
    index0, index1, found = peers.match(d0, d1, 1.0)
    return {ratio: (points0[index0[found < ratio]], points1[index1[found < ratio]])
            for ratio in ratios}


def average(measures):
    """The mean over pairs."""
    return {"accuracy": np.mean([m["accuracy"] for m in measures], axis=0).tolist(),
            "correct": float(np.mean([m["correct"] for m in measures])),
            "matches": float(np.mean([m["matches"] for m in measures]))}


def judge(means):
    """[(reached, sentence)]: ours, the first system, against every other one, in each kind.
    means: {kind: {system: average's result}}."""
    found = []
    for kind, systems in means.items():
        ours, *others = systems
        for other in others:
            a, b = systems[ours], systems[other]
            pairs = [*zip(a["accuracy"], b["accuracy"]), (a["correct"], b["correct"])]
            found.append((all(x >= y for x, y in pairs),
                          f"{kind}: accuracy "
                          + ", ".join(f"{100 * x:.1f} ({100 * y:.1f})" for x, y in pairs[:-1])
                          + f" per cent, {a['correct']:.0f} ({b['correct']:.0f}) correct, "
                          f"against {other}"))
    return found


def print_table(title, systems):
    width = max(len(name) for name in systems)
    tables.say(f"\n{title}")
    tables.say(f"  {'':<{width}} " + " ".join(f"{f'{px:g} px':>6}" for px in LIMITS_PX)
               + f" {'correct':>8} {'matches':>8}")
    for name, m in systems.items():
        tables.say(f"  {name:<{width}} " + " ".join(f"{100 * a:6.1f}" for a in m["accuracy"])
                   + f" {m['correct']:8.1f} {m['matches']:8.1f}")


def main(argv=None):
    parser = argparse.ArgumentParser(prog="accuracy.homography", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", help="folder with pairs_h.txt (default: homography of "
                                       "$TWOVIEW_DATA)")
    for stage in ("feature", "match"):
        parser.add_argument("--" + stage, nargs="+", default=[], metavar="KEY=VALUE")
    parser.add_argument("--lib", help="libtwoview.so (default: build/release/lib)")
    parser.add_argument("--cap", type=int, default=peers.CAP, metavar="N",
                        help=f"descriptors of an image, for both (default {peers.CAP})")
    parser.add_argument("--ratios", default="0.8", metavar="R,..",
                        help="OpenCV's, besides ours (default 0.8)")
    parser.add_argument("--json", metavar="F", help="write everything, every pair included")
    parser.add_argument("--check", action="store_true",
                        help="exit status 1 when a line says NOT REACHED")
    arguments = parser.parse_args(argv)
    folder = arguments.data or os.path.join(datasets.data_dir(), "homography")
    try:
        library = twoview_ctypes.Library(arguments.lib)
        feature_options = {"max_keypoints": arguments.cap,
                           **dict(word.split("=", 1) for word in arguments.feature)}
        match_options = dict(word.split("=", 1) for word in arguments.match)
        ratio = round(float(library.match_options(match_options).ratio), 6)
        pairs = read_pairs(os.path.join(folder, "pairs_h.txt"))
    except (ValueError, OSError, twoview_ctypes.TwoviewError) as error:
        sys.exit(f"accuracy.homography: {error}")
    ratios = list(dict.fromkeys([*map(float, arguments.ratios.split(",")), ratio]))
    ours = f"{tables.OURS} r{ratio:g}"
    rows, kinds = {}, {}
    for pair in pairs:
        gray0, gray1, H = load(folder, pair)
        found = {ours: our_matches(library, gray0, gray1, feature_options, match_options)}
        for contrast in (0.02, 0.04):
            for r, pixels in opencv_matches(gray0, gray1, contrast, ratios,
                                            arguments.cap).items():
                found[f"OpenCV SIFT c{contrast:g} r{r:g}"] = pixels
        name = f"{pair[0]} {pair[1]}"
        rows[name] = {system: measure(transfer_errors(H, *pixels))
                      for system, pixels in found.items()}
        kinds.setdefault(kind_of(pair[0]), []).append(name)
        print_table(f"{name} ({kind_of(pair[0])}): {gray0.shape[1]}x{gray0.shape[0]}, "
                    f"{gray1.shape[1]}x{gray1.shape[0]}", rows[name])
    rest = [name for kind, names in kinds.items() if kind != ZOOM for name in names]
    if rest:
        kinds = {REST: rest, **kinds}
    means = {kind: {system: average([rows[name][system] for name in names])
                    for system in rows[names[0]]} for kind, names in kinds.items()}
    for kind, systems in means.items():
        print_table(f"{kind}: mean over {len(kinds[kind])} pairs", systems)
    judged = judge(means)
    tables.say("\nours (OpenCV's): accuracy at 1, 3 and 5 px, and correct matches of a pair")
    for reached, sentence in judged:
        tables.say(f"{'reached' if reached else 'NOT REACHED':<12}{sentence}")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as f:
            json.dump({"pairs": rows, "kinds": kinds, "means": means, "targets": judged}, f)
    if arguments.check and not all(reached for reached, _ in judged):
        sys.exit(1)


if __name__ == "__main__":
    main()
