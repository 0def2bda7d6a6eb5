"""A simulated drone's flight through a rendered room (`twoview drone simulate --tour`), mapped
while it flies (`twoview odometry --drone`), and the path and the map compared with the room."""

import os
import signal
import subprocess

import numpy as np

from .. import ply
from . import errors, evaluate, poses, surfaces

# The simulator's usual lens (OpenCV's coefficients), which has the size of its pictures.
CAMERA = """%YAML:1.0
---
image_width: 640
image_height: 360
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 568., 0., 320., 0., 567., 180., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.52, 0.27, 0., 0., 0. ]
"""
SECONDS, FRAMES_PER_SECOND = 36, 15  # of the whole tour
CHANNELS = {"at": "commands", "navdata": "navdata", "video": "video", "control": "control"}
# x right, y down, z forward of the camera on the body's axes: x forward, y right, z down.
BODY_FROM_CAMERA = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float)


class Simulator:
    """A running `twoview drone simulate` on free ports; `ports`: the options of a client."""

    def __init__(self, program, folder, options):
        command = [program, "drone", "simulate", "--truth", os.path.join(folder, "truth.txt"),
                   "--surfaces", os.path.join(folder, "surfaces.json"), *options]
        for channel in (*CHANNELS, "recording"):
            command += [f"--{channel}-port", "0"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        words = self.process.stdout.readline().replace(",", "").split()
        if not words:
            raise RuntimeError(f"{program} drone simulate did not start")
        self.port = {channel: words[words.index(name) + 1] for channel, name in CHANNELS.items()}
        self.ports = [word for channel in CHANNELS
                      for word in (f"--{channel}-port", self.port[channel])]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.communicate()


def fly(program, folder, seconds=SECONDS, frames_per_second=FRAMES_PER_SECOND, options=()):
    """Flies the tour for some seconds while `twoview odometry` maps it, into folder/out. Returns
    what subprocess.run returns of the latter."""
    os.makedirs(folder, exist_ok=True)
    camera = os.path.join(folder, "camera.yaml")
    with open(camera, "w", encoding="ascii") as file:
        file.write(CAMERA)
    with Simulator(program, folder, ["--tour", "--fps", str(frames_per_second),
                                     "--duration", str(seconds + 60)]) as simulator:
        return subprocess.run(
            [program, "odometry", "--drone", "127.0.0.1", *simulator.ports, "--camera", camera,
             "--duration", str(seconds), "-o", os.path.join(folder, "out"), "--quiet", *options],
            capture_output=True, text=True, timeout=seconds + 120, check=False)


def truth_of(folder):
    """The true poses of the camera at the frames that the odometry received: the simulator counts
    its pictures, and the names of the frames have these numbers."""
    table = np.loadtxt(os.path.join(folder, "truth.txt"), ndmin=2)
    by_number = {int(row[0]): row for row in table}
    _, rows = evaluate.read_states(os.path.join(folder, "out", "frames.csv"))
    found = [(float(row["timestamp"]), by_number[int(row["name"][6:12])]) for row in rows
             if int(row["name"][6:12]) in by_number]
    values = np.array([row for _, row in found])
    return poses.Trajectory([time for time, _ in found], values[:, 2:5],
                            poses.rotations_of(values[:, 5:9]) @ BODY_FROM_CAMERA), len(rows)


def judge(folder):
    """The figures of a flight: its path after a rigid motion (in metres, without a scale), and its
    map's points beside the walls and furniture."""
    out = os.path.join(folder, "out")
    truth, num_frames = truth_of(folder)
    path = poses.read_tum(os.path.join(out, "trajectory.txt"))
    states, _ = evaluate.read_states(os.path.join(out, "frames.csv"))
    figures = errors.ate(path, truth, num_frames)
    similarity = figures.pop("similarity", None)
    figures["num_frames"] = num_frames
    figures["silent"] = errors.silent_errors(path, truth, states)
    if similarity is None:
        return figures
    cloud = ply.read_ply(os.path.join(out, "cloud.ply"))
    cloud = cloud[cloud["segment"] == figures["segment"]]
    points = np.column_stack([cloud["x"], cloud["y"], cloud["z"]]).astype(float)
    scale, R, t = similarity
    figures["map"] = surfaces.map_accuracy(
        surfaces.read_boxes(os.path.join(folder, "surfaces.json")), scale * points @ R.T + t)
    return figures


def sentences(figures):
    """The lines of scripts/odometry: (reached, text)."""
    if figures["ate_rmse"] is None:
        yield False, "drone's tour: nothing could be tracked"
        return
    off = abs(figures["scale_ratio"] - 1)
    yield (figures["ate_rmse_percent_of_path"] <= 0.5 and figures["coverage"] >= 0.95, (
        f"drone's tour of {figures['path_length']:.1f} m, mapped while it flies: ATE at most 0.5 % "
        f"of the path, coverage at least 95 %: {figures['ate_rmse_percent_of_path']:.2f} % "
        f"({100 * figures['ate_rmse']:.1f} cm; in metres as they are "
        f"{100 * figures['ate_metric_rmse']:.1f} cm), {100 * figures['coverage']:.1f} %"))
    yield off <= 0.02, f"drone's tour: metric scale within 2 %: {100 * off:.1f} %"
    yield (figures["map"]["median_percent"] <= 1 and figures["map"]["outlier_percent"] < 2, (
        "drone's tour: median distance of the points to the room at most 1 % of it, fewer than 2 % "
        f"outliers: {figures['map']['median_percent']:.2f} %, "
        f"{figures['map']['outlier_percent']:.1f} % of {figures['map']['num_points']}"))
    wrong = figures["silent"]["num_wrong"]
    yield wrong == 0, f"drone's tour: never tracking and wrong: {wrong} frames"
