"""Writes files so that they appear complete or not at all."""

import os

from ..folders import foreign_result, foreign_words
from .errors import BadInput


def require_own(folder, verb, names, always):
    """Refuses a folder whose files of these names are not of an earlier run of the verb, which
    leaves `always` in every run."""
    name = foreign_result(folder, names, always)
    if name:
        raise BadInput(foreign_words(folder, name, verb))


def write_files(folder, texts):
    """Writes {name: text} into `folder`, which is created if necessary. Each file is first written
    under a temporary name."""
    temporary = {}
    try:
        os.makedirs(folder, exist_ok=True)
        for name, text in texts.items():
            temporary[name] = os.path.join(folder, f".{name}.{os.getpid()}")
            with open(temporary[name], "w", encoding="utf-8") as file:
                file.write(text)
        for name in texts:
            os.replace(temporary.pop(name), os.path.join(folder, name))
    except OSError as error:
        raise BadInput(f"{folder}: {error.strerror}") from None
    finally:
        for path in temporary.values():
            if os.path.exists(path):
                os.remove(path)
