"""adjust_window: a small window with its truth."""

import numpy as np
import pytest
import twoview as tv
from conftest import needs

pytestmark = needs("tv_adjust_window")

CAMERA = tv.Camera(640, 480, 500, 500, 320, 240)


def make_window(noise_px=0.5, seed=1):
    random = np.random.default_rng(seed)
    truth = np.column_stack([random.uniform(-2, 3, 60), random.uniform(-2, 2, 60),
                             random.uniform(5, 9, 60)])
    views = np.zeros(4, tv.WINDOW_VIEW)
    views["R"] = np.eye(3).ravel()
    views["t"][:, 0] = -0.5 * np.arange(4)
    views["fixed"][0] = 1
    observations = np.zeros(4 * 60, tv.OBSERVATION)
    observations["idx_view"] = np.repeat(np.arange(4), 60)
    observations["idx_point"] = np.tile(np.arange(60), 4)
    x = truth[observations["idx_point"]] + views["t"][observations["idx_view"]]
    observations["pixel"] = 500 * x[:, :2] / x[:, 2:] + [320, 240]
    observations["pixel"] += noise_px * random.standard_normal((240, 2))
    start = views.copy()
    start["t"][1:] += 0.02 * random.standard_normal((3, 3))
    return truth, views, start, truth + 0.05 * random.standard_normal(truth.shape), observations


def test_a_window_is_adjusted_and_its_start_stays():
    truth, views, start, points, observations = make_window()
    distances = np.array([(0, 3, 1.5, 0.001)], tv.DISTANCE_PRIOR)
    before = start.tobytes(), points.tobytes()
    found = tv.adjust_window([CAMERA], start, points, observations, distance_priors=distances,
                             covariances=True, loss=tv.Loss.NONE)
    assert (start.tobytes(), points.tobytes()) == before
    assert found.converged and not found.scale_is_free and found.num_observations == 240
    assert found.noise_px == pytest.approx(0.5, rel=0.15)
    assert np.abs(found.views["t"] - views["t"]).max() < 0.02
    assert np.median(np.abs(found.points - truth)) < 0.02
    assert found.covariances.shape == (4, 6, 6) and not found.covariances[0].any()
    assert np.linalg.eigvalsh(found.covariances[1:]).min() > 0
    assert found.errors_px.shape == (240,) and found.errors_px.min() >= 0


def test_priors_and_wrong_arguments():
    _, views, start, points, observations = make_window()
    gravity = np.zeros(4, tv.GRAVITY_PRIOR)
    gravity["idx_view"], gravity["down"], gravity["sigma_rad"] = np.arange(4), (0, 1, 0), 0.01
    poses = np.zeros(1, tv.POSE_PRIOR)
    poses["idx_view"], poses["R"], poses["t"] = 3, views["R"][3], views["t"][3]
    poses["information"] = (1e4 * np.eye(6)).ravel()
    found = tv.adjust_window([CAMERA], start, points, observations, poses, gravity,
                             world_down=(0, 1, 0))
    assert found.converged and found.covariances is None
    assert np.abs(found.views["t"][3] - views["t"][3]).max() < 0.02
    with pytest.raises(TypeError, match="views"):
        tv.adjust_window([CAMERA], views["t"], points, observations)
    with pytest.raises(TypeError, match="loss_scal"):
        tv.adjust_window([CAMERA], start, points, observations, loss_scal=1)
    observations["idx_point"][0] = 60
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.adjust_window([CAMERA], start, points, observations)
