"""The progress of long work, by the rules of the program (tools/twoview/base/terminal.h): a line
on the terminal that replaces itself, or, where stderr is no terminal, a line of its own every 30 s
(TWOVIEW_PROGRESS_SECONDS; 0: none)."""

import os
import sys
import time


def on_terminal():
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


def seconds_between_lines():
    try:
        seconds = float(os.environ.get("TWOVIEW_PROGRESS_SECONDS") or 30)
    except ValueError:
        return 30.0
    return seconds if seconds >= 0 else 30.0


class Lines:
    """Lines for a log, at most one in seconds_between_lines()."""

    def __init__(self, program="twoview", wanted=True):
        self.program = program
        self.every = seconds_between_lines() if wanted and not on_terminal() else 0
        self.last = time.monotonic()

    def tell(self, text):
        now = time.monotonic()
        if self.every > 0 and now - self.last >= self.every:
            self.last = now
            print(f"{self.program}: {text}", file=sys.stderr, flush=True)
