#!/usr/bin/env python3
"""Whether the lens of a set's camera file is right: the distortion that fits the matches under
the true poses, fitted on one half of a sequence and judged on the other.

  scripts/belief --sets seq_chessboard_desk --pairs 1168 --others 0 --rows rows.jsonl \\
      --matches DIR
  scripts/python -m twoview_tools.accuracy.lens rows.jsonl DIR

Reads the rows and matches of twoview_tools.accuracy.belief. Prints the residuals from the true
pose (Sampson's distance in pixels, median and 80 per cent quantile) of the outer matches (beyond
--outer focal lengths from the principal point in either picture) and of the others, with the file's
lens and with the fitted ones. Where a lens that was fitted on the other half is much better, the
file's is wrong: an error of the true poses or a moving object is not a function of the pixel.
"""

import argparse
import json
import os

import numpy as np

from .. import formats
from . import datasets

CLIP_PX = 15.0  # residuals count as at most this, since some matches are wrong
SCALE_PX = 0.5  # of Cauchy's loss
START_STEPS = (0.01, 0.01, 0.001, 0.001, 0.005)  # the scales of k1, k2, p1, p2, k3
MOST_MATCHES = 160  # of a pair


def rays_of(pixels, K, lens):
    """Normalised points of distorted pixels; 25 fixed-point steps, whatever the lens."""
    k1, k2, p1, p2, k3 = lens
    goal = (pixels - [K[0, 2], K[1, 2]]) / [K[0, 0], K[1, 1]]
    x, y = goal.T
    for _ in range(25):
        r2 = x * x + y * y
        radial = np.maximum(1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 0.3)
        x, y = (np.clip((goal[:, 0] - 2 * p1 * x * y - p2 * (r2 + 2 * x * x)) / radial, -4, 4),
                np.clip((goal[:, 1] - p1 * (r2 + 2 * y * y) - 2 * p2 * x * y) / radial, -4, 4))
    return np.column_stack([x, y])


def essential(R, t):
    x, y, z = np.asarray(t, float) / np.linalg.norm(t)
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ np.reshape(R, (3, 3))


class Sample:
    """Matches of many pairs: distorted pixels of both views and the true E of each."""

    def __init__(self, pixels0, pixels1, E, K):
        self.pixels, self.E, self.K = (pixels0, pixels1), E, K

    def part(self, chosen):
        return Sample(*(p[chosen] for p in self.pixels), self.E[chosen], self.K)

    def residuals_px(self, lens):
        points = [np.column_stack([rays_of(p, self.K, lens), np.ones(len(p))])
                  for p in self.pixels]
        line1 = np.einsum("nij,nj->ni", self.E, points[0])
        line0 = np.einsum("nji,nj->ni", self.E, points[1])
        norm = np.sqrt((line0[:, :2] ** 2).sum(axis=1) + (line1[:, :2] ** 2).sum(axis=1))
        distance = self.K[0, 0] * (points[1] * line1).sum(axis=1) / np.maximum(norm, 1e-12)
        return np.clip(distance, -CLIP_PX, CLIP_PX)

    def outer(self, radius):
        away = [np.linalg.norm((p - [self.K[0, 2], self.K[1, 2]]) / [self.K[0, 0], self.K[1, 1]],
                               axis=1) for p in self.pixels]
        return np.maximum(*away) > radius


def fit(sample, start):
    """(k1, k2, p1, p2, k3) of least residuals, Cauchy's loss."""
    from scipy.optimize import least_squares
    return least_squares(sample.residuals_px, start, loss="cauchy", f_scale=SCALE_PX,
                         x_scale=START_STEPS, max_nfev=40).x


def read_sample(rows, folder, most_gap, num_pairs, seed=1):
    """(Sample, first and last frame of each match's pair)."""
    random = np.random.default_rng(seed)
    rows = [r for r in rows if r["kind"] == "related" and 2 <= r["gap"] <= most_gap]
    rows = [rows[i] for i in random.permutation(len(rows))[:num_pairs]]
    root = os.path.join(datasets.data_dir(), rows[0]["set"])
    names = sorted(os.listdir(os.path.join(root, "images")))
    camera = formats.choose_camera(datasets.read_cameras(root), rows[0]["image0"])
    K = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    lens = [*datasets.distortion_of(camera), 0, 0, 0, 0, 0][:5]
    parts, frames, opened = [], [], {}
    for row in rows:
        file, k = row["matches"]
        if file not in opened:
            opened[file] = np.load(os.path.join(folder, file))
        both = [opened[file][f"keypoints{v}_{k}"] for v in (0, 1)]
        chosen = random.permutation(len(both[0]))[:MOST_MATCHES]
        parts.append([np.column_stack([b["x"], b["y"]]).astype(float)[chosen] for b in both])
        E = essential(row["R_true"], row["t_true"])
        parts[-1].append(np.repeat(E[None], len(chosen), axis=0))
        ends = sorted(names.index(row[key]) for key in ("image0", "image1"))
        frames += [ends] * len(chosen)
    return Sample(*(np.concatenate(p) for p in zip(*parts)), K), np.array(frames), lens


def report(sample, lens, radius):
    residuals, outer = np.abs(sample.residuals_px(lens)), sample.outer(radius)
    return ", ".join(f"{name} {np.median(r):.2f} ({np.percentile(r, 80):.2f})"
                     for name, r in (("outer", residuals[outer]), ("others", residuals[~outer]))
                     if len(r))


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", help="--rows of scripts/belief, of one set")
    parser.add_argument("matches", help="--matches of scripts/belief")
    parser.add_argument("--most-gap", type=int, default=64, help="frames between two images")
    parser.add_argument("--pairs", type=int, default=220)
    parser.add_argument("--outer", type=float, default=0.6, help="in focal lengths (default 0.6)")
    arguments = parser.parse_args(argv)
    with open(arguments.rows, encoding="utf-8") as file:
        rows = [json.loads(line) for line in file]
    sample, frames, lens = read_sample(rows, arguments.matches, arguments.most_gap, arguments.pairs)
    middle = np.median(frames)
    halves = {"first half": frames[:, 1] < middle, "second half": frames[:, 0] >= middle}
    fitted = {"the file's lens": np.array(lens)}
    for name, chosen in [*halves.items(), ("all", np.ones(len(frames), bool))]:
        fitted[f"fitted on {name}"] = fit(sample.part(chosen), lens)
    for name, found in fitted.items():
        print(f"{name}: " + " ".join(f"{v:.5f}" for v in found))
        for half, chosen in halves.items():
            print(f"  {half}: {report(sample.part(chosen), found, arguments.outer)} px")


if __name__ == "__main__":
    main()
