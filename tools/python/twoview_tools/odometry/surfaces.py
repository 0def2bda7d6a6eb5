"""A rendered room's surfaces (surfaces.json), clouds of points (cloud.ply), and how far the one is
from the other."""

import json

import numpy as np

OUTLIER_SHARE = 0.03  # of the room's size: a point that is farther from every surface is an outlier
_TYPES = {"float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8", "uchar": "u1",
          "uint8": "u1", "char": "i1", "int8": "i1", "short": "<i2", "int16": "<i2",
          "ushort": "<u2", "uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4",
          "uint32": "<u4"}


def read_ply(path):
    """The vertices of a PLY file (ascii or binary little-endian) as a structured array."""
    with open(path, "rb") as file:
        header = []
        while not header or header[-1] != "end_header":
            line = file.readline()
            if not line or len(header) > 200:
                raise ValueError(f"{path}: no PLY header")
            header.append(line.decode("ascii", "replace").strip())
        form = next((line.split()[1] for line in header if line.startswith("format ")), "")
        names, count, is_vertex = [], 0, False
        for line in header:
            words = line.split()
            if words[:1] == ["element"]:
                is_vertex = words[1] == "vertex"
                count = int(words[2]) if is_vertex else count
            elif words[:1] == ["property"] and is_vertex:
                names.append((words[2], _TYPES[words[1]]))
        if form == "binary_little_endian":
            vertices = np.frombuffer(file.read(count * np.dtype(names).itemsize), np.dtype(names))
        elif form == "ascii":
            rows = [tuple(float(v) for v in file.readline().split()) for _ in range(count)]
            vertices = np.array(rows, np.dtype(names))
        else:
            raise ValueError(f"{path}: PLY of the form '{form}'")
    if len(vertices) != count:
        raise ValueError(f"{path}: fewer points than its header says")
    return vertices


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
