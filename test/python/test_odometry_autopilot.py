"""The filter that twoview_tools.odometry.autopilot lets fuse the driver's estimates: errors that
are new with each message, and errors that stay."""

import types
import unittest

import numpy as np
from twoview_tools.odometry import autopilot

TIMES = np.arange(0, 20, 0.04)
PLACES = np.stack([np.sin(0.5 * TIMES), 1 - np.cos(0.5 * TIMES), 0.1 * TIMES], axis=1)
VELOCITIES = np.gradient(PLACES, TIMES, axis=0)


def message(k, error, sigma, reset=0):
    return types.SimpleNamespace(
        position=PLACES[k] + error, velocity=VELOCITIES[k], reset=reset,
        position_covariance=sigma ** 2 * np.eye(3), velocity_covariance=0.1 ** 2 * np.eye(3))


def largest(errors, sigma, which="PX4"):
    """The largest error of an axis in the filter's standard deviations, and the mean in metres."""
    found = [(time, message(k, error, sigma), np.zeros(3)) if error is not None
             else (time, None, None) for k, (time, error) in enumerate(zip(TIMES, errors))]
    rows = autopilot.fly(found, TIMES, PLACES, which, 0)
    return rows[:, 1].max(), rows[:, 2].mean()


class Autopilot(unittest.TestCase):
    def setUp(self):
        self.random = np.random.default_rng(1)

    def test_errors_that_are_new_each_time_are_averaged(self):
        for which in autopilot.AUTOPILOTS:
            errors = 0.2 * self.random.normal(size=(len(TIMES), 3))
            sigmas, metres = largest(errors, 0.2, which)
            self.assertLess(sigmas, 4, which)
            self.assertLess(metres, 0.15, which)  # of 0.32 m a message

    def test_an_error_that_stays_leads_astray_unless_its_variance_is_sent_often_enough(self):
        drift = 0.08 * np.outer(TIMES / TIMES[-1], [1, -1, 1])
        self.assertGreater(largest(drift, 0.08)[0], 2.5)
        self.assertLess(largest(drift, 5 * 0.08)[0], 2)

    def test_a_second_without_messages_is_bridged(self):
        errors = list(0.02 * self.random.normal(size=(len(TIMES), 3)))
        errors[200:225] = 25 * [None]
        sigmas, metres = largest(errors, 0.1)
        self.assertLess(sigmas, 3)
        self.assertLess(metres, 0.1)

    def test_a_jump_is_refused_until_the_counter_tells_of_it(self):
        kalman = autopilot.Filter("PX4")
        kalman.fuse(0, message(0, 0, 0.1))
        kalman.fuse(0.04, message(0, 2, 0.1))
        self.assertLess(np.abs(kalman.x[:3] - PLACES[0]).max(), 0.1)
        kalman.fuse(0.08, message(0, 2, 0.1, reset=1))
        np.testing.assert_allclose(kalman.x[:3], PLACES[0] + 2)


if __name__ == "__main__":
    unittest.main()
