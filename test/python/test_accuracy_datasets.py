"""Tests of twoview_tools.accuracy.datasets: which pairs are measured, resizing, undistortion."""

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
        self.assertEqual(datasets.default_resize(1241, 376), 0)
        self.assertEqual(datasets.default_resize(1536, 1024), 640)
        self.assertEqual(datasets.default_resize(1426, 1000), 640)

    def test_shrinks_tall_images_too(self):
        self.assertEqual(datasets.default_resize(720, 1280), 640)  # fox_wall
        self.assertEqual(datasets.default_resize(1280, 720), 640)
        self.assertEqual(datasets.default_resize(376, 1241), 0)


class TestGroups(unittest.TestCase):
    def test_the_wide_sets_are_named_and_every_other_set_is_narrow(self):
        names = ["tankard", "kitti00_turn", "middlebury_dinoSR", "middlebury_bicycle", "another"]
        self.assertEqual(datasets.by_group(names),
                         {"narrow": ["kitti00_turn", "middlebury_bicycle", "another"],
                          "wide": ["tankard", "middlebury_dinoSR"]})
        self.assertEqual(datasets.by_group(["pc_room"]), {"wide": ["pc_room"]})


class TestMeasurable(unittest.TestCase):
    line = ("a.png b.png 0 0 500 0 320 0 501 240 0 0 1 510 0 330 0 511 250 0 0 1 "
            "1 0 0 0.1 0 1 0 0.2 0 0 1 0.3 0 0 0 1")

    def read(self, line, **options):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "pairs.txt")
            with open(path, "w", encoding="utf-8") as f:
                f.write("# a comment\n" + line + "\n")
            return datasets.read_measurable(path, **options)

    def test_reads_both_cameras_and_the_motion(self):
        pair, = self.read(self.line)
        self.assertEqual((pair.name0, pair.name1), ("a.png", "b.png"))
        self.assertEqual((pair.K0[1, 1], pair.K1[1, 2]), (501.0, 250.0))
        np.testing.assert_array_equal(pair.R, np.eye(3))
        np.testing.assert_array_equal(pair.t, [0.1, 0.2, 0.3])
        self.assertEqual(pair.text, self.line)

    def test_refuses_pairs_that_cannot_be_measured(self):
        fields = self.line.split()
        for line, words in ((" ".join(fields[:2]), "no K"), (" ".join(fields[:22]), "no true pose"),
                            (self.line.replace("png 0 0", "png 0 1"), "turned images")):
            with self.assertRaisesRegex(ValueError, f"line 2: .*{words}"):
                self.read(line)
        pair, = self.read(" ".join(fields[:22]), needs_truth=False)
        self.assertIsNone(pair.R)


class TestUndistort(unittest.TestCase):
    def setUp(self):
        self.K = np.array([[520.9, 0, 325.1], [0, 521.0, 249.7], [0, 0, 1]])
        # k1 k2 p1 p2 k3 of TUM freiburg2's lens
        self.k = [0.2312, -0.7849, -0.0033, -0.0001, 0.9172]

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
        # With k1 = -0.5, x (1 - x^2 / 2) is at most 0.5443: a pixel at 0.6 has no ray.
        barrel = [-0.5, 0, 0, 0, 0]
        found = datasets.undistort([[325.1 + 520.9 * 0.6, 249.7]], self.K, barrel)
        self.assertTrue(np.isnan(found).all())


if __name__ == "__main__":
    unittest.main()
