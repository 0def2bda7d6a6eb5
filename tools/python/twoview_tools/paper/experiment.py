"""An experiment of the paper: what the paper shows, and our result."""

from dataclasses import dataclass, field
from typing import Callable, Optional


class Missing(Exception):
    """Raised if data or a program that an experiment needs is not present."""


def available(*makers):
    """Returns (the results of the makers, the reasons why some gave none). Raises Missing if none
    gave a result."""
    found, missing = [], []
    for make in makers:
        try:
            found.append(make())
        except Missing as told:
            missing.append(str(told))
    if not found:
        raise Missing("; ".join(missing))
    return found, missing


@dataclass
class Table:
    caption: str
    head: list
    rows: list  # each a list of texts; the first text is the row's heading
    marked: Optional[int] = None  # index of the row to highlight: the default's, or the paper's


@dataclass
class Picture:
    data: bytes
    kind: str  # the format of `data`: "png" or "webp"
    alt: str
    width: int  # largest width at which the page shows the picture, pixels


@dataclass
class Result:
    numbers: dict  # measured numbers, which are copied to paper.json
    found: str  # sentences for the page that report the numbers
    pictures: list = field(default_factory=list)
    tables: list = field(default_factory=list)
    missing: list = field(default_factory=list)  # sentences for the page about missing inputs


@dataclass(frozen=True)
class Experiment:
    # Such as "figure8"; used in the page's anchors, the pictures' names and paper.json's keys.
    id: str
    section: str
    title: str
    paper: str  # what the paper's figure shows
    differs: str  # how and why our figure differs; may be empty
    run: Callable  # run(inputs) measures and returns a Result
