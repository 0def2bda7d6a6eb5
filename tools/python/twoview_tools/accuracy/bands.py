#!/usr/bin/env python3
"""What comparing descriptors of neighbouring bands alone would cost (docs/decisions/refused.md).

  scripts/python -m twoview_tools.accuracy.bands              # every set, 5 pairs each
  scripts/python -m twoview_tools.accuracy.bands --weights    # the weights over all sets

A descriptor's number is the sum of its bytes times the weights, which are chosen so that the number
differs least between the descriptors of true matches, over its spread. A band is a range of the
number. For each set the weights and the limits of the bands are chosen on the other sets.
"""

import argparse

import numpy as np

from . import datasets, estimators, pipeline, twoview_ctypes

SCHEMES = ((3, 1), (4, 1), (5, 1), (6, 1), (8, 2), (12, 3))  # bands, and the farthest one compared
MOST = 2000  # matches and descriptors of a set that the choice reads, so that sets count alike
REGULARISATION = 1e-3  # added to each variance, as a share of the mean over the 128 bytes
FAR = 1e9


def residuals_px(data, pair, features, links):
    """The distance of matches from the true epipolar lines (Sampson's), in pixels."""
    sizes = [data.gray(name)[0].shape[::-1] for name in (pair.name0, pair.name1)]
    matches = pipeline.make_matches(*features, links, (data.camera(pair, 0), data.camera(pair, 1)),
                                    sizes, 4.0)
    focal = np.mean([K[i, i] for K, _ in matches.cameras for i in (0, 1)])
    return focal * np.sqrt(
        estimators.sampson_squared(matches.rays0, matches.rays1, pair.R, pair.t))


def choose_weights(samples, left_out=None):
    """(128 whole numbers from -127 to 127, the numbers of the descriptors of the sets): from
    {set: (descriptors of true matches, in image 0 and in image 1, all descriptors)}."""
    used = [sample for name, sample in samples.items() if name != left_out]
    a, b = (np.concatenate([sample[side][:MOST] for sample in used]).astype(float)
            for side in (0, 1))
    mean = 0.5 * (a.mean(axis=0) + b.mean(axis=0))
    a, b = a - mean, b - mean
    spread = 0.5 * (a.T @ a + b.T @ b) / len(a)
    spread += REGULARISATION * np.trace(spread) / len(spread) * np.eye(len(spread))
    # The smallest generalised eigenvalue, by the spread's Cholesky factor.
    inverse = np.linalg.inv(np.linalg.cholesky(spread))
    _, vectors = np.linalg.eigh(inverse @ ((a - b).T @ (a - b) / len(a)) @ inverse.T)
    weights = inverse.T @ vectors[:, 0]
    weights = np.round(127 * weights / np.abs(weights).max())
    return weights, np.concatenate([sample[2][:MOST] for sample in used]).astype(float) @ weights


def match(distances, keypoints, ratio, neighbourhood_px):
    """The pairs of indices that tv_match would give for these squared distances, FAR where two
    descriptors are not compared. keypoints: of both images."""
    places = [np.column_stack([k["x"], k["y"]]).astype(float) for k in keypoints]
    nearest, back = distances.argmin(axis=1), distances.argmin(axis=0)
    found = []
    for i in np.flatnonzero(back[nearest] == np.arange(len(nearest))):
        j = nearest[i]
        far = [np.sum((p - p[k]) ** 2, axis=1) >= neighbourhood_px**2
               for p, k in zip(places, (i, j))]
        second = min(np.min(distances[i][far[1]], initial=FAR),
                     np.min(distances[:, j][far[0]], initial=FAR))
        if distances[i, j] < min(FAR, ratio**2 * second):
            found.append((i, j))
    links = np.zeros(len(found), [("idx0", int), ("idx1", int), ("ratio", float)])
    if found:
        links["idx0"], links["idx1"] = np.transpose(found)
    return links


def _pairs(library, name, num_pairs):
    """(data, pair, features of both images as (keypoints, descriptors)) of pairs of a set."""
    data = datasets.load(f"{datasets.data_dir()}/{name}", False, num_pairs)
    context = pipeline.make_context(library, data)
    names = dict.fromkeys(n for p in data.pairs for n in (p.name0, p.name1))
    features = pipeline.extract_images(context, data, names)
    for pair in data.pairs:
        yield data, pair, [features[n][:2] for n in (pair.name0, pair.name1)], context


def sample(library, name, num_pairs):
    """What choose_weights reads of a set; true matches are within 2 px of the truth."""
    parts = []
    for data, pair, features, context in _pairs(library, name, num_pairs):
        links = context.match(features[0][1], features[1][1], {}, *(f[0] for f in features))
        right = residuals_px(data, pair, features, links) < 2
        parts.append((features[0][1][links["idx0"][right]], features[1][1][links["idx1"][right]],
                      features[0][1]))
    return [np.concatenate(part) for part in zip(*parts)]


def measure(library, name, num_pairs, weights, numbers):
    """Rows (right matches, wrong ones, share of the pairs of descriptors that are compared), the
    first of the full comparison and then one for each of SCHEMES, summed over the set's pairs."""
    options = library.match_options({})
    rows = np.zeros((1 + len(SCHEMES), 3))
    for data, pair, features, _ in _pairs(library, name, num_pairs):
        wide = [f[1].astype(np.float32) for f in features]
        squares = [np.sum(w * w, axis=1) for w in wide]
        distances = squares[0][:, None] + squares[1] - 2 * wide[0] @ wide[1].T
        own = [f[1].astype(float) @ weights for f in features]
        for row, scheme in zip(rows, (None, *SCHEMES)):
            compared = np.ones(distances.shape, bool)
            if scheme is not None:
                limits = np.quantile(numbers, np.arange(1, scheme[0]) / scheme[0])
                bands = [np.searchsorted(limits, n) for n in own]
                compared = np.abs(bands[0][:, None] - bands[1]) <= scheme[1]
            links = match(np.where(compared, distances, FAR), [f[0] for f in features],
                          options.ratio, options.neighbourhood_px)
            right = residuals_px(data, pair, features, links) < 3
            row += right.sum(), (~right).sum(), compared.mean()
    return rows


def main():
    parser = argparse.ArgumentParser(prog="bands", description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--lib", help="libtwoview.so (default: the release build's)")
    parser.add_argument("--pairs", type=int, default=5, help="of each set (default: 5)")
    parser.add_argument("--weights", action="store_true", help="print the weights over all sets")
    arguments = parser.parse_args()
    library = twoview_ctypes.Library(arguments.lib)
    names = datasets.all_sets()
    samples = {name: sample(library, name, 2 * arguments.pairs) for name in names}
    if arguments.weights:
        weights, numbers = choose_weights(samples)
        print(weights.astype(int).reshape(-1, 16))
        print("quarters:", np.quantile(numbers, (0.25, 0.5, 0.75)).astype(int))
        return
    print("right and wrong matches over those of the full comparison, and the share compared, for "
          + ", ".join(f"{bands} bands, {reach} apart" for bands, reach in SCHEMES))
    shares = []
    for name in names:
        rows = measure(library, name, arguments.pairs, *choose_weights(samples, name))
        share = rows[1:] / np.maximum(rows[0], 1e-9)
        shares.append(share)
        print(f"{name:<24}", "  ".join("%.3f %.3f %.2f" % tuple(s) for s in share), flush=True)
    print(f"{'mean':<24}", "  ".join("%.3f %.3f %.2f" % tuple(s) for s in np.mean(shares, axis=0)))


if __name__ == "__main__":
    main()
