"""Tests of twoview_tools.accuracy.rolling: the rendered pairs of a rolling shutter, and what is
counted."""

import unittest

try:
    import cv2  # noqa: F401
    import numpy as np
except ImportError:
    np = None

if np is not None:
    from twoview_tools.accuracy import rolling


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy and cv2: run scripts/bootstrap test")


class TestPictures(unittest.TestCase):
    def test_only_the_middle_row_is_of_the_true_pose(self):
        still, rolled = (rolling.Pair(kind, 1, 5) for kind in ("global", "z"))
        scene = rolling.Scene(still.scene)
        a, b = (pair.picture(scene, 0).astype(int) for pair in (still, rolled))
        difference = np.abs(a - b).mean(axis=1)
        middle = rolling.HEIGHT // 2
        self.assertLess(difference[middle - 1:middle + 1].max(), 1.5)
        self.assertGreater(difference[:20].mean(), 4)
        self.assertGreater(difference[-20:].mean(), 4)

    def test_all_kinds_have_the_same_motion_and_the_ranges_hold(self):
        for number in range(50):
            pairs = [rolling.Pair(kind, number, 2) for kind in rolling.KINDS]
            for pair in pairs:
                for ours, first in zip(pair.truth(), pairs[0].truth()):
                    np.testing.assert_array_equal(ours, first)
                for turn in pair.turns:
                    rate = np.degrees(np.linalg.norm(turn))
                    self.assertTrue(20 <= rate <= 70)
                    if pair.kind in "xyz":
                        self.assertAlmostEqual(abs(np.degrees(turn["xyz".index(pair.kind)])), rate)
                shutter = pair.kind in rolling.SHUTTERS
                self.assertTrue(0.015 <= pair.readout <= 0.03 if shutter else pair.readout == 0)
            R, t = pairs[0].truth()
            np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
            self.assertTrue(0.1 <= np.linalg.norm(t) <= 0.45)


class TestCounts(unittest.TestCase):
    def test_an_error_of_three_deviations_is_beyond(self):
        row = {"rotation_error_deg": 0.29, "sigma_rotation_deg": 0.1,
               "direction_error_deg": 2.9, "sigma_direction_deg": 1.0}
        self.assertFalse(rolling.is_beyond(row))
        self.assertTrue(rolling.is_beyond({**row, "rotation_error_deg": 0.31}))
        self.assertTrue(rolling.is_beyond({**row, "direction_error_deg": 3.1}))

    def test_only_ok_pairs_are_counted(self):
        row = {"kind": "x", "verdict": "ok", "principal_point_chi2": 20.0,
               "rotation_error_deg": 9, "sigma_rotation_deg": 0.1,
               "direction_error_deg": 9, "sigma_direction_deg": 1.0}
        lines = rolling.table([row, {**row, "verdict": "doubtful"}, {**row, "kind": "y"}])
        self.assertEqual([line.split()[0:4] for line in lines.splitlines()[1:3]],
                         [["x", "2", "1", "1"], ["y", "1", "1", "1"]])


if __name__ == "__main__":
    unittest.main()
