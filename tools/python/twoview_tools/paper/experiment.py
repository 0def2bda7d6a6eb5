"""An experiment of the paper: what it shows there, what comes of it here."""

from dataclasses import dataclass, field
from typing import Callable, Optional


class Missing(Exception):
    """Data or a program that an experiment needs and that is not here."""


def available(*makers):
    """(what the makers give, why some give nothing, in words); Missing where none does."""
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
    rows: list  # of cells, text; the first cell of a row is its heading
    marked: Optional[int] = None  # the row that is the default, or the paper's choice


@dataclass
class Picture:
    data: bytes
    kind: str  # "png" or "webp"
    alt: str
    width: int  # pixels at which it is drawn at most


@dataclass
class Result:
    numbers: dict  # goes into paper.json as it is
    found: str  # sentences with the numbers
    pictures: list = field(default_factory=list)
    tables: list = field(default_factory=list)
    missing: list = field(default_factory=list)  # in words, what it had to do without


@dataclass(frozen=True)
class Experiment:
    id: str  # "figure8"; of the page's anchors, the pictures' names and paper.json's keys
    section: str
    title: str
    paper: str  # what the paper's figure shows
    differs: str  # where ours is another, and why; may be empty
    run: Callable  # Inputs -> Result
