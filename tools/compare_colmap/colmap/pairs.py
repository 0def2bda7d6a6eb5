"""Which pairs: a pairs file (docs/formats.md: `name0 name1 rot0 rot1 K0 K1 T_0to1`, or the first 2, 4 or 22 fields), all,
or each image with its next ones."""

from dataclasses import dataclass
from typing import Optional

import numpy as np

from .errors import BadInput

FIELD_COUNTS = (2, 4, 22, 38)


@dataclass(frozen=True)
class Pair:
    name0: str
    name1: str
    line: int = 0  #: of the file; 0: not from a file
    K0: Optional[np.ndarray] = None
    K1: Optional[np.ndarray] = None
    R: Optional[np.ndarray] = None  #: the truth, x1 = R x0 + t
    t: Optional[np.ndarray] = None


def _numbers(fields):
    for field in fields:
        try:
            value = float(field)
        except ValueError:
            raise BadInput(f"'{field}' is no number") from None
        if not np.isfinite(value):
            raise BadInput(f"'{field}' is not finite")
        yield value


def _check_K(name, K):
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        raise BadInput(f"{name} has a focal length that is not above 0")
    if K[0, 1] or K[1, 0] or K[2].tolist() != [0, 0, 1]:
        raise BadInput(f"{name} is not [fx 0 cx 0 fy cy 0 0 1]")


def _parse_line(line, number):
    fields = line.split()
    if len(fields) not in FIELD_COUNTS:
        raise BadInput(f"{len(fields)} fields, not 38 (name0 name1 rot0 rot1 K0 K1 T_0to1)")
    if fields[0] == fields[1]:
        raise BadInput(f"{fields[0]} is paired with itself")
    numbers = np.array(list(_numbers(fields[2:])))
    K0 = K1 = R = t = None
    if len(fields) >= 22:
        K0, K1 = numbers[2:11].reshape(3, 3), numbers[11:20].reshape(3, 3)
        _check_K("K0", K0)
        _check_K("K1", K1)
    if len(fields) == 38:
        T = numbers[20:].reshape(4, 4)
        R, t = T[:3, :3], T[:3, 3]
        if not np.allclose(R @ R.T, np.eye(3), atol=1e-3) or np.linalg.det(R) < 0:
            raise BadInput("T_0to1 holds no rotation")
        if T[3].tolist() != [0, 0, 0, 1]:
            raise BadInput("the last row of T_0to1 is not 0 0 0 1")
    return Pair(fields[0], fields[1], number, K0, K1, R, t)


def read_pairs(path):
    """The pairs of a file; a broken line is named by its number."""
    try:
        with open(path, encoding="utf-8") as file:
            lines = file.read().split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: {getattr(error, 'strerror', None) or 'not a text file'}") from None
    pairs = []
    for number, line in enumerate(lines, 1):
        if line.strip() and not line.lstrip().startswith("#"):
            try:
                pairs.append(_parse_line(line, number))
            except BadInput as error:
                raise BadInput(f"{path}: line {number}: {error}") from None
    if not pairs:
        raise BadInput(f"{path}: no pair in it")
    return pairs


def exhaustive(names):
    return [Pair(a, b) for i, a in enumerate(names) for b in names[i + 1:]]


def sequential(names, overlap):
    """Each image with the `overlap` next ones, in the names' order."""
    return [Pair(a, b) for i, a in enumerate(names) for b in names[i + 1:i + 1 + overlap]]


def write_pair(name0, name1, K0, K1, R, t):
    """A whole line; 17 digits, so that reading gives the same numbers."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    numbers = np.concatenate([np.ravel(K0), np.ravel(K1), np.ravel(T)])
    return f"{name0} {name1} 0 0 " + " ".join(f"{value:.17g}" for value in numbers)
