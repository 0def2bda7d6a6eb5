"""Reconstructs two images with `tv_reconstruct` and makes a COLMAP text model and a trajectory."""

import numpy as np
import twoview as tv

from .cameras import resized
from .engine import pixels_of
from .errors import BadInput
from .images import read_luma, read_rgb, shrunk
from .masks import Masks, shrunk_mask
from .model import TwoViewModel


def reconstruct(paths, names, cameras, feature=None, match=None, estimate=None, resize=0,
                mask=""):
    """(TwoView, TwoViewModel); the model is None without a full pose. Images and cameras are scaled
    down so that the longer side is `resize`, where it is above 0. mask: a file for both images, or
    a folder of masks; empty: none. The model's cameras are those that pose and points refer to: the
    given ones with the estimated shift of the principal point (twoview.corrected_camera)."""
    lumas = [read_luma(path) for path in paths]
    for path, luma, camera in zip(paths, lumas, cameras):
        if (camera.height, camera.width) != luma.shape:
            raise BadInput(
                f"image {path} is {luma.shape[1]}x{luma.shape[0]}, but its camera is for "
                f"{camera.width}x{camera.height}"
            )
    masks = Masks(mask)
    used = [shrunk_mask(masks.of(name, luma), resize) for name, luma in zip(names, lumas)]
    lumas = [shrunk(luma, resize) for luma in lumas]
    cameras = [resized(camera, luma.shape[1], luma.shape[0])
               for camera, luma in zip(cameras, lumas)] if resize else cameras
    feature = feature or tv.FeatureOptions()
    try:
        with tv.Context(
            max_width=max(luma.shape[1] for luma in lumas),
            max_height=max(luma.shape[0] for luma in lumas),
            max_keypoints=feature.max_keypoints or 2048,
        ) as context:
            pose, cloud = tv.reconstruct(
                context,
                lumas[0],
                cameras[0],
                lumas[1],
                cameras[1],
                mask0=used[0],
                mask1=used[1],
                feature=feature,
                match=match,
                estimate=estimate,
            )
    except tv.StatusError as error:
        raise BadInput(f"cannot reconstruct {paths[0]} and {paths[1]}: {error}") from None
    if pose.R is None or pose.t is None:
        return pose, None
    good = cloud.inlier_mask & (cloud.points["status"] == tv.PointStatus.OK)
    pixels = tuple(pixels_of(cloud.keypoints[i])[cloud.matches[f"idx{i}"][good]] for i in range(2))
    rgb = shrunk(read_rgb(paths[0]), resize)
    x, y = np.floor(pixels[0].T + 0.5).astype(int)  # the pixel that contains the keypoint
    colours = rgb[np.clip(y, 0, rgb.shape[0] - 1), np.clip(x, 0, rgb.shape[1] - 1)]
    points = cloud.points[good]
    cameras = tuple(tv.corrected_camera(pose, camera) for camera in cameras)
    return pose, TwoViewModel(
        tuple(names),
        cameras,
        pose.R,
        pose.t,
        pixels,
        points["position"].astype(np.float64),
        colours,
        points["error_px"].astype(np.float64),
    )
