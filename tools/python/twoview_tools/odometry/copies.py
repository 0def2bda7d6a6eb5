"""Changed copies of a sequence: another motion, light or lens over pictures whose truth is known.
They show whether a rule that was chosen on the sequences holds beside them.

| kind | what is changed |
| --- | --- |
| backwards | the last frame comes first |
| second_half | begins in the middle |
| every_second, every_third | the rate |
| dark | a third of the light, with noise |
| noisy | noise with a standard deviation of 8 grey levels |
| blurred | by 1.5 pixels |
| flicker | the light of each frame by up to a quarter |
| half_size | half as many rows and columns |
| mirrored | left and right |
| upside_down | turned by half a turn |

What sensors said (imu.txt) is left out: it is of the motion as it was."""

import os
from dataclasses import replace

import numpy as np

from .. import formats
from . import poses
from .set_writer import SetWriter, read_grey, with_noise
from .sets import read_set

STEPS = {"backwards": -1, "every_second": 2, "every_third": 3}
PICTURES = ("dark", "noisy", "blurred", "flicker", "half_size", "mirrored", "upside_down")
KINDS = ("backwards", "second_half", "every_second", "every_third", *PICTURES)


def _picture_of(kind, grey, random):
    import cv2
    if kind == "dark":
        return with_noise(grey / 3.0, 2, random)
    if kind == "noisy":
        return with_noise(grey, 8, random)
    if kind == "blurred":
        return cv2.GaussianBlur(grey, (0, 0), 1.5)
    if kind == "flicker":
        return np.clip(grey * random.uniform(0.75, 1.25), 0, 255).astype(np.uint8)
    if kind == "half_size":
        height, width = grey.shape[0] // 2, grey.shape[1] // 2
        return cv2.resize(grey[:2 * height, :2 * width], (width, height),
                          interpolation=cv2.INTER_AREA)
    return grey[:, ::-1] if kind == "mirrored" else grey[::-1, ::-1]


def _tangential(camera, p1, p2):
    """The coefficients with other signs of the tangential ones."""
    k = list(camera.k)
    if camera.model == "brown_conrady" and len(k) >= 4:
        k[2] *= p1
        k[3] *= p2
    return tuple(k)


def _camera_of(kind, camera):
    if kind == "half_size":
        return replace(camera, width=camera.width // 2, height=camera.height // 2,
                       fx=camera.fx / 2, fy=camera.fy / 2, cx=(camera.cx + 0.5) / 2 - 0.5,
                       cy=(camera.cy + 0.5) / 2 - 0.5)
    if kind == "mirrored":
        return replace(camera, cx=camera.width - 1 - camera.cx, k=_tangential(camera, 1, -1))
    if kind == "upside_down":
        return replace(camera, cx=camera.width - 1 - camera.cx, cy=camera.height - 1 - camera.cy,
                       k=_tangential(camera, -1, -1))
    return camera


def _truth_of(kind, truth, turned_at):
    """turned_at: the sum of the first and the last time."""
    if kind == "mirrored":  # the world is mirrored, too
        mirror = np.diag([-1.0, 1.0, 1.0])
        return poses.Trajectory(truth.times, truth.positions @ mirror,
                                mirror @ truth.rotations @ mirror)
    if kind == "upside_down":
        return poses.Trajectory(truth.times, truth.positions,
                                truth.rotations @ np.diag([-1.0, -1.0, 1.0]))
    if kind == "backwards":
        return poses.Trajectory(turned_at - truth.times[::-1], truth.positions[::-1],
                                truth.rotations[::-1])
    return truth


def _write_camera(path, camera):
    if camera.model == "kannala_brandt":
        raise ValueError("copies: no wide lenses")
    names = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    entries = {"image_width": camera.width, "image_height": camera.height, "fx": camera.fx,
               "fy": camera.fy, "cx": camera.cx, "cy": camera.cy, **dict(zip(names, camera.k))}
    with open(path, "w", encoding="ascii") as file:
        file.write("cam0:\n" + "".join(f"  {name}: {value!r}\n"
                                       for name, value in entries.items()))


def make(kind, source_path, folder, seed=1):
    """Writes the folder of a changed copy, and returns it."""
    if kind not in KINDS:
        raise ValueError(f"no copy '{kind}'; there are {', '.join(KINDS)}")
    source = read_set(source_path)
    writer = SetWriter(source, folder)
    random = np.random.default_rng([seed, KINDS.index(kind)])
    order = range(len(source.times))[::STEPS.get(kind, 1)]
    if kind == "second_half":
        order = order[len(order) // 2:]
    turned_at = source.times[0] + source.times[-1]
    for k in order:
        if kind in PICTURES:
            writer.make(k, _picture_of(kind, read_grey(source, k), random), ".png")
        else:
            writer.keep(k, turned_at - source.times[k] if kind == "backwards" else None)
    cameras = formats.read_camera_set(source.file("cameras.yaml"))
    _write_camera(os.path.join(folder, "cameras.yaml"),
                  _camera_of(kind, next(iter(cameras.values()))))
    truth = source.truth()
    if truth is not None:
        poses.write_tum(os.path.join(folder, "groundtruth.txt"),
                        _truth_of(kind, truth, turned_at))
    return writer.finish(kind)
