"""Rendered flights (tools/flights): each seed is another room, path, lens and light."""

import glob
import hashlib
import os
import shutil
import subprocess

from .. import ROOT

SOURCES = ("flights", "room")  # folders of tools/
FOLDER = os.path.join(ROOT, ".cache", "flights")  # of flights that are rendered once
FILMER = os.path.join(ROOT, "build", "release", "bin", "twoview_flights")


def filmer():
    """The program that renders flights; TWOVIEW_FLIGHTS overrides the release build's. None where
    it is not built."""
    path = os.environ.get("TWOVIEW_FLIGHTS", FILMER)
    return path if os.access(path, os.X_OK) else None


def made_by(options=()):
    """A digest of what a flight depends on beside its seed: the drawing sources, the options."""
    digest = hashlib.sha256(repr(tuple(options)).encode())
    for name in SOURCES:
        for path in sorted(glob.glob(os.path.join(ROOT, "tools", name, "*.[ch]*"))):
            with open(path, "rb") as file:
                digest.update(file.read())
    return digest.hexdigest()


def render(seed, folder, options=()):
    """Renders a flight into a folder, unless the same one is there already. Returns the folder."""
    mark = os.path.join(folder, "made_by.txt")
    if os.path.isfile(mark):
        with open(mark, encoding="ascii") as file:
            if file.read() == made_by(options):
                return folder
    program = filmer()
    if program is None:
        raise FileNotFoundError("twoview_flights is not built (TWOVIEW_TOOLS, TWOVIEW_SIMULATOR)")
    unfinished = folder + ".unfinished"
    shutil.rmtree(unfinished, ignore_errors=True)
    os.makedirs(os.path.dirname(folder), exist_ok=True)
    subprocess.run([program, "--seed", str(seed), "-o", unfinished, *options], check=True)
    with open(os.path.join(unfinished, "made_by.txt"), "w", encoding="ascii") as file:
        file.write(made_by(options))
    shutil.rmtree(folder, ignore_errors=True)
    os.rename(unfinished, folder)
    return folder


def flight(seed):
    """The folder of a seed's flight in FOLDER; rendered where it is not there."""
    return render(seed, os.path.join(FOLDER, f"flight_{seed:02d}"))


def add_arguments(parser):
    """The flights that a laboratory's program runs, which chosen() returns."""
    parser.add_argument("folders", nargs="*", metavar="FLIGHT", help="folders of rendered flights")
    parser.add_argument("--flights", type=int, default=0, metavar="N",
                        help="render and run the flights of the seeds 0 to N-1 (.cache/flights)")


def chosen(parser, arguments):
    """The folders; without one, the parser's error."""
    folders = arguments.folders + [flight(seed) for seed in range(arguments.flights)]
    if not folders:
        parser.error("no flight: name folders, or --flights N")
    return folders
