"""The scores of a room's surface: an exact surface has F 1, one that is 7 cm off has 0, half of it
half the recall; what stands in front hides what is behind."""

import unittest

import numpy as np

from twoview_tools.room import truth

ROOM = {"centre": [0.5, 0, 1], "half": [2, 1.5, 1], "yaw_rad": 0.3, "is_room": True}
BOX = {"centre": [0.5, 0, 1], "half": [0.3, 0.3, 0.3], "yaw_rad": 0.3, "is_room": False}


def mesh_of(box, grow=0.0):
    """The eight corners and twelve triangles of a box that is `grow` larger on each side."""
    c, s = np.cos(box["yaw_rad"]), np.sin(box["yaw_rad"])
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    local = signs * (np.asarray(box["half"]) + grow)
    corners = local @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + box["centre"]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])


def scored(grow, triangles=slice(None), inferred=0):
    positions, all_triangles = mesh_of(ROOM, grow)
    return truth.scores([ROOM], truth.sample_boxes([ROOM], 0.05), positions,
                        np.full(8, inferred, bool), all_triangles[triangles])


class TestTruth(unittest.TestCase):
    def test_an_exact_surface_has_the_full_score(self):
        found = scored(0.0)
        self.assertEqual(found["precision"], 1)
        self.assertGreater(found["recall"], 0.999)
        self.assertIsNone(found["precision_inferred"])

    def test_a_surface_beyond_the_distance_has_none(self):
        found = scored(0.07)
        self.assertLess(found["precision"], 0.001)
        self.assertLess(found["f"], 0.001)

    def test_a_part_has_its_share_of_the_recall_and_inferred_is_told_apart(self):
        found = scored(0.0, slice(0, 2), inferred=1)  # a side of 3 x 2 of 52 square metres
        self.assertEqual(found["precision_inferred"], 1)
        self.assertIsNone(found["precision_measured"])
        self.assertAlmostEqual(found["recall"], 6 / 52, delta=0.03)

    def test_no_surface_is_no_error(self):
        self.assertEqual(scored(0.0, slice(0, 0))["f"], 0)

    def test_a_box_hides_what_is_behind_it_and_not_what_is_before(self):
        eye = np.array([-1.0, 0.0, 1.0])
        points = np.array([[2.0, 0, 1], [-0.5, 0, 1], [2.0, 1.2, 1], [0.0, 0, 1]])
        self.assertEqual(truth.is_blocked([ROOM, BOX], eye, points).tolist(),
                         [True, False, False, False])


if __name__ == "__main__":
    unittest.main()
