"""scripts/odometry: runs `twoview odometry` over sequences, rendered flights and injected faults,
prints the figures beside their targets, and, with --peers, ORB-SLAM3's over the same sources."""

import argparse
import json
import os
import shutil
import sys
import tempfile

from . import (copies, endurance, evaluate, faults, flights, gyro, instructions, mapper,
               no_camera, orbslam, poses, runs, sensors, sets, tables, targets, tour)

# The sources that faults are put into: one real and quick, one rendered; and what other_room shows.
FAULT_SET, OTHER_SET = "seq_tsukuba", "seq_icl_of_kt3"


def arguments_of(argv):
    parser = argparse.ArgumentParser(prog="scripts/odometry", description=__doc__)
    parser.add_argument("--sets", help="sets or folders, separated by commas; 'none': no set "
                                       "(default: all sequences of $TWOVIEW_DATA)")
    parser.add_argument("--copies", nargs="?", const=",".join(copies.KINDS), default="",
                        metavar="KINDS", help="changed copies of the sets, too: "
                                              f"{', '.join(copies.KINDS)} (default: all)")
    parser.add_argument("--flights", type=int, default=0, metavar="N",
                        help="render and run the flights of the seeds 0 to N-1 (.cache/flights)")
    parser.add_argument("--half-turns", type=int, default=0, metavar="N",
                        help="the same with half a turn on the spot")
    parser.add_argument("--faults", action="store_true",
                        help="black frames, covered lens, other room, 5 Hz, 20 %% dropped frames, "
                             "a person, in two sources, and a flight with half a turn")
    parser.add_argument("--fault-sources", metavar="FOLDERS",
                        help="put the faults into these sets or folders, separated by commas")
    parser.add_argument("--sensors", type=int, default=0, metavar="N",
                        help="the flights of the seeds 0 to N-1 with heights or velocities of "
                             f"another unit, sign or time: {', '.join(sensors.KINDS)}")
    parser.add_argument("--gyro", type=int, default=0, metavar="N",
                        help="the flights of the seeds 0 to N-1 with darkness and fast turns, "
                             f"without and with a gyro: {', '.join(gyro.KINDS)}")
    parser.add_argument("--peers", action="store_true", help="ORB-SLAM3 over the same sources")
    parser.add_argument("--json", metavar="FILE", help="write every figure")
    parser.add_argument("--program", help="the program twoview (default: the release build's)")
    parser.add_argument("--seed", type=int, help="of the program's sampling")
    parser.add_argument("--seeds", type=int, default=1, metavar="N",
                        help="run everything with N seeds: the program's own (or --seed), 1, 2, "
                             "and so on, and print a table of what they change")
    parser.add_argument("--endurance", type=int, nargs="?", const=endurance.NUM_FRAMES,
                        metavar="N", help="a flight there and back, again and again, of N frames "
                                          f"({endurance.NUM_FRAMES}), in three runs: whether the "
                                          "time a frame stays the same")
    parser.add_argument("--tour", action="store_true",
                        help="a simulated drone's flight through a room, mapped while it flies")
    parser.add_argument("--instructions", action="store_true",
                        help="instructions a frame on ARM, under qemu")
    parser.add_argument("--colmap", action="store_true",
                        help="the keyframes of each set and flight through COLMAP's mapper (slow)")
    parser.add_argument("--no-camera", action="store_true",
                        help="run each source twice, with its camera and without any (--focal-35mm "
                             "auto), and print a table of the focal lengths, and nothing else")
    parser.add_argument("--option", action="append", default=[], metavar="TEXT",
                        help="an option for the program, such as --option=--every=2")
    parser.add_argument("--keep", metavar="DIR", help="keep the runs' files below this folder")
    parser.add_argument("--evaluate", nargs=2, metavar=("OUT", "SET"),
                        help="run nothing: print the figures of a run that exists")
    return parser.parse_args(argv)


def sources_of(arguments, scratch):
    """Yields (kind, label, folder) of everything to run; renders and injects as it goes."""
    if arguments.sets != "none":
        for path in sets.set_paths(arguments.sets):
            label = os.path.basename(os.path.normpath(path))
            yield "set", label, path
            for kind in filter(None, arguments.copies.split(",")):
                name = f"{label}+{kind}"
                folder = copies.make(kind, path, os.path.join(scratch, "copies", name))
                yield "copy", name, folder
                if not arguments.keep:  # all of them take gigabytes
                    shutil.rmtree(folder)
    for seed in range(arguments.flights):
        yield "flight", f"flight_{seed:02d}", flights.flight(seed)
    for seed in range(max(arguments.half_turns, int(arguments.faults))):
        name = f"half_turn_{seed:02d}"
        yield "fault", name, flights.render(seed, os.path.join(flights.FOLDER, name),
                                            ["--half-turn"])
    for seed in range(arguments.sensors):
        name = f"flight_{seed:02d}"
        flight = flights.flight(seed)
        for kind in sensors.KINDS:
            label = f"{name}+{kind}"
            yield "sensors", label, sensors.make(kind, flight,
                                                 os.path.join(scratch, "sensors", label))
    for seed in range(arguments.gyro):
        flight = flights.flight(seed)
        for kind in gyro.KINDS:
            for with_gyro in (False, True):
                label = f"flight_{seed:02d}+{kind}" + ("+gyro" if with_gyro else "")
                yield "fault", label, gyro.make(kind, flight, os.path.join(scratch, "gyro", label),
                                                seed, with_gyro)
    if not (arguments.faults or arguments.fault_sources):
        return
    chosen = sets.set_paths(arguments.fault_sources or FAULT_SET)
    if not arguments.fault_sources:
        chosen.append(flights.flight(0))
    other = sets.set_paths(OTHER_SET)[0]
    for path in chosen:
        for kind in faults.KINDS:
            name = f"{os.path.basename(os.path.normpath(path))}+{kind}"
            yield "fault", name, faults.inject(kind, path, os.path.join(scratch, "faults", name),
                                               other)


def one_run(system, kind, label, folder, out, arguments, seed=None):
    """The figures of one system over one source, or {label, kind, error}."""
    source = sets.read_set(folder)
    base = {"label": label if seed in (None, arguments.seed) else f"{label} seed {seed}",
            "source": label, "seed": seed, "kind": kind, "system": system}
    try:
        if system == "twoview":
            options = list(arguments.option)
            options += ["--seed", str(seed)] if seed is not None else []
            cost = runs.run_odometry(runs.program_path(arguments.program), folder, out, options)
        else:
            cost = orbslam.run(source, out)
        figures = evaluate.evaluate(out, source)
    except (RuntimeError, OSError, poses.PoseError, ValueError) as error:
        return {**base, "set": source.name, "error": str(error)}
    return {**base, **figures, **cost}


def seeds_of(arguments):
    """The seeds to run: None is the program's own."""
    first = arguments.seed
    others = [seed for seed in range(1, arguments.seeds + 1) if seed != first]
    return [first, *others][:max(arguments.seeds, 1)]


def more_figures(arguments, runs_of, scratch):
    """Yields (reached, sentence) of each measurement beside the sequences that an option names.
    runs_of: [(run, source folder, out)] of the program's own runs with the first seed."""
    if arguments.colmap:
        for run, folder, out in runs_of:
            if run["kind"] in ("fault", "copy"):
                continue
            if not run.get("num_keyframes") or not run.get("truth"):
                continue
            print(f"colmap: {run['label']}", file=sys.stderr, flush=True)
            run["colmap"] = mapper.compare(sets.read_set(folder), out,
                                           os.path.join(scratch, "colmap", run["label"]))
            yield mapper.sentence(run["label"], run["colmap"], run["cpu_s"], run["num_frames"])
    if arguments.endurance:
        flight = flights.flight(0)
        folder = endurance.repeat(flight, os.path.join(scratch, "endurance"), arguments.endurance)
        print("twoview: endurance", file=sys.stderr, flush=True)
        again = [one_run("twoview", "endurance", "endurance", folder,
                         os.path.join(scratch, "twoview", f"endurance_{k}"), arguments,
                         arguments.seed) for k in range(endurance.NUM_RUNS)]
        failed = [run["error"] for run in again if "error" in run]
        count = len(sets.read_set(flight).names)
        yield (False, f"endurance: {failed[0]}") if failed else endurance.judged(again, count)
    if arguments.tour:
        print("twoview: tour", file=sys.stderr, flush=True)
        folder = os.path.join(scratch, "tour")
        done = tour.fly(runs.program_path(arguments.program), folder, options=arguments.option)
        if done.returncode in runs.EXIT_STATUSES:
            yield from tour.sentences(tour.judge(folder))
        else:
            yield False, f"drone's tour: status {done.returncode}: {done.stderr.strip()}"
    if arguments.instructions:
        name = FAULT_SET
        print("instructions", file=sys.stderr, flush=True)
        yield from instructions.sentences(
            instructions.measure(sets.set_paths(name)[0], os.path.join(scratch, "instructions")),
            name)


def without_camera(arguments, scratch):
    """Prints what is found without a camera, and what it costs. Returns the exit status."""
    rows = []
    for _, label, folder in sources_of(arguments, scratch):
        print(f"twoview: {label} without a camera", file=sys.stderr, flush=True)
        rows.append(no_camera.compare(label, folder, os.path.join(scratch, label),
                                      runs.program_path(arguments.program), arguments.option))
    print(no_camera.table(rows))
    sentences = list(no_camera.judged(rows))
    for reached, text in sentences:
        print(f"  {'yes' if reached else 'NO '}  {text}")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump({"films": rows}, file, indent=1)
    return 0 if all(reached for reached, _ in sentences) else 1


def report(found, peers, more=()):
    """Prints the tables and targets; `more`: further (reached, sentence). Returns the judgements,
    and whether every measured target is reached."""
    for system, rows in (("twoview odometry", found), ("ORB-SLAM3", peers)):
        if rows:
            print(f"\n{system}")
            print(tables.table([tables.row_of(run) for run in rows if "error" not in run]))
            for run in rows:
                if "error" in run:
                    print(f"{run['label']}: {run['error']}")
    if len({run["seed"] for run in found}) > 1:
        print("\nAll seeds\n" + tables.seeds_table(found))
    print("\n" + tables.LEGEND + "\n\nTargets")
    judged = targets.judge([run for run in found if "error" not in run],
                           [run for run in peers if "error" not in run]) + list(more)
    for reached, text in judged:
        print(f"  {'yes' if reached else '-- ' if reached is None else 'NO '}  {text}")
    return judged, all(reached is not False for reached, _ in judged) and not any(
        "error" in run for run in found)


def main(argv=None):
    arguments = arguments_of(argv)
    if arguments.evaluate:
        out, folder = arguments.evaluate
        figures = evaluate.evaluate(out, sets.read_set(folder))
        print(json.dumps(figures, indent=1))
        return 0
    scratch = arguments.keep or tempfile.mkdtemp(prefix="twoview-odometry-")
    try:
        if arguments.no_camera:
            return without_camera(arguments, scratch)
        found, peers, first = [], [], []
        for kind, label, folder in sources_of(arguments, scratch):
            for seed in seeds_of(arguments):
                print(f"twoview: {label}" + ("" if seed is None else f", seed {seed}"),
                      file=sys.stderr, flush=True)
                out = os.path.join(scratch, "twoview", label if seed == arguments.seed else
                                   f"{label}_seed_{seed}")
                found.append(one_run("twoview", kind, label, folder, out, arguments, seed))
                if seed == arguments.seed and "error" not in found[-1]:
                    first.append((found[-1], folder, out))
            if arguments.peers:
                print(f"orbslam3: {label}", file=sys.stderr, flush=True)
                peers.append(one_run("orbslam3", kind, label, folder,
                                     os.path.join(scratch, "orbslam3", label), arguments))
        judged, is_good = report(found, peers, list(more_figures(arguments, first, scratch)))
        for run in found:
            run.pop("times_ms", None)
        if arguments.json:
            with open(arguments.json, "w", encoding="utf-8") as file:
                json.dump({"runs": found, "peers": peers,
                           "targets": [{"reached": reached, "target": text}
                                       for reached, text in judged]}, file, indent=1)
    except (ValueError, FileNotFoundError) as error:
        print(f"scripts/odometry: {error}", file=sys.stderr)
        return 2
    finally:
        if not arguments.keep:
            shutil.rmtree(scratch, ignore_errors=True)
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
