"""The filter of examples/fusion_filter.py: simulated flights without pictures, whose errors are
drawn as the filter assumes them."""

import importlib.util
import pathlib
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import twoview as tv

EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "examples"


def load(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


fusion_filter = load("fusion_filter")
# Larger than the example's, so that an error that the filter forgets is seen.
fusion_filter.UNIT_DRIFT, fusion_filter.VELOCITY_SCALE_SIGMA = 0.02, 0.03
SECONDS, STEPS, KEYFRAMES = 0.1, 8, 26  # of a step; from one keyframe to the next; of a flight
VELOCITY_SIGMA, ATTITUDE_SIGMA, WAY_SIGMA = 0.3, 0.01, 0.02  # m/s; radians; metres


def turn(w):
    """exp([w]x) of a small rotation vector."""
    angle = np.linalg.norm(w) + 1e-12
    k = fusion_filter.cross(w / angle)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


class Flight:
    """A vehicle on a curved path of some 20 metres, its filter, and the ids that it refused. At
    keyframe number change_at the map's unit becomes another one, in another segment or after a
    loop; at jump_at it is 1.5 metres off."""

    def __init__(self, seed, with_map=True, change_at=99, is_loop=False, jump_at=99):
        rng = np.random.default_rng(seed)
        self.filter = fusion_filter.Filter(ATTITUDE_SIGMA)
        self.position, self.refused, self.true_log_unit = np.zeros(3), [], np.log(0.3)
        factor = 1 + fusion_filter.VELOCITY_SCALE_SIGMA * rng.normal()
        error, start = ATTITUDE_SIGMA * rng.normal(size=3), None
        for k in range(KEYFRAMES * STEPS):
            s = 0.08 * k * SECONDS
            velocity = np.array([np.cos(s), np.sin(s), 0.3 * np.cos(9 * s)])
            self.position = self.position + velocity * SECONDS
            seen = turn(error).T @ (factor * velocity + VELOCITY_SIGMA * rng.normal(size=3))
            self.filter.predict(seen, VELOCITY_SIGMA, SECONDS)
            error = error + ATTITUDE_SIGMA * np.sqrt(SECONDS / 60) * rng.normal(size=3)
            number, rest = divmod(k, STEPS)
            if rest < STEPS - 1:
                continue
            self.filter.clone(number)
            self.true_log_unit += fusion_filter.UNIT_DRIFT * rng.normal()
            if number == change_at:
                self.true_log_unit += np.log(6)
                if is_loop:
                    self.filter.segment = None  # as the example does
            if with_map and number > 0:
                way = self.position - start + WAY_SIGMA * rng.normal(size=3)
                way[0] += 1.5 * (number == jump_at)
                unit, segment = np.exp(self.true_log_unit), int(number >= change_at and not is_loop)
                if not self.filter.fuse(number - 1, number, segment, turn(error).T @ way / unit,
                                        (WAY_SIGMA / unit) ** 2 * np.eye(3)):
                    self.refused.append(number)
            start = self.position

    def nees(self):
        position, P = self.filter.position()
        error = position - self.position
        return error @ np.linalg.solve(P, error)

    def unit_error(self):
        """In standard deviations; the factor of all velocities is in the unit, too."""
        return (self.filter.x[6] - self.true_log_unit) / np.hypot(
            np.sqrt(self.filter.P[6, 6]), fusion_filter.VELOCITY_SCALE_SIGMA)


@pytest.fixture(scope="module")
def runs():
    return [Flight(seed) for seed in range(100)]


def test_the_errors_are_as_large_as_the_covariance_says(runs):
    # 99 per cent of the mean of 300 squares of independent normal numbers.
    assert 0.80 < np.mean([run.nees() for run in runs]) / 3 < 1.22


def test_the_ways_of_the_map_make_the_path_better(runs):
    errors = [np.mean([np.linalg.norm(run.filter.x[:3] - run.position) for run in group])
              for group in (runs, [Flight(seed, with_map=False) for seed in range(30)])]
    assert errors[0] < 0.8 * errors[1]


def test_the_unit_is_found_with_its_sigma(runs):
    # 99.9 per cent of 100 squares; they are of normal numbers only as far as the filter is linear.
    assert 0.6 < np.mean([run.unit_error() ** 2 for run in runs]) < 1.5
    assert max(np.sqrt(run.filter.P[6, 6]) for run in runs) < 0.06


def test_nothing_is_refused_without_a_cause(runs):
    assert sum(len(run.refused) for run in runs) < 10  # of 2500


@pytest.mark.parametrize("is_loop", (False, True))
def test_another_unit_is_found_in_a_new_segment_and_after_a_loop(is_loop):
    runs = [Flight(seed, change_at=13, is_loop=is_loop) for seed in range(60)]
    assert sum(len(run.refused) for run in runs) < 5
    assert np.mean([run.unit_error() ** 2 for run in runs]) < 1.48  # 99 per cent of 60
    assert np.mean([run.nees() for run in runs]) / 3 < 1.27  # of 180


def test_a_pair_that_jumps_is_not_fused():
    for seed in range(10):
        run = Flight(seed, jump_at=13)
        assert 13 in run.refused and len(run.refused) <= 2
        assert run.nees() < fusion_filter.MOST_CHI2


def test_attitude_and_scale_of_the_velocities_are_in_the_covariance():
    kalman = fusion_filter.Filter(0.05)
    for _ in range(10):
        kalman.predict(np.array([2.0, 0, 0]), 0, 0.5)  # ten metres in five seconds
    position, P = kalman.position()
    np.testing.assert_allclose(position, [10, 0, 0])
    np.testing.assert_allclose(np.diag(P)[:2], [(10 * fusion_filter.VELOCITY_SCALE_SIGMA) ** 2,
                                                (10 * 0.05) ** 2], rtol=0.05)


def test_the_state_keeps_three_keyframes_and_no_way_counts_twice(runs):
    for run in runs[:3]:
        assert run.filter.ids == [23, 24, 25] and run.filter.x.shape == (16,)
        before = run.filter.P.copy()
        assert not run.filter.fuse(22, 24, 0, np.ones(3), np.eye(3))
        np.testing.assert_array_equal(run.filter.P, before)


@pytest.mark.parametrize("change, segment", (
    ({}, 0), ({"status": tv.OdometryStatus.WEAK}, 0), ({"loop_closed": True}, None),
    ({"relocated": True}, None)))
def test_only_a_frame_that_tracks_in_an_unmoved_map_fuses(change, segment):
    pytest.importorskip("imageio")
    kalman = Flight(1).filter
    way = (kalman.x[13:16] - kalman.x[10:13]) / np.exp(kalman.x[6])
    k0, k1 = (SimpleNamespace(id=24 + k, segment=0, frame=k, R=np.eye(3), t=k * way)
              for k in range(2))
    state = SimpleNamespace(**{"status": tv.OdometryStatus.TRACKING, "is_keyframe": True,
                               "loop_closed": False, "relocated": False, **change})
    vehicle = SimpleNamespace(world_from_cam=[None, np.eye(3)])
    assert load("18_fusion").fuse(kalman, vehicle, state, 26,
                                  (k0, k1, 1e-4 * np.eye(6))) == (not change)
    assert kalman.segment == segment and kalman.ids == [24, 25, 26]
