"""Figures of matches, epipolar lines and clouds, for notebooks and papers. They need matplotlib,
which is imported at the first figure; savefig of what they return writes PDF, SVG or PNG."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np

from . import _abi
from .camera import Camera, camera_project_points, camera_unproject_points
from .enums import PointStatus
from .stages import Reconstruction, TwoView

GOOD, POOR = "#2a9d5c", "#c8453b"  # colours of inliers and of the others
_GAP = 0.02  # between the two images of a figure, of their width
# Distances along a ray, in baselines, at which an epipolar curve is computed. Between them it is
# drawn straight; through a lens it is none.
_DISTANCES = np.geomspace(0.05, 1e5, 200)


def _axes(axes: Any, **options: Any) -> Any:
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("twoview.plot needs matplotlib: pip install matplotlib") from error
    return axes if axes is not None else pyplot.subplots(**options)[1]


def _grey(name: str, image: Any) -> np.ndarray:
    pixels = np.asarray(image)
    if pixels.ndim not in (2, 3):
        raise ValueError(f"{name}: shape (height, width) or (height, width, 3) is expected, not "
                         f"{pixels.shape}")
    return pixels


def _side_by_side(axes: Any, image0: Any, image1: Any) -> tuple[Any, float]:
    """Shows both images in one pair of axes. Returns the axes, and where image 1 begins."""
    images = [_grey("image0", image0), _grey("image1", image1)]
    axes = _axes(axes, figsize=(10, 4), layout="constrained")
    height = max(image.shape[0] for image in images)
    start = images[0].shape[1] * (1 + _GAP)
    for image, left in zip(images, (0.0, start)):
        axes.imshow(image, cmap="gray", vmin=0, vmax=255,
                    extent=(left - 0.5, left + image.shape[1] - 0.5, image.shape[0] - 0.5, -0.5))
    axes.set_xlim(-0.5, start + images[1].shape[1] - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.set_axis_off()
    return axes, start


def _chosen(count: int, most: int) -> np.ndarray:
    """At most `most` of `count` indices, evenly spaced."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def _pixels(pixels0: Any, pixels1: Any) -> tuple[np.ndarray, np.ndarray]:
    found = [_abi.check_array(name, pixels, np.float64, 2)
             for name, pixels in (("pixels0", pixels0), ("pixels1", pixels1))]
    if len(found[0]) != len(found[1]):
        raise ValueError(f"{len(found[0])} pixels0 and {len(found[1])} pixels1")
    return found[0], found[1]


def pixels_of(cloud: Reconstruction) -> tuple[np.ndarray, np.ndarray]:
    """The matched pixels of a Reconstruction, (n, 2) float64 of image 0 and of image 1."""
    points = [np.column_stack([keypoints["x"], keypoints["y"]]).astype(np.float64)
              for keypoints in cloud.keypoints]
    return points[0][cloud.matches["idx0"]], points[1][cloud.matches["idx1"]]


def matches(image0: np.ndarray, image1: np.ndarray, pixels0: Any, pixels1: Any = None,
            inliers: Optional[Any] = None, *, most: int = 200, axes: Any = None) -> Any:
    """Both images side by side, and lines between matched pixels: inliers green, others red.

    image0, image1: (height, width) or (height, width, 3). pixels0, pixels1: (n, 2) each; or in
    place of both a Reconstruction, whose inliers are taken. inliers: None, or (n,) of truth values.
    most: at most so many lines of each colour, evenly spaced. axes: matplotlib's, None for a new
    figure.
    Returns matplotlib's Figure. Raises ImportError without matplotlib, ValueError for another
    shape."""
    if isinstance(pixels0, Reconstruction):
        inliers = pixels0.inlier_mask if inliers is None else inliers
        pixels0, pixels1 = pixels_of(pixels0)
    pixels0, pixels1 = _pixels(pixels0, pixels1)
    is_inlier = np.ones(len(pixels0), bool) if inliers is None else np.asarray(inliers, bool)
    if is_inlier.shape != (len(pixels0),):
        raise ValueError(f"inliers: shape ({len(pixels0)},) is expected, not {is_inlier.shape}")
    axes, start = _side_by_side(axes, image0, image1)
    for wanted, colour, width in ((~is_inlier, POOR, 0.4), (is_inlier, GOOD, 0.7)):
        indices = np.flatnonzero(wanted)
        if len(indices) == 0:
            continue
        indices = indices[_chosen(len(indices), most)]
        ends = np.stack([pixels0[indices], pixels1[indices] + [start, 0]], axis=1)
        axes.plot(ends[:, :, 0].T, ends[:, :, 1].T, "-", color=colour, linewidth=width, alpha=0.7)
        axes.plot(ends[:, :, 0].ravel(), ends[:, :, 1].ravel(), ".", color=colour, markersize=2)
    axes.set_title(f"{int(is_inlier.sum())} of {len(pixels0)} matches agree", fontsize=9)
    return axes.figure


def _curve(pixel: np.ndarray, R: np.ndarray, t: np.ndarray, camera: Camera,
           other: Camera) -> np.ndarray:
    """Where the other camera sees the ray of a pixel, (n, 2), through both lenses."""
    rays, has_ray = camera_unproject_points(camera, pixel[None])
    if not has_ray[0]:
        return np.empty((0, 2))
    seen, is_seen = camera_project_points(
        other, np.concatenate([_DISTANCES[:, None] * rays @ R.T + t, rays @ R.T]))
    visible: np.ndarray = seen[is_seen]
    return visible


def _line(line: np.ndarray, width: int, height: int) -> np.ndarray:
    """Two points (2, 2) of the line a x + b y + c = 0, at the borders of an image; or none."""
    a, b, c = line
    if abs(b) >= abs(a) and b != 0:
        x = np.array([0.0, width - 1.0])
        return np.column_stack([x, -(a * x + c) / b])
    if a == 0:
        return np.empty((0, 2))
    y = np.array([0.0, height - 1.0])
    return np.column_stack([-(b * y + c) / a, y])


def epipolar_lines(image0: np.ndarray, image1: np.ndarray, pose: TwoView, pixels0: Any,
                   pixels1: Any = None, camera0: Optional[Camera] = None,
                   camera1: Optional[Camera] = None, *, most: int = 12, axes: Any = None) -> Any:
    """Both images side by side, some matched pixels, and the epipolar line of each in the other
    image, in one colour for each match.

    image0, image1: as for matches. pose: of estimate_two_view or reconstruct. pixels0, pixels1:
    (n, 2) each; or in place of both a Reconstruction, whose inliers are taken. camera0, camera1:
    of the pixels, as corrected_camera gives them: with both the lines are curves as the lenses
    bend them; without them they are straight, by F, which is of undistorted pixels. most: at most
    so many matches. axes: matplotlib's, None for a new figure.
    Returns matplotlib's Figure. Raises ImportError without matplotlib, ValueError where the pose
    has no lines."""
    if isinstance(pixels0, Reconstruction):
        keep = pixels0.inlier_mask
        pixels0, pixels1 = (pixels[keep] for pixels in pixels_of(pixels0))
    pixels0, pixels1 = _pixels(pixels0, pixels1)
    has_cameras = camera0 is not None and camera1 is not None
    if (camera0 is None) != (camera1 is None):
        raise ValueError("give both cameras, or none")
    if has_cameras and (pose.R is None or pose.t is None):
        raise ValueError("the pose has no R and t, and so no epipolar lines")
    if not has_cameras and pose.F is None:
        raise ValueError("the result has no F, and so no epipolar lines; give both cameras")
    axes, start = _side_by_side(axes, image0, image1)
    sizes = [np.shape(image)[1::-1] for image in (image0, image1)]
    for i, index in enumerate(_chosen(len(pixels0), most) if len(pixels0) else ()):
        colour = f"C{i % 10}"
        pair = pixels0[index], pixels1[index]
        if camera0 is not None and camera1 is not None:
            R, t = np.asarray(pose.R), np.asarray(pose.t)
            curves = [_curve(pair[1], R.T, -R.T @ t, camera1, camera0),
                      _curve(pair[0], R, t, camera0, camera1)]
        else:
            F = np.asarray(pose.F)
            curves = [_line(F.T @ [*pair[1], 1], *sizes[0]), _line(F @ [*pair[0], 1], *sizes[1])]
        for curve, pixel, left, (width, height) in zip(curves, pair, (0.0, start), sizes):
            inside: np.ndarray = np.all(
                (curve >= -0.5) & (curve <= np.array([width, height]) - 0.5), axis=1)
            if has_cameras:  # what lies outside is not drawn, nor joined across it
                curve = np.where(inside[:, None], curve, np.nan)
            lines = axes.plot(curve[:, 0] + left, curve[:, 1], "-", color=colour, linewidth=0.8)
            if not has_cameras:
                from matplotlib.patches import Rectangle
                lines[0].set_clip_path(Rectangle((left - 0.5, -0.5), width, height,
                                                 transform=axes.transData))
            axes.plot(pixel[0] + left, pixel[1], "o", color=colour, markersize=4,
                      markerfacecolor="none")
    return axes.figure


def cloud(points: Any, pose: Optional[TwoView] = None, *, colours: Any = None,
          share: float = 0.98, axes: Any = None) -> Any:
    """A cloud of points in three dimensions, with the two cameras where a pose is given. y points
    down and z forward, as a camera sees.

    points: a Reconstruction, an array of twoview.POINT or DENSE_POINT, or (n, 3). pose: None, or
    of estimate_two_view or reconstruct, in the unit of the points. colours: None (by depth), or
    what matplotlib takes, such as (n, 3) in [0, 1]. share: of the points whose box is shown, the
    nearest ones: some are very far. axes: matplotlib's with projection "3d", None for a new figure.
    Returns matplotlib's Figure. Raises ImportError without matplotlib, ValueError for another shape
    and where there is no point."""
    if isinstance(points, Reconstruction):
        points = points.points
    points = np.asarray(points)
    if points.dtype.names:
        if "status" in points.dtype.names:
            kept = points["status"] == PointStatus.OK
            if colours is not None and np.ndim(colours) > 0 and len(colours) == len(points):
                colours = np.asarray(colours)[kept]
            points = points[kept]
        points = points["position"]
    positions = _abi.check_array("points", points, np.float64, 3)
    if len(positions) == 0:
        raise ValueError("points: there is no point to draw")
    if not 0 < share <= 1:
        raise ValueError(f"share: {share} is not in (0, 1]")
    axes = _axes(axes, figsize=(7, 6), subplot_kw={"projection": "3d"}, layout="constrained")
    far = np.quantile(np.linalg.norm(positions - np.median(positions, axis=0), axis=1), share)
    near = np.linalg.norm(positions - np.median(positions, axis=0), axis=1) <= far
    shade = positions[near, 2] if colours is None else colours
    if colours is not None and np.ndim(colours) > 0 and len(colours) == len(positions):
        shade = np.asarray(colours)[near]
    x, y, z = positions[near].T
    axes.scatter(x, z, -y, c=shade, s=2, depthshade=False)  # z forward, y down
    if pose is not None and pose.R is not None and pose.t is not None:
        R, t = np.asarray(pose.R), np.asarray(pose.t)
        for name, centre, forward in (("camera 0", np.zeros(3), np.array([0.0, 0, 1])),
                                      ("camera 1", -R.T @ t, R[2])):
            axes.scatter(centre[0], centre[2], -centre[1], c="k", marker="^", s=25)
            axes.text(centre[0], centre[2], -centre[1], " " + name, fontsize=8)
            axes.quiver(centre[0], centre[2], -centre[1], forward[0], forward[2], -forward[1],
                        color="k", linewidth=0.8)
    axes.set_aspect("equal")
    axes.set(xlabel="x (right)", ylabel="z (forward)", zlabel="-y (up)")
    return axes.figure
