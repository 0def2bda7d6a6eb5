"""The choice of pairs: those of a pairs file (twoview_tools.formats), all pairs, or each image with
the next ones."""

import numpy as np

from .. import formats
from ..formats import Pair
from .errors import BadInput, refused


def read_pairs(path):
    """Reads the pairs of a file. The error for a wrong line, or for a line that pairs an image with
    itself, has the line's number."""
    with refused(path):
        pairs = formats.read_pairs(path)
    for pair in pairs:
        if pair.name0 == pair.name1:
            raise BadInput(f"{path}: line {pair.number}: {pair.name0} is paired with itself")
    return pairs


def exhaustive(names):
    return [Pair(a, b, 0, "") for i, a in enumerate(names) for b in names[i + 1:]]


def sequential(names, overlap):
    """Pairs each image with the next `overlap` ones, in the order of the names."""
    return [Pair(a, b, 0, "") for i, a in enumerate(names) for b in names[i + 1:i + 1 + overlap]]


def write_pair(name0, name1, K0, K1, R, t):
    """A complete line of a pairs file; 17 digits, so that reading it gives the same numbers."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    numbers = np.concatenate([np.ravel(K0), np.ravel(K1), np.ravel(T)])
    return f"{name0} {name1} 0 0 " + " ".join(f"{value:.17g}" for value in numbers)
