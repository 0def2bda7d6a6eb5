#!/usr/bin/env python3
"""Speed beside the peers: one table of ours, theirs and peer / ours.

Runs the programs of bench/ (OpenCV of the system, OpenGV, libcvd) and the peers that are reached
through Python (OpenCV 5, faiss, PoseLib, pycolmap). One thread; a time is the process's CPU time,
the median of the repetitions, which a program runs in random order over all its systems.
docs/performance.md has the protocol and the numbers.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # one thread; set before importing numpy

import argparse
import dataclasses
import json
import platform
import subprocess
import sys
import tempfile

import counts
import footprint
import rows as table

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
# {stage: the C++ program that measures it}; footprint needs no program.
PROGRAMS = {"fast": "bench_fast", "describe": "bench_describe", "extract": "bench_describe",
            "match": "bench_match", "relpose": "bench_relpose", "robust": "bench_robust",
            "triangulate": "bench_triangulation", "pair": "bench_pair", "window": "bench_window",
            "footprint": None}


def run_program(build, name, stage, quick):
    """Runs a program and returns Google Benchmark's report of the stage's rows."""
    with tempfile.NamedTemporaryFile("r", suffix=".json") as out:
        command = [os.path.join(build, "bin", name), f"--benchmark_filter=^{stage}/",
                   f"--benchmark_out={out.name}", "--benchmark_out_format=json"]
        if quick:
            command += ["--benchmark_repetitions=3", "--benchmark_min_time=0.005"]
        print("bench: " + " ".join(command[:2]), file=sys.stderr, flush=True)
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return json.load(out)


def python_measures(build, stages, quick):
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([os.path.join(build, "bin", "bench_export_images"), folder], check=True)
        # Imports numpy and the peers, so it must follow the environment variables.
        import python_peers
        return python_peers.measure(os.path.join(build, "lib", "libtwoview.so"), folder, stages,
                                    quick)


def cpu_name():
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as f:
            return next(line.split(":")[1].strip() for line in f if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown"


def main():
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", metavar="F", help="write the rows there as well")
    parser.add_argument("--quick", action="store_true", help="3 short repetitions: a first look")
    parser.add_argument("--only", metavar="STAGE", choices=sorted(PROGRAMS),
                        help="one of " + ", ".join(PROGRAMS))
    parser.add_argument("--no-python", action="store_true", help="without the peers of Python")
    parser.add_argument("--counts", action="store_true",
                        help="instructions a call under callgrind instead of times")
    parser.add_argument("--build", default=os.path.join(ROOT, "build", "release"),
                        help="build folder (default: build/release)")
    arguments = parser.parse_args()
    stages = [arguments.only] if arguments.only else list(PROGRAMS)
    if arguments.json:
        # A path that cannot be written fails here, before the long run.
        open(arguments.json, "a", encoding="utf-8").close()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

    if arguments.counts:
        found = counts.measure(arguments.build, stages, PROGRAMS)
        if not arguments.only:
            found += counts.arm(arguments.build)
        report = {"machine": cpu_name(), "rows": found}
        counts.print_table(report["rows"], sys.stdout)
    else:
        measures, context = [], {}
        for stage in stages:
            if PROGRAMS[stage]:
                found = run_program(arguments.build, PROGRAMS[stage], stage, arguments.quick)
                context = found["context"]
                measures += table.from_google_benchmark(found)
        rows = table.make_rows(measures)
        if not arguments.no_python:
            found = python_measures(arguments.build, stages, arguments.quick)
            rows += table.make_rows(found + [m for m in measures if m.system == table.OURS and
                                             m.stage == "relpose"])
        rows.sort(key=lambda row: stages.index(row.stage))
        if "footprint" in stages:
            rows += footprint.rows(arguments.build, ROOT)
        report = {"machine": cpu_name(), "context": {k: context.get(k) for k in
                                                     ("twoview", "kernels", "compiler")},
                  "rows": [dataclasses.asdict(row) for row in rows]}
        print(f"{report['machine']}; {report['context']}")
        table.print_table(rows, sys.stdout)
        missed = [row for row in rows if row.reached is False]
        print(f"{sum(row.reached is True for row in rows)} targets reached, {len(missed)} not")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as f:
            json.dump(report, f, indent=1)
            f.write("\n")


if __name__ == "__main__":
    main()
