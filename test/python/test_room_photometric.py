"""A left-out frame rendered from a mesh: a coloured wall is shown where it is and as bright as it
is, from its free side only, and the difference does not count the exposure."""

import unittest

import numpy as np
import twoview as tv

from twoview_tools.room import photometric

CAMERA = tv.Camera(80, 60, 60.0, 60.0, 39.5, 29.5)


def wall(depth=2.0, half=1.0, step=8):
    """A square across the optical axis, brighter to the right; its free side is towards the eye."""
    at = np.linspace(-half, half, step + 1)
    vertices = np.zeros((step + 1) ** 2, [(name, "<f4") for name in "xyz"] + [
        (name, "u1") for name in ("red", "green", "blue", "inferred")])
    vertices["x"], vertices["y"] = (a.ravel() for a in np.meshgrid(at, at))
    vertices["z"] = depth
    for name in ("red", "green", "blue"):
        vertices[name] = np.round(100 + 80 * vertices["x"] / half)
    first = (np.arange(step)[:, None] * (step + 1) + np.arange(step)).ravel()
    triangles = np.concatenate([np.stack(c, 1) for c in (
        (first, first + step + 1, first + 1), (first + 1, first + step + 1, first + step + 2))])
    return vertices, triangles


class TestPhotometric(unittest.TestCase):
    def test_a_wall_is_shown_where_it_is_and_as_bright_as_it_is(self):
        renderer = photometric.Renderer(*wall(), CAMERA, 2.0)
        grey, inferred = renderer.render(np.eye(3), np.array([0.25, 0, 0]))
        column, row = np.meshgrid(np.arange(80), np.arange(60))
        x = (column - CAMERA.cx) / CAMERA.fx * 2 + 0.25
        y = (row - CAMERA.cy) / CAMERA.fy * 2
        inside = (abs(x) < 0.95) & (abs(y) < 0.95)
        self.assertGreater(np.isfinite(grey[inside]).mean(), 0.97)
        self.assertFalse(np.isfinite(grey[(abs(x) > 1.05) | (abs(y) > 1.05)]).any())
        known = inside & np.isfinite(grey)
        self.assertLess(np.abs(grey[known] - (100 + 80 * x[known])).max(), 3)
        self.assertFalse(inferred.any())

    def test_what_is_nearer_hides_what_is_behind_and_backs_are_not_shown(self):
        near, far = wall(1.0, 0.3), wall(2.0)
        near[0]["inferred"] = 1
        both = (np.concatenate([near[0], far[0]]),
                np.concatenate([near[1], far[1] + len(near[0])]))
        renderer = photometric.Renderer(*both, CAMERA, 1.0)
        grey, inferred = renderer.render(np.eye(3), np.zeros(3))
        self.assertGreater(inferred[15:45, 25:55].mean(), 0.95)
        self.assertFalse(inferred[:10].any())
        behind, _ = renderer.render(np.diag([-1.0, 1, -1]), np.array([0, 0, 4.0]))
        self.assertFalse(np.isfinite(behind).any())

    def test_the_exposure_is_no_difference_and_another_picture_is_one(self):
        rng = np.random.default_rng(5)
        shown = rng.uniform(0, 200, 5000)
        median, mean = photometric.difference(shown, 0.8 * shown + 20)
        self.assertLess(mean, 1e-6)
        self.assertLess(median, 1e-6)
        self.assertGreater(photometric.difference(shown, rng.uniform(0, 200, 5000))[1], 30)


if __name__ == "__main__":
    unittest.main()
