"""How the program says no: one line on stderr, exit status 2."""

import contextlib
import signal
import sys
import threading

from ..formats import FormatError

EXIT_DONE = 0
EXIT_BAD_INPUT = 2
EXIT_NO_POSE = 3


class BadInput(Exception):
    """str() is the line that the user reads."""


@contextlib.contextmanager
def refused(path):
    """What a reader of twoview_tools.formats refuses in `path`, or cannot open, becomes BadInput."""
    try:
        yield
    except FormatError as error:
        raise BadInput(str(error)) from None
    except OSError as error:
        raise BadInput(f"{error.filename or path}: {error.strerror}") from None


ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def need_pycolmap(what):
    """pycolmap, or the line that says how to get it. The first call comes before there is anything to clean up: a
    signal during the import ends the program."""
    if sys.modules.get("pycolmap"):
        return sys.modules["pycolmap"]
    in_main = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, signal.SIG_DFL) for number in ENDING_SIGNALS if in_main}
    try:
        import pycolmap
    except ImportError as error:
        raise BadInput(f"{what} needs pycolmap (scripts/bootstrap bench installs it): {error}") from error
    finally:
        for number, handler in before.items():  # its log library has put a crash's report in their place
            signal.signal(number, handler)
    return pycolmap
