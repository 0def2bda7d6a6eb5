"""What can be said of a room without a true surface: frames that it was not made from are rendered
from its coloured mesh, and compared with what the camera saw."""

import json
import os
import shutil
import subprocess

import cv2
import numpy as np
import twoview as tv

from .. import ply
from ..odometry import sets
from . import flight, truth

EVERY = 10  # of the frames that are no keyframes, one is left out of so many
FILES = ("result.json", "keyframes.txt", "frames.csv", "still_mask.png", "colmap")
LONGER_SIDE = 320  # pixels, at which pictures are compared: about two for a voxel of the mesh
FEWEST_SAMPLES = 2  # of the surface, along a side of a pixel


def left_out(source):
    """Indices of the frames of a Flight that its room is not to see."""
    others = sorted(set(range(len(source.names))) - set(source.keyframes))
    return others[EVERY // 2::EVERY]


def room_without(program, out, folder, times):
    """Makes the room of the flight in `out` in `folder`, from all frames but those of these times.
    False where there is none."""
    rest = os.path.join(folder, "rest")
    os.makedirs(rest)
    for name in FILES:
        path = os.path.join(out, name)
        if os.path.isdir(path):
            shutil.copytree(path, os.path.join(rest, name))
        elif os.path.exists(path):
            shutil.copy(path, rest)
    hidden = np.round(times, 4)
    with open(os.path.join(out, "trajectory.txt"), encoding="utf-8") as file, \
            open(os.path.join(rest, "trajectory.txt"), "w", encoding="utf-8") as kept:
        for line in file:
            is_pose = line.strip() and line[0] != "#"
            if not is_pose or not np.isin(round(float(line.split()[0]), 4), hidden):
                kept.write(line)
    run = subprocess.run([program, "room", rest, "-o", os.path.join(folder, "room"), "--quiet"],
                         check=False)
    return run.returncode == 0


class Renderer:
    """A mesh as points that are so dense that a picture of it has no gaps."""

    def __init__(self, vertices, triangles, camera, nearest):
        """nearest: the distance from which the surface is still whole."""
        positions = np.stack([vertices[axis] for axis in "xyz"], 1).astype(float)
        grey = np.array([0.299, 0.587, 0.114]) @ [vertices[c].astype(float)
                                                 for c in ("red", "green", "blue")]
        spacing = nearest / camera.fx / FEWEST_SAMPLES
        self.points, self.triangle = truth.sample_mesh(positions, triangles, spacing)
        corners = positions[triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.normals = normals[self.triangle]
        self.inferred = vertices["inferred"][triangles].any(1)[self.triangle]
        # The grey level of a sample: that of the corners, weighted by its place in the triangle.
        a, b, c = (corners[self.triangle, k] for k in range(3))
        area = np.linalg.norm(self.normals, axis=1)
        weight = [np.linalg.norm(np.cross(u - self.points, v - self.points), axis=1) / area
                  for u, v in ((b, c), (c, a), (a, b))]
        self.grey = sum(w * grey[triangles[self.triangle, k]] for k, w in enumerate(weight))
        self.camera = camera

    def render(self, R, centre):
        """(grey levels, NaN where nothing is shown; whether what is shown was inferred)."""
        size = self.camera.height, self.camera.width
        away = self.points - centre
        faces = np.einsum("ij,ij->i", away, self.normals) < 0
        seen = np.flatnonzero(faces)
        in_camera = away[seen] @ R
        ahead = in_camera[:, 2] > 0
        seen, in_camera = seen[ahead], in_camera[ahead]
        pixels, inside = tv.camera_project_points(self.camera, np.ascontiguousarray(in_camera))
        column, row = np.round(pixels).astype(int).T
        shown = (inside != 0) & (row >= 0) & (column >= 0) & (row < size[0]) & (column < size[1])
        seen, at = seen[shown], (row * size[1] + column)[shown]
        order = np.argsort(-in_camera[shown, 2], kind="stable")  # the nearest is written last
        grey, inferred = np.full(size, np.nan), np.zeros(size, bool)
        grey.ravel()[at[order]] = self.grey[seen[order]]
        inferred.ravel()[at[order]] = self.inferred[seen[order]] > 0
        return grey, inferred


def difference(shown, picture):
    """The median and the mean absolute difference in grey levels, once the exposure (gain and
    offset) is that of the picture."""
    x, y = shown, picture
    for _ in range(3):  # what is seen wrongly must not decide the exposure
        gain, offset = np.polyfit(x, y, 1)
        error = np.abs(gain * x + offset - y)
        near = np.abs(gain * shown + offset - picture) <= np.quantile(error, 0.8)
        x, y = shown[near], picture[near]
    error = np.abs(gain * shown + offset - picture)
    return float(np.median(error)), float(error.mean())


def scores(source, hidden, mesh, folder):
    """What the mesh shows of the frames that were left out: which share of the pixels it covers,
    and the differences there; beside it the picture of the nearest keyframe, as it is."""
    scale = LONGER_SIDE / max(source.camera.width, source.camera.height)
    size = (round(scale * source.camera.width), round(scale * source.camera.height))
    camera = source.camera.scaled(*size)
    eyes = source.centres[hidden]
    positions = np.stack([mesh[0][axis] for axis in "xyz"], 1)
    distances = [np.quantile(np.linalg.norm(positions - eye, axis=1), 0.05) for eye in eyes]
    renderer = Renderer(*mesh, camera, float(np.median(distances)))

    def picture(k):
        grey = cv2.imread(os.path.join(folder, source.names[k]), cv2.IMREAD_GRAYSCALE)
        return cv2.resize(grey, size, interpolation=cv2.INTER_AREA).astype(float)

    rows = []
    for k in hidden:
        grey, inferred = renderer.render(source.R[k], source.centres[k])
        known = np.isfinite(grey)
        if known.mean() < 0.02:
            rows.append((known.mean(), np.nan, np.nan, np.nan, np.nan))
            continue
        own = picture(k)
        nearest = min(source.keyframes, key=lambda key: abs(key - k))
        rows.append((known.mean(), inferred[known].mean(), *difference(grey[known], own[known]),
                     difference(picture(nearest)[known], own[known])[1]))
    covered, inferred, median, mean, still = np.nanmedian(np.array(rows), axis=0)
    return {"frames": len(rows), "covered": covered, "inferred": inferred, "median": median,
            "mean": mean, "mean_of_nearest": still}


def measure(program, folder, work):
    """The scores of a set folder's flight; None where it gives no room."""
    out = os.path.join(work, "out")
    run = subprocess.run([program, "odometry", folder, "-o", out, "--quiet", "--no-pictures"],
                         check=False)
    if not os.path.exists(os.path.join(out, "keyframes.txt")) or run.returncode == 2:
        return None
    source = flight.read_flight(folder, out)
    hidden = left_out(source)
    found = sets.read_set(folder)
    times = dict(zip(found.names, found.times))
    if not hidden or not room_without(program, out, work, [times[source.names[k]] for k in hidden]):
        return None
    with open(os.path.join(work, "room", "result.json"), encoding="utf-8") as file:
        room = json.load(file)["room"]
    mesh = ply.read_mesh(os.path.join(work, "room", "room.ply"))
    return {**scores(source, hidden, mesh, folder), "keyframes": room["keyframes_used"],
            "vertices": len(mesh[0])}
