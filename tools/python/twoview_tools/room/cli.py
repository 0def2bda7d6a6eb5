"""scripts/room: rooms made from rendered flights, beside their exact surfaces."""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile

import numpy as np

from .. import ROOT
from ..odometry import flights, poses, sets, surfaces
from . import flight, model, peer, photometric, plan, tape, truth

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
    parser.add_argument("--peers", action="store_true",
                        help="the same with the depth maps of PatchMatch stereo (ppg_core) as well,"
                        " of the same keyframes, partners and poses; some 10 s a keyframe")
    parser.add_argument("--tape", action="store_true",
                        help="lengths between marks on the surface as well, beside the true ones")
    parser.add_argument("--plan", action="store_true",
                        help="the lines of the plan that `twoview room` draws as well, beside the "
                        "upright sides of the true room")
    parser.add_argument("--sequences", nargs="+", metavar="FOLDER",
                        help="set folders without a true surface, in place of rendered flights: "
                        "how a tenth of their frames, which the room is not made from, differ "
                        "from its mesh")
    return parser.parse_args(argv)


def measure(folder, out, arguments):
    """The scores of one flight's room, and its times; under "peer" those of the peer's maps."""
    source = flight.read_flight(folder, out, arguments.true_poses)
    settings = model.Settings(voxel=arguments.voxel, measured_only=arguments.measured_only)
    made = model.make(source, settings)
    boxes = surfaces.read_boxes(os.path.join(folder, "surfaces.json"))
    scale, R, t = 1.0, np.eye(3), np.zeros(3)
    if not arguments.true_poses:
        found = flight.longest(poses.read_tum(os.path.join(out, "trajectory.txt")))
        scale, R, t = flight.world_from_map(found, sets.read_set(folder).truth())
    keys = source.keyframes  # all of them: what they could see is to be there
    samples = truth.sample_boxes(boxes, 0.03)
    seen = truth.seen_twice(boxes, samples, source.camera, R @ source.R[keys],
                            scale * source.centres[keys] @ R.T + t)

    def row_of(one):
        positions = scale * one.vertices["position"].astype(float) @ R.T + t
        row = truth.scores(boxes, samples[seen], positions, one.vertices["inferred"] > 0,
                           one.triangles, WITHIN)
        return {**row, "keyframes": len(one.keyframes), "voxel": one.voxel,
                "vertices": len(positions),
                "ms_depth": one.ms_depth, "ms_fusion": one.ms_fusion, "ms_mesh": one.ms_mesh}

    row = row_of(made)
    if arguments.plan:
        with tempfile.TemporaryDirectory() as room:
            result = plan.make(PROGRAM, out, os.path.join(room, "room"))
        row["plan"] = plan.scores(
            result, boxes, lambda points: truth.seen_twice(
                boxes, points, source.camera, R @ source.R[keys],
                scale * source.centres[keys] @ R.T + t), (scale, R, t))
    if arguments.tape:
        row["tape"] = taped(folder, out, arguments, source, made, boxes, samples[seen], scale)
    if arguments.peers:
        row["peer"] = row_of(model.make(source, settings, peer.depth_like(made)))
    return row


def taped(folder, out, arguments, source, made, boxes, points, scale):
    """The tape measure's scores of a room that was made."""
    true = flight.read_flight(folder, out, true_poses=True)
    at = {name: k for k, name in enumerate(true.names)}
    keys = [k for k in source.keyframes if source.names[k] in at]
    true_keys = [at[source.names[k]] for k in keys]
    picks = tape.picks_of(tape.Surface(made.vertices, made.triangles), boxes, points,
                          source.camera,
                          (true.R[true_keys], true.centres[true_keys]),
                          (source.R[keys], source.centres[keys]))
    scale_sigma = 0.0
    if not arguments.true_poses:
        with open(os.path.join(out, "result.json"), encoding="utf-8") as file:
            result = json.load(file)
        if result["scale"] != "metric":
            return {"lengths": 0}
        scale_sigma = result["scale_sigma"]
    return tape.scores(picks, made.voxel, scale_sigma, scale)


def tape_line_of(label, found):
    if not found["lengths"]:
        return f"{label:10} no lengths: the path's unit is not the metre, or nothing was picked"
    percent = lambda name: f"{100 * found[name]:.1f} %"
    return (f"{label:10} {found['lengths']} lengths: {percent('within_2_sigma')} within 2 sigma, "
            f"{percent('within_1_percent')} within 1 % ({percent('within_1_percent_of_scaled')} "
            f"with the true metre), off by {100 * found['off_median']:.2f} % in the median; metre "
            f"off by {percent('metre_off')} (sigma {percent('metre_sigma')})")


def line_of(label, row):
    share = lambda name: "   - " if row.get(name) is None else f"{row[name]:5.3f}"
    return (f"{label:10} {share('f')} {share('precision')} {share('recall')} "
            f"{share('precision_measured')} {share('precision_inferred')} {row['keyframes']:5d} "
            f"{row['vertices']:8d} {row['ms_depth']:6.0f} {row['ms_fusion']:6.1f} "
            f"{row['ms_mesh']:6.0f}")


def compare_sequences(folders):
    print("sequence               frames covered infer. median  mean  nearest keyf. vertices  "
          "(left-out frames; grey levels)")
    for folder in folders:
        name = os.path.basename(os.path.normpath(folder))
        with tempfile.TemporaryDirectory() as work:
            row = photometric.measure(PROGRAM, folder, work)
        if row is None:
            print(f"{name:22} no room", flush=True)
            continue
        print(f"{name:22} {row['frames']:6d} {row['covered']:7.2f} {row['inferred']:6.2f} "
              f"{row['median']:6.1f} {row['mean']:5.1f} {row['mean_of_nearest']:8.1f} "
              f"{row['keyframes']:5d} {row['vertices']:8d}", flush=True)
    return 0


def main(argv=None):
    arguments = arguments_of(argv)
    if arguments.sequences:
        return compare_sequences(arguments.sequences)
    print("flight         F  prec. recall  meas. infer. keyf. vertices  depth   fuse   mesh  "
          f"(within {100 * WITHIN:g} cm; ms a keyframe, of CPU; mesh in all)")
    rows = []
    for seed in range(arguments.first, arguments.first + arguments.flights):
        folder = flights.flight(seed)
        with tempfile.TemporaryDirectory() as out:
            run = subprocess.run([PROGRAM, "odometry", folder, "-o", out, "--quiet"], check=False)
            if run.returncode != 0:
                print(f"{seed:02d}: twoview odometry ended with status {run.returncode}")
                rows.append({"f": 0.0})
                continue
            row = measure(folder, out, arguments)
        rows.append(row)
        print(line_of(f"{seed:02d}", row), flush=True)
        if arguments.peers:
            print(line_of("  peer", row["peer"]), flush=True)
        if arguments.plan:
            print(plan.line_of(f"   plan {seed:02d}", row["plan"]), flush=True)
        if arguments.tape:
            print(tape_line_of(f"   tape {seed:02d}", row["tape"]), flush=True)
    if rows:
        print(f"mean F {statistics.mean(row['f'] for row in rows):.3f}, "
              f"worst {min(row['f'] for row in rows):.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
