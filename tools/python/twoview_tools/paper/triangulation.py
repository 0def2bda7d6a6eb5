"""Figure 13 and table 1: the weights of Iterative-LS in each iteration, and a comparison of seven
triangulation methods.

R. Hartley, P. Sturm, "Triangulation", CVIU 68(2), 1997. Iterative-LS is computed here from their
definition, with 4 x 3 equations in pixels and numpy's least squares; the library eliminates
unknowns first."""

import time
from dataclasses import replace

import cv2
import numpy as np

from . import drawing, ransac
from .experiment import Experiment, Missing, Result, Table
from .inputs import Pair, library

METHODS = {"Poly": "POLY", "Poly-Abs": "POLY_ABS", "Linear-Eigen": "LINEAR_EIGEN",
           "Linear-LS": "LINEAR_LS", "Iterative-Eigen": "ITERATIVE_EIGEN",
           "Iterative-LS": "ITERATIVE_LS", "Midpoint": "MIDPOINT"}
OPENCV = "OpenCV triangulatePoints"
PAPER_TIMES = {"Poly": 14, "Poly-Abs": 30, "Linear-Eigen": 3, "Linear-LS": 2, "Iterative-Eigen": 5,
               "Iterative-LS": 3, "Midpoint": 2}  # as in the paper's table 1
ROUNDS = 6
NOISE_PX = 1.0


# ---- scenes ----

def scene(kind, num=2000, noise_px=NOISE_PX, seed=7):
    """(pair without images, true points, noisy pixels0, noisy pixels1): 640x480, f = 500, |t| = 1,
    depths of 4 to 20 baselines. For kind "converging": optical axes that cross 1.31 baselines away
    at an angle of 45 degrees, and depths of 0.9 to 1.5 baselines."""
    tv = library()
    camera = tv.Camera(640, 480, 500, 500, 319.5, 239.5)
    angle = np.pi / 4 if kind == "converging" else 0.0
    R = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    center = {"sideways": (1, 0, 0), "forward": (0, 0, 1),
              "converging": (np.cos(np.pi / 8), 0, np.sin(np.pi / 8))}[kind]
    pair = Pair(kind, (), (camera, camera), R, -R @ np.array(center, float), 1.0)
    random = np.random.default_rng(seed)
    far = (
        random.uniform(0.9, 1.5, 8 * num)
        if kind == "converging"
        else random.uniform(4, 20, 8 * num)
    )
    seen = random.uniform((0, 0), (640, 480), (8 * num, 2))
    points = np.column_stack([(seen - (319.5, 239.5)) / 500 * far[:, None], far])
    there = pixels_of(pair, 1, points)
    inside = ((there >= 0) & (there <= (640, 480))).all(axis=1) & (
        (points @ R.T + pair.t)[:, 2] > 0
    )
    points = points[inside][:num]
    noisy = [
        pixels_of(pair, view, points) + random.normal(0, noise_px, (len(points), 2))
        for view in (0, 1)
    ]
    return pair, points, noisy[0], noisy[1]


def projection(pair, view):
    """The 3 x 4 projection matrix in pixels, for |t| = 1."""
    pose = np.column_stack([np.eye(3), np.zeros(3)] if view == 0 else [pair.R, pair.t])
    return pair.cameras[view].K @ pose


def pixels_of(pair, view, points):
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ projection(pair, view).T
    return homogeneous[:, :2] / homogeneous[:, 2:]


def errors_px(pair, points, pixels0, pixels1):
    """The reprojection error of each match: the root mean square of its distances in both
    images."""
    off = [np.sum((pixels_of(pair, view, points) - pixels) ** 2, axis=1)
           for view, pixels in ((0, pixels0), (1, pixels1))]
    return np.sqrt((off[0] + off[1]) / 2)


# ---- figure 13 ----

def iterative_ls(pair, pixels0, pixels1, rounds=ROUNDS):
    """(points, weights) of each iteration, (rounds, n, 3) and (rounds, n, 2). The equations u p3.X
    - p1.X and v p3.X - p2.X of camera i are multiplied by its weight, which is 1 at first and then
    1 / (p3.X) with X from the last iteration."""
    P = [projection(pair, view) for view in (0, 1)]
    n = len(pixels0)
    rows = np.stack([pixels[:, k, None] * P[view][2] - P[view][k]
                     for view, pixels in ((0, pixels0), (1, pixels1)) for k in (0, 1)], axis=1)
    weights = np.ones((n, 2))
    all_points, all_weights = [], []
    for _ in range(rounds):
        weighted = rows * np.repeat(weights, 2, axis=1)[:, :, None]
        A, b = weighted[:, :, :3], -weighted[:, :, 3]
        points = np.stack([np.linalg.lstsq(A[i], b[i], rcond=None)[0] for i in range(n)])
        all_points.append(points)
        all_weights.append(weights)
        homogeneous = np.column_stack([points, np.ones(n)])
        weights = 1 / np.stack([homogeneous @ p[2] for p in P], axis=1)
    return np.array(all_points), np.array(all_weights)


def forward_pair(inputs):
    """(pair, pixels0, pixels1): the inliers of a camera that drives forward. The pose is the
    estimated one, and the cameras are those that it refers to."""
    pair = inputs.listed_pair("kitti00_turn", "000100.png", "000104.png", "KITTI, 1.65 m forward")
    tv = library()
    pixels0, pixels1, ratios = ransac.matches_of(pair)
    with tv.Context(max_matches=len(pixels0)) as context:
        found, inliers = tv.estimate_two_view(context, *pair.cameras, pixels0, pixels1, ratios)
    if found.R is None or found.t is None:
        raise Missing("a pose of the KITTI pair")
    cameras = tuple(tv.corrected_camera(found, camera) for camera in pair.cameras)
    points = tv.triangulate(
        *cameras, found.R, found.t, pixels0[inliers].copy(), pixels1[inliers].copy()
    )
    good = points["status"] == tv.PointStatus.OK
    estimated = Pair(pair.name, pair.colour, cameras, found.R, found.t, 1.0)
    return estimated, pixels0[inliers][good].copy(), pixels1[inliers][good].copy()


def weights_study(pair, pixels0, pixels1):
    """Measures figure 13, the weights of Iterative-LS, for matches given as pixels."""
    tv = library()
    points, weights = iterative_ls(pair, pixels0, pixels1)
    errors = np.array([errors_px(pair, p, pixels0, pixels1) for p in points])
    ours = tv.triangulate(*pair.cameras, pair.R, pair.t, pixels0, pixels1,
                          tv.Triangulation.ITERATIVE_LS)
    ok = ours["status"] == tv.PointStatus.OK
    off = np.linalg.norm(ours["position"] - points[-1], axis=1) / np.linalg.norm(points[-1], axis=1)
    numbers = {
        "pair": pair.name,
        "matches": len(pixels0),
        "rms_px": np.sqrt((errors[:, ok] ** 2).mean(axis=1)).tolist(),
        "weight_ratio_median": np.median(weights[:, ok, 1] / weights[:, ok, 0], axis=1).tolist(),
        "library_rms_px": float(np.sqrt((ours["error_px"][ok].astype(float) ** 2).mean())),
        "library_difference_p99": float(np.percentile(off[ok], 99)),
    }
    return numbers, points, weights, errors, ok


def excess_percent(numbers):
    """The excess of the root mean square error over its final value, for each iteration, in per
    cent."""
    rms = np.array(numbers["rms_px"])
    return 100 * (rms / rms[-1] - 1)


def draw_rounds(weights, shown, numbers, drawn):
    sheet, axes = drawing.sheet(11, 3.5, 1, 3)
    rounds = np.arange(ROUNDS)
    for k, colour in zip(shown, (drawing.BLUE, drawing.ORANGE, drawing.GOOD)):
        for view, style in ((0, "o-"), (1, "s--")):
            axes[0].plot(rounds, weights[:, k, view], style, color=colour, markersize=4)
        change = np.abs(np.diff(weights[:, k], axis=0) / weights[1:, k]).max(axis=1)
        axes[1].plot(rounds[1:], np.maximum(change, 1e-16), "o-", color=colour, markersize=4)
    for view, style in ((0, "ko-"), (1, "ks--")):
        axes[0].plot([], [], style, label=f"camera {view}", markersize=4)
    axes[0].set_ylim(0, 1.05)
    axes[0].set_title("Weights 1 / (p3 · X) of three matches")
    axes[1].set_yscale("log")
    axes[1].set_title("Their relative change in a round")
    axes[2].plot(rounds, excess_percent(numbers), "o-", color=drawing.BLUE, markersize=4,
                 label=f"KITTI, {numbers['matches']} matches")
    axes[2].plot(rounds, excess_percent(drawn), "s-", color=drawing.ORANGE, markersize=4,
                 label=f"table 1's forward scene, {NOISE_PX:g} px of noise")
    axes[2].set_title("Root mean square above its last value [%]")
    for axis in axes:
        axis.set_xlabel("round (0: Linear-LS)")
        axis.set_xticks(rounds)
    axes[0].legend()
    axes[2].legend()
    return drawing.finish(sheet, "Weights and errors of Iterative-LS by round")


def figure13(inputs):
    numbers, _, weights, errors, ok = weights_study(*forward_pair(inputs))
    pair, _truth, *pixels = scene("forward")
    drawn = weights_study(pair, *pixels)[0]
    shown = np.argsort(-np.where(ok, errors[0] - errors[-1], -1))[:3]
    numbers["shown"] = [{"weights": weights[:, k].tolist(), "error_px": errors[:, k].tolist()}
                        for k in shown]
    rms = numbers["rms_px"]
    found = (
        f"{numbers['pair']}, {numbers['matches']} matches: the root mean square error falls from "
        f"{rms[0]:.4f} px (Linear-LS) to {rms[1]:.4f} px after one round and {rms[-1]:.4f} px at "
        f"the "
        f"end; the library's Iterative-LS has {numbers['library_rms_px']:.4f} px, its points are "
        f"these "
        f"to within {numbers['library_difference_p99']:.0e} of their distance (99 %). With table "
        f"1's noise "
        f"and nearer points, {drawn['rms_px'][0]:.3f} falls to {drawn['rms_px'][-1]:.3f} px. On "
        f"the left "
        "are the three matches that gain most."
    )
    return Result(
        {**numbers, "forward_scene": drawn},
        found,
        [draw_rounds(weights, shown, numbers, drawn)],
        [rounds_table(weights[:, shown[0]], errors[:, shown[0]])],
    )


def rounds_table(weights, errors):
    """Makes a Table with the weights and the error after each iteration for one match."""
    rows = [[str(k), *(f"{w:.6f}" for w in weights[k]), f"{errors[k]:.6f}"] for k in range(ROUNDS)]
    return Table("The match that gains most, round by round (0: Linear-LS)",
                 ["round", "weight, camera 0", "weight, camera 1", "reprojection error [px]"], rows)


# ---- table 1 ----

def dlt(pair, pixels0, pixels1):
    """Linear-Eigen from its definition: for each match the singular vector of the smallest singular
    value of the four equations."""
    P = [projection(pair, view) for view in (0, 1)]
    points = []
    for a, b in zip(pixels0, pixels1):
        rows = [p[k] * P[v][2] - P[v][k] for v, p in ((0, a), (1, b)) for k in (0, 1)]
        X = np.linalg.svd(
            np.array(rows) / np.array([c.fx for c in pair.cameras]).repeat(2)[:, None]
        )[2][-1]
        points.append(X[:3] / X[3])
    return np.array(points)


def opencv(pair, pixels0, pixels1):
    X = cv2.triangulatePoints(projection(pair, 0), projection(pair, 1), pixels0.T, pixels1.T)
    return (X[:3] / X[3]).T


def ours(method, pair, pixels0, pixels1):
    tv = library()
    return tv.triangulate(*pair.cameras, pair.R, pair.t, pixels0, pixels1,
                          tv.Triangulation[METHODS[method]])


def run_ns(method, scenes):
    """The CPU time in ns that a method takes to triangulate the points of all scenes."""
    begin = time.process_time_ns()
    for pair, _points, pixels0, pixels1 in scenes:
        if method in METHODS:
            ours(method, pair, pixels0, pixels1)
        else:
            opencv(pair, pixels0, pixels1)
    return time.process_time_ns() - begin


def times_ns(scenes, repetitions=25):
    """{method: ns for one point}: medians, with the methods measured in turn. The time of a call
    itself, measured from Python with one match, is subtracted."""
    taken = {method: [] for method in (*METHODS, OPENCV)}
    single = [(pair, points[:1], pixels0[:1].copy(), pixels1[:1].copy())
              for pair, points, pixels0, pixels1 in scenes]
    num = sum(len(s[1]) - 1 for s in scenes)
    for _ in range(repetitions):
        for method, runs in taken.items():
            runs.append((run_ns(method, scenes), run_ns(method, single)))
    return {
        method: float(np.subtract(*np.median(runs, axis=0))) / num for method, runs in taken.items()
    }


def through_a_lens(pair):
    """Returns the pair with cameras of negligible lens distortion, with which the library
    triangulates the points one by one."""
    model = library().CameraModel.BROWN_CONRADY
    cameras = tuple(replace(camera, model=model, k=(1e-9, 0, 0, 0, 0)) for camera in pair.cameras)
    return replace(pair, cameras=cameras)


def relative(times):
    return {method: 2 * ns / times["Midpoint"] for method, ns in times.items()}


def accuracy(pair, truth, positions, pixels0, pixels1):
    """The root mean square reprojection error in pixels, and the position error in per cent of the
    distance (median, 95 %)."""
    off = 100 * np.linalg.norm(positions - truth, axis=1) / np.linalg.norm(truth, axis=1)
    return {"rms_px": float(np.sqrt((errors_px(pair, positions, pixels0, pixels1) ** 2).mean())),
            "percent_median": float(np.median(off)), "percent_p95": float(np.percentile(off, 95))}


def motorcycle_points(pair):
    """The correct matches of the pair with their true points, in baselines."""
    pixels0, pixels1, _ = ransac.matches_of(pair)
    x, y = np.round(pixels0).astype(int).T
    depth = pair.depth0[y, x] / pair.baseline_m
    good = ransac.true_matches(pair, pixels0, pixels1) & np.isfinite(depth)
    rays = np.linalg.solve(pair.cameras[0].K, np.column_stack([pixels0, np.ones(len(pixels0))]).T).T
    return pair, (rays * depth[:, None])[good], pixels0[good].copy(), pixels1[good].copy()


def errors_table(scenes):
    """Returns {scene: {method: accuracy}} for the library's methods and OpenCV."""
    found = {}
    for name, (pair, truth, pixels0, pixels1) in scenes.items():
        found[name] = {
            m: accuracy(pair, truth, ours(m, pair, pixels0, pixels1)["position"], pixels0, pixels1)
            for m in METHODS
        }
        found[name][OPENCV] = accuracy(
            pair, truth, opencv(pair, pixels0, pixels1), pixels0, pixels1
        )
    return found


def table1(inputs):
    scenes = {kind: scene(kind) for kind in ("sideways", "forward", "converging")}
    times = times_ns(list(scenes.values()))
    singly = times_ns([(through_a_lens(pair), *rest) for pair, *rest in scenes.values()])
    listed, missing = dict(scenes), []
    try:
        listed["Motorcycle"] = motorcycle_points(inputs.motorcycle)
    except Missing as told:
        missing.append(str(told))
    errors = errors_table(listed)
    numbers = {"times_ns": times, "times_one_by_one_ns": singly, "relative_times": relative(times),
               "relative_times_one_by_one": relative(singly), "paper_relative_times": PAPER_TIMES,
               "errors": errors, "noise_px": NOISE_PX,
               "points": {name: len(s[1]) for name, s in listed.items()}}
    forward = {m: f"{e['rms_px']:.3f}" for m, e in errors["forward"].items()}
    one = relative(singly)
    found = (
        f"With pinhole cameras Midpoint takes {times['Midpoint']:.0f} ns a point, Iterative-LS "
        f"{times['Iterative-LS']:.0f} and Poly {times['Poly']:.0f}. One by one, through lenses, "
        f"Midpoint, "
        f"Iterative-LS and Poly are as 2 to {one['Iterative-LS']:.1f} to {one['Poly']:.1f}. Poly "
        f"has the "
        f"least pixel error everywhere; flying forward, Poly has {forward['Poly']} px, "
        f"Iterative-LS "
        f"{forward['Iterative-LS']} and Linear-LS {forward['Linear-LS']}."
    )
    return Result(
        numbers, found, [draw_times(relative(times), one)], [times_table(numbers)], missing
    )


def times_table(numbers):
    errors, times = numbers["errors"], numbers["times_ns"]
    singly = {
        m: f"{ratio:.1f}"
        for m, ratio in numbers["relative_times_one_by_one"].items()
        if m in METHODS
    }
    rows = [
        [
            m,
            str(PAPER_TIMES.get(m, "–")),
            singly.get(m, "–"),
            f"{numbers['relative_times'][m]:.1f}",
            f"{times[m]:.0f}",
            *(
                f"{errors[n][m]['rms_px']:.3f}, {errors[n][m]['percent_median']:.2f}"
                for n in errors
            ),
        ]
        for m in times
    ]
    caption = (
        "Times with Midpoint as 2; errors: rms px to the measured pixels, median per cent of the "
        f"distance. Three drawn scenes of 2000 points with {NOISE_PX:g} px of noise, and "
        "Motorcycle's right matches under the true pose and depth"
    )
    return Table(
        caption,
        [
            "method",
            "time, paper",
            "time, one by one",
            "time, pinholes",
            "ns a point, pinholes",
            *errors,
        ],
        rows,
        list(times).index("Iterative-LS"),
    )


def draw_times(pinholes, singly):
    sheet, axis = drawing.sheet(8, 3.4)
    places = np.arange(len(METHODS))
    for shift, times, colour, label in (
        (-0.27, PAPER_TIMES, drawing.GREY, "paper"),
        (0, singly, drawing.BLUE, "twoview, one by one"),
        (0.27, pinholes, drawing.ORANGE, "twoview, pinhole cameras"),
    ):
        axis.barh(places + shift, [times[m] for m in METHODS], 0.26, color=colour, label=label)
    axis.set_yticks(places, METHODS)
    axis.invert_yaxis()
    axis.set_xscale("log")
    axis.set_xlim(1, None)
    axis.set_xlabel("relative time, Midpoint = 2")
    sheet.legend(loc="outside upper center", ncols=3)
    return drawing.finish(sheet, "Relative times of the seven triangulations, the paper's and ours")


EXPERIMENTS = [
    Experiment(
        "figure13",
        "Triangulation",
        "Figure 13: the iterated weights of Iterative-LS",
        "The weights w = 1 / (P3 X) that Iterative-LS gives its equations, round by round, and how "
        "the "
        "error falls with them.",
        "The weights only matter where the two depths differ: in sideways flight both are equal "
        "and "
        "Iterative-LS is Linear-LS, so the pair here drives forward. The library iterates at most "
        "ten "
        "rounds and stops when both depths move by less than 1e-10; it eliminates the depth in "
        "closed "
        "form, so no normal matrix is formed, whose condition would grow with the depth's square.",
        figure13,
    ),
    Experiment(
        "table1",
        "Triangulation",
        "Table 1: seven triangulations, relative times and errors",
        "Relative times 14 for Poly, 30 for Poly-Abs, 3 for Linear-Eigen, 2 for Linear-LS, 5 for "
        "Iterative-Eigen, 3 for Iterative-LS and 2 for Midpoint; Iterative-LS is chosen.",
        "Our Poly needs no polynomial of degree 6: one monotonic equation gives the proved minimum "
        "in "
        "about two Newton steps, so that it costs hardly more than the iterations "
        "(docs/algorithms/triangulation.md). With pinholes Linear-LS, Iterative-LS and Midpoint "
        "take "
        "several points at once, and leave all others far behind. Ours also tells angle, error and "
        "status "
        "of each point in that time. Iterative-LS is the default, as in the paper.",
        table1,
    ),
]
