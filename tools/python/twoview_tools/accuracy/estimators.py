"""Robust estimators behind one interface: ours, OpenCV's USAC, PoseLib's, COLMAP's and OpenGV's.

Each peer gets undistorted pixels and pinhole cameras; ours gets the original pixels and the lens.
OpenCV accepts only one K, so the pixels of the second view are mapped to the first K. USAC_MAGSAC
gets pixels because its results on normalised points are much worse.
"""

import numpy as np

from . import datasets

# The confidence that every estimator is given, and the limit of samples for each of them but
# OpenGV.
CONFIDENCE = 0.9999
MAX_ITERATIONS = 10000
# OpenGV's own default; with ten times as many it took longer than all other peers
OPENGV_MAX_ITERATIONS = 1000


class Matches:
    """The matched points of a pair, with the cameras of both views. relative_sizes: None, or for
    each view the size of each match's keypoint over that of a keypoint of level 0. sigma_factors:
    None, or the factor of each match's sigmas by tv_align_matches."""

    relative_sizes = sigma_factors = None  # of matches that an earlier version saved

    def __init__(self, pixels0, pixels1, cameras, sizes, ratios=None, relative_sizes=None,
                 sigma_factors=None):
        self.pixels0 = np.asarray(pixels0, float).reshape(-1, 2)
        self.pixels1 = np.asarray(pixels1, float).reshape(-1, 2)
        self.cameras, self.sizes = cameras, sizes  # each a pair: (K, distortion), (width, height)
        self.ratios, self.relative_sizes = ratios, relative_sizes
        self.sigma_factors = sigma_factors
        self.rays0 = datasets.undistort(self.pixels0, *cameras[0])
        self.rays1 = datasets.undistort(self.pixels1, *cameras[1])

    def __len__(self):
        return len(self.pixels0)

    def shuffled(self, seed):
        """A permutation of the matches by `seed`, without those that have no ray."""
        order = np.random.default_rng(seed).permutation(len(self))
        keep = np.isfinite(self.rays0).all(axis=1) & np.isfinite(self.rays1).all(axis=1)
        return order[keep[order]]

    def pinhole_pixels(self, order, one_K=False):
        """Undistorted pixels in the given order. one_K: both views use the first view's K."""
        (K0, _), (K1, _) = self.cameras
        K1 = K0 if one_K else K1
        return tuple(np.ascontiguousarray(rays[order] * [K[0, 0], K[1, 1]] + K[:2, 2])
                     for rays, K in ((self.rays0, K0), (self.rays1, K1)))


def _opencv(flag):
    def run(matches, order, threshold_px, seed):
        import cv2
        points0, points1 = matches.pinhole_pixels(order, one_K=True)
        K = matches.cameras[0][0]
        cv2.setRNGSeed(seed)
        E, mask = cv2.findEssentialMat(points0, points1, K, getattr(cv2, flag), CONFIDENCE,
                                       threshold_px, MAX_ITERATIONS)
        if E is None or E.shape != (3, 3):
            return None
        # 1e9 keeps all points (the default drops points beyond 50 baselines)
        _, R, t, _, _ = cv2.recoverPose(E, points0, points1, K, distanceThresh=1e9,
                                        mask=mask.copy())
        return R, t.ravel(), int(np.count_nonzero(mask))
    return run


def _poselib(matches, order, threshold_px, seed):
    import poselib
    points0, points1 = matches.pinhole_pixels(order)
    cameras = [{"model": "PINHOLE", "width": w, "height": h,
                "params": [K[0, 0], K[1, 1], K[0, 2], K[1, 2]]}
               for (K, _), (w, h) in zip(matches.cameras, matches.sizes)]
    pose, info = poselib.estimate_relative_pose(
        points0, points1, *cameras, {"max_epipolar_error": threshold_px, "seed": seed}, {})
    if info["num_inliers"] < 5:
        return None
    return np.array(pose.R), np.array(pose.t), int(info["num_inliers"])


def pycolmap_module():
    """The module pycolmap, set to log only warnings and errors."""
    import pycolmap
    pycolmap.logging.minloglevel = 1
    return pycolmap


def _pycolmap_cameras(matches):
    pycolmap = pycolmap_module()
    return [pycolmap.Camera(model="PINHOLE", width=w, height=h,
                            params=[K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5])
            for (K, _), (w, h) in zip(matches.cameras, matches.sizes)]


def _pycolmap_essential(matches, order, threshold_px, seed):
    pycolmap = pycolmap_module()
    points0, points1 = (p + 0.5 for p in matches.pinhole_pixels(order))
    options = pycolmap.RANSACOptions()
    options.max_error, options.random_seed = threshold_px, seed
    found = pycolmap.estimate_essential_matrix(points0, points1, *_pycolmap_cameras(matches),
                                               options)
    if found is None:
        return None
    pose = found["cam2_from_cam1"]
    return pose.rotation.matrix(), np.array(pose.translation), int(found["num_inliers"])


def _pycolmap_calibrated(matches, order, threshold_px, seed):
    pycolmap = pycolmap_module()
    points0, points1 = (p + 0.5 for p in matches.pinhole_pixels(order))
    options = pycolmap.TwoViewGeometryOptions()
    options.compute_relative_pose = True
    options.ransac.max_error, options.ransac.random_seed = threshold_px, seed
    camera0, camera1 = _pycolmap_cameras(matches)
    indices = np.repeat(np.arange(len(order), dtype=np.uint32)[:, None], 2, axis=1)
    geometry = pycolmap.estimate_calibrated_two_view_geometry(camera0, points0, camera1, points1,
                                                              indices, options)
    pose = geometry.cam2_from_cam1
    if pose is None:
        return None
    t = np.array(pose.translation)
    if not np.linalg.norm(t) > 0:  # t = 0: no pose was found, or a pure rotation
        return None
    return pose.rotation.matrix(), t, len(geometry.inlier_matches)


def unit_rays(rays):
    rays = np.column_stack([rays, np.ones(len(rays))])
    return np.ascontiguousarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def sampson_squared(rays0, rays1, R, t):
    """The squared Sampson distance of each match, from normalised points (n x 2) and the pose."""
    tx, ty, tz = t
    E = np.array([[0, -tz, ty], [tz, 0, -tx], [-ty, tx, 0]]) @ R
    p0, p1 = (np.column_stack([p, np.ones(len(p))]) for p in (rays0, rays1))
    line1, line0 = p0 @ E.T, p1 @ E
    norm = np.sum(line1[:, :2] ** 2, axis=1) + np.sum(line0[:, :2] ** 2, axis=1)
    return np.sum(p1 * line1, axis=1) ** 2 / np.maximum(norm, 1e-300)


def _opengv(algorithm, nonlinear):
    """OpenGV's RANSAC; with `nonlinear`, two optimisations over the inliers follow."""
    def run(matches, order, threshold_px, seed):
        import pyopengv  # seeds its sampler itself; `seed` only changes the order of the matches
        del seed
        rays0, rays1 = matches.rays0[order], matches.rays1[order]
        unit0, unit1 = unit_rays(rays0), unit_rays(rays1)
        K0, K1 = (K for K, _ in matches.cameras)
        focal = (K0[0, 0] + K0[1, 1] + K1[0, 0] + K1[1, 1]) / 4
        # The error is the sum of 1 - cos of both reprojection angles, as in OpenGV's own programs.
        threshold = 2 * (1 - np.cos(np.arctan(threshold_px / focal)))
        try:
            T = pyopengv.relative_pose_ransac(unit0, unit1, algorithm, threshold,
                                              OPENGV_MAX_ITERATIONS, CONFIDENCE)
        except RuntimeError:
            return None
        T = np.asarray(T, float)
        # T is the pose of camera 1 in camera 0; R and t are its inverse, with |t| = 1.
        for steps_left in (2, 1, 0) if nonlinear else (0,):
            if T.shape != (3, 4) or not np.isfinite(T).all() or not np.any(T[:, 3]):
                return None
            R, t = T[:, :3].T, -T[:, :3].T @ T[:, 3]
            t = t / np.linalg.norm(t)
            inliers = sampson_squared(rays0, rays1, R, t) < (threshold_px / focal) ** 2
            if steps_left == 0 or np.count_nonzero(inliers) < 6:
                return R, t, int(np.count_nonzero(inliers))
            T = np.asarray(pyopengv.relative_pose_optimize_nonlinear(
                unit0[inliers], unit1[inliers], T[:, 3].copy(), T[:, :3].copy()), float)
        return None
    return run


PEERS = {
    "magsac": ("OpenCV USAC_MAGSAC", "cv2", _opencv("USAC_MAGSAC")),
    "usac": ("OpenCV USAC_DEFAULT", "cv2", _opencv("USAC_DEFAULT")),
    "accurate": ("OpenCV USAC_ACCURATE", "cv2", _opencv("USAC_ACCURATE")),
    "poselib": ("PoseLib E", "poselib", _poselib),
    "pycolmap": ("COLMAP E", "pycolmap", _pycolmap_essential),
    "pycolmap_tvg": ("COLMAP calibrated two-view geometry", "pycolmap", _pycolmap_calibrated),
    "opengv_refined": ("OpenGV NISTER + nonlinear", "pyopengv", _opengv("NISTER", True)),
}
# All of OpenGV's algorithms, for tools/compare_colmap. The accuracy tables use only the best one,
# above.
OPENGV = {f"opengv_{algorithm.lower()}{'_nonlinear' if nonlinear else ''}":
          (f"OpenGV {algorithm}{' + nonlinear' if nonlinear else ''}", "pyopengv",
           _opengv(algorithm, nonlinear))
          for algorithm in ("NISTER", "STEWENIUS", "SEVENPT", "EIGHTPT")
          for nonlinear in (False, True)}


def module_version(module):
    """The version of a peer's module. Raises ImportError if it is not installed."""
    if module == "poselib":
        import poselib  # some versions have no __version__
        from importlib import metadata
        try:
            return metadata.version("poselib")
        except metadata.PackageNotFoundError:
            return getattr(poselib, "__version__", "unknown")
    if module == "pyopengv":  # the module has no __version__; its Debian package does
        import pyopengv
        del pyopengv
        import subprocess
        told = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", "python3-opengv"],
                              capture_output=True, text=True, check=False).stdout
        return told.split("+")[0] or "unknown"
    return __import__(module).__version__


def run_peer(kind, matches, threshold_px=1.0, seed=0):
    """(R, t, inliers) on the matches in the order given by `seed`; None for a failure."""
    order = matches.shuffled(seed)
    if len(order) < 5:
        return None
    _, module, function = {**PEERS, **OPENGV}[kind]
    if module != "cv2":
        return function(matches, order, threshold_px, seed)
    import cv2
    try:
        return function(matches, order, threshold_px, seed)
    except cv2.error:  # raised by OpenCV if too few matches remain for a model
        return None


def estimate(context, matches, options=None, seed_step=0):
    """(R or None, t or None, tv_two_view, inlier mask) of our estimator; seed_step is added to its
    seed. The option sigma_by_size is the exponent of tv_keypoint_sigmas; matches without sizes
    count alike."""
    from . import twoview_ctypes
    cameras = [twoview_ctypes.make_camera(K, *size, distortion)
               for (K, distortion), size in zip(matches.cameras, matches.sizes)]
    wanted = dict(options or {})
    exponent = context.library.take_sigma_by_size(wanted)
    sigmas = (None, None)
    if exponent and matches.relative_sizes is not None:
        sigmas = [context.keypoint_sigmas(sizes, exponent) for sizes in matches.relative_sizes]
        if matches.sigma_factors is not None:
            for of_view in sigmas:
                of_view *= matches.sigma_factors
    if seed_step:
        default = context.library.estimate_options(wanted).seed
        wanted["seed"] = default + seed_step
    result, inliers = context.estimate_two_view(*cameras, matches.pixels0, matches.pixels1,
                                                matches.ratios, wanted, sigmas)
    R = np.array(result.R).reshape(3, 3) if result.has_R else None
    t = np.array(result.t) if result.has_R and result.has_t else None
    return R, t, result, inliers


def run_twoview(context, matches, options=None, seed_step=0):
    """(R or None, t or None, inliers, tv_two_view) of estimate()."""
    R, t, result, _ = estimate(context, matches, options, seed_step)
    return R, t, result.num_inliers, result
