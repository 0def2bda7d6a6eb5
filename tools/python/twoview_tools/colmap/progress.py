"""Shows the progress of long work as a line on a terminal, and nothing elsewhere."""

import os
import sys


def progress(items, what, quiet=False):
    items = list(items)
    shown = sys.stderr.isatty() and os.environ.get("TERM") != "dumb" and not quiet
    for done, item in enumerate(items):
        if shown:
            print(f"\r{what} {done + 1}/{len(items)}", end="", file=sys.stderr, flush=True)
        yield item
    if shown and items:
        print("\r\033[K", end="", file=sys.stderr, flush=True)
