"""Rotations as files have them: rounded, or estimated, and so no rotations to the last digit."""

import numpy as np

MOST_ROTATION_ERROR = 0.01  # of an entry of the matrix, as in tools/twoview/base/matrix.h


def made_rotation(matrix, name):
    """The rotation that is nearest to a 3x3 matrix of a file (the least sum of squared
    differences). ValueError, whose text begins with `name`, where an element is farther than
    MOST_ROTATION_ERROR from it, and for a reflection."""
    matrix = np.asarray(matrix, float).reshape(3, 3)
    size = np.linalg.det(matrix)
    if size < 0:
        raise ValueError(f"{name} holds a reflection, no rotation")
    if not 0.5 < size < 2:
        raise ValueError(f"{name} holds no rotation")
    R = matrix
    for _ in range(8):  # Newton's iteration for the polar decomposition, as in base/matrix.cc
        R = 0.5 * (R + np.linalg.inv(R).T)
    farthest = np.abs(matrix - R).max()
    if not farthest <= MOST_ROTATION_ERROR:
        raise ValueError(f"{name} holds no rotation: the nearest one differs by {farthest:.2g}")
    return R
