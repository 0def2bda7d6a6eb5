"""The cameras of images: from camera files and cameras.yaml (twoview_tools.formats), or from a
pair's K."""

import math
import os

import twoview as tv

from .. import formats
from .errors import BadInput, refused


def _camera(found):
    """Converts a formats.Camera to a twoview.Camera."""
    return tv.Camera(found.width, found.height, found.fx, found.fy, found.cx, found.cy,
                     tv.CameraModel[found.model.upper()], found.k)


def read_camera(path):
    """Reads one camera in OpenCV's or ROS's format."""
    with refused(path):
        return _camera(formats.read_camera(path))


def read_calibration(path):
    """How uncertain the calibration of a camera file is."""
    with refused(path):
        return tv.read_calibration(path)


def read_camera_set(path):
    """Reads a cameras.yaml as {name: camera}."""
    with refused(path):
        return {name: _camera(found) for name, found in formats.read_camera_set(path).items()}


def film_camera(focal_35mm, width, height):
    """A pinhole camera from the focal length as for 35 mm film, in millimetres, as the program's
    --focal-35mm makes it: of the image's diagonal, with the principal point in its middle."""
    focal = focal_35mm * math.hypot(width, height) / math.hypot(36, 24)
    return tv.Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)


def resized(camera, width, height):
    """The camera of an image that was resized: on each axis, with s = new size / old size, f' = s f
    and c' = s (c + 0.5) - 0.5."""
    sx, sy = width / camera.width, height / camera.height
    return tv.Camera(width, height, sx * camera.fx, sy * camera.fy, sx * (camera.cx + 0.5) - 0.5,
                     sy * (camera.cy + 0.5) - 0.5, camera.model, camera.k)


class CameraChoice:
    """Chooses the camera of an image from the given or found camera files, or makes it from a focal
    length as for 35 mm film."""

    def __init__(self, files, folders, focal_35mm=0):
        """files: the camera files of --camera. folders: if `files` is empty and focal_35mm is 0,
        the first cameras.yaml in these folders is read."""
        self.focal_35mm = focal_35mm
        if focal_35mm:
            self.cameras = {}
            return
        paths = list(files)
        for folder in folders if not files else ():
            path = os.path.join(folder, "cameras.yaml")
            if os.path.isfile(path):
                paths.append(path)
                break
        with refused(paths[0] if paths else ""):
            self.cameras = formats.read_cameras_of(paths)

    def of(self, name, width, height, K=None):
        """The camera of an image of this size. formats.choose_entry defines the choice. If the
        pair's line has K, it replaces the camera's intrinsics; without a camera it makes a
        pinhole."""
        if self.focal_35mm and K is None:
            return film_camera(self.focal_35mm, width, height)
        with refused(name):
            found = formats.choose_camera(self.cameras, name, K)
        camera = None if found is None else _camera(found)
        if camera is None:
            if K is None:
                raise BadInput(
                    f"image {name}: no camera for it (--camera, or a cameras.yaml beside the pairs "
                    f"file or "
                    "the images)"
                )
            with refused(name):
                formats.check_K(None, name, K, width, height)
            return tv.Camera(width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2])
        if (camera.width, camera.height) != (width, height):
            raise BadInput(
                f"image {name} is {width}x{height}, but its camera is for "
                f"{camera.width}x{camera.height}"
            )
        if K is None:
            return camera
        with refused(name):
            formats.check_K(camera, name, K, width, height)
        return tv.Camera(width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2], camera.model, camera.k)
