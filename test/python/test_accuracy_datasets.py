"""twoview_tools.accuracy.datasets: formats, camera choice, resize, undistortion."""

import os
import tempfile
import unittest

try:
    import numpy as np
except ImportError:
    np = None

if np is not None:
    from twoview_tools.accuracy import datasets


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy: run scripts/bootstrap test")


def make_K(fx, cx):
    return np.array([[fx, 0, cx], [0, fx, 100.0], [0, 0, 1]])


class TestResize(unittest.TestCase):
    def test_keeps_pixel_centres_where_they_are(self):
        # Halving: the centre between pixels 0 and 1 of a row is the new pixel 0.
        K = datasets.scale_K(np.array([[500.0, 0, 0.5], [0, 400, 239.5], [0, 0, 1]]), 0.5, 0.5)
        self.assertAlmostEqual(K[0, 0], 250.0)
        self.assertAlmostEqual(K[1, 1], 200.0)
        self.assertAlmostEqual(K[0, 2], 0.0)
        self.assertAlmostEqual(K[1, 2], 119.5)
        self.assertEqual(K[2, 2], 1.0)

    def test_follows_each_axis(self):
        K = datasets.scale_K(np.array([[500.0, 0, 99.5], [0, 500, 99.5], [0, 0, 1]]), 0.5, 0.25)
        np.testing.assert_allclose(K, [[250.0, 0, 49.5], [0, 125, 24.5], [0, 0, 1]])

    def test_never_scales_up(self):
        self.assertEqual(datasets.resized_shape(320, 240, 640), (320, 240))
        self.assertEqual(datasets.resized_shape(1536, 1024, 640), (640, 427))
        self.assertEqual(datasets.resized_shape(1024, 1536, 640), (427, 640))
        self.assertEqual(datasets.resized_shape(1536, 1024, 0), (1536, 1024))

    def test_leaves_kitti_alone_and_shrinks_strecha_and_bicycle(self):
        self.assertEqual(datasets.default_resize(1241), 0)
        self.assertEqual(datasets.default_resize(1536), 640)
        self.assertEqual(datasets.default_resize(1426), 640)


class TestCameraChoice(unittest.TestCase):
    cameras = {"left": {"fx": 500.0, "cx": 320.0}, "right": {"fx": 510.0, "cx": 330.0}}

    def test_one_entry_serves_every_image(self):
        entry = {"fx": 1.0, "cx": 2.0}
        self.assertIs(datasets.choose_camera({"rgb": entry}, "right_1.png", make_K(510.0, 330.0)),
                      entry)

    def test_the_file_name_comes_before_K(self):
        self.assertIs(datasets.choose_camera(self.cameras, "left01.jpg", make_K(510.0, 330.0)),
                      self.cameras["left"])

    def test_K_decides_where_no_name_fits(self):
        self.assertIs(datasets.choose_camera(self.cameras, "im1.png", make_K(510.0, 330.0)),
                      self.cameras["right"])

    def test_the_longest_name_wins(self):
        cameras = {"cam1": {"fx": 1.0}, "cam10": {"fx": 2.0}}
        self.assertIs(datasets.choose_camera(cameras, "cam10_5.png", make_K(9, 9)),
                      cameras["cam10"])

    def test_no_entry_is_an_error_and_no_file_is_none(self):
        with self.assertRaises(ValueError):
            datasets.choose_camera(self.cameras, "im1.png", make_K(512.0, 330.0))
        self.assertIsNone(datasets.choose_camera({}, "im1.png", make_K(512.0, 330.0)))


class TestPairs(unittest.TestCase):
    line = ("a.png b.png 0 0 500 0 320 0 501 240 0 0 1 510 0 330 0 511 250 0 0 1 "
            "1 0 0 0.1 0 1 0 0.2 0 0 1 0.3 0 0 0 1")

    def test_reads_both_cameras_and_the_motion(self):
        pair = datasets.Pair(self.line)
        self.assertEqual((pair.name0, pair.name1), ("a.png", "b.png"))
        self.assertEqual((pair.K0[1, 1], pair.K1[1, 2]), (501.0, 250.0))
        np.testing.assert_array_equal(pair.R, np.eye(3))
        np.testing.assert_array_equal(pair.t, [0.1, 0.2, 0.3])

    def test_skips_blank_lines_and_comments(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "pairs.txt")
            with open(path, "w", encoding="utf-8") as f:
                f.write(f"# a comment\n\n{self.line}\n   \n{self.line}\n")
            self.assertEqual(len(datasets.read_pairs(path)), 2)

    def test_refuses_a_short_line_and_turned_images(self):
        with self.assertRaises(ValueError):
            datasets.Pair(self.line.rsplit(" ", 1)[0])
        with self.assertRaises(ValueError):
            datasets.Pair(self.line.replace("png 0 0", "png 0 1"))


class TestUndistort(unittest.TestCase):
    def setUp(self):
        self.K = np.array([[520.9, 0, 325.1], [0, 521.0, 249.7], [0, 0, 1]])
        self.k = [0.2312, -0.7849, -0.0033, -0.0001, 0.9172]  # TUM freiburg2

    def test_inverts_the_lens(self):
        random = np.random.default_rng(3)
        points = random.uniform([-0.55, -0.42], [0.55, 0.42], (200, 2))
        k1, k2, p1, p2, k3 = self.k
        x, y = points.T
        s = x * x + y * y
        radial = 1 + k1 * s + k2 * s**2 + k3 * s**3
        distorted = np.column_stack([x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x),
                                     y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y])
        pixels = distorted * [520.9, 521.0] + [325.1, 249.7]
        np.testing.assert_allclose(datasets.undistort(pixels, self.K, self.k), points, atol=1e-8)

    def test_without_a_lens_is_K_alone(self):
        np.testing.assert_allclose(datasets.undistort([[325.1, 770.7]], self.K, [0.0] * 5),
                                   [[0.0, 1.0]])

    def test_marks_a_pixel_that_no_ray_meets(self):
        barrel = [-0.5, 0, 0, 0, 0]  # x (1 - x^2 / 2) is never above 0.5443
        found = datasets.undistort([[325.1 + 520.9 * 0.6, 249.7]], self.K, barrel)
        self.assertTrue(np.isnan(found).all())


if __name__ == "__main__":
    unittest.main()
