"""Runs the library's stages on images of any size, with one set of options."""

import numpy as np
import twoview as tv

from .errors import BadInput


class Engine:
    def __init__(self, feature=None, match=None, estimate=None, max_matches=0, rungs=(0, 0)):
        """rungs: the rung of effort to begin with, and the highest one, of `climb`."""
        self.feature, self.match_options = (
            feature or tv.FeatureOptions(),
            match or tv.MatchOptions(),
        )
        self.estimate_options = estimate or tv.EstimateOptions()
        self.max_matches, self.rungs = max_matches, rungs
        self.width = self.height = 0
        self.context = None

    def _context(self, width, height):
        if self.context is None or width > self.width or height > self.height:
            self.width, self.height = max(width, self.width), max(height, self.height)
            self.context = tv.Context(max_width=self.width, max_height=self.height,
                                      max_keypoints=max(self.feature.max_keypoints or 2048, 1),
                                      max_matches=self.max_matches, max_effort=self.rungs[1])
        return self.context

    def extract(self, luma, name, mask=None):
        try:
            return tv.extract(
                self._context(luma.shape[1], luma.shape[0]), luma, mask, options=self.feature
            )
        except tv.StatusError as error:
            raise BadInput(f"image {name}: {error}") from None

    def match(self, descriptors0, descriptors1, keypoints0=None, keypoints1=None):
        """tv.match. Without keypoints, as for descriptors of other programs, the second nearest
        neighbour is one of all others."""
        return tv.match(self._context(1, 1), descriptors0, descriptors1, self.match_options,
                        keypoints0, keypoints1)

    def estimate(self, camera0, camera1, pixels0, pixels1, ratios=None, options=None):
        """tv.estimate_two_view; `options` in place of the engine's own."""
        try:
            return tv.estimate_two_view(
                self._context(1, 1),
                camera0,
                camera1,
                pixels0,
                pixels1,
                ratios,
                options or self.estimate_options,
            )
        except tv.StatusError as error:
            raise BadInput(str(error)) from None

    def climb(self, views):
        """tv.reconstruct with the engine's rungs, of two (luma, mask, camera). Keypoints stay where
        they were found. Returns (TwoView, Reconstruction)."""
        (luma0, mask0, camera0), (luma1, mask1, camera1) = views
        width, height = (max(luma0.shape[i], luma1.shape[i]) for i in (1, 0))
        try:
            return tv.reconstruct(
                self._context(width, height), luma0, camera0, luma1, camera1, mask0=mask0,
                mask1=mask1, feature=self.feature, match=self.match_options,
                estimate=self.estimate_options, align_matches=False, effort=self.rungs[0],
                max_effort=self.rungs[1])
        except tv.StatusError as error:
            raise BadInput(str(error)) from None


def pixels_of(keypoints):
    """The positions x, y of keypoints in pixels, (n, 2) float64."""
    return np.column_stack([keypoints["x"], keypoints["y"]]).astype(np.float64)
