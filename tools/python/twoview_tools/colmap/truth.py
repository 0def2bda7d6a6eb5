"""Compares a model's poses with the truth, aligned by the similarity that fits the camera centres
best."""

import os

import numpy as np

from .conventions import rotation


def read_truth(folder):
    """{image: (R, centre)} of a data set; R is camera from world. Read from groundtruth.txt (TUM,
    world from camera) and frames.txt."""
    with open(os.path.join(folder, "groundtruth.txt"), encoding="utf-8") as file:
        rows = [line.split() for line in file if line.strip() and not line.startswith("#")]
    poses = {row[0]: np.array(row[1:], float) for row in rows}
    with open(os.path.join(folder, "frames.txt"), encoding="utf-8") as file:
        frames = [line.split() for line in file if line.strip() and not line.startswith("#")]
    truth = {}
    for stamp, name, *_ in frames:
        if stamp in poses:
            x, y, z, w = poses[stamp][3:]
            truth[os.path.basename(name)] = rotation([w, x, y, z]).T, poses[stamp][:3]
    return truth


def align(source, target):
    """(scale, R, t) that minimise the squared errors of target = scale R source + t; S. Umeyama,
    PAMI 1991."""
    mean0, mean1 = source.mean(axis=0), target.mean(axis=0)
    a, b = source - mean0, target - mean1
    U, S, Vt = np.linalg.svd(b.T @ a)
    sign = np.diag([1, 1, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    R = U @ sign @ Vt
    scale = np.trace(np.diag(S) @ sign) / (a ** 2).sum()
    return scale, R, mean1 - scale * R @ mean0


def pose_errors(model, truth):
    """(names, position errors in the truth's unit, rotation errors in degrees) of {image: (R,
    centre)}, for the images that both have. With fewer than three images the errors are infinite.

    If the centres lie on a line, they do not determine the rotation about it. Therefore the
    rotations are aligned separately, by the rotation of the world that fits them best."""
    names = sorted(set(model) & set(truth))
    if len(names) < 3:
        return names, np.full(len(names), np.inf), np.full(len(names), np.inf)
    source, target = (np.array([poses[name][1] for name in names]) for poses in (model, truth))
    scale, R, t = align(source, target)
    positions = np.linalg.norm(scale * source @ R.T + t - target, axis=1)
    U, _, Vt = np.linalg.svd(sum(truth[name][0].T @ model[name][0] for name in names))
    turn = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    chords = [np.linalg.norm(model[name][0] - truth[name][0] @ turn) for name in names]
    return names, positions, np.degrees(2 * np.arcsin(np.minimum(np.array(chords) / np.sqrt(8), 1)))
