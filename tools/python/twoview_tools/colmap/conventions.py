"""Conversions between twoview's conventions and COLMAP's.

Pixels: twoview's (0, 0) is the centre of the top-left pixel; in COLMAP (0, 0) is its corner and
(0.5, 0.5) its centre.
Poses are the same: x1 = R x0 + t; databases and text models store quaternions as w x y z.
Keypoints: COLMAP's scale is SIFT's sigma, half of twoview's diameter. In both, the angle increases
from x towards y."""

from dataclasses import dataclass
from typing import Optional

import numpy as np
import twoview as tv
from twoview import camera_files

HALF_PIXEL = 0.5
_TO_COLMAP = np.array([[1, 0, HALF_PIXEL], [0, 1, HALF_PIXEL], [0, 0, 1]])
_FROM_COLMAP = np.array([[1, 0, -HALF_PIXEL], [0, 1, -HALF_PIXEL], [0, 0, 1]])

# The values of COLMAP's TwoViewGeometry::ConfigurationType.
DEGENERATE, CALIBRATED, UNCALIBRATED, PLANAR, PANORAMIC, PLANAR_OR_PANORAMIC = 1, 2, 3, 4, 5, 6
WATERMARK = 7
# A pair without motion is stored as a panorama with no rotation, so that its matches still join
# tracks.
CONFIGURATIONS = {
    tv.Kind.DEGENERATE: DEGENERATE, tv.Kind.CALIBRATED: CALIBRATED,
    tv.Kind.UNCALIBRATED: UNCALIBRATED, tv.Kind.PLANAR: PLANAR, tv.Kind.PANORAMIC: PANORAMIC,
    tv.Kind.PLANAR_OR_PANORAMIC: PLANAR_OR_PANORAMIC, tv.Kind.NO_MOTION: PANORAMIC}


@dataclass(frozen=True)
class ColmapCamera:
    """A camera as a row of the table `cameras` of COLMAP's database."""

    model: str
    width: int
    height: int
    params: tuple


# COLMAP's numbers of its camera models: those of version 3.8, and those of the models that later
# versions added.
MODEL_IDS = {name: number for number, name in enumerate((
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE",
    "FULL_OPENCV", "FOV", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE",
    "RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_DIVISION", "DIVISION", "SIMPLE_FISHEYE", "FISHEYE",
    "EUCM", "EQUIRECTANGULAR"))}


def camera_to_colmap(camera):
    k = [float(c) for c in camera.k] + [0.0] * (8 - len(camera.k))
    params = [camera.fx, camera.fy, camera.cx + HALF_PIXEL, camera.cy + HALF_PIXEL]
    if camera.model == tv.CameraModel.KANNALA_BRANDT:
        model, lens = "OPENCV_FISHEYE", k[:4]
    elif camera.model == tv.CameraModel.PINHOLE or not any(k):
        model, lens = "PINHOLE", []
    elif any(k[4:]):
        model, lens = "FULL_OPENCV", k
    else:
        model, lens = "OPENCV", k[:4]
    return ColmapCamera(
        model, int(camera.width), int(camera.height), tuple(map(float, params + lens))
    )


def camera_from_colmap(camera, name):
    """Converts a ColmapCamera to a twoview.Camera. Raises ValueError that begins with `name` for a
    lens that twoview has no model of."""
    return camera_files.colmap_camera(camera.model, camera.width, camera.height, camera.params,
                                      name)


def keypoints_to_colmap(keypoints, tilts=None):
    """Keypoints as (n, 6) float32, x y a11 a12 a21 a22, the form that COLMAP's own extractor
    writes. tilts: of keypoints of squeezed views, whose patches are no squares."""
    x, y, angle = (keypoints[name].astype(np.float64) for name in ("x", "y", "angle_rad"))
    scale = keypoints["size"].astype(np.float64) / 2
    cos, sin = scale * np.cos(angle), scale * np.sin(angle)
    shape = [cos, -sin, sin, cos]
    if tilts is not None:
        shape = (tv.keypoint_shapes(keypoints, tilts).reshape(-1, 4) / 2).T
    columns = [x + HALF_PIXEL, y + HALF_PIXEL, *shape]
    return np.column_stack(columns).astype(np.float32).reshape(-1, 6)


def pixels_from_colmap(keypoints):
    """Pixels (n, 2) float64 from COLMAP's keypoints (n, 2), (n, 4) or (n, 6)."""
    return np.ascontiguousarray(np.asarray(keypoints, np.float64)[:, :2] - HALF_PIXEL)


def quaternion(R):
    """The quaternion w x y z of a rotation, with w >= 0."""
    from scipy.spatial.transform import Rotation
    x, y, z, w = found = Rotation.from_matrix(R).as_quat()
    if next((c for c in (w, x, y, z) if c != 0), 1) < 0:  # Debian 12's scipy has no canonical=True
        x, y, z, w = -found
    return np.array([w, x, y, z])


def rotation(qvec):
    """The 3x3 rotation of a quaternion w x y z."""
    from scipy.spatial.transform import Rotation
    w, x, y, z = qvec
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def _scaled(H):
    return H / H[2, 2] if H[2, 2] else H


@dataclass(frozen=True)
class PairGeometry:
    """A row of two_view_geometries, in COLMAP's pixels. An unknown value is None."""

    config: int
    inlier_matches: np.ndarray  #: (n, 2) uint32, indices of the keypoints of both images
    F: Optional[np.ndarray] = None
    E: Optional[np.ndarray] = None
    H: Optional[np.ndarray] = None
    R: Optional[np.ndarray] = None
    t: Optional[np.ndarray] = None

    def swapped(self):
        """The geometry of the pair with image 0 and image 1 exchanged."""
        H = R = t = None
        if self.H is not None:
            H = _scaled(np.linalg.inv(self.H))
        if self.R is not None:
            R, t = self.R.T, -self.R.T @ self.t
        return PairGeometry(self.config, np.ascontiguousarray(self.inlier_matches[:, ::-1]),
                            None if self.F is None else self.F.T.copy(),
                            None if self.E is None else self.E.T.copy(), H, R, t)


def geometry_to_colmap(found, matches):
    """Converts a twoview.TwoView and its inlier matches (n, 2) to a row. A degenerate pair gets no
    matches."""
    config = CONFIGURATIONS[found.kind]
    if config == DEGENERATE:
        return PairGeometry(DEGENERATE, np.zeros((0, 2), np.uint32))
    F, H = found.F, found.H
    if F is not None:
        F = _FROM_COLMAP.T @ F @ _FROM_COLMAP
    if H is not None:
        H = _scaled(_TO_COLMAP @ H @ _FROM_COLMAP)
    t = found.t
    if found.R is not None and t is None:
        t = np.zeros(3)  # COLMAP stores t = 0 for a pure rotation (panorama)
    return PairGeometry(config, np.ascontiguousarray(matches, np.uint32), F, found.E, H, found.R, t)
