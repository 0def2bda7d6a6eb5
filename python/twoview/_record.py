"""What the results have in common: equality that arrays take part in, and a short printed form."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any, ClassVar, Optional, Sequence

import numpy as np


def same(a: Any, b: Any) -> bool:
    """True for equal values. Arrays are equal when shape, type and values are; NaN equals NaN."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return (isinstance(a, np.ndarray) and isinstance(b, np.ndarray) and a.dtype == b.dtype
                and a.shape == b.shape
                and (a.tobytes() == b.tobytes() or bool(np.all(a == b))))
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b) or (a != a and b != b)


class Record:
    """A dataclass with arrays in it. == compares all fields and gives a bool; such an object has no
    hash, as an array has none. repr is the first line of str."""

    __hash__: ClassVar[None]  # type: ignore[assignment]

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(same(getattr(self, f.name), getattr(other, f.name))
                   for f in fields(self))  # type: ignore[arg-type]

    def __repr__(self) -> str:
        first, *_ = str(self).split("\n")
        return f"<{type(self).__name__}: {first}>"


def vector(values: Optional[np.ndarray]) -> str:
    """Three numbers with their signs, or "unknown"."""
    if values is None:
        return "unknown"
    return "(" + ", ".join(f"{round(float(value), 3) + 0.0:+.3f}" for value in values) + ")"


def rotation(R: Optional[np.ndarray]) -> str:
    """A rotation matrix as its angle in degrees and its axis."""
    if R is None:
        return "unknown"
    twist = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    size = float(np.linalg.norm(twist))
    angle = math.degrees(math.atan2(size, (float(np.trace(R)) - 1) / 2))
    if size < 1e-12:
        return f"{angle:.3f} deg"
    return f"{angle:.3f} deg about {vector(twist / size)}"


def largest_sigma(covariance: np.ndarray) -> float:
    """The square root of the largest eigenvalue: the standard deviation along the worst axis."""
    return math.sqrt(max(float(np.linalg.eigvalsh(covariance)[-1]), 0.0))


def words(flags: Any) -> str:
    """The names of the bits of a Reason, in lower case."""
    return ", ".join(flag.name.lower() for flag in type(flags) if flag in flags)


def judged(name: str, verdict: str, reasons: Any) -> str:
    """For example "calibrated, doubtful (low_parallax)"."""
    found = f"{name}, {verdict}"
    return f"{found} ({words(reasons)})" if reasons else found


def table(rows: Sequence[tuple[str, str]]) -> str:
    """Lines of a name and a value; a name of "" gives a line of the value alone."""
    return "\n".join(f"{name:<12} {value}" if name else value for name, value in rows)
