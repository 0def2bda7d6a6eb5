"""scripts/room: rooms made from rendered flights, beside their exact surfaces."""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile

import numpy as np

from .. import ROOT
from ..odometry import flights, poses, sets, surfaces
from . import flight, model, truth

FLIGHT_FOLDER = os.path.join(ROOT, ".cache", "flights")
PROGRAM = os.path.join(ROOT, "build", "release", "bin", "twoview")
WITHIN = 0.05  # metres: what precision and recall count as right


def arguments_of(argv):
    parser = argparse.ArgumentParser(prog="scripts/room", description=__doc__)
    parser.add_argument("--flights", type=int, default=10, metavar="N",
                        help="rendered flights, of the seeds FIRST to FIRST + N - 1 (default 10)")
    parser.add_argument("--first", type=int, default=0, metavar="FIRST")
    parser.add_argument("--true-poses", action="store_true",
                        help="the flights' exact poses in place of the odometry's")
    parser.add_argument("--voxel", type=float, default=0.03, metavar="METRES")
    parser.add_argument("--measured-only", action="store_true",
                        help="carry no planes across areas without texture")
    return parser.parse_args(argv)


def measure(folder, out, arguments):
    """The scores of one flight's room, and its times."""
    source = flight.read_flight(folder, out, arguments.true_poses)
    made = model.make(source, model.Settings(voxel=arguments.voxel,
                                             measured_only=arguments.measured_only))
    boxes = surfaces.read_boxes(os.path.join(folder, "surfaces.json"))
    scale, R, t = 1.0, np.eye(3), np.zeros(3)
    if not arguments.true_poses:
        found = flight.longest(poses.read_tum(os.path.join(out, "trajectory.txt")))
        scale, R, t = flight.world_from_map(found, sets.read_set(folder).truth())
    positions = scale * made.vertices["position"].astype(float) @ R.T + t
    keys = source.keyframes  # all of them: what they could see is to be there
    samples = truth.sample_boxes(boxes, 0.03)
    seen = truth.seen_twice(boxes, samples, source.camera, R @ source.R[keys],
                            scale * source.centres[keys] @ R.T + t)
    row = truth.scores(boxes, samples[seen], positions, made.vertices["inferred"] > 0,
                       made.triangles, WITHIN)
    return {**row, "keyframes": len(made.keyframes), "voxel": made.voxel,
            "vertices": len(positions),
            "ms_depth": made.ms_depth, "ms_fusion": made.ms_fusion, "ms_mesh": made.ms_mesh}


def line_of(label, row):
    share = lambda name: "   - " if row.get(name) is None else f"{row[name]:5.3f}"
    return (f"{label:10} {share('f')} {share('precision')} {share('recall')} "
            f"{share('precision_measured')} {share('precision_inferred')} {row['keyframes']:5d} "
            f"{row['vertices']:8d} {row['ms_depth']:6.0f} {row['ms_fusion']:6.1f} "
            f"{row['ms_mesh']:6.0f}")


def main(argv=None):
    arguments = arguments_of(argv)
    print("flight         F  prec. recall  meas. infer. keyf. vertices  depth   fuse   mesh  "
          f"(within {100 * WITHIN:g} cm; ms a keyframe, of CPU; mesh in all)")
    rows = []
    for seed in range(arguments.first, arguments.first + arguments.flights):
        folder = flights.render(seed, os.path.join(FLIGHT_FOLDER, f"{seed:02d}"))
        with tempfile.TemporaryDirectory() as out:
            run = subprocess.run([PROGRAM, "odometry", folder, "-o", out, "--quiet"], check=False)
            if run.returncode != 0:
                print(f"{seed:02d}: twoview odometry ended with status {run.returncode}")
                rows.append({"f": 0.0})
                continue
            row = measure(folder, out, arguments)
        rows.append(row)
        print(line_of(f"{seed:02d}", row), flush=True)
    if rows:
        print(f"mean F {statistics.mean(row['f'] for row in rows):.3f}, "
              f"worst {min(row['f'] for row in rows):.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
