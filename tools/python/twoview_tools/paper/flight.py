"""Records a flight of the simulated AR.Drone through its rendered room, as a real flight is
recorded.

`twoview drone simulate` is the drone, and `twoview drone record` records it. This module moves the
sticks with AT commands over UDP. It runs in real time: nine seconds, of which the take-off takes
four."""

import signal
import socket
import struct
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .experiment import Missing

# Approximately the lens of the AR.Drone 2's front camera.
CAMERA = """%YAML:1.0
---
image_width: 640
image_height: 360
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 560., 0., 320., 0., 560., 180., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.5, 0.25, 0., 0., 0. ]
"""
TAKE_OFF_S, STEER_S = 4.3, 3.2
# Higher than those of the recorder, so that the drone ignores the recorder's commands.
FIRST_SEQUENCE = 1000000


@dataclass(frozen=True)
class Plan:
    name: str
    start: str  # "x,y", the start position in the room, metres
    roll: float = 0.0  # roll: right is positive; pitch: backward is positive; [-1, 1]
    pitch: float = 0.0


SIDEWAYS = Plan("sideways", "0,-2", roll=0.25)
FORWARD = Plan("forward", "-1.5,0", pitch=-0.25)


@dataclass(frozen=True)
class Recorded:
    folder: Path  # the output folder of `drone record`
    camera: Path
    truth: np.ndarray  # a row a picture: number, seconds, x y z, qx qy qz qw, vx vy vz


def free_ports(process):
    words = process.stdout.readline().replace(",", "").split()
    if len(words) < 2:
        raise Missing("the simulated drone: built without the drivers?")
    return {
        name: int(words[words.index(name) + 1])
        for name in ("commands", "navdata", "video", "control")
    }


def steer(port, plan):
    """Flies the plan: commands the take-off, then holds the plan's roll and pitch."""
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    begin, sequence = time.monotonic(), FIRST_SEQUENCE
    bits = [
        struct.unpack("<i", struct.pack("<f", value))[0]
        for value in (plan.roll, plan.pitch, 0.0, 0.0)
    ]
    while (now := time.monotonic() - begin) < TAKE_OFF_S + STEER_S:
        commands = [f"AT*REF={sequence},290718208\r"]
        if now > TAKE_OFF_S:
            commands.append(f"AT*PCMD={sequence + 1},1,{','.join(map(str, bits))}\r")
        for command in commands:
            link.sendto(command.encode(), ("127.0.0.1", port))
        sequence += 2
        time.sleep(0.03)
    link.close()


def stop(process):
    process.send_signal(signal.SIGINT)
    try:
        process.wait(timeout=15)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def fly(inputs, plan, attempt=0):
    folder = Path(inputs.scratch) / f"{plan.name}{attempt}"
    camera, truth = folder / "camera.yaml", folder / "truth.txt"
    fly_anew(inputs, plan, folder, camera, truth)
    if not truth.exists() or truth.stat().st_size == 0:
        raise Missing("a picture from the simulated drone")
    return Recorded(folder / "recording", camera, np.loadtxt(truth, ndmin=2))


def fly_anew(inputs, plan, folder, camera, truth):
    folder.mkdir()
    camera.write_text(CAMERA, encoding="utf-8")
    program = inputs.build / "bin" / "twoview"
    if not program.is_file():
        raise Missing(f"{program} is not built")
    ports = [word for channel in ("at", "navdata", "video", "control", "recording")
             for word in (f"--{channel}-port", "0")]
    command = [
        program,
        "drone",
        "simulate",
        *ports,
        "--duration",
        "60",
        "--fps",
        "15",
        "--camera",
        camera,
        "--start",
        plan.start,
        "--truth",
        truth,
    ]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as drone:
        try:
            port = free_ports(drone)
            record = [
                program,
                "drone",
                "record",
                "--host",
                "127.0.0.1",
                "--at-port",
                port["commands"],
                "--navdata-port",
                port["navdata"],
                "--video-port",
                port["video"],
                "--control-port",
                port["control"],
                "--duration",
                "30",
                "--quiet",
                "-o",
                folder / "recording",
            ]
            with subprocess.Popen(list(map(str, record)), stdout=subprocess.DEVNULL) as recorder:
                time.sleep(1.0)
                steer(port["commands"], plan)
                stop(recorder)
        finally:
            stop(drone)
