"""The filter that twoview_tools.odometry.autopilot lets fuse the driver's estimates: errors that
are new with each message, and errors that stay."""

import os
import tempfile
import types
import unittest

import numpy as np
import twoview as tv
from twoview import _abi
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
    rows = np.array(autopilot.fly(found, TIMES, PLACES, which, 0))
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

    def test_a_run_is_a_row_and_a_line_of_the_table(self):
        rows = [(0, 1.0, 0.1, 0.0), (1, 3.5, 0.2, 0.5), (2, 9.0, 0.9, 1.5), (3, 3.1, 0.1, 0.0),
                (4, 2.0, 0.1, 0.0)]
        row = {"flight": "f", "fault": "off", "autopilot": "PX4",
               **autopilot.result(rows, [[0.5, 1.5]])}
        self.assertEqual("f off PX4 5 4 2 3.50 0.200 1.50 2.50".split(),
                         autopilot.line(row).split())
        self.assertIn("off PX4 1 1 3.50 0.200 0 of 1".split(),
                      [text.split() for text in autopilot.summary([row])])
        empty = autopilot.result([], [])
        self.assertIn("no message", autopilot.line({**row, **empty, "fed": 0}))

    def test_flights_are_counted_inside_the_band_of_one_draw(self):
        rows = [{"memory_s": None, "nees": [value, 1.0]} for value in (0.01, 0.1, 1.0, 4.0)]
        position = autopilot.nees_lines(rows)[1].split()
        self.assertEqual((position[0], position[-3:]), ("position", ["1", "2", "1"]))

    def test_what_was_kept_is_not_tracked_again(self):
        with tempfile.TemporaryDirectory() as folder:
            np.savez(os.path.join(folder, "name.npz"), time=TIMES)
            said = autopilot.kept(folder, "name", lambda: self.fail("the set was made again"))
        np.testing.assert_array_equal(said["time"], TIMES)

    def test_the_driver_reads_the_structs_that_are_written_here(self):
        path = os.path.join(os.path.dirname(os.environ["TWOVIEW_LIBRARY"]),
                            "libtwoview_mavlink.so")
        if not os.path.exists(path):
            self.skipTest("the library was built without the MAVLink driver")
        estimator = autopilot.Estimator(path, np.eye(3)[[2, 0, 1]], 0)
        state = tv.Library(os.environ["TWOVIEW_LIBRARY"]).make(_abi.tv_odometry_state)
        state.status, state.has_pose, state.has_covariance, state.scale_source = 1, 1, 1, 3
        state.world_from_cam_R[:] = (0, 0, 1, 1, 0, 0, 0, 1, 0)
        for k in range(6):
            state.cam_from_world_covariance[7 * k] = 1e-4
        estimator.update(state, 1.0, None, True)
        state.world_from_cam_t[0] = 0.5
        found = autopilot.Message(estimator.update(state, 1.5, None, True))
        np.testing.assert_allclose(found.position, (0.5, 0, 0), atol=1e-12)
        np.testing.assert_allclose(found.velocity, (1, 0, 0), atol=1e-12)
        drift = (0.005 * 0.5) ** 2 * np.ones(3)
        drift[1:] += (0.008 * 0.5) ** 2  # by the turn about the origin
        # Two messages in the filter's second.
        np.testing.assert_allclose(np.diag(found.position_covariance), 1e-4 + 2 * drift)

    def test_a_jump_is_refused_until_the_counter_tells_of_it(self):
        kalman = autopilot.Filter("PX4")
        kalman.fuse(0, message(0, 0, 0.1))
        kalman.fuse(0.04, message(0, 2, 0.1))
        self.assertLess(np.abs(kalman.x[:3] - PLACES[0]).max(), 0.1)
        kalman.fuse(0.08, message(0, 2, 0.1, reset=1))
        np.testing.assert_allclose(kalman.x[:3], PLACES[0] + 2)


if __name__ == "__main__":
    unittest.main()
