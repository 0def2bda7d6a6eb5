"""ORB-SLAM3 (C. Campos et al., TRO 37(6), 2021) as a peer: orbslam3-python of PyPI in a virtual
environment of its own, .cache/venv-orbslam, with a vocabulary that is made here once from images of
the data (vocabulary.py)."""

import glob
import json
import os
import subprocess
import sys

from .. import ROOT, formats
from ..accuracy.datasets import data_dir
from .runs import measured

REQUIREMENTS = os.path.join(ROOT, "scripts", "requirements-orbslam.txt")
FOLDER = os.path.join(ROOT, ".cache", "venv-orbslam")
VOCABULARY = os.path.join(ROOT, ".cache", "orbslam-vocabulary.txt")
HERE = os.path.dirname(os.path.abspath(__file__))
# Every 20th image of the sequences, at most 20 of each, and the images of some sets of pairs.
SEQUENCES = ("seq_chessboard_desk", "seq_tum_fr1_rpy", "seq_parking", "seq_kitti00_first200",
             "seq_icl_of_kt3", "seq_tsukuba", "hololens_room_seq")
PAIR_SETS = ("tum_fr2_desk", "tum_fr3_office", "strecha_fountain_P11", "kitti00_turn", "pc_room",
             "desk_monitors")
FEATURES = {"seq_kitti00_first200": 2000}  # ORB-SLAM3's own settings: 1000, KITTI 2000
# Milliseconds from a frame to the next: the sequences' own pace is as little as 33 ms, at which
# ORB-SLAM3's tracking thread leaves out keyframes on two cores. The pace of baselines.md's run B.
INTERVAL_MS = {"seq_chessboard_desk": 100, "seq_tum_fr1_rpy": 120, "seq_kitti00_first200": 300,
               "hololens_room_seq": 200}
DEFAULT_INTERVAL_MS = 150


def python():
    """The interpreter of the environment; installs it where it is missing."""
    interpreter = os.path.join(FOLDER, "bin", "python")
    with open(REQUIREMENTS, encoding="utf-8") as file:
        wanted = file.read()
    mark = os.path.join(FOLDER, "requirements-orbslam.txt")
    if not os.path.isfile(mark) or open(mark, encoding="utf-8").read() != wanted:
        print(f"scripts/odometry: installing ORB-SLAM3 into {FOLDER}", file=sys.stderr)
        subprocess.run(["/usr/bin/python3", "-m", "venv", "--clear", FOLDER], check=True)
        subprocess.run([interpreter, "-m", "pip", "install", "--quiet",
                        "--disable-pip-version-check", "--only-binary=:all:", "-r", REQUIREMENTS],
                       check=True)
        with open(mark, "w", encoding="utf-8") as file:
            file.write(wanted)
    return interpreter


def vocabulary():
    """The path of the vocabulary; makes it where it is missing (about half a minute)."""
    if not os.path.isfile(VOCABULARY):
        images = []
        for name in SEQUENCES:
            images += sorted(glob.glob(os.path.join(data_dir(), name, "images", "*")))[4::20][:20]
        for name in PAIR_SETS:
            images += sorted(glob.glob(os.path.join(data_dir(), name, "images", "*")))
        print("scripts/odometry: making ORB-SLAM3's vocabulary", file=sys.stderr)
        subprocess.run([python(), os.path.join(HERE, "vocabulary.py"), VOCABULARY, *images],
                       check=True, stdout=sys.stderr)
    return VOCABULARY


def settings_text(camera, features, frames_per_second):
    """ORB-SLAM3's settings file for a formats.Camera: its own values but for the camera's."""
    k = [*camera.k, 0, 0, 0, 0, 0][:5]
    return "\n".join([
        "%YAML:1.0", 'File.version: "1.0"', 'Camera.type: "PinHole"',
        f"Camera1.fx: {camera.fx:.9f}", f"Camera1.fy: {camera.fy:.9f}",
        f"Camera1.cx: {camera.cx:.9f}", f"Camera1.cy: {camera.cy:.9f}",
        *(f"Camera1.{name}: {value:.9f}" for name, value in zip(("k1", "k2", "p1", "p2", "k3"), k)),
        f"Camera.width: {camera.width}", f"Camera.height: {camera.height}",
        f"Camera.fps: {max(1, round(frames_per_second))}", "Camera.RGB: 0",
        f"ORBextractor.nFeatures: {features}", "ORBextractor.scaleFactor: 1.2",
        "ORBextractor.nLevels: 8", "ORBextractor.iniThFAST: 20", "ORBextractor.minThFAST: 7",
        "Viewer.KeyFrameSize: 0.05", "Viewer.KeyFrameLineWidth: 1.0", "Viewer.GraphLineWidth: 0.9",
        "Viewer.PointSize: 2.0", "Viewer.CameraSize: 0.08", "Viewer.CameraLineWidth: 3.0",
        "Viewer.ViewpointX: 0.0", "Viewer.ViewpointY: -0.7", "Viewer.ViewpointZ: -1.8",
        "Viewer.ViewpointF: 500.0", ""])


def run(source, out, timeout=1800):
    """Runs ORB-SLAM3 over a sets.SetFolder into the folder `out`. Returns runs.measured()'s figures
    with cpu_ms_per_frame, which leaves out the reading of the images. RuntimeError where it ended
    without a trajectory."""
    os.makedirs(out, exist_ok=True)
    camera = next(iter(formats.read_camera_set(source.file("cameras.yaml")).values()))
    span = source.times[-1] - source.times[0]
    rate = (len(source.times) - 1) / span if span > 0 else 30
    settings = os.path.join(out, "settings.yaml")
    with open(settings, "w", encoding="ascii") as file:
        file.write(settings_text(camera, FEATURES.get(source.name, 1000), rate))
    log = os.path.join(out, "log.txt")
    for name in ("trajectory.txt", "peer.json"):
        if os.path.exists(os.path.join(out, name)):
            os.remove(os.path.join(out, name))
    figures = measured([python(), os.path.join(HERE, "orbslam_child.py"), source.path, out,
                        vocabulary(), settings,
                        str(INTERVAL_MS.get(source.name, DEFAULT_INTERVAL_MS))], log, timeout)
    if not os.path.isfile(os.path.join(out, "peer.json")):
        raise RuntimeError(f"ORB-SLAM3 on {source.name}: status {figures['status']}; see {log}")
    with open(os.path.join(out, "peer.json"), encoding="utf-8") as file:
        return {**figures, **json.load(file)}
