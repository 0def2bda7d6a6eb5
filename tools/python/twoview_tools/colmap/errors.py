"""How the program reports bad input: one line on stderr and exit status 2."""

import contextlib
import signal
import sys
import threading

from .. import advice
from ..formats import FormatError

EXIT_DONE = 0
EXIT_BAD_INPUT = 2
EXIT_NO_POSE = 3


class BadInput(Exception):
    """Bad input; str() is the line that the user reads."""


@contextlib.contextmanager
def refused(path):
    """A context manager: errors of twoview_tools.formats in `path`, and errors of opening it,
    become BadInput."""
    try:
        yield
    except FormatError as error:
        raise BadInput(str(error)) from None
    except OSError as error:
        raise BadInput(f"{error.filename or path}: {error.strerror}") from None


ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def need_pycolmap(what):
    """Imports pycolmap; if it is missing, BadInput says how to get it. Call it before any temporary
    file exists, because a signal during the import ends the program at once."""
    if sys.modules.get("pycolmap"):
        return sys.modules["pycolmap"]
    in_main = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, signal.SIG_DFL) for number in ENDING_SIGNALS if in_main}
    try:
        import pycolmap
    except ImportError as error:
        raise BadInput(
            f"{what} needs pycolmap ({advice(['pycolmap'])}): {error}"
        ) from error
    finally:
        # Restores the signal handlers: pycolmap's log library replaced them when it was imported.
        for number, handler in before.items():
            signal.signal(number, handler)
    return pycolmap
