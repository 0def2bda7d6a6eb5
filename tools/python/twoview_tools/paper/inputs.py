"""The input data of the experiments and their locations."""

import json
import os
import subprocess
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Optional

import cv2
import numpy as np

from .. import ROOT, formats
from .experiment import Missing

# Middlebury 2014's Motorcycle pair as scikit-image has it (scripts/bootstrap): rectified, so that
# the motion is sideways and the disparity map is the depth.
MOTORCYCLE = ROOT / ".cache" / "motorcycle"
FOCAL_PX, CX, CY, BASELINE_M = 994.978, (311.193, 342.279), 254.877, 0.193001


def library():
    """The package twoview of this source tree, which loads the library that TWOVIEW_LIBRARY
    names."""
    import twoview
    return twoview


def read_colour(path):
    """Reads an image file as 8-bit BGR."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise Missing(f"{path} is no image")
    return image


def grey(colour):
    """The luma of an image, computed as the program does."""
    return cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY)


@dataclass(frozen=True)
class Pair:
    """Two images with their cameras and what is known of their truth: x1 = R x0 + t, |t| = 1."""

    name: str
    colour: tuple  # two BGR images
    cameras: tuple  # two twoview.Camera, one for each image
    R: np.ndarray
    t: np.ndarray
    baseline_m: float
    depth0: Optional[np.ndarray] = None  # depth in image 0, metres; not finite where unknown
    truth_px: float = 2.0  # a correct match is at most this far from the true epipolar line

    @cached_property
    def grey(self):
        return tuple(grey(image) for image in self.colour)

    @property
    def true_F(self):
        """The true fundamental matrix for pixels, with Frobenius norm 1."""
        E = np.cross(np.eye(3), self.t) @ self.R  # E = [t]x R
        F = np.linalg.inv(self.cameras[1].K).T @ E @ np.linalg.inv(self.cameras[0].K)
        return F / np.linalg.norm(F)


@dataclass(frozen=True)
class Inputs:
    build: Path  # the build folder with bin/twoview and lib/libtwoview.so
    data: Optional[Path]  # the folder that TWOVIEW_DATA names
    fixtures: Optional[Path]  # the folder that TWOVIEW_ARDRONE_FIXTURES names
    scratch: Path  # a temporary folder, which is deleted at the end of the run

    def program(self, *words, statuses=(0,)):
        """Runs `twoview WORDS...`. Returns its stdout; its exit status must be in `statuses`."""
        path = self.build / "bin" / "twoview"
        if not path.is_file():
            raise Missing(f"{path} is not built")
        done = subprocess.run([path, *map(str, words)], capture_output=True, text=True, timeout=120,
                              check=False)
        if done.returncode not in statuses:
            raise RuntimeError(
                f"twoview {words[0]}: status {done.returncode}: {done.stderr.strip()}"
            )
        return done.stdout

    def of_data(self, *parts):
        path = self.data and self.data.joinpath(*parts)
        if not path or not path.exists():
            raise Missing("/".join(parts) + " of the evaluation data (TWOVIEW_DATA)")
        return path

    def of_fixtures(self, *parts):
        path = self.fixtures and self.fixtures.joinpath(*parts)
        if not path or not path.exists():
            raise Missing("/".join(parts) + " of the AR.Drone fixtures (TWOVIEW_ARDRONE_FIXTURES)")
        return path

    @cached_property
    def motorcycle(self):
        tv = library()
        if not MOTORCYCLE.is_dir():
            raise Missing("the Motorcycle pair: run scripts/bootstrap")
        colour = tuple(
            read_colour(MOTORCYCLE / f"motorcycle_{side}.png") for side in ("left", "right")
        )
        height, width = colour[0].shape[:2]
        with np.load(MOTORCYCLE / "motorcycle_disp.npz") as archive:
            disparity = archive[archive.files[0]].astype(float)
        cameras = tuple(tv.Camera(width, height, FOCAL_PX, FOCAL_PX, cx, CY) for cx in CX)
        depth = FOCAL_PX * BASELINE_M / (disparity + CX[1] - CX[0])
        depth[~np.isfinite(disparity)] = np.nan
        return Pair("Middlebury Motorcycle", colour, cameras, np.eye(3), np.array([-1.0, 0, 0]),
                    BASELINE_M, depth)

    def listed_pair(self, folder, name0, name1, title="", truth_px=2.0):
        """A pair of a set's pairs.txt; the set's cameras must have no distortion."""
        tv = library()
        listed = formats.read_pairs(str(self.of_data(folder, "pairs.txt")))
        pair = next((p for p in listed if (p.name0, p.name1) == (name0, name1)), None)
        if pair is None:
            raise Missing(f"{name0} {name1} in {folder}/pairs.txt")
        colour = tuple(read_colour(self.of_data(folder, "images", n)) for n in (name0, name1))
        cameras = tuple(
            tv.Camera(image.shape[1], image.shape[0], k[0, 0], k[1, 1], k[0, 2], k[1, 2])
            for image, k in zip(colour, (pair.K0, pair.K1))
        )
        baseline = float(np.linalg.norm(pair.t))
        return Pair(title or folder, colour, cameras, pair.R, pair.t / baseline, baseline,
                    truth_px=truth_px)


def from_environment(build, scratch):
    def folder(variable, *default):
        path = Path(os.environ.get(variable) or ROOT.parent.joinpath("shared", *default))
        return path if path.is_dir() else None
    return Inputs(Path(build), folder("TWOVIEW_DATA", "data"),
                  folder("TWOVIEW_ARDRONE_FIXTURES", "ardrone", "fixtures"), Path(scratch))


def machine():
    """The name of this computer's processor."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as f:
            return next(line.split(":")[1].strip() for line in f if line.startswith("model name"))
    except (OSError, StopIteration):
        return "unknown"


def read_json(path):
    with open(path, encoding="utf-8") as f:
        return json.load(f)
