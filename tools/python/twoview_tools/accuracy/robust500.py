#!/usr/bin/env python3
"""Compares our robust essential estimate with PoseLib's: error and time on simulated matches.

  scripts/accuracy --robust500                   # 200 problems for each share of inliers
  scripts/python -m twoview_tools.accuracy.robust500 --problems 50 \\
      --lib build/release/lib/libtwoview.so

A problem is 500 matches in random order, without ratios, of two 640x480 pinhole views (f 500). The
rotation turns by 1 to 12 degrees about any axis, the baseline has any direction; true matches lie
2 to 8 baselines deep, spread evenly over image 0, with 0.5 px of Gaussian noise a coordinate in
both images; wrong ones pair two points spread evenly over the images. Problem k of every share is
made by numpy's default_rng((k, share in per cent)). Each problem goes to ours at the library's
defaults and to PoseLib at 1 px with its defaults and with min_iterations=50, in turn, all of it
through Python in one process pinned to one core; a time is the CPU time of the best of --repeats
calls. The error is the larger of the rotation's and the translation direction's angle.

What must hold: our median error is not above that of either PoseLib configuration, and our time is
at most a third of theirs.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import sys
import time

import numpy as np

from . import metrics, twoview_ctypes

WIDTH, HEIGHT, FOCAL = 640, 480, 500.0
CENTRE = np.array([320.0, 240.0])
K = np.array([[FOCAL, 0, CENTRE[0]], [0, FOCAL, CENTRE[1]], [0, 0, 1]])
NOISE_PX = 0.5
SHARES = (30, 50, 80)  # correct matches among all matches, per cent


def _direction(random):
    v = random.normal(size=3)
    return v / np.linalg.norm(v)


def _rotation(axis, angle):
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _inside(pixels):
    return ((pixels > 0) & (pixels < [WIDTH - 1, HEIGHT - 1])).all(axis=-1)


def problem(share, number, num=500):
    """(pixels0, pixels1, R, t) of problem `number` with `share` per cent of true matches."""
    random = np.random.default_rng((number, share))
    num_true = num * share // 100
    while True:
        R = _rotation(_direction(random), np.radians(random.uniform(1, 12)))
        t = _direction(random)
        pixels0 = random.uniform([5, 5], [WIDTH - 6, HEIGHT - 6], (20 * num, 2))
        rays = np.column_stack([(pixels0 - CENTRE) / FOCAL, np.ones(len(pixels0))])
        points = random.uniform(2, 8, (len(rays), 1)) * rays @ R.T + t
        pixels1 = FOCAL * points[:, :2] / points[:, 2:] + CENTRE
        seen = np.flatnonzero((points[:, 2] > 0) & _inside(pixels1))[:num_true]
        if len(seen) == num_true:
            break
    wrong = [random.uniform([5, 5], [WIDTH - 6, HEIGHT - 6], (num - num_true, 2)) for _ in "01"]
    pixels0 = np.concatenate(
        [pixels0[seen] + random.normal(0, NOISE_PX, (num_true, 2)), wrong[0]])
    pixels1 = np.concatenate(
        [pixels1[seen] + random.normal(0, NOISE_PX, (num_true, 2)), wrong[1]])
    order = random.permutation(num)
    return pixels0[order], pixels1[order], R, t


def _ours(context):
    camera = twoview_ctypes.make_camera(K, WIDTH, HEIGHT)

    def run(pixels0, pixels1):
        result, _ = context.estimate_two_view(camera, camera, pixels0, pixels1)
        return (
            (np.array(result.R).reshape(3, 3), np.array(result.t)) if result.has_t else (None,) * 2
        )
    return run


def _poselib(**options):
    import poselib
    camera = {"model": "PINHOLE", "width": WIDTH, "height": HEIGHT,
              "params": [FOCAL, FOCAL, *CENTRE]}

    def run(pixels0, pixels1):
        pose, _ = poselib.estimate_relative_pose(pixels0, pixels1, camera, camera,
                                                 {"max_epipolar_error": 1.0, **options}, {})
        return np.array(pose.R), np.array(pose.t)
    return run


def measure(share, runners, num_problems, repeats):
    """Returns {estimator: (errors in degrees, times in ms)} of its runs on problems with this share
    of correct matches."""
    errors = {name: [] for name in runners}
    times = {name: [] for name in runners}
    for number in range(num_problems):
        pixels0, pixels1, R, t = problem(share, number)
        for name, run in runners.items():
            best = np.inf
            for _ in range(repeats):
                start = time.thread_time()
                R_found, t_found = run(pixels0, pixels1)
                best = min(best, time.thread_time() - start)
            times[name].append(1e3 * best)
            errors[name].append(metrics.pose_error(R_found, t_found, R, t)["pose_error_deg"])
    return {name: (np.array(errors[name]), np.array(times[name])) for name in runners}


def run(library=None, num_problems=200, repeats=1, shares=SHARES, peers=True):
    """Prints the table. Returns True if all targets are reached."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    context = twoview_ctypes.Context(twoview_ctypes.Library(library), max_width=64, max_height=64,
                                     max_matches=500)
    runners = {"twoview": _ours(context)}
    if peers:
        runners["PoseLib"] = _poselib()
        runners["PoseLib, min_iterations 50"] = _poselib(min_iterations=50)
    print(f"{'true':>5} {'estimator':<28}{'median deg':>11}{'mean deg':>10}{'>5 deg':>8}"
          f"{'median ms':>11}{'mean ms':>10}{'time ratio':>12}")
    held = True
    for share in shares:
        found = measure(share, runners, num_problems, repeats)
        our_errors, our_times = found["twoview"]
        for name, (errors, times) in found.items():
            finite = errors[np.isfinite(errors)]
            ratio = np.median(times) / np.median(our_times)
            print(f"{share:>4}% {name:<28}{np.median(errors):>11.4f}{np.mean(finite):>10.4f}"
                  f"{int(np.sum(errors > 5)):>8}{np.median(times):>11.3f}{np.mean(times):>10.3f}"
                  f"{ratio:>12.2f}", flush=True)
        for name, (errors, times) in list(found.items())[1:]:
            accurate = np.median(our_errors) <= np.median(errors)
            fast = 3 * np.median(our_times) <= np.median(times)
            held = held and accurate and fast
            print(f"      {'holds' if accurate and fast else 'FAILS'}: {name}: error "
                  f"{'not above' if accurate else 'ABOVE'}, time "
                  f"{'at most' if fast else 'MORE than'} a third")
    return held


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=int, default=200, help="a share (default 200)")
    parser.add_argument("--repeats", type=int, default=1, help="calls a problem; the best counts")
    parser.add_argument("--shares", default=",".join(map(str, SHARES)), help="per cent of 500")
    parser.add_argument("--lib", help="libtwoview.so (default: of build/release)")
    parser.add_argument("--ours", action="store_true", help="without PoseLib")
    arguments = parser.parse_args()
    shares = [int(share) for share in arguments.shares.split(",")]
    if not run(arguments.lib, arguments.problems, arguments.repeats, shares, not arguments.ours):
        sys.exit(1)


if __name__ == "__main__":
    main()
