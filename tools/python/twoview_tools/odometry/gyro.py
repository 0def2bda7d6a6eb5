"""Copies of rendered flights with what a gyro measures, for the odometry with and without it.

| kind | what happens |
| --- | --- |
| black | 1 s of black frames in the middle |
| fast | turns above 0.7 of the flight's fastest are flown at 200 deg/s, blurred as such |
| both | fast turns, and 1 s of black frames in the middle |
| black_turn | fast turns, and the second with most of the turn is black |

A turn becomes fast by leaving frames out and giving the others times one frame apart. The gyro has
`gyro` lines in imu.txt at 200 Hz: the true rate between two frames, a constant offset, noise."""

import os

import numpy as np

from . import poses
from .set_writer import SetWriter, read_grey, with_noise
from .sets import read_set

KINDS = ("black", "fast", "both", "black_turn")
FAST_DEG_S, FAST_SHARE = 200.0, 0.7
RATE_HZ = 200.0
# Of a cheap MEMS gyro: 0.01 deg/s/sqrt(Hz) at 200 Hz, and an offset of 1 deg/s an axis.
NOISE_RAD_S, BIAS_RAD_S = 0.0025, 0.0175
LINKS = ("cameras.yaml", "surfaces.json", "flight.json")


def turn_vectors(rotations):
    """Rotation vectors (n - 1 x 3) from each rotation to the next, on the axes of the first."""
    relative = np.swapaxes(rotations[:-1], 1, 2) @ rotations[1:]
    q = poses.quaternions_of(relative)
    sine = np.linalg.norm(q[:, :3], axis=1)
    angle = 2 * np.arctan2(sine, q[:, 3])
    return q[:, :3] * (angle / np.maximum(sine, 1e-300))[:, None]


def kept_frames(turns_rad, frame_s):
    """The frames that make the fast turns ones of FAST_DEG_S: [k, ...]."""
    rates = np.degrees(np.convolve(turns_rad, np.ones(5) / 5, "same")) / frame_s
    kept, share = [0], 0.0
    while kept[-1] + 1 < len(turns_rad) + 1:
        k = kept[-1]
        fast = k < len(rates) and rates[k] > FAST_SHARE * rates.max()
        share = min(share + 0.25, 1.0) if fast else max(share - 0.25, 0.0)
        wanted = share * np.radians(FAST_DEG_S) * frame_s
        turned, nearest = 0.0, k + 1
        for n in range(k, min(k + 6, len(turns_rad))):
            turned += turns_rad[n]
            nearest = n + 1
            if turned + turns_rad[min(n + 1, len(turns_rad) - 1)] / 2 >= wanted:
                break
        kept.append(nearest)
    return kept


def blurred(grey, turn, seconds, exposure_s, focal_px, stride):
    """The picture with the blur that it lacks where the turn is `stride` times as fast."""
    import cv2
    flow = np.array([-turn[1], turn[0]]) / seconds * exposure_s * focal_px * (1 - 1 / stride)
    length = int(round(np.linalg.norm(flow)))
    if length < 2:
        return grey
    kernel = np.zeros((2 * length + 1, 2 * length + 1), np.float32)
    end = flow / 2
    cv2.line(kernel, tuple(int(round(length - v)) for v in end),
             tuple(int(round(length + v)) for v in end), 1.0, 1)
    return cv2.filter2D(grey, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)


def gyro_lines(times, turns, body_from_cam, random):
    """`gyro` lines at RATE_HZ: rates on the axes of the body."""
    bias = random.normal(0, BIAS_RAD_S, 3)
    lines = []
    sample_s = np.arange(times[0] - 0.5 / RATE_HZ, times[-1] + 1 / RATE_HZ, 1 / RATE_HZ)
    steps = np.clip(np.searchsorted(times, sample_s) - 1, 0, len(turns) - 1)
    rates = turns / np.diff(times)[:, None]
    for time, step in zip(sample_s, steps):
        rate = body_from_cam @ rates[step] + bias + random.normal(0, NOISE_RAD_S, 3)
        lines.append(f"gyro {time:.6f} {rate[0]:.8f} {rate[1]:.8f} {rate[2]:.8f} {NOISE_RAD_S}\n")
    return lines


def make(kind, source_path, folder, seed=1, with_gyro=True):
    """Writes the folder of a copy, and returns it."""
    source = read_set(source_path)
    flight = source.json("flight.json")
    truth = source.truth()
    times = np.array(source.times)
    frame_s = float(np.median(np.diff(times)))
    random = np.random.default_rng([seed, KINDS.index(kind)])
    turns = turn_vectors(truth.rotations)
    angles = np.linalg.norm(turns, axis=1)
    kept = list(range(len(times))) if kind == "black" else kept_frames(angles, frame_s)
    new_times = times[0] + frame_s * np.arange(len(kept))
    new_turns = turn_vectors(truth.rotations[kept])
    count = int(round(1 / frame_s))
    begin = len(kept) if kind == "fast" else int(0.5 * len(kept))
    if kind == "black_turn":
        turned = np.convolve(np.linalg.norm(new_turns, axis=1), np.ones(count), "valid")
        early = len(turned) // 4
        begin = early + int(np.argmax(turned[early:]))
    black = range(begin, min(begin + count, len(kept)))
    writer = SetWriter(source, folder, LINKS)
    with open(os.path.join(source.path, "cameras.yaml"), encoding="utf-8") as file:
        focal_px = float(next(line for line in file if "fx" in line).split(":")[1])
    shape = read_grey(source, 0).shape
    for n, k in enumerate(kept):
        stride = k - kept[n - 1] if n else 1
        if n in black:
            writer.make(k, with_noise(np.full(shape, 2.0), 1.0, random))
        elif stride > 1:
            picture = blurred(read_grey(source, k), new_turns[n - 1], frame_s, flight["exposure_s"],
                              focal_px, stride)
            writer.make(k, picture)
        else:
            writer.keep(k)
    writer.times = [float(time) for time in new_times]
    strides = np.diff([kept[0] - 1, *kept])
    w, x, y, z = flight["body_from_cam_wxyz"]
    body_from_cam = poses.rotations_of([x, y, z, w])[0]
    write_imu(source.path, folder, kept, new_times, strides,
              gyro_lines(new_times, new_turns, body_from_cam, random) if with_gyro else [])
    q = poses.quaternions_of(truth.rotations[kept])
    with open(os.path.join(folder, "groundtruth.txt"), "w", encoding="utf-8") as file:
        for time, p, r in zip(new_times, truth.positions[kept], q):
            file.write(f"{time:.9f} " + " ".join(f"{v:.9f}" for v in (*p, *r)) + "\n")
    interval = [float(new_times[black[0]]), float(new_times[black[-1]])] if len(black) else None
    writer.finish(kind, [interval] if interval else [])
    return folder


def write_imu(source_path, folder, kept, times, strides, gyro):
    """imu.txt of the kept frames at their new times; velocities as these times have them."""
    with open(os.path.join(source_path, "imu.txt"), encoding="utf-8") as file:
        lines = [line for line in file if not line.startswith("#")]
    samples = [line.split() for line in lines[1:]]
    with open(os.path.join(folder, "imu.txt"), "w", encoding="utf-8") as file:
        file.write(lines[0])
        for k, time, stride in zip(kept, times, strides):
            fields = samples[k]
            fields[0] = f"{time:.9f}"
            fields[8:11] = [f"{stride * float(v):.9f}" for v in fields[8:11]]
            file.write(" ".join(fields) + "\n")
        file.writelines(gyro)
