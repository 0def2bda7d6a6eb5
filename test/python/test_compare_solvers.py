"""tools/compare_colmap: solvers and triangulations on simulated matches, each in its convention."""

import json
import unittest

import compare_support as support


def setUpModule():
    support.skip_without(*support.PEERS)


class TestConventions(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        import cv2
        import numpy as np
        random = np.random.default_rng(8)
        points = random.uniform([-2, -1.5, 3], [2, 1.5, 7], (400, 3))
        cls.R = cv2.Rodrigues(np.array([0.1, -0.3, 0.05]))[0]
        cls.t = np.array([0.8, -0.1, 0.3]) / np.linalg.norm([0.8, -0.1, 0.3])
        cls.points = points
        cameras = [[[[500.0, 0, 330], [0, 505, 240], [0, 0, 1]], [-0.1, 0.02, 0.001, -0.002, 0.0]],
                   [[[450.0, 0, 300], [0, 452, 250], [0, 0, 1]], [-0.2, 0.05, 0.0, 0.001, 0.0]]]
        pixels = [cv2.projectPoints(points, cv2.Rodrigues(R)[0], t, np.array(K), np.array(d))[0]
                  .reshape(-1, 2) for R, t, (K, d) in
                  ((np.eye(3), np.zeros(3), cameras[0]), (cls.R, cls.t, cameras[1]))]
        cls.given = {"pixels0": pixels[0].tolist(), "pixels1": pixels[1].tolist(), "ratios": None,
                     "cameras": cameras, "sizes": [[640, 480], [640, 480]]}
        pixels[1][::10] = random.uniform([0, 0], [640, 480], (40, 2))
        cls.with_wrong = {**cls.given, "pixels1": pixels[1].tolist()}

    def call(self, system, given):
        import children
        import program
        pose = {"R": self.R.tolist(), "t": self.t.tolist()}
        return children.call(system.python, {
            "call": system.kind, "system": system.id,
            "task": {"max_error_px": 1.0, "seed": 0, "reference": pose, "pose": pose,
                     "library": program.library_path()}}, 120, json.dumps(given).encode())[0]

    def test_every_solver_finds_the_pose(self):
        import metrics
        import systems
        for system in systems.of_kind("solver"):
            with self.subTest(system=system.id):
                found = self.call(system, self.with_wrong)
                error = metrics.pose_error(found["R"], found["t"], self.R, self.t)
                self.assertLess(error["rotation_error_deg"], 1.0)
                self.assertLess(error["translation_error_signed_deg"], 1.0)
                self.assertGreater(found["num_inliers"], 300)

    def test_every_triangulation_finds_the_points(self):
        import numpy as np
        import systems
        for system in systems.of_kind("triangulation"):
            with self.subTest(system=system.id):
                found = np.array(self.call(system, self.given)["points"], float)
                np.testing.assert_allclose(found, self.points, atol=1e-4)


if __name__ == "__main__":
    unittest.main()
