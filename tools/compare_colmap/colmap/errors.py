"""How the program says no: one line on stderr, exit status 2."""

EXIT_DONE = 0
EXIT_BAD_INPUT = 2
EXIT_NO_POSE = 3


class BadInput(Exception):
    """str() is the line that the user reads."""


def need_pycolmap(what):
    """pycolmap, or the line that says how to get it."""
    try:
        import pycolmap
    except ImportError as error:
        raise BadInput(f"{what} needs pycolmap (scripts/bootstrap bench installs it): {error}") from error
    return pycolmap
