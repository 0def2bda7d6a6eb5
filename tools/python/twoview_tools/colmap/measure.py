#!/usr/bin/env python3
"""Makes the table of docs/colmap.md: the mapper on COLMAP's own features and on exports of
twoview's, compared with the truth.

Each step runs in a process of its own, whose CPU time is measured. A step whose result is already
in the output folder is not repeated."""

import argparse
import json
import multiprocessing
import os
import pathlib
import resource
import statistics
import sys
import time

from .. import DEFAULT_LIBRARY, ROOT

os.environ.setdefault("TWOVIEW_LIBRARY", DEFAULT_LIBRARY)
from . import mapping, settings, truth  # noqa: E402
from .errors import BadInput  # noqa: E402
from .model import read_model  # noqa: E402

SETS = ("strecha_fountain_P11", "strecha_Herz_Jesus_P8", "tum_fr3_office")
EXPORTS = {"twoview": {"max_keypoints": settings.MAPPING_KEYPOINTS}, "twoview, 2048 keypoints": {}}
OWN = "COLMAP's own"


def _export(database, data, schema, options):
    import twoview as tv
    from .exporter import Job, export
    export(
        Job(database, os.path.join(data, "images"), schema=schema, quiet=True),
        tv.FeatureOptions(**options),
    )


def _own(database, data, schema):
    from .cameras import read_camera_set
    camera = next(iter(read_camera_set(os.path.join(data, "cameras.yaml")).values()))
    mapping.FEATURES[schema](database, os.path.join(data, "images"), camera)


def _entry(log, function, arguments):
    sink = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(sink, 1)
    os.dup2(sink, 2)
    function(*arguments)


def _cpu_seconds(log, function, *arguments):
    """The CPU seconds of a function that runs in a process of its own, including its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    process = multiprocessing.get_context("spawn").Process(
        target=_entry, args=(log, function, arguments)
    )
    process.start()
    process.join()
    if process.exitcode:
        raise BadInput(f"a step failed, see {log}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _measure_features(folder, data, schema, features):
    """Makes folder/database.db with features and matches. Returns the CPU time in seconds."""
    note = os.path.join(folder, "features.json")
    if not os.path.isfile(note):
        os.makedirs(folder, exist_ok=True)
        database = os.path.join(folder, "database.db")
        for suffix in ("", "-wal", "-shm", "-journal"):  # deletes the files of an interrupted run
            if os.path.exists(database + suffix):
                os.remove(database + suffix)
        log = os.path.join(folder, "features.log")
        seconds = (_cpu_seconds(log, _own, database, data, schema) if features == OWN else
                   _cpu_seconds(log, _export, database, data, schema, EXPORTS[features]))
        pathlib.Path(note).write_text(json.dumps({"seconds": seconds}))
    return json.loads(pathlib.Path(note).read_text())["seconds"]


def _best_model(folder):
    models = [
        read_model(str(path)) for path in sorted(pathlib.Path(folder).iterdir()) if path.is_dir()
    ]
    return max(models, key=lambda model: len(model.images), default=None)


def _measure_mapper(folder, data, schema, hold, seed):
    """Runs the mapper once. Returns what it registered and its errors against the truth."""
    note = os.path.join(folder, f"mapper_{'held' if hold else 'refined'}_{seed}.json")
    if not os.path.isfile(note):
        models = note[:-len(".json")]
        seconds = _cpu_seconds(
            models + ".log",
            mapping.MAPPERS[schema],
            os.path.join(folder, "database.db"),
            os.path.join(data, "images"),
            models,
            hold,
            seed,
        )
        model, true = _best_model(models), truth.read_truth(data)
        row = {"images": len(true), "registered": 0, "seconds": seconds}
        if model:
            names, positions, angles = truth.pose_errors(model.poses(), true)
            row.update(
                registered=len(names),
                points=model.num_points,
                reprojection_px=model.mean_error_px,
                position_rms_mm=1000 * float((positions**2).mean() ** 0.5),
                rotation_rms_deg=float((angles**2).mean() ** 0.5),
            )
        pathlib.Path(note).write_text(json.dumps(row))
    return json.loads(pathlib.Path(note).read_text())


def measure(output, data_dir, sets, schemas, hold, seeds):
    """Yields the rows of the table. A value is the median over the seeds, except `registered`, the
    smallest, and `feature_seconds`, which is measured once."""
    for name in sets:
        data = os.path.join(data_dir, name)
        for schema in schemas:
            for features in (OWN, *EXPORTS):
                folder = os.path.join(
                    output, name, schema, features.replace(" ", "_").replace("'", "")
                )
                started = time.monotonic()
                seconds = _measure_features(folder, data, schema, features)
                runs = [_measure_mapper(folder, data, schema, hold, seed) for seed in seeds]
                print(
                    f"{name} {schema} {features}: {time.monotonic() - started:.0f} s",
                    file=sys.stderr,
                    flush=True,
                )
                yield {
                    "set": name,
                    "colmap": schema,
                    "features": features,
                    "feature_seconds": seconds,
                    **{
                        key: statistics.median(run[key] for run in runs)
                        for key in runs[0]
                        if all(key in run for run in runs)
                    },
                    "registered": min(run["registered"] for run in runs),
                }


def _seconds(value):
    return "-" if value is None else f"{value:.1f}"


def table(rows):
    text = (
        "| set | mapper | features | registered | points | position, mm | rotation, deg | CPU s: "
        "features and pairs, "
        "mapper |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n"
    )
    for row in rows:
        text += (
            f"| {row['set']} | {row['colmap']} | {row['features']} | {row['registered']} of "
            f"{row['images']} "
            f"| {row.get('points', 0):.0f} | {row.get('position_rms_mm', float('nan')):.2f} "
            f"| {row.get('rotation_rms_deg', float('nan')):.4f} "
            f"| {_seconds(row['feature_seconds'])}, {_seconds(row['seconds'])} |\n"
        )
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", default=str(ROOT / "out" / "colmap"), metavar="DIR")
    parser.add_argument("--sets", nargs="+", default=SETS, metavar="SET")
    parser.add_argument("--schema", nargs="+", choices=("4", "3.8"), default=("4", "3.8"))
    parser.add_argument(
        "--seeds", type=int, default=3, metavar="N", help="runs of the mapper; the median counts"
    )
    parser.add_argument(
        "--hold-intrinsics", action="store_true", help="the mapper keeps the cameras as given"
    )
    parser.add_argument("--json", default="", metavar="FILE")
    arguments = parser.parse_args()
    data_dir = os.environ.get("TWOVIEW_DATA") or str(ROOT.parent / "shared" / "data")
    try:
        rows = list(
            measure(
                arguments.output,
                data_dir,
                arguments.sets,
                arguments.schema,
                arguments.hold_intrinsics,
                range(1, arguments.seeds + 1),
            )
        )
    except (BadInput, OSError) as error:
        print(f"colmap: {error}", file=sys.stderr)
        return 2
    print(table(rows), end="")
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps(rows, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
