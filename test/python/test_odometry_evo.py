"""ATE and RPE of `twoview odometry` beside their definitions in numpy, and beside evo."""
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

SKIP_CODE = 77
FRAMES = 45
DATA = Path(os.environ.get("TWOVIEW_DATA",
                           Path(__file__).resolve().parents[3] / "shared" / "data"))
SET = DATA / "seq_tsukuba"


def program():
    path = os.environ.get("TWOVIEW_PROGRAM", "")
    if not os.path.isfile(path):
        print("skipped: TWOVIEW_PROGRAM names no program")
        sys.exit(SKIP_CODE)
    if b"odometry" not in subprocess.run([path, "--help"], capture_output=True).stdout:
        print("skipped: the program was built without TWOVIEW_ODOMETRY")
        sys.exit(SKIP_CODE)
    if not SET.is_dir():
        print(f"skipped: there is no {SET}")
        sys.exit(SKIP_CODE)
    return path


def rotation(q):
    x, y, z, w = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def matrices(rows):
    made = np.tile(np.eye(4), (len(rows), 1, 1))
    for m, row in zip(made, rows):
        m[:3, :3], m[:3, 3] = rotation(row[4:8]), row[1:4]
    return made


class Errors(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(tempfile.mkdtemp(prefix="twoview_odometry_"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        done = subprocess.run([program(), "odometry", SET, "-o", cls.folder / "out", "--quiet",
                               "--max-frames", str(FRAMES)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        cls.truth = json.loads((cls.folder / "out/result.json").read_text())["truth"]
        cls.path = np.loadtxt(cls.folder / "out/trajectory.txt")
        cls.live = np.loadtxt(cls.folder / "out/live.txt")

    def pairs(self, path):
        true = np.loadtxt(SET / "groundtruth.txt")
        nearest = [np.abs(true[:, 0] - t).argmin() for t in path[:, 0]]
        self.assertLess(np.abs(true[nearest, 0] - path[:, 0]).max(), 0.01)
        return matrices(path), matrices(true[nearest])

    def fit(self, path):
        """The scale of the least-squares similarity and its root mean square, by Horn's
        quaternions, which is another way than the program's."""
        estimate, true = self.pairs(path)
        x, y = estimate[:, :3, 3], true[:, :3, 3]
        x0, y0 = x - x.mean(0), y - y.mean(0)
        values, vectors = np.linalg.eigh(horn(x0, y0))
        w, a, b, c = vectors[:, values.argmax()]
        R = rotation((a, b, c, w))
        scale = (y0 * (x0 @ R.T)).sum() / (x0 ** 2).sum()
        return scale, np.sqrt(((scale * x0 @ R.T - y0) ** 2).sum(1).mean())

    def test_errors_are_their_definitions(self):
        scale, rms = self.fit(self.path)
        self.assertAlmostEqual(self.truth["ate_rmse"], rms, 9)
        self.assertAlmostEqual(self.truth["ate_live_rmse"], self.fit(self.live)[1], 9)
        self.assertAlmostEqual(self.truth["scale_ratio"] * scale, 1, 6)
        self.assertEqual(self.truth["num_compared"], len(self.path))
        self.assertAlmostEqual(self.truth["coverage"], len(self.path) / FRAMES, 12)
        estimate, true = self.pairs(self.path)
        length = np.linalg.norm(np.diff(true[:, :3, 3], axis=0), axis=1).sum()
        self.assertAlmostEqual(self.truth["path_length"], length, 9)
        self.assertAlmostEqual(self.truth["ate_rmse_percent_of_path"], 100 * rms / length, 6)
        estimate[:, :3, 3] *= scale
        turns, ways = [], []
        for k in range(len(estimate) - 1):
            step = np.linalg.inv(estimate[k]) @ estimate[k + 1]
            error = np.linalg.inv(np.linalg.inv(true[k]) @ true[k + 1]) @ step
            turns.append(np.degrees(np.arccos(min(1, (np.trace(error[:3, :3]) - 1) / 2))))
            ways.append(np.linalg.norm(error[:3, 3]))
        turn, way = (np.sqrt(np.mean(np.square(v))) for v in (turns, ways))
        self.assertAlmostEqual(self.truth["rpe_rotation_deg"], turn, 5)
        self.assertAlmostEqual(self.truth["rpe_translation_rmse"], way, 8)
        self.assertAlmostEqual(self.truth["rpe_translation_percent"],
                               100 * way / (length / (len(true) - 1)), 5)

    def test_errors_are_those_of_evo(self):
        if importlib.util.find_spec("evo") is None:
            self.skipTest("evo is not installed beside this Python")
        from evo.core import metrics, sync, trajectory

        def read(path):
            rows = np.loadtxt(path)
            return trajectory.PoseTrajectory3D(rows[:, 1:4], rows[:, [7, 4, 5, 6]], rows[:, 0])

        true, estimate = sync.associate_trajectories(
            read(SET / "groundtruth.txt"), read(self.folder / "out/trajectory.txt"))
        estimate.align(true, correct_scale=True)
        for key, metric in (
                ("ate_rmse", metrics.APE(metrics.PoseRelation.translation_part)),
                ("rpe_rotation_deg", metrics.RPE(metrics.PoseRelation.rotation_angle_deg, 1,
                                                 metrics.Unit.frames)),
                ("rpe_translation_rmse", metrics.RPE(metrics.PoseRelation.translation_part, 1,
                                                     metrics.Unit.frames))):
            with self.subTest(key):
                metric.process_data((true, estimate))
                self.assertAlmostEqual(self.truth[key],
                                       metric.get_statistic(metrics.StatisticsType.rmse),
                                       delta=1e-7)


def horn(x, y):
    """Horn's 4x4 matrix, whose eigenvector of the largest eigenvalue is the quaternion w x y z of
    the rotation from x to y (J. Opt. Soc. Am. A 4(4), 1987)."""
    s = x.T @ y
    d = np.array([s[1, 2] - s[2, 1], s[2, 0] - s[0, 2], s[0, 1] - s[1, 0]])
    made = np.zeros((4, 4))
    made[0, 0], made[0, 1:], made[1:, 0] = np.trace(s), d, d
    made[1:, 1:] = s + s.T - np.trace(s) * np.eye(3)
    return made


if __name__ == "__main__":
    program()
    if not SET.is_dir():
        print(f"skipped: no data in {SET}")
        sys.exit(SKIP_CODE)
    unittest.main(verbosity=2)
