#!/usr/bin/env python3
"""Reproduces the paper's figures and tables from real data, on one page.

DIR/paper.html is self-contained; DIR/paper.json has the numbers. If an experiment lacks data or
fails, the page reports it, the other experiments still run, and the exit status is 1."""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import json
import sys
import tempfile
import time
import traceback
from pathlib import Path

from .. import ROOT


def experiments():
    from . import calibration, cloud, corners, descriptor, motion, ransac, triangulation
    # The experiments, in the order of the paper's figures.
    modules = (calibration, corners, descriptor, ransac, triangulation, motion, cloud)
    return [e for module in modules for e in module.EXPERIMENTS]


def run(experiment, inputs):
    from .experiment import Missing
    begin = time.monotonic()
    outcome = {"experiment": experiment, "result": None, "problem": ""}
    try:
        outcome["result"] = experiment.run(inputs)
    except Missing as missing:
        outcome["problem"] = f"missing: {missing}"
    except Exception as error:  # a failed experiment must not end the others
        traceback.print_exc()
        outcome["problem"] = f"failed: {type(error).__name__}: {error}"
    outcome["seconds"] = time.monotonic() - begin
    print(f"{experiment.id}: {outcome['problem'] or outcome['result'].found} "
          f"[{outcome['seconds']:.1f} s]", flush=True)
    return outcome


def numbers_of(outcome):
    if outcome["problem"]:
        return {"problem": outcome["problem"]}
    result = outcome["result"]
    return {**result.numbers, "missing": result.missing, "seconds": round(outcome["seconds"], 2)}


def is_whole(outcome):
    return not outcome["problem"] and not outcome["result"].missing


def write(path, data):
    """Writes a file so that it appears under its name only when it is complete."""
    temporary = path.with_name(path.name + ".part")
    temporary.write_bytes(data)
    temporary.replace(path)


def write_results(folder, outcomes, version, seconds, with_pictures):
    from . import page
    report = {"version": version, "seconds": round(seconds, 1),
              "experiments": {o["experiment"].id: numbers_of(o) for o in outcomes}}
    write(folder / "paper.json", (json.dumps(report, indent=1, allow_nan=False) + "\n").encode())
    write(folder / "paper.html", page.render(outcomes, version, seconds).encode())
    for outcome in outcomes if with_pictures else ():
        for number, picture in enumerate(outcome["result"].pictures if outcome["result"] else ()):
            suffix = f"_{number + 1}" if number else ""
            write(folder / f"{outcome['experiment'].id}{suffix}.{picture.kind}", picture.data)


def arguments_of(command):
    parser = argparse.ArgumentParser(prog="scripts/paper", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "-o",
        dest="folder",
        metavar="DIR",
        type=Path,
        default=ROOT / "out" / "paper",
        help="folder for paper.html and paper.json (default: out/paper)",
    )
    parser.add_argument(
        "--only", metavar="ID,..", help="figure8,table1 ..: these experiments alone"
    )
    parser.add_argument("--pictures", action="store_true", help="also write each picture as a file")
    parser.add_argument("--build", metavar="DIR", type=Path, default=ROOT / "build" / "release",
                        help="build folder (default: build/release)")
    return parser.parse_args(command)


def chosen(only):
    listed = experiments()
    wanted = only.split(",") if only else [e.id for e in listed]
    unknown = sorted(set(wanted) - {e.id for e in listed})
    if unknown:
        sys.exit(f"scripts/paper: no experiment {', '.join(unknown)}; there are "
                 f"{', '.join(e.id for e in listed)}")
    return [e for e in listed if e.id in wanted]


def main(command=None):
    arguments = arguments_of(command)
    os.environ.setdefault("TWOVIEW_LIBRARY", str(arguments.build / "lib" / "libtwoview.so"))
    from . import inputs
    listed = chosen(arguments.only)
    try:
        arguments.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        sys.exit(f"scripts/paper: {error}")
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        given = inputs.from_environment(arguments.build, scratch)
        outcomes = [run(experiment, given) for experiment in listed]
    write_results(arguments.folder, outcomes, inputs.library().version_string(),
                  time.monotonic() - begin, arguments.pictures)
    print(f"Open {arguments.folder / 'paper.html'}; the numbers are in paper.json")
    return 0 if all(map(is_whole, outcomes)) else 1


if __name__ == "__main__":
    sys.exit(main())
