"""The tape measure on a room's model: lengths between marks on its surface, beside the true ones.

A mark is a point of the true surface that a keyframe shows, with nothing nearer or farther around
it. What lies on its ray in the model is what a user picks who sees it from there. The length
between two picks and its standard deviation are those that the page of `twoview room` shows."""

from dataclasses import dataclass

import numpy as np
import twoview as tv

from . import truth

MOST_MARKS = 250
LENGTHS_A_MARK = 12
NEAREST = 0.3  # metres from a camera to a mark, and between two marks
AROUND = 0.03  # radians: how far the surface around a mark must go on ...
MOST_STEP = 0.12  # ... without a step of more than this share of its distance
MARGIN = 5  # pixels between a mark and the picture's edge


@dataclass
class Pick:
    true: np.ndarray  # where the mark is, metres, in the truth's frame
    place: np.ndarray  # where the model has it, in the model's frame and unit
    normal: np.ndarray
    sigma: float  # of the surface along its normal
    ray: np.ndarray  # of length 1, on which it was picked, in the model's frame


def nearest_views(boxes, points, camera, rotations, centres):
    """For each point the keyframe that sees it from nearest; -1 where none does."""
    nearest, found = np.full(len(points), np.inf), np.full(len(points), -1)
    for k, (R, centre) in enumerate(zip(rotations, centres)):
        in_camera = (points - centre) @ R
        away = np.linalg.norm(in_camera, axis=1)
        pixels, inside = tv.camera_project_points(camera, np.ascontiguousarray(in_camera))
        nearer = np.flatnonzero(
            (inside != 0) & (pixels >= MARGIN).all(1) & (away > NEAREST) & (away < nearest) &
            (pixels < [camera.width - MARGIN, camera.height - MARGIN]).all(1))
        nearer = nearer[~truth.is_blocked(boxes, centre, points[nearer])]
        nearest[nearer], found[nearer] = away[nearer], k
    return found


def is_on_one_surface(boxes, eye, ray, distance):
    """Whether what lies around a ray is about as far away as what it meets."""
    across = np.cross(ray, [0, 0, 1] if abs(ray[2]) < 0.9 else [1, 0, 0])
    across /= np.linalg.norm(across)
    steps = [a * across + b * np.cross(ray, across)
             for a in (-AROUND, 0, AROUND) for b in (-AROUND, 0, AROUND)]
    away = truth.first_distances(boxes, eye, ray + np.array(steps))
    return bool((np.abs(away - distance) <= MOST_STEP * distance).all())


class Surface:
    """A model's triangles, as what a ray from a camera meets."""

    def __init__(self, vertices, triangles):
        self.vertices, self.triangles = vertices, triangles
        self.corners = vertices["position"][triangles].astype(float)
        self.middle = self.corners.mean(1)
        self.reach = np.linalg.norm(self.corners - self.middle[:, None], axis=2).max(1)

    def first_hit(self, eye, ray):
        """(place, normal, sigma) of what a ray of length 1 meets first of the surface's free sides;
        None where it meets nothing."""
        way = self.middle - eye
        away_sq = (way ** 2).sum(1) - (way @ ray) ** 2
        near = np.flatnonzero(away_sq <= self.reach ** 2 + 1e-12)
        a = self.corners[near, 0]
        u, v = self.corners[near, 1] - a, self.corners[near, 2] - a
        # T. Moeller, B. Trumbore, "Fast, minimum storage ray-triangle intersection", 1997.
        p, q = np.cross(ray, v), np.cross(eye - a, u)
        volume = (u * p).sum(1)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = ((eye - a) * p).sum(1) / volume
            t = (q @ ray) / volume
            distance = (v * q).sum(1) / volume
            hits = (volume > 0) & (s >= 0) & (t >= 0) & (s + t <= 1) & (distance > 0)
        if not hits.any():
            return None
        k = np.flatnonzero(hits)[distance[hits].argmin()]
        nearest = self.triangles[near[k]][np.argmax([1 - s[k] - t[k], s[k], t[k]])]
        vertex = self.vertices[nearest]
        return eye + distance[k] * ray, vertex["normal"].astype(float), float(vertex["sigma"])


def picks_of(surface, boxes, points, camera, true_poses, poses, seed=5):
    """A Pick for each of some of the points that a keyframe sees and the Surface has; true_poses
    and poses: (rotations, centres) of the keyframes in the truth and in the model's frame."""
    random = np.random.default_rng(seed)
    points = points[random.choice(len(points), min(MOST_MARKS, len(points)), replace=False)]
    found = []
    for point, k in zip(points, nearest_views(boxes, points, camera, *true_poses)):
        if k < 0:
            continue
        way = point - true_poses[1][k]
        distance = np.linalg.norm(way)
        if not is_on_one_surface(boxes, true_poses[1][k], way / distance, distance):
            continue
        ray = poses[0][k] @ true_poses[0][k].T @ (way / distance)
        hit = surface.first_hit(poses[1][k], ray)
        if hit is not None:
            found.append(Pick(point, *hit, ray))
    return found


def length_between(one, other, voxel, scale_sigma):
    """(length, standard deviation), as viewer.js has them."""
    way = other.place - one.place
    length = np.linalg.norm(way)
    variance = (length * scale_sigma) ** 2
    for end in (one, other):
        cosine = abs(way @ end.normal) / length
        along = abs(way @ end.ray) / length / max(abs(end.ray @ end.normal), 0.2)
        variance += (end.sigma * along) ** 2 + (voxel / 2) ** 2 * max(0, 1 - cosine ** 2)
    return length, np.sqrt(variance)


def scores(picks, voxel, scale_sigma, scale, seed=5):
    """Shares of the lengths between marks that are right. scale: of the truth over the model's, by
    the path alone, for what the lengths are apart from the metre."""
    random = np.random.default_rng(seed)
    true, found, sigma = [], [], []
    for k, one in enumerate(picks):
        for j in random.choice(len(picks), min(LENGTHS_A_MARK, len(picks)), replace=False):
            right = np.linalg.norm(picks[j].true - one.true)
            if j == k or right < NEAREST:
                continue
            length, deviation = length_between(one, picks[j], voxel, scale_sigma)
            true.append(right), found.append(length), sigma.append(deviation)
    if not true:
        return {"lengths": 0}
    true, found, sigma = map(np.array, (true, found, sigma))
    off = np.abs(found / true - 1)
    off_scaled = np.abs(scale * found / true - 1)
    return {"lengths": len(true),
            "within_2_sigma": float((np.abs(found - true) < 2 * sigma).mean()),
            "within_1_percent": float((off < 0.01).mean()), "off_median": float(np.median(off)),
            "within_1_percent_of_scaled": float((off_scaled < 0.01).mean()),
            "metre_off": float(1 / scale - 1), "metre_sigma": scale_sigma}
