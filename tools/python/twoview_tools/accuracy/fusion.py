"""Measures examples/18_fusion.py over rendered flights: the table of docs/fusion.md. The odometry
runs once a flight; the filter runs with several draws of additional noise of the velocities, with
the odometry and by velocities alone.

  scripts/python -m twoview_tools.accuracy.fusion --flights 8 --noise 0 0.1 0.2 0.4"""

import argparse
import importlib.util
import os
import pathlib
import sys

import numpy as np

from .. import ROOT
from ..odometry import flights

FIRST = 5  # keyframes that the mean of NEES leaves out: the position is known exactly at first
COLUMNS = ("mean m", "end m", "sigma m", "NEES", "fused")


def example():
    """The example as a module."""
    folder = os.path.join(ROOT, "examples")
    if folder not in sys.path:
        sys.path.insert(0, folder)
    spec = importlib.util.spec_from_file_location("fusion_example",
                                                  os.path.join(folder, "18_fusion.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def noisy(vehicle, sigma, rng):
    """Adds noise of sigma m/s to each axis of each velocity, and says so."""
    vehicle.velocities = vehicle.velocities + sigma * rng.normal(size=vehicle.velocities.shape)
    vehicle.velocity_sigma = np.hypot(vehicle.velocity_sigma, sigma)
    return vehicle


def follow(module, vehicle, steps, truth, with_odometry=True):
    """The figures of COLUMNS, over the keyframes. steps: what the example's track yields."""
    kalman = module.Filter(vehicle.attitude_sigma)
    rows, pairs = [], 0
    for k, (state, keyframe_id, pair) in enumerate(steps):
        if k > 0:
            vehicle.predict(kalman, k)
        pairs += module.fuse(kalman, vehicle, state, keyframe_id, pair) if with_odometry else 0
        if state.is_keyframe and k > 0:
            position, P = kalman.position()
            error = position - (truth[k] - truth[0])
            rows.append((np.linalg.norm(error), np.sqrt(np.trace(P)),
                         error @ np.linalg.solve(P, error) / 3))
    errors, sigmas, nees = np.array(rows).T
    return np.array([errors.mean(), errors[-1], sigmas.mean(), nees[FIRST:].mean(),
                     pairs / len(rows)])


def measure(folder, noises, draws, seed):
    """{(noise, with_odometry): an array of draws x COLUMNS} of a flight's folder."""
    module, folder = example(), pathlib.Path(folder)
    truth = np.loadtxt(folder / "groundtruth.txt")[:, 1:4]
    steps, found = list(module.track(folder)), {}
    for noise in noises:
        for with_odometry in (False, True):
            rows = []
            for draw in range(draws if noise else 1):
                vehicle = noisy(module.Vehicle(folder / "imu.txt"), noise,
                                np.random.default_rng([seed, draw]))
                rows.append(follow(module, vehicle, steps, truth, with_odometry))
            found[noise, with_odometry] = np.array(rows)
    return found


def line(name, noise, values):
    cells = (f"{value:8.3f}" for way in values for value in way[:4])
    return f"{name:<12}{noise:5.2f} {' '.join(cells)} {100 * values[1][4]:5.0f} %"


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    flights.add_arguments(parser)
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0], metavar="M_PER_S",
                        help="added to each axis of each velocity (0)")
    parser.add_argument("--draws", type=int, default=5, help="of that noise (%(default)s)")
    arguments = parser.parse_args(argv)
    folders = flights.chosen(parser, arguments)
    print(f"{'':18}{'velocities alone':>35} {'fused':>35}\n{'flight':<12}noise "
          + " ".join(f"{name:>8}" for name in 2 * COLUMNS[:4]) + "   fused")
    found = {}
    for seed, folder in enumerate(folders):
        figures = measure(folder, arguments.noise, arguments.draws, seed)
        for (noise, with_odometry), rows in figures.items():
            found.setdefault((noise, with_odometry), []).append(rows)
            if with_odometry:
                both = [found[noise, way][-1].mean(axis=0) for way in (False, True)]
                print(line(os.path.basename(os.path.normpath(folder)), noise, both), flush=True)
    for noise in arguments.noise:
        runs = [np.concatenate(found[noise, way]) for way in (False, True)]
        print(line("all", noise, [rows.mean(axis=0) for rows in runs]))
        low, high = np.quantile(runs[1][:, 3], (0.1, 0.9))
        print(f"{'':18}NEES of the fused runs, 10 % to 90 %: {low:.2f} to {high:.2f}")


if __name__ == "__main__":
    main()
