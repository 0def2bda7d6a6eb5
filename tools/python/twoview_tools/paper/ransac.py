"""Figures 8 and 9: RANSAC for a line, and for the matches of two views.

M. Fischler, R. Bolles, "Random sample consensus", 1981. The library has no line estimator, so the
loop of figure 8 is written here to show the principle; figure 9 uses the library."""

import cv2
import numpy as np

from . import drawing
from .experiment import Experiment, Result, Table, available
from .inputs import library

NUM_POINTS, NUM_INLIERS = 500, 300  # of a simulated line, as in the paper's figure 8
SIGMA_PX, THRESHOLD_PX = 1.0, 2.5
SIZE = 640, 480
NUM_RUNS = 1000
CONFIDENCE = 0.9999
DRAWN_INLIERS = 110  # figure 9 draws about this many inliers


def line_points(random):
    """Returns (500 points, a mask of the 300 that lie on a line with perpendicular noise)."""
    angle = random.uniform(0, np.pi)
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    middle = np.array(SIZE) / 2 + random.uniform(-60, 60, 2)
    inliers = (middle + np.outer(random.uniform(-220, 220, NUM_INLIERS), along)
               + np.outer(random.normal(0, SIGMA_PX, NUM_INLIERS), across))
    outliers = random.uniform((0, 0), SIZE, (NUM_POINTS - NUM_INLIERS, 2))
    order = random.permutation(NUM_POINTS)
    return np.concatenate([inliers, outliers])[order], (np.arange(NUM_POINTS) < NUM_INLIERS)[order]


def line_through(points):
    """(normal, offset) of the line with the least squared distances: normal . x = offset."""
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][-1]
    return normal, float(normal @ middle)


def within(points, line):
    normal, offset = line
    return np.abs(points @ normal - offset) < THRESHOLD_PX


def ransac_line(points, random):
    """(inliers, number of samples): the paper's loop with two points a sample, then one fit to all
    inliers."""
    best, drawn, wanted = np.zeros(len(points), bool), 0, 1000
    while drawn < wanted:
        drawn += 1
        first, second = random.choice(len(points), 2, replace=False, shuffle=False)
        normal = np.array([[0, -1], [1, 0]]) @ (points[second] - points[first])
        normal /= np.linalg.norm(normal)
        found = within(points, (normal, normal @ points[first]))
        if found.sum() > best.sum():
            best = found
            share = best.mean() ** 2
            wanted = min(1000, np.log(1 - CONFIDENCE) / np.log1p(-min(share, 1 - 1e-12)))
    return within(points, line_through(points[best])), drawn


def line_run(seed):
    random = np.random.default_rng(seed)
    points, truth = line_points(random)
    found, drawn = ransac_line(points, random)
    return {"points": points, "truth": truth, "found": found, "samples": drawn,
            "right": int((found & truth).sum()), "wrong": int((found & ~truth).sum())}


def draw_line_run(axis, run):
    groups = (
        (run["found"] & run["truth"], drawing.GOOD, "o", f"found, of the line: {run['right']}"),
        (run["found"] & ~run["truth"], drawing.ORANGE, "D", f"found by chance: {run['wrong']}"),
        (~run["found"] & run["truth"], drawing.BAD, "s", f"missed: {NUM_INLIERS - run['right']}"),
        (~run["found"] & ~run["truth"], drawing.GREY, "x", "outliers"),
    )
    for chosen, colour, marker, label in groups:
        axis.plot(*run["points"][chosen].T, marker, color=colour, markersize=3.5, label=label,
                  linestyle="none")
    axis.set_aspect("equal")
    axis.set_xlim(0, SIZE[0])
    axis.set_ylim(SIZE[1], 0)
    axis.set_title(f"One run: {run['samples']} samples of two points")
    axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)


def figure8(_inputs):
    runs = [line_run(seed) for seed in range(NUM_RUNS)]
    right = np.array([r["right"] for r in runs])
    samples = np.array([r["samples"] for r in runs])
    sheet, axes = drawing.sheet(11, 3.7, 1, 2, width_ratios=(1.9, 1))
    draw_line_run(axes[0], runs[0])
    axes[1].hist(right, bins=np.arange(right.min() - 0.5, NUM_INLIERS + 1), color=drawing.GOOD)
    axes[1].set_xlabel(f"of the {NUM_INLIERS} points of the line, found")
    axes[1].set_title(f"{NUM_RUNS} runs")
    numbers = {
        "points": NUM_POINTS,
        "inliers": NUM_INLIERS,
        "sigma_px": SIGMA_PX,
        "threshold_px": THRESHOLD_PX,
        "found_first_run": runs[0]["right"],
        "by_chance_first_run": runs[0]["wrong"],
        "samples_first_run": runs[0]["samples"],
        "runs": NUM_RUNS,
        "found_median": float(np.median(right)),
        "found_least": int(right.min()),
        "by_chance_median": float(np.median([r["wrong"] for r in runs])),
        "samples_median": float(np.median(samples)),
    }
    found = (
        f"Of {NUM_POINTS} points with {NUM_INLIERS} on a line (noise {SIGMA_PX:g} px, threshold "
        f"{THRESHOLD_PX:g} px) the first run finds {runs[0]['right']} of the {NUM_INLIERS} and "
        f"{runs[0]['wrong']} outliers that lie near the line by chance, after {runs[0]['samples']} "
        f"samples. Over {NUM_RUNS} runs: median {numbers['found_median']:.0f} of {NUM_INLIERS}, "
        f"never "
        f"fewer than {numbers['found_least']}."
    )
    return Result(
        numbers,
        found,
        [drawing.finish(sheet, "RANSAC on a line, and how many of its points it " "finds")],
    )


# ---- figure 9 ----

def matches_of(pair, **options):
    """(pixels0, pixels1, ratios) of FAST-12 corners with plain SIFT, the paper's front end."""
    tv = library()
    height = max(image.shape[0] for image in pair.grey)
    width = max(image.shape[1] for image in pair.grey)
    feature = {"arc": 12, "threshold": 10, "levels": 1, "cell_px": 0,
               "descriptor": tv.Normalisation.SIFT, **options}
    with tv.Context(max_width=width, max_height=height) as context:
        (keys0, bytes0), (keys1, bytes1) = (
            tv.extract(context, image, **feature) for image in pair.grey
        )
        found = tv.match(context, bytes0, bytes1)
    pixels = [np.column_stack([keys["x"], keys["y"]]).astype(float)[found[index]]
              for keys, index in ((keys0, "idx0"), (keys1, "idx1"))]
    return np.ascontiguousarray(pixels[0]), np.ascontiguousarray(pixels[1]), found["ratio"].copy()


def true_matches(pair, pixels0, pixels1):
    """A mask of the correct matches: within truth_px of the true epipolar line and, where the depth
    is known, within 2 truth_px of the true position."""
    lines = np.column_stack([pixels0, np.ones(len(pixels0))]) @ pair.true_F.T
    distance = np.abs(np.sum(lines[:, :2] * pixels1, axis=1) + lines[:, 2]) / np.hypot(
        *lines[:, :2].T
    )
    right = distance < pair.truth_px
    if pair.depth0 is not None:
        x, y = np.round(pixels0).astype(int).T
        depth = pair.depth0[np.clip(y, 0, pair.depth0.shape[0] - 1),
                            np.clip(x, 0, pair.depth0.shape[1] - 1)] / pair.baseline_m
        rays = np.linalg.solve(
            pair.cameras[0].K, np.column_stack([pixels0, np.ones(len(pixels0))]).T
        ).T
        points = (rays * depth[:, None]) @ pair.R.T + pair.t
        seen = points @ pair.cameras[1].K.T
        off = np.linalg.norm(seen[:, :2] / seen[:, 2:] - pixels1, axis=1)
        right &= ~(off > 2 * pair.truth_px)  # NaN, an unknown depth, compares false: no rejection
    return right


def estimates(pair, pixels0, pixels1, ratios):
    """{name: (inliers, number of samples or None)} of each estimator."""
    tv = library()
    found = {}
    with tv.Context(max_matches=len(pixels0)) as context:
        for name, cameras, method in (
            ("eight-point, no camera", (None, None), tv.Solver.EIGHT_POINT),
            ("five-point, calibrated", pair.cameras, tv.Solver.FIVE_POINT),
        ):
            result, inliers = tv.estimate_two_view(context, *cameras, pixels0, pixels1, ratios,
                                                   method=method)
            found[name] = inliers, result.num_iterations
    cv2.setRNGSeed(1)
    mask = cv2.findFundamentalMat(pixels0, pixels1, cv2.FM_RANSAC, 1.0, 0.9999, 10000)[1]
    found[f"OpenCV {cv2.__version__} FM_RANSAC"] = mask.ravel().astype(bool), None
    return found


def draw_matches(axis, pair, pixels0, pixels1, inliers):
    left, right = pair.grey
    canvas = np.full(
        (max(left.shape[0], right.shape[0]), left.shape[1] + right.shape[1]), 255, np.uint8
    )
    canvas[:left.shape[0], :left.shape[1]] = left
    canvas[:right.shape[0], left.shape[1]:] = right
    drawing.show(axis, canvas)
    offset = np.array([left.shape[1], 0])
    few = np.flatnonzero(inliers)[::max(1, int(inliers.sum()) // DRAWN_INLIERS)]
    for chosen, colour in ((np.flatnonzero(~inliers), "#f0545c"), (few, "#34d17f")):
        x = np.stack([pixels0[chosen][:, 0], (pixels1 + offset)[chosen][:, 0]])
        y = np.stack([pixels0[chosen][:, 1], pixels1[chosen][:, 1]])
        axis.plot(x, y, ".-", color=colour, linewidth=0.7, markersize=2.5, alpha=0.8)


def pairs_of_figure9(inputs):
    """Returns (pairs, a list of sentences about missing pairs)."""
    def office():
        return inputs.listed_pair(
            "tum_fr3_office", *first_pair(inputs, "tum_fr3_office", 20), "TUM office", truth_px=5.0
        )
    return available(lambda: inputs.motorcycle, office)


def first_pair(inputs, folder, index):
    """The two image names in pair line `index`, from 0, of the pairs.txt in `folder`."""
    with open(inputs.of_data(folder, "pairs.txt"), encoding="utf-8") as f:
        return [line.split()[:2] for line in f if line.strip() and not line.startswith("#")][index]


def studied(axis, pair):
    """(numbers, rows of the table) of a pair, whose matches are drawn."""
    pixels0, pixels1, ratios = matches_of(pair)
    right = true_matches(pair, pixels0, pixels1)
    numbers, rows = {"matches": len(pixels0), "right": int(right.sum()), "methods": {}}, []
    for name, (inliers, samples) in estimates(pair, pixels0, pixels1, ratios).items():
        kept, both = int(inliers.sum()), int((inliers & right).sum())
        numbers["methods"][name] = {"inliers": kept, "right": both, "samples": samples}
        rows.append(
            [
                f"{pair.name}: {name}",
                str(len(pixels0)),
                str(kept),
                f"{both} of {numbers['right']}",
                f"{100 * both / max(1, kept):.1f} %",
                "–" if samples is None else str(samples),
            ]
        )
        if name.startswith("eight"):
            draw_matches(axis, pair, pixels0, pixels1, inliers)
            axis.set_title(f"{pair.name}: {kept} inliers of {len(pixels0)} matches")
    return numbers, rows


def figure9(inputs):
    pairs, missing = pairs_of_figure9(inputs)
    sheet, axes = drawing.sheet(11, 4.1 * len(pairs), len(pairs), 1, squeeze=False)
    studies = {pair.name: studied(axis, pair) for axis, pair in zip(axes[:, 0], pairs)}
    numbers = {name: entry for name, (entry, _) in studies.items()}
    first = numbers[pairs[0].name]
    eight = first["methods"]["eight-point, no camera"]
    found = (
        f"On {pairs[0].name} RANSAC with the eight-point algorithm keeps {eight['inliers']} of "
        f"{first['matches']} matches, of which {eight['right']} are right by the true depth. "
        f"Drawn: about "
        "a hundred of the inliers, green, and all outliers, red."
    )
    table = Table(
        "Inliers at 1 px. Right: within 2 px of the true epipolar line (the office, whose truth is "
        "good to half a degree: 5 px), and within 4 px of the true place where depth is known",
        [
            "pair: method",
            "matches",
            "inliers",
            "right ones kept",
            "of the inliers right",
            "samples",
        ],
        [row for _, rows in studies.values() for row in rows],
    )
    picture = drawing.finish(
        sheet,
        "Matches of two views: about a hundred of the inliers in green, all " "outliers in red",
    )
    return Result(numbers, found, [picture], [table], missing)


EXPERIMENTS = [
    Experiment(
        "figure8",
        "Matching and RANSAC",
        "Figure 8: RANSAC finds a line",
        f"A demonstration: {NUM_POINTS} points, {NUM_INLIERS} of which lie on a line, and the ones "
        "that RANSAC finds.",
        "This loop is the plain one: samples of two, the most inliers win, one fit at the end. The "
        "library's own, for two views, differs in three ways: half of its samples come from the "
        "surest "
        "matches first (PROSAC), the score is MSAC's and not a count, and each new best is "
        "optimised "
        "locally (docs/algorithms/two_view.md).",
        figure8,
    ),
    Experiment(
        "figure9",
        "Matching and RANSAC",
        "Figure 9: inliers by RANSAC and eight-point",
        "The matches of two views that RANSAC over the eight-point fundamental matrix keeps.",
        "The paper samples eight matches without cameras; so does --method eight-point. Our "
        "default "
        "samples five and uses the cameras that are known anyway: with a share w of right matches "
        "a "
        "sample is clean with probability w^5 in place of w^8, and a plane does not defeat it.",
        figure9,
    ),
]
