"""The figures of one run: what `twoview odometry` (or a peer) wrote, against the set's truth.

Reads of a run: trajectory.txt, live.txt, frames.csv; where they are, result.json, cloud.ply,
keyframes.txt and covariances.txt (`time0 time1` and 36 numbers a line, see covariance.py)."""

import csv
import json
import os

import numpy as np

from .. import ply
from . import covariance, errors, poses, surfaces
from .errors import FrameState

FLAG_COLUMNS = ("reasons", "relocated", "loop_closed")


def read_states(path):
    """{time: FrameState} and the rows of frames.csv."""
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    states = {}
    for row in rows:
        flags = " ".join(row.get(name) or "" for name in FLAG_COLUMNS)
        states[round(float(row["timestamp"]), 6)] = FrameState(
            row["status"], flags.replace("0", "").strip())
    return states, rows


def _read(path, reader):
    return reader(path) if os.path.isfile(path) else None


def _read_json(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def _times_ms(rows):
    times = np.array([float(row["time_ms"]) for row in rows if row.get("time_ms")])
    if not times.size:
        return None
    return {"mean": float(times.mean()), "median": float(np.median(times)),
            "p99": float(np.percentile(times, 99)), "max": float(times.max())}


def _by_unit(live, rows):
    """Live poses with a segment of its own for each unit: the map's first unit is arbitrary, and
    where its program says (`scale` in frames.csv) that it is the metre from a frame on, earlier
    poses do not compare with later ones."""
    units = {round(float(row["timestamp"]), 6): row.get("scale") == "metric" for row in rows}
    live.segments = 2 * live.segments + np.array(
        [units.get(round(float(time), 6), False) for time in live.times], int)
    return live


def evaluate(out, source):
    """The figures of the run in the folder `out` over a sets.SetFolder, as a dict for JSON."""
    truth = source.truth()
    final = poses.read_tum(os.path.join(out, "trajectory.txt"))
    live = _read(os.path.join(out, "live.txt"), poses.read_tum)
    live = final if live is None else live
    states, rows = read_states(os.path.join(out, "frames.csv"))
    live = _by_unit(live[np.arange(len(live))], rows)
    result = _read(os.path.join(out, "result.json"), _read_json) or {}
    num_frames = len(source.times)
    known = {round(float(time), 6) for time in final.times}
    figures = {
        "set": source.name,
        "num_frames": num_frames,
        "picture_size": source.picture_size(),
        "num_known": len(final),
        "known_share": len(known) / num_frames,
        "num_segments": len(np.unique(final.segments)) if len(final) else 0,
        "status_counts": {status: sum(s.status == status for s in states.values())
                          for status in ("starting", "tracking", "weak", "rotation", "lost")},
        "time_ms": _times_ms(rows),
        "times_ms": [float(row["time_ms"]) for row in rows if row.get("time_ms")],
        **{key: result.get(key) for key in ("num_keyframes", "num_points", "num_relocalisations",
                                            "num_loops", "scale", "scale_sigma",
                                            "context_bytes")},
    }
    # How many frames after the map's start have no pose although the program did not report them as
    # lost.
    figures["num_unsaid_losses"] = sum(
        state.status in ("tracking", "weak") and time not in known
        for time, state in states.items())
    if truth is None:
        return figures
    figures.update(_against_truth(final, live, states, truth, source, out))
    return figures


def _against_truth(final, live, states, truth, source, out):
    fault = source.json("fault.json") or {}
    outside = [[first, last] for first, last in fault.get("elsewhere", [])]
    found = errors.ate(_without(final, outside), truth, len(source.times))
    similarity = found.pop("similarity", None)
    live_found = errors.ate(_without(live, outside), truth, len(source.times))
    figures = {"truth": found, "live": {key: live_found.get(key) for key in (
        "coverage", "ate_rmse", "ate_rmse_percent_of_path", "scale_ratio")}}
    sigma = source.truth_sigma()
    for name, path in (("silent", final), ("silent_live", live)):
        figures[name] = errors.silent_errors(path, truth, states, sigma, outside)
    if found["ate_rmse"] is None:
        return figures
    segment = found["segment"]
    boxes = source.file("surfaces.json")
    cloud = _read(os.path.join(out, "cloud.ply"), ply.read_ply)
    if boxes and cloud is not None:
        if "segment" in cloud.dtype.names:
            cloud = cloud[cloud["segment"] == segment]
        points = np.column_stack([cloud["x"], cloud["y"], cloud["z"]]).astype(float)
        scale, R, t = similarity
        figures["map"] = surfaces.map_accuracy(surfaces.read_boxes(boxes),
                                               scale * points @ R.T + t)
    stated = _read(os.path.join(out, "covariances.txt"), covariance.read_covariances)
    keyframes = _read(os.path.join(out, "keyframes.txt"), poses.read_tum)
    if stated and keyframes is not None:
        share, count = covariance.of_keyframes(
            stated, keyframes[keyframes.segments == segment], truth, similarity[0])
        figures["covariance"] = {"inside_share": share, "num_pairs": count,
                                 "is_truth_exact": not any(sigma)}
    return figures


def _without(path, intervals):
    away = np.zeros(len(path), bool)
    for first, last in intervals:
        away |= (path.times >= first - 1e-6) & (path.times <= last + 1e-6)
    return path[~away]
