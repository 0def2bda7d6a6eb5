"""Reads COLMAP models, text or binary, of any version that pycolmap reads; writes text models."""

import os
from dataclasses import dataclass, field

import numpy as np

from .conventions import HALF_PIXEL, ColmapCamera, camera_to_colmap, quaternion
from .errors import BadInput, need_pycolmap


@dataclass(frozen=True)
class ModelImage:
    camera_id: int
    R: np.ndarray  #: (3, 3), x_camera = R x_world + t
    t: np.ndarray
    point_ids: frozenset = frozenset()  #: ids of the 3D points that the image sees

    @property
    def centre(self):
        return -self.R.T @ self.t


@dataclass(frozen=True)
class Model:
    cameras: dict  #: {camera_id: ColmapCamera}
    images: dict  #: {name: ModelImage} of the registered images
    num_points: int = 0
    mean_error_px: float = 0.0
    contradicted: dict = field(default_factory=dict)  #: {name: px}, see _contradicted

    def words_on_contradicted(self):
        """Continues a summary where images contradict the model's points; else empty."""
        if not self.contradicted:
            return ""
        return (f"; {len(self.contradicted)} images contradict the model's own points "
                f"({_off_words(self.contradicted)}): a wrong pose or camera?")

    def poses(self):
        """Returns {name: (R, centre)} of the registered images, the centre in the world frame."""
        return {name: (image.R, image.centre) for name, image in self.images.items()}


def _whole_names(path):
    """{image_id: name} of images.txt. The name is the rest of its line, which COLMAP writes so and
    reads up to the first blank: 'my 1.png' and 'my 2.png' become two images 'my' (pycolmap 4.2.1,
    2026-11-29)."""
    with open(path, encoding="utf-8", newline="\n") as file:
        lines = [line.strip() for line in file]
    names, at = {}, 0
    while at < len(lines):
        if lines[at] and not lines[at].startswith("#"):
            fields = lines[at].split(None, 9)
            if len(fields) < 10:
                raise ValueError(f"images.txt: line {at + 1}: {len(fields)} fields, not 10")
            names[int(fields[0])] = fields[9]
            at += 1  # the line of the image's points, which may be empty, follows its own
        at += 1
    return names


# COLMAP's mapper drops what is farther from its point (Mapper.filter_max_reproj_error).
MOST_ERROR_PX = 4
_MOST_POINTS = 500  # of an image, that are looked at


def _contradicted(found, names):
    """{name: px} of the images whose pose or camera their own points contradict: more than half of
    them lie more than MOST_ERROR_PX from their pixels, px in the median. It is so where the
    quaternions are in another order or no unit, where poses are world_from_cam, centres or of
    another unit than the points, and where the camera is of another size."""
    off = {}
    for image in found.images.values():
        seen = image.get_observation_points2D() if image.has_pose else []
        if not seen:
            continue
        seen = seen[::max(1, len(seen) // _MOST_POINTS)]
        pose = image.cam_from_world().matrix()
        points = np.array([found.points3D[p.point3D_id].xyz for p in seen]) @ pose[:, :3].T
        points += pose[:, 3]
        camera = found.cameras[image.camera_id]
        pixels = np.array([p.xy for p in seen])
        errors = np.linalg.norm(camera.img_from_cam(points) - pixels, axis=1)
        is_outside = ((pixels < 0) | (pixels > (camera.width, camera.height))).any(axis=1)
        errors[is_outside | ~(points[:, 2] > 0) | ~np.isfinite(errors)] = np.inf
        median = float(np.median(errors))
        if median > MOST_ERROR_PX:
            off[names[image.image_id]] = median
    return off


def read_model(folder):
    """Reads a folder with cameras, images and points3D, .txt or .bin."""
    colmap = need_pycolmap("reading a model")
    for suffix in (".bin", ".txt"):
        if all(
            os.path.isfile(os.path.join(folder, stem + suffix))
            for stem in ("cameras", "images", "points3D")
        ):
            break
    else:
        raise BadInput(
            f"{folder}: no COLMAP model in it (cameras, images and points3D, .bin or .txt)"
        )
    try:
        found = colmap.Reconstruction(folder)
        names = (_whole_names(os.path.join(folder, "images.txt")) if suffix == ".txt" else
                 {key: image.name for key, image in found.images.items()})
    except (RuntimeError, ValueError, IndexError) as error:
        raise BadInput(
            f"{folder}: not a COLMAP model: {' '.join(str(error).split())[:200]}"
        ) from None
    cameras = {
        key: ColmapCamera(
            camera.model.name, camera.width, camera.height, tuple(camera.params.tolist())
        )
        for key, camera in found.cameras.items()
    }
    images = {}
    for image in sorted(found.images.values(), key=lambda image: names[image.image_id]):
        if image.has_pose:
            name = names[image.image_id]
            if name in images:
                raise BadInput(f"{folder}: two images are called {name}")
            pose = image.cam_from_world().matrix()
            seen = frozenset(point.point3D_id for point in image.get_observation_points2D())
            images[name] = ModelImage(
                image.camera_id, pose[:, :3].copy(), pose[:, 3].copy(), seen
            )
    error = found.compute_mean_reprojection_error() if found.num_points3D() else 0.0
    off = _contradicted(found, names)
    if 2 * len(off) > len(images):
        raise BadInput(
            f"{folder}: {len(off)} of {len(images)} images contradict the model's own points "
            f"({_off_words(off)}): quaternions in another order than w x y z, poses or centres of "
            f"the other direction, another unit, or a camera of pictures of another size?"
        )
    return Model(cameras, images, found.num_points3D(), error, off)


def _off_words(off):
    name, px = max(off.items(), key=lambda item: item[1])
    return (f"{name}: half of them behind it or outside its picture" if np.isinf(px) else
            f"{name}: {px:.3g} px off in the median")


@dataclass
class TwoViewModel:
    """A model of two images, the first at the origin, and the points that both see."""

    names: tuple
    cameras: tuple  #: a twoview.Camera for each image
    R: np.ndarray
    t: np.ndarray
    pixels: tuple  #: for each image (n, 2); (0, 0) is the centre of the first pixel
    points: np.ndarray  #: (n, 3), positions in the first camera's frame
    colours: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), np.uint8))
    errors_px: np.ndarray = field(default_factory=lambda: np.zeros(0))


def _line(*values):
    return " ".join(f"{v:.17g}" if isinstance(v, float) else str(v) for v in values) + "\n"


def text_model(model):
    """{file name: text} of a model in COLMAP's text format, which 3.8 and 4 read."""
    rows = [camera_to_colmap(camera) for camera in model.cameras]
    shared = rows[0] == rows[1]
    cameras = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n" + "".join(
        _line(i + 1, row.model, row.width, row.height, *row.params)
        for i, row in enumerate(rows[: 1 if shared else 2])
    )
    images = "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then POINTS2D[] as X Y POINT3D_ID\n"
    for i, (R, t) in enumerate(((np.eye(3), np.zeros(3)), (model.R, model.t))):
        images += _line(
            i + 1,
            *map(float, quaternion(R)),
            *map(float, t),
            1 if shared else i + 1,
            model.names[i],
        )
        images += " ".join(f"{x:.17g} {y:.17g} {k + 1}"
                           for k, (x, y) in enumerate(model.pixels[i] + HALF_PIXEL)) + "\n"
    colours = model.colours if len(model.colours) else np.zeros((len(model.points), 3), np.uint8)
    errors = model.errors_px if len(model.errors_px) else np.zeros(len(model.points))
    points = "# POINT3D_ID X Y Z R G B ERROR, then TRACK[] as IMAGE_ID POINT2D_IDX\n" + "".join(
        _line(k + 1, *map(float, point), *map(int, colours[k]), float(errors[k]), 1, k, 2, k)
        for k, point in enumerate(model.points))
    return {"cameras.txt": cameras, "images.txt": images, "points3D.txt": points}
