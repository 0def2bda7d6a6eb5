#!/usr/bin/env python3
"""Compares tv_estimate_absolute_pose with PoseLib's and OpenCV's robust absolute pose on the same
matches.

  scripts/python -m twoview_tools.accuracy.absolute_pose                simulated matches
  scripts/python -m twoview_tools.accuracy.absolute_pose --real         of the sequences seq_*

Simulated: pixels all over an image of 640x480, points at 2 to 8 units, 1 px of noise, a share of
wrong matches, for which the pixel is anywhere in the image. Real: points triangulated from two
frames with their true poses, matched to a third frame, whose pose is estimated.
All use one threshold (--max-error-px). PoseLib runs with its own defaults, and once more with 100
instead of 1000 as the least number of samples ("poselib100"); OpenCV with its default and its USAC
(MAGSAC) method, confidence 0.9999 and at most 10000 samples. Time is this thread's CPU time
including each library's Python binding; errors are of the rotation in degrees and of the camera's
centre in percent of the median distance of the points, and in the mean an error counts as at most
5. The last columns are this library's mean error less the other one's, and the standard error of
that difference over the problems: what is above 0 by less than two of them is no evidence."""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import json
import sys
import time

import numpy as np
import twoview as tv

from .. import ROOT, formats
from . import datasets

os.environ.setdefault("TWOVIEW_LIBRARY",
                      os.path.join(ROOT, "build", "release", "lib", "libtwoview.so"))

WORST = 5.0  # the largest error that counts in a mean, and that of no pose


def optional(name):
    try:
        return __import__(name)
    except ImportError:
        return None


cv2, poselib = optional("cv2"), optional("poselib")


def rotation_of(vector):
    """The rotation about a vector by its length."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / max(angle, 1e-300)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)


def rotation_of_quaternion(x, y, z, w):
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def errors_of(pose, truth, points):
    if pose is None:
        return WORST, WORST
    (R, t), (R_true, t_true) = pose, truth
    distance = np.median(np.linalg.norm(points @ R_true.T + t_true, axis=1))
    cosine = (np.trace(R @ R_true.T) - 1) / 2
    centre = np.linalg.norm(R.T @ t - R_true.T @ t_true)
    sine = np.linalg.norm(R - R_true) / np.sqrt(8)  # accurate for small angles
    angle = 2 * np.arcsin(min(sine, 1)) if cosine > 0 else np.arccos(np.clip(cosine, -1, 1))
    return min(np.degrees(angle), WORST), min(100 * centre / distance, WORST)


def estimators(limit_px):
    """{name: function of (context, camera, pixels, points) that returns (R, t) or None}."""

    def ours(context, camera, pixels, points):
        pose, _ = tv.estimate_absolute_pose(context, camera, pixels, points, max_error_px=limit_px)
        return None if pose.R is None else (pose.R, pose.t)

    def of_poselib(least):
        options = {"max_reproj_error": limit_px}
        if least:
            options["min_iterations"] = least

        def run(context, camera, pixels, points):
            k = list(camera.k) + [0.0] * 8
            given = {"model": "OPENCV", "width": camera.width, "height": camera.height,
                     "params": [camera.fx, camera.fy, camera.cx, camera.cy, *k[:4]]}
            if not any(k):
                given.update(model="PINHOLE", params=given["params"][:4])
            pose, info = poselib.estimate_absolute_pose(pixels, points, given, options, {})
            return (pose.R, pose.t) if info["num_inliers"] > 3 else None
        return run

    def of_opencv(method):
        def run(context, camera, pixels, points):
            distortion = np.array(camera.k, float) if any(camera.k) else None
            if method == "default":
                found, vector, t, _ = cv2.solvePnPRansac(
                    points, pixels, camera.K, distortion, reprojectionError=limit_px,
                    iterationsCount=10000, confidence=0.9999)
            else:
                parameters = cv2.UsacParams()
                parameters.confidence, parameters.maxIterations = 0.9999, 10000
                parameters.threshold = limit_px
                parameters.score = cv2.SCORE_METHOD_MAGSAC
                parameters.sampler = cv2.SAMPLING_UNIFORM
                parameters.loMethod = cv2.LOCAL_OPTIM_SIGMA
                found, _, vector, t, _ = cv2.solvePnPRansac(points, pixels, camera.K, distortion,
                                                            params=parameters)
            return (cv2.Rodrigues(vector)[0], t[:, 0]) if found else None
        return run

    found = {"twoview": ours}
    if poselib:
        found.update({"poselib": of_poselib(0), "poselib100": of_poselib(100)})
    if cv2:
        found.update({"opencv": of_opencv("default"), "opencv usac": of_opencv("usac")})
    return found


def simulated(seed, num, wrong, noise_px=1.0):
    """(camera, pixels, points, (R, t))."""
    random = np.random.default_rng([seed, num, int(100 * wrong)])
    camera = tv.Camera(640, 480, 500.0, 500.0, 319.5, 239.5)
    R, t = rotation_of(0.7 * random.normal(size=3)), random.normal(size=3)
    pixels = np.column_stack([random.uniform(0, 639, num), random.uniform(0, 479, num)])
    rays = np.column_stack([(pixels - [camera.cx, camera.cy]) / camera.fx, np.ones(num)])
    points = (rays * random.uniform(2, 8, num)[:, None] - t) @ R
    pixels += noise_px * random.normal(size=pixels.shape)
    few = int(round(wrong * num))
    pixels[:few] = np.column_stack([random.uniform(0, 639, few), random.uniform(0, 479, few)])
    return camera, pixels, np.ascontiguousarray(points), (R, t)


class Sequence:
    """A folder seq_*: its frames with their true poses cam_from_world."""

    def __init__(self, folder):
        (entry,) = formats.read_camera_set(os.path.join(folder, "cameras.yaml")).values()
        k = datasets.distortion_of(entry)
        with open(os.path.join(folder, "groundtruth.txt"), encoding="utf-8") as file:
            rows = [line.split() for line in file if not line.startswith("#")]
        truth = np.array(rows, float)
        with open(os.path.join(folder, "frames.txt"), encoding="utf-8") as file:
            names = [line.split() for line in file if line.strip() and not line.startswith("#")]
        self.frames = []  # (path, R, t), of frames whose pose is known
        for time_s, name in names:
            row = truth[np.argmin(np.abs(truth[:, 0] - float(time_s)))]
            if abs(row[0] - float(time_s)) > 0.005:
                continue
            R = rotation_of_quaternion(*row[4:]).T
            self.frames.append((os.path.join(folder, name), R, -R @ row[1:4]))
        height, width = datasets.read_luma(self.frames[0][0]).shape[:2]
        model = tv.CameraModel.BROWN_CONRADY if any(k) else tv.CameraModel.PINHOLE
        self.camera = tv.Camera(width, height, entry.fx, entry.fy, entry.cx, entry.cy, model,
                                k)

    def problem(self, context, first, step):
        """Matches of frame `first + 2 step` and points seen by the two frames before it, or None
        where they are fewer than 10."""
        chosen = [self.frames[first + k * step] for k in range(3)]
        features = [tv.extract(context, datasets.read_luma(path)) for path, _, _ in chosen]
        links = [tv.match(context, features[0][1], features[k][1], keypoints0=features[0][0],
                          keypoints1=features[k][0])
                 for k in (1, 2)]
        both, i, j = np.intersect1d(links[0]["idx0"], links[1]["idx0"], return_indices=True)
        if len(both) < 10:
            return None
        index = [both, links[0]["idx1"][i], links[1]["idx1"][j]]
        pixels = [np.ascontiguousarray(
            np.column_stack([f[0]["x"][at], f[0]["y"][at]]), float)
            for f, at in zip(features, index)]
        (_, R0, t0), (_, R1, t1), (_, R2, t2) = chosen
        points = tv.triangulate(self.camera, self.camera, R1 @ R0.T, t1 - R1 @ R0.T @ t0,
                                pixels[0], pixels[1])
        good = (points["status"] == tv.PointStatus.OK) & (points["angle_rad"] > 0.01) & \
            (points["error_px"] < 1.5)
        if good.sum() < 10:
            return None
        seen = np.ascontiguousarray((points["position"][good] - t0) @ R0)
        return self.camera, np.ascontiguousarray(pixels[2][good]), seen, (R2, t2)


def real(num, step):
    """Yields (name of the sequence, [problem])."""
    for name in sorted(os.listdir(datasets.data_dir())):
        folder = os.path.join(datasets.data_dir(), name)
        needed = [os.path.join(folder, needed) for needed in ("cameras.yaml", "groundtruth.txt")]
        if not name.startswith("seq_") or not all(map(os.path.isfile, needed)):
            continue  # seq_corridor has no true poses
        sequence = Sequence(folder)
        with tv.Context(max_width=sequence.camera.width,
                        max_height=sequence.camera.height) as context:
            firsts = np.linspace(0, len(sequence.frames) - 1 - 2 * step, num).astype(int)
            problems = [sequence.problem(context, int(first), step) for first in firsts]
        yield name, [p for p in problems if p is not None]


def measure(problems, methods):
    """{name: {"rotation", "centre": medians, "mean_rotation", "mean_centre", "none": share without
    a pose, "ms": median time, and of the others than the first "difference" and
    "difference_error": of rotation and centre, the first one's mean error less theirs}}."""
    with tv.Context(max_matches=100000, max_keypoints=1,
                    purposes=tv.Purpose.ABSOLUTE_POSE) as context:
        summary, of_first = {}, None
        for name, run in methods.items():
            errors, times, none = [], [], 0
            for camera, pixels, points, truth in problems:
                start = time.thread_time()
                try:
                    pose = run(context, camera, pixels, points)
                except (RuntimeError, ValueError) as error:  # cv2.error is a RuntimeError's kin
                    raise SystemExit(f"{name}: {error}") from error
                times.append(1e3 * (time.thread_time() - start))
                none += pose is None
                errors.append(errors_of(pose, truth, points))
            errors = np.array(errors)
            median, mean = np.median(errors, axis=0), np.mean(errors, axis=0)
            summary[name] = {"rotation": median[0], "centre": median[1], "mean_rotation": mean[0],
                             "mean_centre": mean[1], "none": none / len(problems),
                             "ms": float(np.median(times))}
            if of_first is None:
                of_first = errors
                continue
            less = of_first - errors
            summary[name]["difference"] = less.mean(axis=0).tolist()
            summary[name]["difference_error"] = (less.std(axis=0) / np.sqrt(len(less))).tolist()
    return summary


def print_line(title, summary):
    for name, s in summary.items():
        less = "".join(f"{value:+10.4f} ±{error:7.4f}" for value, error in
                       zip(s.get("difference", ()), s.get("difference_error", ())))
        print(f"{title:<28}{name:<13}{s['rotation']:9.4f}{s['centre']:9.4f}"
              f"{s['mean_rotation']:9.4f}{s['mean_centre']:9.4f}{100 * s['none']:6.1f}"
              f"{s['ms']:9.3f}{less}", flush=True)
        title = ""


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", action="store_true", help="measure on the sequences seq_*")
    parser.add_argument("--trials", type=int, default=100, help="problems a line (default 100)")
    parser.add_argument("--step", type=int, default=5, help="frames from one view to the next")
    parser.add_argument("--max-error-px", type=float, default=4.0)
    parser.add_argument("--only", default="", help="names of estimators, separated by commas")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args(arguments)
    if args.trials < 1 or args.step < 1 or not args.max_error_px > 0:
        parser.error("--trials, --step and --max-error-px are above 0")
    methods = estimators(args.max_error_px)
    if args.only:
        missing = sorted(set(args.only.split(",")) - set(methods))
        if missing:
            parser.error(f"no estimator {', '.join(missing)}; there are {', '.join(methods)}")
        methods = {name: methods[name] for name in args.only.split(",")}
    if args.real:
        lines = real(args.trials, args.step)
    else:
        lines = ((f"{num} matches, {int(100 * wrong)} % wrong",
                  [simulated(seed, num, wrong) for seed in range(args.trials)])
                 for num in (20, 100, 1000) for wrong in (0, 0.3, 0.6, 0.8))
    if not args.json:
        first = next(iter(methods))
        print(f"{'':<41}{'median':>18}{'mean':>18}{'none':>6}{'ms':>9}{first + ' less this':>38}")
        print(f"{'':<41}" + f"{'rot':>9}{'centre':>9}" * 2 + f"{'%':>6}{'':>9}"
              f"{'rot':>19}{'centre':>19}")
    results = {}
    for title, problems in lines:
        if not problems:
            print(f"{title}: no problems", file=sys.stderr)
            continue
        results[title] = measure(problems, methods)
        if not args.json:
            print_line(title, results[title])
    if args.json:
        print(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
