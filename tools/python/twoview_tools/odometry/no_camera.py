"""The same films with their cameras and without: what `--focal-35mm auto` finds, what the path
loses
by it, and the time it takes."""

import json
import math
import os

from .. import formats
from . import runs, sets

# What must be reached: issue 49.
MOST_FOCAL_ERROR = 5.0  # per cent, or the focal length is said to be doubtful
MOST_PATH_RATIO = 1.5   # error of the path over that with the true camera, in eight films of ten
MOST_TIME_RATIO = 5.0
SHARE_OF_FILMS = 0.8


def _run(program, folder, out, options):
    cost = runs.run_odometry(program, folder, out, options)
    with open(os.path.join(out, "result.json"), encoding="utf-8") as file:
        return cost, json.load(file)


def compare(label, folder, out, program, options=()):
    """The figures of one film: {label, true_px, focal_px, k1, focal_error_percent, sigma_percent,
    uncertain, path_percent, path_ratio, time_ratio}; path figures are None without a truth."""
    cameras = formats.read_camera_set(sets.read_set(folder).file("cameras.yaml"))
    camera = next(iter(cameras.values()))
    true_px = math.sqrt(camera.fx * camera.fy)
    known_cost, known = _run(program, folder, os.path.join(out, "known"), list(options))
    cost, found = _run(program, folder, os.path.join(out, "auto"),
                       ["--focal-35mm", "auto", *options])
    focal = found["focal_length"]
    errors = [(result["truth"] or {}).get("ate_rmse_percent_of_path") for result in (found, known)]
    has_truth = None not in errors
    return {"label": label, "true_px": true_px, "focal_px": focal["pixels"], "k1": focal["k1"],
            "focal_error_percent": 100 * (focal["pixels"] / true_px - 1),
            "sigma_percent": focal["sigma_percent"], "uncertain": focal["uncertain"],
            "path_percent": errors, "path_ratio": errors[0] / errors[1] if has_truth else None,
            "time_ratio": cost["cpu_s"] / known_cost["cpu_s"], "cpu_s": known_cost["cpu_s"]}


def table(rows):
    """The films as lines of text."""
    text = [f"{'film':26} {'true px':>8} {'found px':>8} {'error %':>8} {'sigma %':>8} {'k1':>7} "
            f"{'':9} {'path %':>7} {'known %':>7} {'ratio':>6} {'time':>5}"]
    for row in rows:
        k1 = "-" if row["k1"] is None else f"{row['k1']:.3f}"
        path = ["-" if e is None else f"{e:.3f}" for e in row["path_percent"]]
        ratio = "-" if row["path_ratio"] is None else f"{row['path_ratio']:.2f}"
        text.append(f"{row['label']:26} {row['true_px']:8.1f} {row['focal_px']:8.1f} "
                    f"{row['focal_error_percent']:8.2f} {row['sigma_percent']:8.2f} {k1:>7} "
                    f"{'doubtful' if row['uncertain'] else '':9} {path[0]:>7} {path[1]:>7} "
                    f"{ratio:>6} {row['time_ratio']:5.2f}")
    return "\n".join(text)


def judged(rows):
    """Yields (reached, sentence) of the targets."""
    wrong = [row["label"] for row in rows
             if abs(row["focal_error_percent"]) > MOST_FOCAL_ERROR and not row["uncertain"]]
    doubtful = sum(row["uncertain"] for row in rows)
    yield not wrong, (f"without a camera: focal length within {MOST_FOCAL_ERROR:g} % or "
                      "doubtful in "
                      f"{len(rows) - len(wrong)} of {len(rows)} films ({doubtful} doubtful)")
    ratios = [row["path_ratio"] for row in rows if row["path_ratio"] is not None]
    good = sum(ratio <= MOST_PATH_RATIO for ratio in ratios)
    yield good >= SHARE_OF_FILMS * len(ratios), (
        f"without a camera: path within {MOST_PATH_RATIO:g} times the error with the true one in "
        f"{good} of {len(ratios)} films")
    slowest = max(row["time_ratio"] for row in rows)
    yield slowest <= MOST_TIME_RATIO, (
        f"without a camera: at most {slowest:.1f} times the CPU time (at most {MOST_TIME_RATIO:g})")
