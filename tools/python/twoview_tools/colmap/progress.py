"""The progress of long work over a list."""

import sys

from ..progress import Lines, on_terminal


def progress(items, what, quiet=False):
    """Yields the items, and shows how many of them are done."""
    items = list(items)
    shown, lines = on_terminal() and not quiet, Lines(wanted=not quiet)
    for done, item in enumerate(items):
        if shown:
            print(f"\r{what} {done + 1}/{len(items)}", end="", file=sys.stderr, flush=True)
        lines.tell(f"{what} {done + 1} of {len(items)}")
        yield item
    if shown and items:
        print("\r\033[K", end="", file=sys.stderr, flush=True)
