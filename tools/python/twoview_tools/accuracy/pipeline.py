"""Runs our stages on a data set through libtwoview.so, with any options, for tuning."""

import pickle
import time

import numpy as np

from . import datasets, estimators, metrics, twoview_ctypes


def make_context(library, data, feature_options=None):
    """A context with room for the images and features of the set."""
    width, height = data.max_size()
    limits = {"max_width": width, "max_height": height}
    cap = library.feature_options(feature_options).max_keypoints or 2048
    limits["max_keypoints"] = max(cap, 1)
    return twoview_ctypes.Context(library, **limits)


def extract_images(context, data, names, feature_options=None):
    """{name: (keypoints, descriptors, ms)} of images of a set."""
    features = {}
    for name in names:
        start = time.perf_counter()
        keypoints, descriptors = context.extract(data.gray(name)[0], feature_options)
        features[name] = keypoints, descriptors, 1e3 * (time.perf_counter() - start)
    return features


def match_features(context, grays, features, match_options=None, size_of_one=4.0):
    """Matches and aligns as tv_reconstruct does. grays: both images; features: (keypoints,
    descriptors, ms) of each; match_options may hold align_matches of tv_reconstruct_options.
    size_of_one: the size of a keypoint of level 0, the feature option keypoint_size. Returns
    (the keypoints of both images, an array of dtype CORRESPONDENCE, the factor that the alignment
    gives each match's sigmas, ms)."""
    start = time.perf_counter()
    wanted = dict(match_options or {})
    align = context.library.take_align_matches(wanted)
    keypoints = [f[0] for f in features]
    links = context.match(features[0][1], features[1][1], wanted, *keypoints)
    factors = np.ones(len(links), np.float32)
    if align:
        *keypoints, factors = context.align_matches(*grays, *keypoints, links, size_of_one)
    return keypoints, links, factors, 1e3 * (time.perf_counter() - start)


def make_matches(features0, features1, links, cameras, sizes, size_of_one, factors=None):
    """The estimators.Matches of two images' (keypoints, ..). size_of_one and factors: as of
    match_features."""
    chosen = [f[0][links[i]] for f, i in ((features0, "idx0"), (features1, "idx1"))]
    pixels = [np.column_stack([k["x"], k["y"]]).astype(float) for k in chosen]
    relative = [(k["size"] / size_of_one).astype(float) for k in chosen]
    return estimators.Matches(*pixels, cameras, sizes, links["ratio"].copy(), relative,
                              factors)


def match_pairs(context, data, feature_options=None, match_options=None, features=None):
    """[(estimators.Matches, {"extract": ms, "match": ms, "keypoints": n})] for each pair of a set.
    The features of an image are computed once, and their time counts in each of its pairs;
    `features` are those of extract_images if they exist already."""
    if features is None:
        names = dict.fromkeys(n for p in data.pairs for n in (p.name0, p.name1))
        features = extract_images(context, data, names, feature_options)
    size_of_one = context.library.feature_options(feature_options).keypoint_size
    found = []
    for pair in data.pairs:
        both = features[pair.name0], features[pair.name1]
        grays = [data.gray(n)[0] for n in (pair.name0, pair.name1)]
        keypoints, links, factors, match_ms = match_features(context, grays, both, match_options,
                                                             size_of_one)
        matches = make_matches(*zip(keypoints), links, (data.camera(pair, 0), data.camera(pair, 1)),
                               [gray.shape[::-1] for gray in grays], size_of_one, factors)
        found.append((matches, {"extract": both[0][2] + both[1][2], "match": match_ms,
                                "keypoints": (len(both[0][0]) + len(both[1][0])) / 2}))
    return found


def evaluate_matches(data, matched, estimate_options=None, estimator="twoview", context=None,
                     num_seeds=1):
    """A row for each pair and seed, as evaluate_pairs returns them. `matched` has the form of
    match_pairs' result."""
    rows = []
    for pair, (matches, stage) in zip(data.pairs, matched):
        share = metrics.precision(matches.rays0, matches.rays1, pair.R, pair.t)
        for seed in range(num_seeds):
            row = {"set": data.name, "name0": pair.name0, "name1": pair.name1, "seed": seed,
                   "num_matches": len(matches), "precision": share,
                   "ms": {"extract": stage["extract"], "match": stage["match"]},
                   "num_keypoints": stage["keypoints"]}
            R = t = None
            inliers = 0
            start = time.perf_counter()
            if estimator == "twoview":
                R, t, inliers, result = estimators.run_twoview(context, matches, estimate_options,
                                                               seed)
                row["config"] = twoview_ctypes.enum_name("kind", result.kind)
                row["verdict"] = twoview_ctypes.enum_name("verdict", result.verdict)
                row["num_iterations"] = result.num_iterations
            else:
                threshold_px = float((estimate_options or {}).get("max_error_px", 1.0))
                found = estimators.run_peer(estimator, matches, threshold_px, seed)
                if found is not None:
                    R, t, inliers = found
            row["ms"]["estimate"] = 1e3 * (time.perf_counter() - start)
            row["num_inliers"] = inliers
            row.update(metrics.pose_error(R, t, pair.R, pair.t))
            rows.append(row)
    return rows


def evaluate_pairs(set_dir, feature_options=None, match_options=None, estimate_options=None,
                   max_pairs=None, resize=None, estimator="twoview", num_seeds=1, library=None,
                   flagged=False, save=None, load=None):
    """Extracts, matches and estimates every pair of a set. Returns a list of rows, one per pair and
    seed: the error keys of report.json, num_matches, num_inliers, num_keypoints, precision, and
    ms {extract (both images), match, estimate}.

    Options are dicts of the C structs' fields; values may be text. Of tv_reconstruct_options
    match_options may hold align_matches, and estimate_options sigma_by_size, too; with their
    defaults the poses are those of tv_reconstruct. estimator: "twoview" or a key of
    estimators.PEERS, which reads max_error_px only. resize: None is the tables' rule, 0 native.
    library: a twoview_ctypes.Library or a path. save/load: a file for the matches (pickle, our own
    files only), so that estimators can be tuned on fixed matches.
    """
    data = datasets.Set(set_dir, resize, flagged, max_pairs)
    if not isinstance(library, twoview_ctypes.Library) and (estimator == "twoview" or not load):
        library = twoview_ctypes.Library(library)
    if load:
        with open(load, "rb") as f:
            stored = pickle.load(f)
        matched = [stored[pair.text] for pair in data.pairs]
        context = None
        if estimator == "twoview":
            most = max([len(m) for m, _ in matched] + [1])
            context = twoview_ctypes.Context(library, max_width=64, max_height=64, max_matches=most)
    else:
        context = make_context(library, data, feature_options)
        matched = match_pairs(context, data, feature_options, match_options)
        if save:
            with open(save, "wb") as f:
                pickle.dump({p.text: m for p, m in zip(data.pairs, matched)}, f)
    return evaluate_matches(data, matched, estimate_options, estimator, context, num_seeds)


def summarise(rows):
    """Summarises the rows of a set: mean AUC over the seeds, medians and means."""
    seeds = sorted({row["seed"] for row in rows})
    runs = [[r["pose_error_deg"] for r in rows if r["seed"] == s] for s in seeds]
    summary = {f"auc{t:g}": metrics.auc_of_runs(runs, t) for t in metrics.THRESHOLDS_DEG}
    summary["median_error_deg"] = float(np.median(runs))
    summary["failures"] = float(np.mean(np.isinf(runs)))
    for key in ("num_keypoints", "num_matches", "num_inliers", "precision"):
        summary[key] = float(np.mean([r[key] for r in rows]))
    for stage in ("extract", "match", "estimate"):
        summary[stage + "_ms"] = float(np.mean([r["ms"][stage] for r in rows]))
    summary["num_pairs"] = len(runs[0])
    return summary
