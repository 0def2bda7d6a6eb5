"""Tests of compare_colmap: solvers and triangulations on simulated matches, each with its own
convention."""

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
        from twoview_tools.compare import children, cli
        pose = {"R": self.R.tolist(), "t": self.t.tolist()}
        return children.call(system.python, {
            "call": system.kind, "system": system.id,
            "task": {"max_error_px": 1.0, "seed": 0, "reference": pose, "pose": pose,
                     "library": cli.library_path()}}, 120, json.dumps(given).encode())[0]

    def test_every_solver_finds_the_pose(self):
        from twoview_tools.accuracy import metrics
        from twoview_tools.compare import systems
        for system in systems.of_kind("solver"):
            with self.subTest(system=system.id):
                found = self.call(system, self.with_wrong)
                error = metrics.pose_error(found["R"], found["t"], self.R, self.t)
                self.assertLess(error["rotation_error_deg"], 1.0)
                self.assertLess(error["translation_error_signed_deg"], 1.0)
                self.assertGreater(found["num_inliers"], 300)

    def test_every_triangulation_finds_the_points(self):
        import numpy as np
        from twoview_tools.compare import systems
        for system in systems.of_kind("triangulation"):
            with self.subTest(system=system.id):
                found = np.array(self.call(system, self.given)["points"], float)
                np.testing.assert_allclose(found, self.points, atol=1e-4)


class TestShift(unittest.TestCase):
    """With TV_REFINE_PRINCIPAL_POINT our poses may belong to a camera with a shifted principal
    point; then lines, residuals and points belong to that camera too."""

    @classmethod
    def setUpClass(cls):
        import cv2
        import numpy as np
        random = np.random.default_rng(9)
        points = random.uniform([-2, -1.5, 4], [2, 1.5, 9], (400, 3))
        R, t = cv2.Rodrigues(np.array([0.15, 0.3, 0.4]))[0], np.array([1.2, 0.3, 0.6])
        right, lens = np.array([[500.0, 0, 325], [0, 500, 236], [0, 0, 1]]), [
            -0.1,
            0.02,
            0.001,
            -0.002,
            0.0,
        ]
        pixels = [
            cv2.projectPoints(points, cv2.Rodrigues(turn)[0], move, right, np.array(lens))[
                0
            ].reshape(-1, 2)
            + random.normal(0, 0.1, (400, 2))
            for turn, move in ((np.eye(3), np.zeros(3)), (R, t))
        ]
        told = [[[500.0, 0, 319.5], [0, 500, 239.5], [0, 0, 1]], lens]
        cls.given = {"pixels0": pixels[0].tolist(), "pixels1": pixels[1].tolist(), "ratios": None,
                     "cameras": [told, told], "sizes": [[640, 480], [640, 480]]}
        cls.task = {"max_error_px": 1.0, "seed": 0, "reference": None,
                    "options": {"calibration0.center_sigma": 0.01, "calibration0.refine": 2}}

    def answer(self):
        from twoview_tools.compare import children, cli, systems
        system = next(s for s in systems.of_kind("solver") if s.id == "twoview_five_point")
        return children.call(
            system.python,
            {
                "call": "solver",
                "system": system.id,
                "task": {**self.task, "library": cli.library_path()},
            },
            120,
            json.dumps(self.given).encode(),
        )[0]

    def test_residuals_and_lines_are_of_the_camera_that_the_pose_is_of(self):
        import numpy as np
        from twoview_tools.compare import pair_run
        answer = self.answer()
        self.assertLess(
            np.abs(np.subtract(answer["principal_point_shift_px"], (5.5, -3.5))).max(), 3
        )
        matches = pair_run._matches(self.given)
        of_pose = pair_run._of_pose(matches, answer)
        self.assertLess(
            np.median(pair_run.epipolar_error_px(of_pose, answer["R"], answer["t"])), 0.1
        )
        self.assertGreater(
            np.median(pair_run.epipolar_error_px(matches, answer["R"], answer["t"])), 0.2
        )
        row = pair_run._row(self.task, {**answer, "ms": {}}, "ok", "", matches)
        self.assertGreater(row["error_px_histogram"][0], 350)  # matches with errors below 0.25 px
        self.assertEqual(row["principal_point_shift_px"], answer["principal_point_shift_px"])

    def test_points_on_our_own_pose_are_of_that_camera(self):
        from twoview_tools.compare import cli, pair_run
        answer = {**self.given, **self.answer()}
        run = pair_run.Run({**self.task, "matches_of": "twoview", "missing": {}, "timeout_s": 120,
                            "library": cli.library_path(), "systems": []})
        rows = {}
        wanted = ("twoview_poly", "opencv_triangulate")
        whose = pair_run._triangulate(run, rows, (answer, pair_run._matches(self.given)), wanted)
        self.assertEqual((whose, set(rows)), ("twoview", set(wanted)))
        for system in wanted:
            self.assertGreater(rows[system]["num_in_front"], 390)
            self.assertLess(rows[system]["median_error_px"], 0.12)

    def test_the_parser_names_the_pipelines_that_there_are(self):
        from twoview_tools.compare import arguments, systems
        for kind, ids in (("pipeline", arguments.PIPELINES), ("solver", arguments.SOLVERS),
                          ("triangulation", arguments.TRIANGULATIONS)):
            self.assertEqual(list(ids), [s.id for s in systems.of_kind(kind)])


if __name__ == "__main__":
    unittest.main()
