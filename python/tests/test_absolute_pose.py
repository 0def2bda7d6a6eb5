"""Checks estimate_absolute_pose on points with known truth, and against OpenCV's."""

import numpy as np
import pytest
import twoview as tv
from conftest import needs

pytestmark = needs("tv_estimate_absolute_pose")


def matches_of(scene, wrong=0):
    """The scene's second view: pixels of points, the first `wrong` of them anywhere."""
    random = np.random.default_rng(2)
    pixels = scene.pixels1 + 0.3 * random.normal(size=scene.pixels1.shape)
    pixels[:wrong] = random.uniform((0, 0), (320, 240), (wrong, 2))
    return pixels


def test_the_pose_is_found(context, scene):
    pose, inliers = tv.estimate_absolute_pose(context, scene.camera, matches_of(scene, 80),
                                              scene.points)
    assert pose.verdict == tv.Verdict.OK and pose.reasons == tv.Reason(0)
    assert inliers.dtype == bool and inliers[80:].all() and inliers[:80].sum() < 5
    assert np.abs(pose.R - scene.R).max() < 5e-3 and np.abs(pose.t - scene.t).max() < 3e-2
    assert pose.covariance.shape == (6, 6) and (np.linalg.eigvalsh(pose.covariance) > 0).all()
    assert pose.num_matches == 200 and pose.num_inliers == inliers.sum()
    assert 0.2 < pose.noise_px < 0.4 and pose.alternative_R is None


def test_options_and_values_of_matches_reach_the_library(context, scene):
    pixels = matches_of(scene, 60)
    pose, _ = tv.estimate_absolute_pose(
        context, scene.camera, pixels, scene.points,
        options=tv.AbsolutePoseOptions(max_error_px=2, seed=7, fixed_iterations=33))
    assert pose.seed == 7 and pose.num_iterations == 33
    sigmas = np.full(200, 2, np.float32)
    scaled, _ = tv.estimate_absolute_pose(context, scene.camera, pixels, scene.points,
                                          sigmas=sigmas, ratios=sigmas, max_error_px=2)
    assert abs(scaled.noise_px - pose.noise_px / 2) < 0.03
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.estimate_absolute_pose(context, scene.camera, pixels, scene.points, sigmas=0 * sigmas)
    with pytest.raises(ValueError, match="199 points"):
        tv.estimate_absolute_pose(context, scene.camera, pixels, scene.points[1:])
    with pytest.raises(TypeError, match="float64"):
        tv.estimate_absolute_pose(context, scene.camera, pixels.astype(complex), scene.points)
    with pytest.raises(TypeError, match="no option 'gravity'|unexpected"):
        tv.estimate_absolute_pose(context, scene.camera, pixels, scene.points, gravity=(0, 0, 1))


def test_no_pose_is_none(context, scene):
    random = np.random.default_rng(4)
    pose, inliers = tv.estimate_absolute_pose(context, scene.camera,
                                              random.uniform(0, 240, (200, 2)), scene.points)
    assert pose.verdict == tv.Verdict.REFUSED and pose.R is None and pose.covariance is None
    assert pose.reasons == tv.Reason.LOW_INLIER_RATIO and not inliers.any()


def test_a_lens_is_that_of_opencv(context, scene):
    cv2 = pytest.importorskip("cv2")
    k = (-0.3, 0.1, 0.001, -0.002, 0.02)
    camera = tv.Camera(320, 240, 300.0, 300.0, 159.5, 119.5, tv.CameraModel.BROWN_CONRADY, k)
    pixels, inside = tv.camera_project_points(
        camera, np.ascontiguousarray(scene.points @ scene.R.T + scene.t))
    pixels, points = pixels[inside], np.ascontiguousarray(scene.points[inside])
    pixels += 0.5 * np.random.default_rng(1).normal(size=pixels.shape)
    pose, _ = tv.estimate_absolute_pose(context, camera, pixels, points)
    found, vector, t = cv2.solvePnP(points, pixels, camera.K, np.array(k))
    rotation = cv2.Rodrigues(vector)[0]
    assert found
    # Both are minima of the same errors; only the weights of the largest differ.
    deviations = np.sqrt(np.diag(pose.covariance))
    assert np.abs(pose.R - rotation).max() < deviations[:3].max()
    assert np.abs(pose.t - t[:, 0]).max() < deviations[3:].max()
