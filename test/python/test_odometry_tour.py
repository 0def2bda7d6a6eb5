"""A simulated drone flies through a rendered room while `twoview odometry --drone` maps it: the
path and the walls agree with the room."""

import os
import subprocess
import sys
import tempfile
import unittest

from twoview_tools.odometry import runs, tour

LIBRARY = os.environ.get("TWOVIEW_LIBRARY", "")
BUILT = os.path.join(os.path.dirname(os.path.dirname(LIBRARY)), "bin", "twoview")
PROGRAM = runs.program_path(BUILT if os.access(BUILT, os.X_OK) else None)
SECONDS, FRAMES_PER_SECOND = 13, 10  # take-off, along a wall, between shelf and pillar
SKIP_CODE = 77


class Tour(unittest.TestCase):
    def test_path_and_walls_agree_with_the_room(self):
        with tempfile.TemporaryDirectory() as folder:
            done = tour.fly(PROGRAM, folder, SECONDS, FRAMES_PER_SECOND)
            self.assertIn(done.returncode, (0, 3), done.stderr)
            figures = tour.judge(folder)
        if figures["num_frames"] < SECONDS * FRAMES_PER_SECOND / 2:
            self.skipTest(f"only {figures['num_frames']} pictures came: the machine is too busy to "
                          "render a room as it is flown through")
        # The drone stands still at first, so that the map begins with its take-off.
        self.assertGreater(figures["coverage"], 0.6, figures)
        self.assertGreater(figures["path_length"], 5, figures)
        self.assertLess(figures["ate_rmse_percent_of_path"], 1, figures)
        self.assertAlmostEqual(figures["scale_ratio"], 1, delta=0.04)
        self.assertEqual(figures["silent"]["num_wrong"], 0, figures)
        self.assertGreater(figures["map"]["num_points"], 500)
        self.assertLess(figures["map"]["median_percent"], 1, figures)
        self.assertLess(figures["map"]["outlier_percent"], 4, figures)


if __name__ == "__main__":
    for words in (["odometry", "--help"], ["drone", "simulate", "--help"]):
        if not os.access(PROGRAM, os.X_OK) or subprocess.run(
                [PROGRAM, *words], capture_output=True, check=False).returncode:
            print(f"skipped: {PROGRAM} has no `{' '.join(words[:-1])}`")
            sys.exit(SKIP_CODE)
    unittest.main()
