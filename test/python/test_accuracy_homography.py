"""Tests of twoview_tools.accuracy.homography with synthetic homographies."""

import os
import tempfile
import unittest

try:
    import cv2
    import numpy as np
except ImportError:
    np = None

if np is not None:
    from twoview_tools.accuracy import homography, peers, twoview_ctypes

H = None if np is None else np.array([[0.9, -0.1, 12.0], [0.05, 1.1, -7.0], [2e-4, -1e-4, 1.0]])


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy or cv2: run scripts/bootstrap test")


def project(H, points):
    """By the definition, one point after another."""
    found = []
    for x, y in points:
        p = [sum(H[i][j] * v for j, v in enumerate((x, y, 1.0))) for i in range(3)]
        found.append((p[0] / p[2], p[1] / p[2]))
    return np.array(found)


class TestTransferErrors(unittest.TestCase):
    def setUp(self):
        self.points = np.random.default_rng(3).uniform(0, 300, (40, 2))

    def test_are_the_distances_in_image_1(self):
        away = np.random.default_rng(4).uniform(-6, 6, (40, 2))
        errors = homography.transfer_errors(H, self.points, project(H, self.points) + away)
        np.testing.assert_allclose(errors, np.hypot(*away.T), atol=1e-9)

    def test_do_not_depend_on_the_scale_or_sign_of_H(self):
        targets = project(H, self.points) + 2.0
        np.testing.assert_allclose(homography.transfer_errors(-3 * H, self.points, targets),
                                   homography.transfer_errors(H, self.points, targets))

    def test_a_point_behind_is_infinitely_wrong(self):
        behind = np.array([[0.0, 2e4]])  # w = 1 - 1e-4 * 2e4 = -1
        points = np.concatenate([self.points, behind])
        errors = homography.transfer_errors(H, points, project(H, points))
        self.assertTrue((errors[:-1] < 1e-9).all())
        self.assertEqual(errors[-1], np.inf)

    def test_counts_what_is_below_each_limit(self):
        found = homography.measure(np.array([0.2, 0.99, 1.0, 2.9, 3.1, 4.9, 5.0, np.inf]))
        self.assertEqual(found, {"accuracy": [2 / 8, 4 / 8, 6 / 8], "correct": 4, "matches": 8})
        nothing = homography.measure(homography.transfer_errors(H, np.zeros((0, 2)),
                                                                np.zeros((0, 2))))
        self.assertEqual(nothing, {"accuracy": [0, 0, 0], "correct": 0, "matches": 0})


class TestResize(unittest.TestCase):
    def test_H_follows_the_pixel_centres_of_both_images(self):
        points = np.random.default_rng(5).uniform(0, 300, (20, 2))
        scales = (0.5, 0.25), (0.4, 0.8)
        small0, small1 = ((p + 0.5) * s - 0.5 for p, s in zip((points, project(H, points)), scales))
        scaled = homography.scale_homography(H, *scales)
        np.testing.assert_allclose(project(scaled, small0), small1, atol=1e-9)

    def test_both_images_of_a_large_pair_shrink_by_one_factor(self):
        with tempfile.TemporaryDirectory() as folder:
            for name, size in (("a.png", (400, 1280)), ("b.png", (300, 600))):
                cv2.imwrite(os.path.join(folder, name), np.zeros(size, np.uint8))
            path = os.path.join(folder, "pairs_h.txt")
            with open(path, "w", encoding="utf-8") as f:
                f.write("# a comment\na.png b.png 1 0 20 0 1 10 0 0 1\n")
            (pair,) = homography.read_pairs(path)
            gray0, gray1, found = homography.load(folder, pair)
            self.assertEqual((gray0.shape, gray1.shape), ((200, 640), (150, 300)))
            np.testing.assert_allclose(found, [[1, 0, 10], [0, 1, 5], [0, 0, 1]], atol=1e-9)
            cv2.imwrite(os.path.join(folder, "a.png"), np.zeros((400, 1241), np.uint8))
            self.assertEqual(homography.load(folder, pair)[0].shape, (400, 1241))


class TestSystems(unittest.TestCase):
    def test_ours_and_opencvs_matches_follow_the_true_homography(self):
        noise = np.random.default_rng(6).uniform(0, 255, (240, 320)).astype(np.float32)
        gray0 = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 2.0), None, 0, 255,
                              cv2.NORM_MINMAX).astype(np.uint8)
        gray1 = cv2.warpPerspective(gray0, H, (320, 240), flags=cv2.INTER_LINEAR)
        systems = {"opencv": homography.opencv_matches(gray0, gray1, 0.02, [0.8], peers.CAP)[0.8]}
        if os.path.isfile(twoview_ctypes.DEFAULT_LIBRARY):
            systems["ours"] = homography.our_matches(twoview_ctypes.Library(), gray0, gray1, {}, {})
        for name, pixels in systems.items():
            found = homography.measure(homography.transfer_errors(H, *pixels))
            self.assertGreater(found["accuracy"][1], 0.9, name)
            self.assertGreater(found["correct"], 100, name)

    def test_the_kinds_stand_apart_and_one_lower_figure_is_not_reached(self):
        self.assertEqual(homography.kind_of("homogr_boat/A.png"), "zoom and rotation")
        self.assertEqual(homography.kind_of("churchill/1.png"), "viewpoint")
        ours = {"accuracy": [0.5, 0.6, 0.7], "correct": 100.0, "matches": 150.0}
        lower = {**ours, "correct": 99.0}
        higher = {**ours, "accuracy": [0.5, 0.61, 0.7]}
        judged = homography.judge({"viewpoint": {"ours": ours, "a": lower, "b": higher}})
        self.assertEqual([reached for reached, _ in judged], [True, False])


if __name__ == "__main__":
    unittest.main()
