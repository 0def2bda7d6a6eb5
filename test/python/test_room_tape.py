"""The tape measure on a room's model: an exact model has exact lengths, one that is 2 % too large
has none within 1 % but where the metre is left aside, and marks at an edge are not taken."""

import unittest

import numpy as np
import twoview as tv

from twoview_tools.room import tape, truth
from test_room_truth import BOX, ROOM, mesh_of

CAMERA = tv.Camera(320, 240, 200.0, 200.0, 159.5, 119.5)
EYE = np.array([-0.6, -0.5, 1.0])
# A camera that looks along the world's x axis, whose y axis is the world's -z.
AHEAD = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
BOXES = [ROOM, BOX]


def surface_of(grow=1.0):
    """The room's walls, seen from inside, and the box before them, as a model of that size."""
    inside, faces = mesh_of(ROOM)
    outside, _ = mesh_of(BOX)
    corners = grow * np.concatenate([inside, outside])
    vertices = np.zeros(len(corners), tv.ROOM_VERTEX)
    vertices["position"], vertices["sigma"] = corners, 0.01
    vertices["normal"] = [1, 0, 0]
    middles = np.repeat(grow * np.array([ROOM["centre"], BOX["centre"]]), len(faces), 0)
    triangles = np.concatenate([faces, faces + 8])
    # Anticlockwise as seen from the free side: from the room's middle, from outside the box.
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    outwards = (np.cross(b - a, c - a) * (a - middles)).sum(1) > 0
    turned = outwards == (np.arange(len(triangles)) < len(faces))
    triangles[turned] = triangles[turned][:, ::-1]
    return tape.Surface(vertices, triangles)


def measured(grow, scale, scale_sigma=0.01):
    points = truth.sample_boxes(BOXES, 0.1)
    poses = (AHEAD[None], EYE[None])
    picks = tape.picks_of(surface_of(grow), BOXES, points, CAMERA, poses,
                          (AHEAD[None], grow * EYE[None]))
    return picks, tape.scores(picks, 0.03, scale_sigma, scale)


class TestTape(unittest.TestCase):
    def test_an_exact_model_has_exact_lengths(self):
        picks, found = measured(1.0, 1.0)
        self.assertGreater(len(picks), 40)
        for pick in picks:
            np.testing.assert_allclose(pick.place, pick.true, atol=1e-6)
        self.assertEqual((found["within_2_sigma"], found["within_1_percent"]), (1, 1))

    def test_a_metre_that_is_wrong_is_told_apart(self):
        _, found = measured(1.02, 1 / 1.02)
        self.assertEqual(found["within_1_percent"], 0)
        self.assertEqual(found["within_1_percent_of_scaled"], 1)
        self.assertAlmostEqual(found["metre_off"], 0.02)
        self.assertAlmostEqual(found["off_median"], 0.02)
        self.assertEqual(found["within_2_sigma"], 1)
        _, sure = measured(1.02, 1 / 1.02, scale_sigma=0.001)
        self.assertLess(sure["within_2_sigma"], 0.9)

    def test_a_ray_that_meets_a_surface_flatly_knows_less(self):
        normal, flat = np.array([1.0, 0, 0]), np.array([0.5, 0.75 ** 0.5, 0])  # 60 degrees
        ends = [[tape.Pick(None, np.array([0, y, 0.0]), normal, 0.01, ray) for y in (0.0, 2.0)]
                for ray in (normal, flat)]
        across = 2 * 0.015 ** 2  # half a voxel at both ends
        for (one, other), along in zip(ends, (0, 0.01 * 0.75 ** 0.5 / 0.5)):
            length, sigma = tape.length_between(one, other, 0.03, 0)
            self.assertAlmostEqual(length, 2)
            self.assertAlmostEqual(sigma, (across + 2 * along ** 2) ** 0.5)

    def test_a_mark_has_no_edge_around_it(self):
        # The box's front ends at the corner that is nearest to the eye, and then the wall is seen.
        eye = np.array([-1.0, 0.0, 1.0])
        ray = np.array([1.0, 0, 0])
        distance = truth.first_distances(BOXES, eye, ray[None])[0]
        self.assertLess(distance, 1.3)
        self.assertTrue(tape.is_on_one_surface(BOXES, eye, ray, distance))
        up = np.array([1.0, 0, 0.3 / distance - 0.01])
        up /= np.linalg.norm(up)
        away = truth.first_distances(BOXES, eye, up[None])[0]
        self.assertLess(away, 1.5)
        self.assertFalse(tape.is_on_one_surface(BOXES, eye, up, away))

    def test_a_ray_meets_the_first_free_side(self):
        surface = surface_of()
        place, _, sigma = surface.first_hit(EYE, np.array([0, 1.0, 0]))
        away = truth.first_distances(BOXES, EYE, np.array([[0, 1.0, 0]]))[0]
        np.testing.assert_allclose(place, EYE + [0, away, 0], atol=1e-6)
        self.assertAlmostEqual(sigma, 0.01, 6)
        # From within the box its sides are backs, and the walls are met.
        place, _, _ = surface.first_hit(np.array(BOX["centre"], float), np.array([0, 0, 1.0]))
        self.assertAlmostEqual(place[2], 2, 5)


if __name__ == "__main__":
    unittest.main()
