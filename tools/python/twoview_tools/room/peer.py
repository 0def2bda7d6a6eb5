"""The peer of scripts/room --peers: PatchMatch multi-view stereo on the CPU, ppg_core of
pyarchinit-photogrammetry-core (scripts/requirements-room.txt), with the same keyframes, partners,
poses and pictures as ours, for the same fusion."""

import cv2
import numpy as np
import twoview as tv

from . import model

RELATIVE_SIGMA = 0.01  # of a distance: the peer gives none, and a room's maps without one have this


def rays_of(camera):
    """Directions with z = 1 of the pixels of a pinhole, (height, width, 3)."""
    x, y = np.meshgrid((np.arange(camera.width) - camera.cx) / camera.fx,
                       (np.arange(camera.height) - camera.cy) / camera.fy)
    return np.stack([x, y, np.ones_like(x)], -1)


def depth_like(made):
    """A depth_of for model.make, on the pinholes that the maps of the Model `made` have."""
    from ppg_core import patchmatch_depth  # only the peer needs it
    cameras = {index: pose[0] for index, pose, _ in made.keyframes}

    def depth_of(flight, index, pictures):
        if index not in cameras:
            return None
        camera = cameras[index]
        near, middle, far = flight.depth_range(index)
        rays = rays_of(camera)
        pixels, inside = tv.camera_project_points(flight.camera, rays.reshape(-1, 3))
        at = np.where((inside != 0)[:, None], pixels, -1).astype(np.float32)
        at = at.reshape(camera.height, camera.width, 2)

        def seen(i):
            return cv2.remap(pictures(i), at[..., 0], at[..., 1], cv2.INTER_LINEAR)

        lens = (camera.fx, camera.fy, camera.cx, camera.cy)
        R, centre = flight.R[index], flight.centres[index]
        sources = [(seen(i).astype(np.float32) / 255, lens, flight.R[i].T @ R,
                    flight.R[i].T @ (centre - flight.centres[i]))
                   for i in model.choose_partners(flight, index, middle)]
        grey = seen(index)
        depth, _, _ = patchmatch_depth(grey.astype(np.float32) / 255, lens, sources, (near, far))
        distance = (depth * np.linalg.norm(rays, axis=2)).astype(np.float32)
        witnesses = np.where(distance > 0, model.LEAST_WITNESSES, 0).astype(np.uint8)
        return tv.DepthMap(camera, distance, RELATIVE_SIGMA * distance, witnesses, grey)

    return depth_of
