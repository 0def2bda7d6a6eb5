"""FAST-12's pixels equal scikit-image's corner_fast(n=12): before suppression, at several
thresholds.

The library always suppresses non-maxima, so the unsuppressed set is computed pixel by pixel: each
pixel's 7x7 neighbourhood is an image in which that pixel is the only candidate. This is slow, so it
is done for the pixels that may be corners to either library and for a sample of the others.
Besides, the library's suppressed corners of the whole image must be a subset of scikit-image's.
"""

import os
import unittest

try:
    import numpy as np
    from skimage.feature import corner_fast
    from skimage.io import imread
except ImportError as missing:
    raise unittest.SkipTest(f"{missing}: run scripts/bootstrap test")

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
from twoview_tools.accuracy import twoview_ctypes as tv

LEFT = os.path.join(ROOT, ".cache", "motorcycle", "motorcycle_left.png")
SIDE = 260
# The library of the same build as the program that ctest names; else the default build's.
PROGRAM = os.environ.get("TWOVIEW_PROGRAM")
LIBRARY = (os.path.join(os.path.dirname(os.path.dirname(PROGRAM)), "lib", "libtwoview.so")
           if PROGRAM else tv.DEFAULT_LIBRARY)


def reference_set(gray, threshold):
    """The pixels where scikit-image finds a corner. It compares floats; half a grey level is added
    to the threshold, since the differences are integers."""
    image = gray.astype(np.float64)
    return corner_fast(image, n=12, threshold=threshold + 0.5 - 1e-9) > 0


class TestFast12(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        if not os.path.exists(LIBRARY):
            raise unittest.SkipTest(f"no {LIBRARY}: build it first")
        cls.library = tv.Library(LIBRARY)
        cls.whole = tv.Context(cls.library, max_width=SIDE, max_height=SIDE, max_keypoints=20000)
        cls.piece = tv.Context(cls.library, max_width=7, max_height=7, max_keypoints=1)

    def is_corner(self, gray, x, y, options):
        piece = np.ascontiguousarray(gray[y - 3:y + 4, x - 3:x + 4])
        return len(self.piece.extract(piece, dict(options, max_keypoints=1))[0]) == 1

    def check(self, gray):
        rng = np.random.default_rng(7)
        for threshold in (5, 10, 20, 60):
            options = {"arc": 12, "threshold": threshold, "min_threshold": 0, "levels": 1,
                       "cell_px": 0, "subpixel": 0, "orientation": "upright",
                       "max_keypoints": 20000}
            reference = reference_set(gray, threshold)
            reference[:3] = reference[-3:] = False
            reference[:, :3] = reference[:, -3:] = False
            self.assertGreater(reference.sum(), 0)
            found, _ = self.whole.extract(gray, options)
            for point in found:
                self.assertTrue(reference[int(point["y"]), int(point["x"])])
            asked = reference.copy()
            asked[3:-3, 3:-3] |= rng.random((gray.shape[0] - 6, gray.shape[1] - 6)) < 0.05
            for y, x in np.argwhere(asked):
                self.assertEqual(self.is_corner(gray, x, y, options), reference[y, x], (x, y))

    def test_noise(self):
        noise = np.random.default_rng(8).integers(0, 256, (90, 110))
        self.check(np.where(noise < 40, 255, noise // 3).astype(np.uint8))

    def test_real_image(self):
        if not os.path.exists(LEFT):
            self.skipTest(f"no {LEFT}: run scripts/bootstrap test")
        gray = imread(LEFT).astype(np.float64) @ (0.299, 0.587, 0.114)
        self.check(
            np.ascontiguousarray(np.rint(gray).astype(np.uint8)[150 : 150 + SIDE, 200 : 200 + SIDE])
        )


if __name__ == "__main__":
    unittest.main()
