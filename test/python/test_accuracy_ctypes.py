"""Tests of twoview_tools.accuracy.twoview_ctypes: options given as text, and a library given by its
path."""

import os
import unittest

try:
    import numpy as np
except ImportError:
    np = None

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
if np is not None:
    from twoview_tools.accuracy import datasets, estimators, pipeline, twoview_ctypes as tv


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy: run scripts/bootstrap test")


class TestOptions(unittest.TestCase):
    def test_options_may_be_text(self):
        options = tv.STRUCTS["tv_feature_options"]()
        tv.set_options(options, {"arc": "9", "scale-factor": "1.5", "orientation": "gradient"})
        self.assertEqual((options.arc, options.scale_factor, options.orientation), (9, 1.5, 1))
        with self.assertRaises(tv.TwoviewError):
            tv.set_options(options, {"arcs": 9})
        with self.assertRaises(tv.TwoviewError):
            tv.set_options(options, {"orientation": "sideways"})


class TestLibrary(unittest.TestCase):
    def test_extracts_and_matches_an_image_with_itself(self):
        if not os.path.isfile(tv.DEFAULT_LIBRARY):
            self.skipTest("build/release is not built")
        library = tv.Library()
        noise = np.random.default_rng(5).integers(0, 256, (198, 262))
        image = sum(noise[y:y + 192, x:x + 256] for y in range(7) for x in range(7)) // 49
        image = np.ascontiguousarray((image - image.min()) * 255 // np.ptp(image)).astype(np.uint8)
        context = tv.Context(library, max_width=256, max_height=192)
        keypoints, descriptors = context.extract(image)
        self.assertGreater(len(keypoints), 20)
        self.assertEqual(descriptors.shape, (len(keypoints), 128))
        links = context.match(descriptors, descriptors)
        np.testing.assert_array_equal(links["idx0"], links["idx1"])
        self.assertTrue((links["dist_sq"] == 0).all())


class TestPipeline(unittest.TestCase):
    """The stages one by one, as tuning runs them, give the poses of tv_reconstruct."""

    def test_the_poses_are_those_of_tv_reconstruct(self):
        folder = os.path.join(datasets.data_dir(), "strecha_Herz_Jesus_P8")
        if not os.path.isfile(tv.DEFAULT_LIBRARY) or not os.path.isdir(folder):
            self.skipTest("build/release is not built, or there is no data")
        data = datasets.Set(folder, max_pairs=2)
        context = pipeline.make_context(tv.Library(), data)
        poses = []
        for match, estimate in (({}, {}), ({"align_matches": "0"}, {}), ({}, {"sigma_by_size": 0}),
                                ({"align_matches": 1, "ratio": 0.8}, {"sigma_by_size": "0.5"})):
            matched = pipeline.match_pairs(context, data, None, match)
            for pair, (matches, _) in zip(data.pairs, matched):
                R, t, result, inliers = estimators.estimate(context, matches, estimate)
                views = [part for side, name in enumerate((pair.name0, pair.name1)) for part in (
                    data.gray(name)[0],
                    tv.make_camera(data.camera(pair, side)[0], *matches.sizes[side],
                                   data.camera(pair, side)[1]))]
                whole, cloud = context.reconstruct(*views, ({}, match, estimate))
                self.assertEqual(bytes(result.R), bytes(whole.R))
                self.assertEqual(bytes(result.t), bytes(whole.t))
                np.testing.assert_array_equal(inliers, cloud.inlier_mask)
                poses.append(bytes(result.R))
        self.assertEqual(len(set(poses)), len(poses))


if __name__ == "__main__":
    unittest.main()
