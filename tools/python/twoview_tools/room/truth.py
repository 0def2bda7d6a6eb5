"""A model's surface beside the exact one: precision, recall and F at a distance, as INTERFACES.md
defines them."""

import numpy as np
import twoview as tv
from scipy.spatial import cKDTree

from ..odometry import surfaces

SPACING = 0.02  # metres between samples of a surface
NEAR = 0.01  # the same where the nearest sample stands for the surface itself
MARGIN = 0.05  # metres: what stands nearer before a point does not hide it, as in `twoview room`


def sample_boxes(boxes, spacing=SPACING):
    """Points on all sides of the boxes, evenly spread, (n, 3)."""
    found = []
    for box in boxes:
        half = np.asarray(box["half"])
        c, s = np.cos(box["yaw_rad"]), np.sin(box["yaw_rad"])
        world_from_box = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        for axis in range(3):
            u, v = [k for k in range(3) if k != axis]
            grids = [np.arange(-half[k] + spacing / 2, half[k], spacing) for k in (u, v)]
            a, b = np.meshgrid(*grids, indexing="ij")
            for side in (-1, 1):
                local = np.zeros((a.size, 3))
                local[:, axis], local[:, u], local[:, v] = side * half[axis], a.ravel(), b.ravel()
                found.append(local @ world_from_box.T + box["centre"])
    return np.concatenate(found)


def crossings(box, eye, rays):
    """Where each ray enters and leaves a box, in lengths of the ray: slabs method. It misses the
    box where it enters after it leaves."""
    c, s = np.cos(box["yaw_rad"]), np.sin(box["yaw_rad"])
    box_from_world = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    start = box_from_world @ (eye - np.asarray(box["centre"]))
    ray = rays @ box_from_world.T
    with np.errstate(divide="ignore", invalid="ignore"):
        low = (-np.asarray(box["half"]) - start) / ray
        high = (np.asarray(box["half"]) - start) / ray
    return np.nanmax(np.minimum(low, high), 1), np.nanmin(np.maximum(low, high), 1)


def is_blocked(boxes, eye, points):
    """Whether something stands between the eye and each point: a solid box."""
    blocked = np.zeros(len(points), bool)
    for box in boxes:
        if box["is_room"]:
            continue
        enter, leave = crossings(box, eye, points - eye)
        end = 1 - MARGIN / np.linalg.norm(points - eye, axis=1)
        blocked |= (enter < leave) & (enter < end) & (leave > 0)
    return blocked


def first_distances(boxes, eye, rays):
    """How far each ray goes before it meets a surface: a box, or the room's walls from inside; in
    lengths of the ray."""
    nearest = np.full(len(rays), np.inf)
    for box in boxes:
        enter, leave = crossings(box, eye, rays)
        hit = leave if box["is_room"] else enter
        nearest = np.where((enter < leave) & (hit > 0), np.minimum(nearest, hit), nearest)
    return nearest


def seen_twice(boxes, points, camera, rotations, centres):
    """Which true points at least two keyframes could see."""
    count = np.zeros(len(points), int)
    for R, centre in zip(rotations, centres):
        todo = np.flatnonzero(count < 2)
        in_camera = (points[todo] - centre) @ R
        pixels, inside = tv.camera_project_points(camera, np.ascontiguousarray(in_camera))
        shown = (inside != 0) & (pixels >= 0).all(1) & (
            pixels < [camera.width, camera.height]).all(1)
        todo = todo[shown]
        count[todo[~is_blocked(boxes, centre, points[todo])]] += 1
    return count >= 2


def sample_mesh(positions, triangles, spacing=SPACING, seed=1):
    """Points spread evenly by area over the triangles, and the triangle of each."""
    corners = positions[triangles].astype(float)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0],
                                         corners[:, 2] - corners[:, 0]), axis=1)
    random = np.random.default_rng(seed)
    count = min(int(area.sum() / spacing**2), 2000000)
    chosen = random.choice(len(triangles), count, p=area / area.sum())
    a, b = random.random((2, count))
    flip = a + b > 1
    a, b = np.where(flip, 1 - a, a), np.where(flip, 1 - b, b)
    p = corners[chosen]
    return p[:, 0] + a[:, None] * (p[:, 1] - p[:, 0]) + b[:, None] * (p[:, 2] - p[:, 0]), chosen


def scores(boxes, true_points, positions, inferred, triangles, within=0.05):
    """Precision (of all, of what was measured, of what was inferred), recall and F."""
    if not len(triangles):
        return {"precision": None, "recall": 0.0, "f": 0.0}
    points, chosen = sample_mesh(positions, triangles)
    is_inferred = inferred[triangles].any(1)[chosen]
    right = surfaces.distances(boxes, points) <= within
    finer, _ = sample_mesh(positions, triangles, NEAR)
    away, _ = cKDTree(finer).query(true_points, distance_upper_bound=10 * within)
    precision, recall = float(right.mean()), float((away <= within).mean())
    share = lambda mask: float(right[mask].mean()) if mask.any() else None
    return {"precision": precision, "recall": recall,
            "f": 2 * precision * recall / max(precision + recall, 1e-9),
            "precision_measured": share(~is_inferred), "precision_inferred": share(is_inferred),
            "share_inferred": float(is_inferred.mean()),
            "accuracy_median": float(np.median(surfaces.distances(boxes, points)))}
