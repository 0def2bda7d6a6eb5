"""A flight whose sensors contradict each other: one of height and velocity has another unit, sign
or time than it should have. The map must then never be in metres that are off by more than the
stated standard deviation allows.

| kind | what is wrong |
| --- | --- |
| none | nothing |
| height_mm, height_cm, height_double, height_sign | the heights times 1000, 100, 2, -1 |
| velocity_mm, velocity_cm, velocity_double, velocity_sign | the velocities likewise |
| height_late, velocity_late | come LATE_S seconds late |
| height_still, velocity_still | stay at their first value |

Sigmas stay as they were: a program that mistakes the unit states those of its sensor's page."""

import os

import numpy as np

LATE_S = 0.3
HEIGHT, VELOCITY = slice(6, 7), slice(8, 11)  # of a line of imu.txt (docs/formats.md)
FACTORS = {"mm": 1000.0, "cm": 100.0, "double": 2.0, "sign": -1.0}
KINDS = ("none", *(f"{sensor}_{fault}" for sensor in ("height", "velocity")
                   for fault in (*FACTORS, "late", "still")))


def altered(kind, samples):
    """The samples (a row each, as in imu.txt) with the fault."""
    samples = np.array(samples, float)
    if kind == "none":
        return samples
    sensor, fault = kind.split("_")
    columns = HEIGHT if sensor == "height" else VELOCITY
    if fault in FACTORS:
        samples[:, columns] *= FACTORS[fault]
    elif fault == "still":
        samples[:, columns] = samples[0, columns]
    else:
        times = samples[:, 0]
        for column in range(columns.start, columns.stop):
            samples[:, column] = np.interp(times - LATE_S, times, samples[:, column])
    return samples


def make(kind, source, folder):
    """Writes a folder with the pictures of a rendered flight and other sensors, and returns it."""
    if kind not in KINDS:
        raise ValueError(f"no fault of sensors '{kind}'; there are {', '.join(KINDS)}")
    os.makedirs(folder, exist_ok=True)
    for name in os.listdir(source):
        if name != "imu.txt" and not os.path.lexists(os.path.join(folder, name)):
            os.symlink(os.path.abspath(os.path.join(source, name)), os.path.join(folder, name))
    with open(os.path.join(source, "imu.txt"), encoding="ascii") as file:
        lines = [line.split() for line in file if line.strip() and line[0] != "#"]
    with open(os.path.join(folder, "imu.txt"), "w", encoding="ascii") as file:
        file.write(" ".join(lines[0]) + "\n")  # body_from_cam
        for row in altered(kind, lines[1:]):
            file.write(" ".join(f"{value:.9f}" for value in row) + "\n")
    return folder


def is_honest(run):
    """Whether a run's metre, where it states one, is off by at most three standard deviations."""
    ratio = (run.get("truth") or {}).get("scale_ratio")
    if run.get("scale") != "metric" or not ratio:
        return True
    return abs(ratio - 1) <= 3 * run["scale_sigma"]
