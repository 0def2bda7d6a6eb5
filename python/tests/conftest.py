"""Fixtures: the package of the source tree. ctest sets TWOVIEW_LIBRARY to the built library."""

import os
import pathlib
import sys

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "python"))
os.environ.setdefault("TWOVIEW_LIBRARY", str(ROOT / "build" / "release" / "lib" / "libtwoview.so"))

import twoview as tv  # noqa: E402  (sys.path must be extended before)


def needs(function):
    """A mark: the test is skipped where the library was built without this function."""
    missing = not hasattr(tv.default_library().lib, function)
    return pytest.mark.skipif(missing, reason=f"the library was built without {function}")


class Scene:
    """A textured wall with boxes in front of it, seen by two cameras with a sideways motion."""

    def __init__(self):
        self.camera = tv.Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
        angle = 0.05
        self.R = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0],
                           [-np.sin(angle), 0, np.cos(angle)]])
        self.t = np.array([-1.0, 0.1, 0.05])
        self.t /= np.linalg.norm(self.t)
        random = np.random.default_rng(3)
        n = 200
        self.points = np.column_stack([random.uniform(-2, 2, n), random.uniform(-1.5, 1.5, n),
                                       random.uniform(4, 9, n)])
        self.pixels0, inside0 = tv.camera_project_points(self.camera, self.points)
        self.pixels1, inside1 = tv.camera_project_points(
            self.camera, np.ascontiguousarray(self.points @ self.R.T + self.t))
        assert inside0.all() and inside1.all()


@pytest.fixture(scope="session")
def scene():
    return Scene()


@pytest.fixture
def context():
    with tv.Context(max_width=320, max_height=240, max_keypoints=500) as made:
        yield made


@pytest.fixture(scope="session")
def image():
    """An image of smoothed noise, which has corners everywhere."""
    noise = np.random.default_rng(5).integers(0, 256, (246, 326))
    total = sum(noise[y:y + 240, x:x + 320] for y in range(5) for x in range(5))
    return np.clip((total // 25 - 127) * 4 + 127, 0, 255).astype(np.uint8)
