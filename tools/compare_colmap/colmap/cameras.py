"""Camera files: OpenCV's and ROS's YAML, and the cameras.yaml of a data set (docs/formats.md, Cameras)."""

import math
import os
import re

import numpy as np
import twoview as tv

from .errors import BadInput

_LENS = {None: tv.CameraModel.BROWN_CONRADY, "": tv.CameraModel.BROWN_CONRADY,
         "plumb_bob": tv.CameraModel.BROWN_CONRADY,
         "rational_polynomial": tv.CameraModel.BROWN_CONRADY,
         "equidistant": tv.CameraModel.KANNALA_BRANDT}


def _load_yaml(path):
    import yaml

    class Loader(yaml.SafeLoader):
        """With OpenCV's matrices as maps."""

    Loader.add_multi_constructor("tag:yaml.org,2002:opencv-matrix",
                                 lambda loader, _, node: loader.construct_mapping(node, deep=True))
    try:
        with open(path, encoding="utf-8") as file:
            text = re.sub(r"^%YAML:.*", "", file.read())  # OpenCV's first line is no YAML
        root = yaml.load(text, Loader)
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: no YAML: {' '.join(str(error).split())}") from None
    if not isinstance(root, dict):
        raise BadInput(f"{path}: not a map of names and values")
    return root


def _number(value, entry, where):
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise BadInput(f"{where}: {entry} is {'missing' if value is None else 'no number'}")
    return float(value)


def _numbers(value, entry, where):
    value = value.get("data") if isinstance(value, dict) else value
    if not isinstance(value, list):
        raise BadInput(f"{where}: {entry} is {'missing' if value is None else 'no list'}")
    return [_number(v, entry, where) for v in value]


def _checked(where, width, height, fx, fy, cx, cy, model, k):
    if model == tv.CameraModel.BROWN_CONRADY and not any(k):
        model, k = tv.CameraModel.PINHOLE, ()
    camera = tv.Camera(int(width), int(height), fx, fy, cx, cy, model, tuple(k))
    try:
        tv.camera_check(camera)
    except tv.StatusError as error:
        raise BadInput(f"{where}: {error}") from None
    return camera


def read_camera(path):
    """One camera, OpenCV's or ROS's form."""
    root = _load_yaml(path)
    K = _numbers(root.get("camera_matrix"), "camera_matrix", path)
    if len(K) != 9 or K[1] or K[3] or K[6:] != [0, 0, 1]:
        raise BadInput(f"{path}: camera_matrix is not [fx 0 cx; 0 fy cy; 0 0 1]")
    model = root.get("distortion_model")
    if model == "none":
        k, model = [], None
    elif model not in _LENS:
        raise BadInput(f"{path}: distortion_model '{model}' is not one of plumb_bob, rational_polynomial, equidistant")
    else:
        given = root.get("distortion_coefficients")
        k = _numbers(given, "distortion_coefficients", path) if given is not None or model else []
    if len(k) not in ((4,) if model == "equidistant" else (0, 4, 5, 8)):
        raise BadInput(f"{path}: distortion_coefficients has {len(k)} numbers")
    width, height = (_number(root.get(side), side, path) for side in ("image_width", "image_height"))
    return _checked(path, width, height, K[0], K[4], K[2], K[5], _LENS[model], k)


def read_camera_set(path):
    """{name: camera} of a cameras.yaml."""
    cameras = {}
    for name, entry in _load_yaml(path).items():
        where = f"{path}: {name}"
        if not isinstance(entry, dict):
            raise BadInput(f"{where} is not a map of names and values")
        sizes = [_number(entry.get(side), side, where) for side in ("image_width", "image_height")]
        K = [_number(entry.get(key), key, where) for key in ("fx", "fy", "cx", "cy")]
        k = [_number(entry.get(key, 0), key, where) for key in ("k1", "k2", "p1", "p2", "k3")]
        cameras[str(name)] = _checked(where, *sizes, *K, tv.CameraModel.BROWN_CONRADY, k)
    if not cameras:
        raise BadInput(f"{path}: no camera in it")
    return cameras


def write_camera_set(cameras):
    """The text of a cameras.yaml of {name: camera}."""
    text = ""
    for name, camera in cameras.items():
        k = list(camera.k) + [0.0] * 8
        if camera.model == tv.CameraModel.KANNALA_BRANDT or any(k[5:8]):
            raise ValueError(f"{name}: cameras.yaml holds k1 k2 p1 p2 k3 and no other lens")
        values = [camera.fx, camera.fy, camera.cx, camera.cy, *k[:5]]
        text += f"{name}:\n  image_width: {camera.width}\n  image_height: {camera.height}\n"
        text += "".join(f"  {key}: {float(value)!r}\n" for key, value in
                        zip("fx fy cx cy k1 k2 p1 p2 k3".split(), values))
    return text


class CameraChoice:
    """Whose camera an image is of."""

    def __init__(self, files, folders):
        """files: of --camera; folders: where a cameras.yaml is looked for when there are none."""
        self.cameras = {}
        for path in files:
            root = _load_yaml(path)
            if "camera_matrix" in root:
                name = root.get("camera_name") or os.path.splitext(os.path.basename(path))[0]
                self.cameras[str(name)] = read_camera(path)
            else:
                self.cameras.update(read_camera_set(path))
        for folder in folders if not files else ():
            path = os.path.join(folder, "cameras.yaml")
            if os.path.isfile(path):
                self.cameras = read_camera_set(path)
                break

    def of(self, name, width, height, K=None):
        """One camera serves every image; of several the one whose name begins the file's, else the one of K."""
        camera = self._entry(name, K)
        if camera is None:
            if K is None:
                raise BadInput(f"image {name}: no camera for it (--camera, or a cameras.yaml beside the pairs file or "
                               "the images)")
            return tv.Camera(width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2])
        if (camera.width, camera.height) != (width, height):
            raise BadInput(f"image {name} is {width}x{height}, but its camera is for {camera.width}x{camera.height}")
        if K is None:
            return camera
        return tv.Camera(width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2], camera.model, camera.k)

    def _entry(self, name, K):
        if len(self.cameras) <= 1:
            return next(iter(self.cameras.values()), None)
        file = name.rsplit("/", 1)[-1]
        begins = [entry for entry in self.cameras if file.startswith(entry)]
        if begins:
            return self.cameras[max(begins, key=len)]
        if K is not None:
            for camera in self.cameras.values():
                if np.allclose([camera.fx, camera.cx], [K[0, 0], K[0, 2]], rtol=1e-6, atol=0):
                    return camera
        raise BadInput(f"image {name}: none of the cameras {', '.join(self.cameras)} has its name or its K")
