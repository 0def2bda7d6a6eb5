"""Runs one pair through every system, in a process of --jobs or in a worker of a cluster."""

import json

import numpy as np

from ..accuracy import estimators, metrics
from . import children, systems

OVERLAY_INLIERS, OVERLAY_OUTLIERS = 60, 25  # most matches of a pipeline that the page draws
HISTOGRAM_EDGES_PX = np.array([0, .25, .5, .75, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64])


def work(task):
    """The result of a task. task["what"] selects it: the versions of the systems, COLMAP's
    reconstruction, or a pair."""
    if task["what"] == "versions":
        return probe(task)
    if task["what"] == "reference":
        return children.call(systems.sys.executable, {"call": "reference", "task": task},
                             task["timeout_s"])[0]
    return run_pair(task)


def probe(task):
    """Returns {module: {"version": ..} or {"missing": reason}} for the systems' modules."""
    found = {}
    for python in dict.fromkeys(s.python for s in systems.SYSTEMS):
        modules = sorted({s.module for s in systems.SYSTEMS if s.python == python})
        try:
            found.update(children.call(python, {
                "call": "versions", "task": {"modules": modules, "library": task["library"]}},
                                       task["timeout_s"])[0])
        except children.ChildError as error:
            found.update({module: {"missing": str(error)} for module in modules})
    return found


class Run:
    """Runs systems on one pair and records the seconds of CPU of each."""

    def __init__(self, task):
        self.task, self.seconds = task, {}
        self.request = {k: v for k, v in task.items() if k not in ("missing", "systems")}

    def call(self, system, request, matches=None):
        """Returns (the worker's answer or None, status, message)."""
        missing = self.task["missing"].get(system.module)
        if missing:
            return None, "missing", missing
        request = {"call": system.kind, "system": system.id, "task": {**self.request, **request}}
        try:
            reply, seconds = children.call(system.python, request, self.task["timeout_s"], matches)
        except children.ChildError as error:
            return None, error.status, str(error)
        self.seconds[f"{system.kind} {system.id}"] = round(seconds, 4)
        note = reply.get("note", "") if isinstance(reply, dict) else ""
        return reply, "ok", note

    def read_images(self):
        """Reads the images before any system runs, so that the time of reading is not charged to
        the first one. Errors are reported by the pipelines."""
        try:
            children.call(systems.sys.executable, {"call": "images", "task": self.request},
                          self.task["timeout_s"])
        except children.ChildError:
            pass


def run_pair(task):
    """{"rows": {kind: {id: row}}, "overlays", "seconds", ..}, which contains only plain numbers."""
    run = Run(task)
    run.read_images()
    rows = {kind: {} for kind in systems.KINDS}
    wanted = set(task["systems"])
    answers, overlays = {}, {}
    for system in [*systems.of_kind("pipeline"), *systems.own_of(task["own"])]:
        if system.id not in wanted and system.id != task["matches_of"]:
            continue
        if "poses" in system.options:
            rows["pipeline"][system.id] = _row(task, *_own_pose(system.options), None)
            continue
        answer, status, message = run.call(system, {})
        if answer:
            matches = _matches(answer)
            answers[system.id] = answer, matches
            overlays[system.id] = overlay(_of_pose(matches, answer), answer, task)
        if system.id in wanted:
            rows["pipeline"][system.id] = _row(task, answer, status, message,
                                               answers.get(system.id, (0, None))[1])
    source = answers.get(task["matches_of"])
    _run_solvers(run, rows["solver"], source, wanted)
    pose = _triangulate(run, rows["triangulation"], source, wanted)
    views = next((a for a, _ in answers.values()), None)
    return {"set": task["set"], "name0": task["views"][0]["name"],
            "name1": task["views"][1]["name"], "reference": task["reference"],
            "cameras": views and views["cameras"], "sizes": views and views["sizes"],
            "rows": rows, "triangulated": pose, "overlays": overlays,
            "seconds": run.seconds}


def _own_pose(options):
    """(answer, status, message) of a pose that the user's file has, or has not."""
    if not options["listed"]:
        return None, "failed", f"not in {options['poses']}"
    pose = options["pose"] or {"R": None, "t": None}
    return {**pose, "num_inliers": None, "ms": {}}, "ok", ""


def _matches(answer):
    cameras = [(np.array(K), d) for K, d in answer["cameras"]]
    return estimators.Matches(answer["pixels0"], answer["pixels1"], cameras, answer["sizes"])


def _given(answer):
    return {key: answer[key] for key in ("pixels0", "pixels1", "ratios", "cameras", "sizes")}


def _shift(answer):
    """The pixels that an answer's pose needs added to cx and cy; [0, 0] for all systems but
    ours."""
    return answer.get("principal_point_shift_px", [0.0, 0.0])


def _of_pose(matches, answer):
    """The matches with the cameras that a system's pose refers to, which epipolar lines and points
    must use."""
    shift = _shift(answer)
    if not any(shift):
        return matches
    moved = np.array([[0, 0, shift[0]], [0, 0, shift[1]], [0, 0, 0]])
    cameras = [(K + moved, distortion) for K, distortion in matches.cameras]
    return estimators.Matches(
        matches.pixels0, matches.pixels1, cameras, matches.sizes, matches.ratios
    )


def _coded(given):
    return json.dumps(given).encode()


def _run_solvers(run, rows, source, wanted):
    given = _coded(_given(source[0])) if source else None
    for system in systems.of_kind("solver", wanted):
        if source is None:
            rows[system.id] = _row(run.task, None, "failed",
                                   f"no matches: {run.task['matches_of']} failed", None)
            continue
        answer, status, message = run.call(system, {}, given)
        rows[system.id] = _row(run.task, answer, status, message, source[1])


def _row(task, answer, status, message, matches):
    """The measures of a system on the pair; None where they are not known."""
    R = answer and answer["R"]
    t = answer and answer["t"]
    if status == "ok" and R is None:
        status = "no_pose"
    row = {"status": status, "message": message, "R": R, "t": t, "num_keypoints": None,
           "num_matches": None, "num_inliers": None, "precision": None, "time_ms": None, "ms": None,
           "rotation_error_deg": None, "translation_error_deg": None,
           "translation_error_signed_deg": None, "pose_error_deg": None}
    if answer:
        row.update({key: answer[key]
                    for key in ("num_keypoints", "config", "verdict", "probability_wrong",
                                "principal_point_shift_px")
                    if key in answer})
        row["num_inliers"], row["ms"] = answer["num_inliers"], _rounded(answer["ms"])
        row["time_ms"] = round(sum(answer["ms"].values()), 3) if answer["ms"] else None
    if matches is not None:
        row["num_matches"] = len(matches)
    reference = task["reference"]
    if reference:
        R_true, t_true = np.array(reference["R"]), np.array(reference["t"])
        row.update(metrics.finite(metrics.pose_error(R, t, R_true, t_true)))
        if matches is not None:
            row["precision"] = metrics.precision(matches.rays0, matches.rays1, R_true, t_true)
    if R is not None and matches is not None and len(matches):
        error = epipolar_error_px(_of_pose(matches, answer), R, t)
        row["error_px_histogram"] = np.histogram(error, HISTOGRAM_EDGES_PX)[0].tolist()
    return row


def _rounded(ms):
    return {stage: round(value, 3) for stage, value in ms.items()}


def epipolar_error_px(matches, R, t):
    """The Sampson distance under a pose, in pixels of the mean focal length."""
    focal = np.mean([(K[0, 0], K[1, 1]) for K, _ in matches.cameras])
    unit = np.asarray(t, float) / max(np.linalg.norm(t), 1e-300)
    with np.errstate(invalid="ignore"):
        squared = estimators.sampson_squared(matches.rays0, matches.rays1, np.array(R), unit)
    return focal * np.sqrt(squared)


def overlay(matches, answer, task):
    """Evenly spaced inliers and outliers of a pipeline's own pose, for the page."""
    inlier = np.zeros(len(matches), bool)
    if answer["R"] is not None:
        inlier = epipolar_error_px(matches, answer["R"], answer["t"]) < task["max_error_px"]
    chosen = []
    for indices, most in ((np.flatnonzero(inlier), OVERLAY_INLIERS),
                          (np.flatnonzero(~inlier), OVERLAY_OUTLIERS)):
        if len(indices) > most:
            indices = indices[np.linspace(0, len(indices) - 1, most).astype(int)]
        chosen.append(np.round(np.column_stack([matches.pixels0, matches.pixels1])[indices],
                               1).tolist())
    return {"inliers": chosen[0], "outliers": chosen[1], "num_within": int(inlier.sum())}


# ---- triangulations ----------------------------------------------------------------------------

def _triangulate(run, rows, source, wanted):
    """Runs every triangulation on matches of the pipeline task["matches_of"]: those within
    2 max_error_px of the epipolar lines of the pose. The pose is the reference's, else that
    pipeline's own. source: (its answer, its matches) or None. Returns whose pose was used; None if
    there is none."""
    chosen = systems.of_kind("triangulation", wanted)
    if not chosen:
        return None
    task, whose = run.task, "reference"
    pose = task["reference"]
    if pose is None and source and source[0]["R"] is not None:
        pose, whose = {"R": source[0]["R"], "t": source[0]["t"]}, task["matches_of"]
    if pose is None or source is None:
        for system in chosen:
            rows[system.id] = _points_row("failed", "no pose to triangulate with")
        return None
    answer, matches = source
    if whose != "reference":
        matches = _of_pose(matches, answer)
    t = np.array(pose["t"], float)
    if not np.linalg.norm(t) > 0:
        for system in chosen:
            rows[system.id] = _points_row("failed", "the cameras stand at one place")
        return None
    pose = {"R": pose["R"], "t": (t / np.linalg.norm(t)).tolist()}
    keep = epipolar_error_px(matches, pose["R"], pose["t"]) < 2 * task["max_error_px"]
    given = {**_given(answer), "cameras": [[K.tolist(), list(d)] for K, d in matches.cameras]}
    for key in ("pixels0", "pixels1"):
        given[key] = np.array(given[key]).reshape(-1, 2)[keep].tolist()
    given["ratios"] = None
    kept, coded = _matches(given), _coded(given)
    for system in chosen:
        if not keep.any():
            rows[system.id] = _points_row("failed", "no match agrees with the pose")
            continue
        found, status, message = run.call(system, {"pose": pose}, coded)
        rows[system.id] = _points_row(status, message, found, kept, pose)
    return whose


def _points_row(status, message, found=None, matches=None, pose=None):
    """The number of points in front of both cameras and their reprojection errors: the root of the
    mean of the two squares, in undistorted pixels."""
    row = {"status": status, "message": message, "num_points": None, "num_in_front": None,
           "median_error_px": None, "p95_error_px": None, "time_us_per_point": None}
    if not found:
        return row
    points = np.array([[np.nan if v is None else v for v in p] for p in found["points"]], float)
    X1 = points @ np.array(pose["R"]).T + np.array(pose["t"])
    with np.errstate(divide="ignore", invalid="ignore"):
        in_front = (points[:, 2] > 0) & (X1[:, 2] > 0)
        squares = []
        for X, rays, (K, _) in ((points, matches.rays0, matches.cameras[0]),
                                (X1, matches.rays1, matches.cameras[1])):
            offset = (X[:, :2] / X[:, 2:] - rays) * [K[0, 0], K[1, 1]]
            squares.append((offset**2).sum(axis=1))
    error = np.sqrt(np.mean(squares, axis=0))[in_front]
    row.update(num_points=len(points), num_in_front=int(in_front.sum()),
               time_us_per_point=1e3 * found["ms"]["triangulate"] / len(points))
    if len(error):
        row.update(median_error_px=float(np.median(error)),
                   p95_error_px=float(np.percentile(error, 95)))
    return row
