"""Rendered flights (tools/flights): each seed is another room, path, lens and light."""

import os
import shutil
import subprocess

from .. import ROOT

FILMER = os.path.join(ROOT, "build", "release", "bin", "twoview_flights")


def filmer():
    """The program that renders flights; TWOVIEW_FLIGHTS overrides the release build's. None where
    it is not built."""
    path = os.environ.get("TWOVIEW_FLIGHTS", FILMER)
    return path if os.access(path, os.X_OK) else None


def render(seed, folder, options=()):
    """Renders a flight into a folder, unless it is there already. Returns the folder."""
    if os.path.isfile(os.path.join(folder, "flight.json")):
        return folder
    program = filmer()
    if program is None:
        raise FileNotFoundError("twoview_flights is not built (TWOVIEW_TOOLS, TWOVIEW_SIMULATOR)")
    unfinished = folder + ".unfinished"
    shutil.rmtree(unfinished, ignore_errors=True)
    os.makedirs(os.path.dirname(folder), exist_ok=True)
    subprocess.run([program, "--seed", str(seed), "-o", unfinished, *options], check=True)
    shutil.rmtree(folder, ignore_errors=True)
    os.rename(unfinished, folder)
    return folder
