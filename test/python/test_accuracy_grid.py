"""Tests of twoview_tools.accuracy.leaveout and grid: the choice never sees the set that is left
out, and a grid evaluates every point once."""

import copy
import tempfile
import unittest
from unittest import mock

try:
    import numpy as np
except ImportError:
    np = None

if np is not None:
    from twoview_tools.accuracy import grid, leaveout

# Two sets of each group.
SETS = ("kitti00_turn", "tum_fr2_desk", "pc_room", "tankard")


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy: run scripts/bootstrap test")


def made_up(points):
    """{set: points x 3} from {set: [a number for each point]}, equal for the three AUC."""
    return {name: np.repeat(np.array(scores, float)[:, None], 3, axis=1)
            for name, scores in points.items()}


class TestLeaveOut(unittest.TestCase):
    def test_a_sets_own_scores_do_not_change_its_point(self):
        random = np.random.default_rng(8)
        for _ in range(50):
            table = {name: random.uniform(0, 100, (12, 3)) for name in SETS}
            before = leaveout.leave_one_out(table)
            for name in SETS:
                other = copy.deepcopy(table)
                other[name] = random.uniform(0, 100, (12, 3))
                other[name][random.integers(12)] = 1000.0  # would win if it were read
                after = leaveout.leave_one_out(other)
                self.assertEqual(after["sets"][name]["point"], before["sets"][name]["point"])
                np.testing.assert_array_equal(after["sets"][name]["left_out"],
                                              other[name][before["sets"][name]["point"]])

    def test_a_case_done_by_hand(self):
        # Point 0 is made for pc_room alone: with it point 0 wins, without it point 1 does.
        table = made_up({"kitti00_turn": [50, 60], "tum_fr2_desk": [50, 60],
                         "pc_room": [90, 40], "tankard": [50, 60]})
        found = leaveout.leave_one_out(table)
        self.assertEqual(found["tuned"], 0)  # (50 + 70) / 2 against (60 + 50) / 2
        self.assertEqual([s["point"] for s in found["sets"].values()], [0, 0, 1, 0])
        self.assertEqual(found["worst"], "pc_room")
        np.testing.assert_allclose(found["tuned_mean"], 60.0)
        np.testing.assert_allclose(found["left_out_mean"], (50 + (40 + 50) / 2) / 2)
        self.assertAlmostEqual(found["difference"], -12.5)

    def test_the_groups_weigh_the_same_whatever_their_sizes(self):
        table = made_up({"kitti00_turn": [40, 50], "pc_room": [60, 52], "tankard": [60, 52],
                         "fox_wall": [60, 52]})
        np.testing.assert_allclose(leaveout.criterion(table), [50.0, 51.0])
        self.assertEqual(leaveout.choose(table), 1)
        # Without the one narrow set only the group wide remains.
        self.assertEqual(leaveout.leave_one_out(table)["sets"]["kitti00_turn"]["point"], 0)

    def test_a_tie_gives_the_first_point(self):
        self.assertEqual(leaveout.choose(made_up({"pc_room": [7, 9, 9], "tankard": [7, 9, 9]})), 1)

    def test_one_set_cannot_be_left_out(self):
        with self.assertRaises(ValueError):
            leaveout.leave_one_out(made_up({"pc_room": [1, 2]}))


class TestGridFile(unittest.TestCase):
    def test_alternatives_multiply_and_points_are_added(self):
        points = grid.read_grid(["# a comment", "feature", "feature levels=2,4 cell_px=24  # two",
                                 "", "match ratio=0.9,0.92",
                                 "point feature.levels=3 estimate.max_error_px=1,2"])
        self.assertEqual(len(points), 3 * 2 * 1 + 2)
        self.assertEqual(points[0], ({}, {"ratio": "0.9"}, {}))
        self.assertIn(({"levels": "4", "cell_px": "24"}, {"ratio": "0.92"}, {}), points)
        self.assertEqual(points[-1], ({"levels": "3"}, {}, {"max_error_px": "2"}))

    def test_only_points_make_no_product(self):
        self.assertEqual(grid.read_grid(["point match.ratio=0.9"]), [({}, {"ratio": "0.9"}, {})])

    def test_a_title_names_options_and_build(self):
        self.assertEqual(grid.title(({}, {}, {})), "defaults")
        self.assertEqual(grid.title(({}, {"ratio": "0.9"}, {}, {"lib": "b.so"})),
                         "match ratio=0.9 | with lib=b.so")

    def test_a_wrong_line_is_named(self):
        for line, words in (("feature levels", "not KEY=VALUE"), ("levels=2", "begins with"),
                            ("point levels=2", "begins with none"), ("match ratio=", "not KEY")):
            with self.assertRaisesRegex(ValueError, f"line 2: .*{words}"):
                grid.read_grid(["feature", line])


class TestEvaluation(unittest.TestCase):
    """evaluate_points with the stages replaced by counters."""

    def setUp(self):
        self.calls = []
        pairs = [mock.Mock(text=f"p{i}", name0=f"{i}a", name1=f"{i}b") for i in range(2)]
        self.data = mock.Mock(pairs=pairs, resize=0)
        self.data.name = "pc_room"
        self.data.pixel_hash = lambda name: name
        self.data.camera = lambda pair, side: (np.eye(3), [0.0] * 5)
        row = {c: 1.0 for c in grid.COLUMNS}

        def record(stage, result):
            def call(*arguments):
                self.calls.append(stage)
                return result
            return call

        # Of two rows one is a failure: null in the cache, infinite outside.
        rows = [row, {**row, "pose_error_deg": np.inf}]
        for name, function in (
                ("pipeline.make_context", lambda *a: None),
                ("pipeline.extract_images", record("extract", {})),
                ("pipeline.match_pairs", record("match", [None, None])),
                ("pipeline.evaluate_matches", record("estimate", rows)),
                ("canonical", lambda library, point: tuple(map(str, point)))):
            patch = mock.patch(f"twoview_tools.accuracy.grid.{name}", side_effect=function)
            patch.start()
            self.addCleanup(patch.stop)
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def run_points(self, points, library="one"):
        self.calls.clear()
        return grid.evaluate_points(self.data, None, library, dict(enumerate(points)), self.folder)

    def test_each_stage_runs_once_for_its_options_and_never_from_the_cache(self):
        points = [({}, {"ratio": r}, {"e": e}) for r in "12" for e in "345"]
        first = self.run_points(points)
        self.assertEqual([self.calls.count(s) for s in ("extract", "match", "estimate")], [1, 2, 6])
        self.assertEqual(first[5][1]["pose_error_deg"], np.inf)
        self.assertEqual(self.run_points(points), first)
        self.assertEqual(self.calls, [])
        self.run_points(points + [({}, {"ratio": "2"}, {"e": "9"})])
        self.assertEqual(self.calls, ["extract", "match", "estimate"])

    def test_another_library_or_another_image_is_not_in_the_cache(self):
        points = [({}, {}, {})]
        self.run_points(points)
        self.run_points(points, "another")
        self.assertEqual(self.calls, ["extract", "match", "estimate"])
        self.data.pixel_hash = lambda name: "changed"
        self.run_points(points)
        self.assertEqual(self.calls, ["extract", "match", "estimate"])


if __name__ == "__main__":
    unittest.main()
