"""Tests of tools/python/twoview_tools/room/plan.py: a plan's lines beside the true sides."""
import unittest

import numpy as np

from twoview_tools.room import plan

ROOM = {"centre": [0, 0, -1], "half": [2, 1.5, 1], "yaw_rad": 0, "is_room": True}
POSTER = {"centre": [0, -1.49, -1], "half": [0.3, 0.01, 0.2], "yaw_rad": 0, "is_room": False}
WORLD = (1.0, np.eye(3), np.zeros(3))


def line(start, end, normal, is_wall=True):
    return {"from": [*start, 0], "to": [*end, 0], "normal": [*normal, 0], "is_wall": is_wall}


WALLS = [line((-2, -1.5), (2, -1.5), (0, 1)), line((-2, 1.5), (2, 1.5), (0, -1)),
         line((-2, -1.5), (-2, 1.5), (1, 0)), line((2, -1.5), (2, 1.5), (-1, 0))]


def scores(walls):
    return plan.scores({"walls": walls, "floor_area": 12.0}, [ROOM, POSTER],
                       lambda points: np.ones(len(points), bool), WORLD)


class RoomPlan(unittest.TestCase):
    def test_a_true_plan(self):
        row = scores(WALLS)
        self.assertEqual((row["walls"], row["walls_found"], row["false"], row["twice"]),
                         (4, 4, 0, 0))
        self.assertLess(row["offset_median"], 1e-9)
        self.assertAlmostEqual(row["area_off"], 0)

    def test_a_false_line_a_missing_and_a_doubled_wall(self):
        row = scores(WALLS[:3] + [line((-2, -1.44), (1.5, -1.44), (0, 1)),
                                  line((-1, -1), (1, 1), (0.7, -0.7), False)])
        self.assertEqual((row["walls_found"], row["false"], row["twice"]), (3, 1, 1))

    def test_a_wall_that_faces_outwards_is_false(self):
        row = scores([line((-2, 1.5), (2, 1.5), (0, 1))])
        self.assertEqual((row["walls_found"], row["false"]), (0, 1))


if __name__ == "__main__":
    unittest.main()
