"""The plan of a room that `twoview room` made, beside the true one: its lines against the upright
sides of the boxes."""

import json
import os
import subprocess

import numpy as np

STEP = 0.05  # metres between points along a line, and between those of a side
NEAR = 0.10  # metres: a line's point is right where a side is so near
PARALLEL = np.cos(np.radians(10))  # and turned by less than this
LEAST_SEEN = 0.3  # metres of its height that two keyframes see, for a part of a side to count
LEAST_AREA = 0.5  # square metres that they see, for a side of furniture to count


def make(program, odometry, out, extra=()):
    """What result.json says of the room that the program makes of an odometry's folder."""
    subprocess.run([program, "room", odometry, "-o", out, "--quiet", *extra], check=True)
    with open(os.path.join(out, "result.json"), encoding="utf-8") as file:
        return json.load(file)["room"]


def sides_of(boxes):
    """The upright sides from above: each with its middle, its normal towards the free side, the
    direction along it, half its length, and the range of its heights."""
    found = []
    for box in boxes:
        c, s = np.cos(box["yaw_rad"]), np.sin(box["yaw_rad"])
        axes = np.array([[c, s], [-s, c]])
        for axis in (0, 1):
            for sign in (-1, 1):
                found.append({
                    "middle": np.asarray(box["centre"])[:2] + sign * box["half"][axis] * axes[axis],
                    "normal": (-sign if box["is_room"] else sign) * axes[axis],
                    "along": axes[1 - axis], "half": box["half"][1 - axis],
                    "heights": box["centre"][2] + np.array([-1, 1]) * box["half"][2],
                    "is_wall": box["is_room"]})
    return found


def seen_parts(sides, seen):
    """For each side the points along it of which enough height was seen, and the area that was.
    seen(points) says which points of the world two keyframes could see."""
    feet, points = [], []
    for side in sides:
        along = np.arange(-side["half"] + STEP / 2, side["half"], STEP)
        heights = np.arange(side["heights"][0] + STEP / 2, side["heights"][1], STEP)
        foot = side["middle"] + along[:, None] * side["along"]
        feet.append(foot)
        points.append(np.concatenate([np.repeat(foot, len(heights), 0),
                                      np.tile(heights, len(foot))[:, None]], 1))
    is_seen, begin, parts = seen(np.concatenate(points)), 0, []
    for foot, of_side in zip(feet, points):
        rows = len(of_side) // max(len(foot), 1)  # none for a side thinner than STEP
        count = is_seen[begin:begin + len(of_side)].reshape(len(foot), rows).sum(1)
        begin += len(of_side)
        parts.append((foot[count * STEP >= LEAST_SEEN], float(count.sum()) * STEP**2))
    return parts


def lines_of(result, world):
    """The lines of a result.json in the true world, from above: (ends, normal, is_wall) each.
    world: (scale, R, t) of the true world from the map."""
    scale, R, t = world
    found = []
    for line in result["walls"]:
        ends = scale * np.array([line["from"], line["to"]]) @ R.T + t
        normal = (R @ line["normal"])[:2]
        found.append((ends[:, :2], normal / np.linalg.norm(normal), line["is_wall"]))
    return found


def points_along(ends):
    count = max(2, int(np.linalg.norm(ends[1] - ends[0]) / STEP) + 1)
    return ends[0] + np.linspace(0, 1, count)[:, None] * (ends[1] - ends[0])


def offsets_from(points, normal, side):
    """How far before a side each point of a line lies; NaN beside it, beyond NEAR, or turned."""
    from_middle = points - side["middle"]
    offset = from_middle @ side["normal"]
    beside = np.abs(from_middle @ side["along"]) > side["half"] + NEAR
    wrong = beside | (np.abs(offset) > NEAR) | (normal @ side["normal"] < PARALLEL)
    return np.where(wrong, np.nan, offset)


def is_covered(point, side, lines):
    """Whether a line stands for the point of a side."""
    for ends, normal, _ in lines:
        if normal @ side["normal"] < PARALLEL:
            continue
        step = ends[1] - ends[0]
        share = np.clip((point - ends[0]) @ step / max(step @ step, 1e-12), 0, 1)
        if np.linalg.norm(ends[0] + share * step - point) <= NEAR:
            return True
    return False


def scores(result, boxes, seen, world):
    """How the plan's lines and the true sides fit."""
    lines, sides = lines_of(result, world), sides_of(boxes)
    row = {"lines": len(lines), "false": 0, "twice": 0, "walls": 0, "walls_found": 0,
           "fronts": 0, "fronts_found": 0}
    offsets, explained = [], set()
    for ends, normal, _ in sorted(lines, key=lambda line: -np.linalg.norm(line[0][1] - line[0][0])):
        points = points_along(ends)
        away = np.array([offsets_from(points, normal, side) for side in sides])
        right = ~np.isnan(away).all(0)
        if right.mean() < 0.5:
            row["false"] += 1
            continue
        # Each point belongs to its nearest side; what another line had of it is there twice.
        nearest = np.argmin(np.where(np.isnan(away), np.inf, np.abs(away)), 0)[right]
        offsets.extend(np.abs(away[:, right][nearest, np.arange(right.sum())]))
        cells = {(k, round(float((p - sides[k]["middle"]) @ sides[k]["along"]) / STEP))
                 for k, p in zip(nearest, points[right])}
        again = sum(any((k, c + d) in explained for d in (-1, 0, 1)) for k, c in cells)
        row["twice"] += again > 0.5 * len(cells)
        explained |= cells
    for side, (feet, area) in zip(sides, seen_parts(sides, seen)):
        if not len(feet) or (area < LEAST_AREA and not side["is_wall"]):
            continue
        kind = "walls" if side["is_wall"] else "fronts"
        of_kind = [line for line in lines if line[2]] if side["is_wall"] else lines
        row[kind] += 1
        row[kind + "_found"] += np.mean([is_covered(p, side, of_kind) for p in feet]) >= 0.5
    row["offset_median"] = float(np.median(offsets)) if offsets else None
    room = next(box for box in boxes if box["is_room"])
    area = world[0]**2 * result["floor_area"]
    row["area_off"] = float(area / (4 * room["half"][0] * room["half"][1]) - 1)
    return row


def line_of(label, row):
    offset = "-" if row["offset_median"] is None else f"{100 * row['offset_median']:.1f} cm"
    return (f"{label:10} walls {row['walls_found']} of {row['walls']} found, furniture "
            f"{row['fronts_found']} of {row['fronts']}; of {row['lines']} lines {row['false']} "
            f"false, {row['twice']} twice; off by {offset} in the median; area "
            f"{100 * row['area_off']:+.1f} %")
