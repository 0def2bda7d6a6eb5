"""Set folders: frames.txt, images/, cameras.yaml and perhaps groundtruth.txt, imu.txt (rendered
flights), surfaces.json, flight.json, and fault.json (faults)."""

import json
import os
import re
from dataclasses import dataclass, field

from .. import formats
from ..accuracy.datasets import data_dir
from . import poses

SETS = ("seq_chessboard_desk", "seq_tum_fr1_rpy", "seq_parking", "seq_kitti00_first200",
        "seq_icl_of_kt3", "seq_tsukuba", "hololens_room_seq")
# The standard deviations of the truth of the sets, (metres, degrees), as the data's README.md
# states them. The rendered ones are exact, and so are those that are not named.
TRUTH_SIGMA = {"seq_chessboard_desk": (0.001, 0.1), "seq_tum_fr1_rpy": (0.01, 0.5),
               "seq_kitti00_first200": (0.05, 0.1), "hololens_room_seq": (0.02, 0.5)}
DESCRIPTIONS = ("cameras.yaml", "groundtruth.txt", "imu.txt", "surfaces.json", "flight.json")


@dataclass
class SetFolder:
    """A set folder as it was read."""

    path: str
    times: list = field(default_factory=list)  # seconds
    names: list = field(default_factory=list)  # relative to path

    @property
    def name(self):
        return os.path.basename(os.path.normpath(self.path))

    def file(self, name):
        """The path of one of the set's files; None if the set does not have it."""
        path = os.path.join(self.path, name)
        return path if os.path.isfile(path) else None

    def truth(self):
        path = self.file("groundtruth.txt")
        return poses.read_tum(path) if path else None

    def json(self, name):
        path = self.file(name)
        if path is None:
            return None
        with open(path, encoding="utf-8") as file:
            return json.load(file)

    def picture_size(self):
        """[width, height] of the first camera; None without cameras.yaml."""
        path = self.file("cameras.yaml")
        if path is None:
            return None
        camera = next(iter(formats.read_camera_set(path).values()))
        return [camera.width, camera.height]

    def truth_sigma(self):
        """Of the set, or of the set that faults were put into: (metres, degrees)."""
        fault = self.json("fault.json") or {}
        return TRUTH_SIGMA.get(fault.get("source", self.name), (0.0, 0.0))


def read_set(path):
    """Reads a set folder's frames.txt. ValueError names a line that is not `timestamp name`."""
    found = SetFolder(path)
    with open(os.path.join(path, "frames.txt"), encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            if not line.strip() or line.startswith("#"):
                continue
            fields = line.split(maxsplit=1)
            if len(fields) != 2 or not re.fullmatch(r"[0-9.eE+-]+", fields[0]):
                raise ValueError(f"{path}/frames.txt: line {number}: not `timestamp name`")
            found.times.append(float(fields[0]))
            found.names.append(fields[1].strip())
    if not found.times:
        raise ValueError(f"{path}/frames.txt: no frame in it")
    return found


def write_frames(path, times, names):
    with open(os.path.join(path, "frames.txt"), "w", encoding="utf-8") as file:
        file.write("# timestamp filename\n")
        file.writelines(f"{time:.9f} {name}\n" for time, name in zip(times, names))


def set_paths(names=None):
    """The folders of the named sets (a list separated by commas; a name with a slash is a path);
    None means SETS, as far as they exist. ValueError says what there is not."""
    chosen = names.split(",") if names else SETS
    paths = [name if os.sep in name else os.path.join(data_dir(), name) for name in chosen]
    missing = [path for path in paths if not os.path.isfile(os.path.join(path, "frames.txt"))]
    if names and missing:
        raise ValueError(f"no frames.txt in {', '.join(missing)}")
    return [path for path in paths if path not in missing]
