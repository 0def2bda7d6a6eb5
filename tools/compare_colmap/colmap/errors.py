"""How the program says no: one line on stderr, exit status 2."""

import signal
import threading

EXIT_DONE = 0
EXIT_BAD_INPUT = 2
EXIT_NO_POSE = 3


class BadInput(Exception):
    """str() is the line that the user reads."""


ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def need_pycolmap(what):
    """pycolmap, or the line that says how to get it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING_SIGNALS)  # its import takes them for failures of its own
    try:
        import pycolmap
    except ImportError as error:
        raise BadInput(f"{what} needs pycolmap (scripts/bootstrap bench installs it): {error}") from error
    finally:
        if threading.current_thread() is threading.main_thread():
            for number in ENDING_SIGNALS:  # its log library has put a crash's report in place of ours
                signal.signal(number, signal.getsignal(number))
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return pycolmap
