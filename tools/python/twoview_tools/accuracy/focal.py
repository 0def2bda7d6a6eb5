"""How well the covariance covers a focal length that is off, as one from --focal-35mm may be.

  scripts/python -m twoview_tools.accuracy.focal ROWS

ROWS: the file of `scripts/belief --rows`. Of its pairs that are "ok" and right, at most --pairs of
each set are estimated again with the focal length times 0.9, 1 and 1.1 and the standard deviation
that --focal-35mm implies. A line each: in how many the truth lies in the 95 per cent ellipsoid, and
rotation and direction within two sigmas, with the truth's stated errors; of all and of the "ok"."""

import argparse
import os

import numpy as np
import twoview

from . import belief, datasets, truth, twoview_ctypes

FACTORS = (0.9, 1.0, 1.1)
FILM = {f"calibration{i}.{part}": value for i in (0, 1)
        for part, value in twoview.FILM._asdict().items()}


class ScaledViews(belief.Views):
    """Views whose cameras have the focal length times a factor."""

    factor = 1.0

    def view(self, name, image, change=("", 1.0)):
        gray, (K, distortion) = super().view(name, image, change)
        K = np.array(K, float)
        K[[0, 1], [0, 1]] *= self.factor
        return gray, (K, distortion)


def choose(rows, num):
    """At most `num` "ok" and right pairs of each set whose direction counts, evenly spaced."""
    chosen, by_set = [], {}
    for row in rows:
        if (row["kind"] == "related" and row["trusted"] and row["verdict"] == "ok" and row["right"]
                and row["direction_counts"]):
            by_set.setdefault(row["set"], []).append(row)
    for some in by_set.values():
        chosen += [some[int(i)] for i in np.linspace(0, len(some) - 1, min(num, len(some)))]
    return chosen


def within_two_sigmas(row):
    return all(row[f"{part}_error_deg"]
               <= 2 * row[f"sigma_{part}_deg"] + row[f"truth_{part}_deg"]
               for part in ("rotation", "direction"))


def measure(pairs, factor, library):
    """(inside, within two sigmas, ok) of each pair with a covariance, as an array of booleans."""
    found, views, name = [], None, None
    for pair in pairs:
        if pair["set"] != name:
            name = pair["set"]
            sets = {name: truth.PosedSet(os.path.join(datasets.data_dir(), name))}
            views = ScaledViews(sets, library, ({}, {}, FILM))
            views.factor = factor
        job = "related", name, pair["image0"], name, pair["image1"], 1.0
        row, _ = belief.run_pair(views, job)
        if row["covariance"] is not None and row["inside_with_truth"] is not None:
            found.append((row["inside_with_truth"], within_two_sigmas(row), row["verdict"] == "ok"))
    return np.array(found, bool)


def main(argv=None):
    parser = argparse.ArgumentParser(prog="accuracy.focal", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", help="the file of scripts/belief --rows")
    parser.add_argument("--pairs", type=int, default=30, help="of each set (default 30)")
    parser.add_argument("--lib", help="libtwoview.so (default: build/release/lib)")
    arguments = parser.parse_args(argv)
    pairs = choose(belief.read_rows(arguments.rows), arguments.pairs)
    library = twoview_ctypes.Library(arguments.lib)
    print(f"{len(pairs)} pairs. focal length: with a covariance, % inside, % in two sigmas; "
          "ok, % inside, % in two sigmas")
    for factor in FACTORS:
        found = measure(pairs, factor, library)
        both = []
        for some in (found, found[found[:, 2]]):
            inside, in_two_sigmas = 100 * some[:, :2].mean(axis=0)
            both.append(f"{len(some)}, {inside:.1f}, {in_two_sigmas:.1f}")
        print(f"{factor:.1f}: {'; '.join(both)}", flush=True)


if __name__ == "__main__":
    main()
