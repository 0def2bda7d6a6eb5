"""A rendered room's surfaces (surfaces.json), and how far points are from them."""

import json

import numpy as np

OUTLIER_SHARE = 0.03  # of the room's size: a point that is farther from every surface is an outlier


def read_boxes(path):
    """The boxes of surfaces.json; the one with is_room is seen from inside."""
    with open(path, encoding="utf-8") as file:
        return json.load(file)["boxes"]


def room_size(boxes):
    """The longest side of the room, metres."""
    return 2 * max(next(box["half"] for box in boxes if box["is_room"]))


def distances(boxes, points):
    """The distance of each point (n x 3) to the nearest side of any box, metres."""
    points = np.asarray(points, float).reshape(-1, 3)
    nearest = np.full(len(points), np.inf)
    for box in boxes:
        c, s = np.cos(box["yaw_rad"]), np.sin(box["yaw_rad"])
        local = (points - box["centre"]) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        beyond = np.abs(local) - box["half"]
        outside = np.linalg.norm(np.clip(beyond, 0, None), axis=1)
        nearest = np.minimum(nearest, np.where(outside > 0, outside, -beyond.max(1)))
    return nearest


def map_accuracy(boxes, points):
    """How well points in the room's frame and unit lie on its surfaces."""
    away, size = distances(boxes, points), room_size(boxes)
    if not len(away):
        return {"num_points": 0}
    return {"num_points": len(away), "room_size": size,
            "median_percent": float(100 * np.median(away) / size),
            "p95_percent": float(100 * np.percentile(away, 95) / size),
            "outlier_percent": float(100 * np.mean(away > OUTLIER_SHARE * size))}
