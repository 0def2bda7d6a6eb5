"""Tests of twoview_tools.accuracy.metrics on cases that were computed by hand."""

import math
import unittest

try:
    import numpy as np
except ImportError:
    np = None

if np is not None:
    from twoview_tools.accuracy import metrics


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy: run scripts/bootstrap test")


def superglue_auc(errors, threshold):
    """The published formula, written independently: trapezoids under the recall of the sorted
    errors."""
    errors = sorted(errors)
    recall = [(i + 1) / len(errors) for i in range(len(errors))]
    errors, recall = [0.0] + errors, [0.0] + recall
    last = sum(1 for e in errors if e < threshold)
    x = errors[:last] + [threshold]
    y = recall[:last] + [recall[last - 1]]
    return 100 * sum((x[i + 1] - x[i]) * (y[i] + y[i + 1]) / 2
                     for i in range(len(x) - 1)) / threshold


class TestAuc(unittest.TestCase):
    def test_equals_a_case_done_by_hand(self):
        # Errors 1 and 3 and a failure: recall rises to 1/3 over [0, 1] and to 2/3 over [1, 3], and
        # stays there to 5: 1/6 + 1 + 4/3 = 2.5, of 5.
        self.assertAlmostEqual(metrics.auc([3.0, 1.0, math.inf], 5.0), 50.0)

    def test_leaves_out_errors_at_and_above_the_threshold(self):
        # Recall rises to 1/2 at error 2 and stays there to 5: the area is 1/2 + 3/2 = 2 of 5.
        self.assertAlmostEqual(metrics.auc([2.0, 5.0], 5.0), 40.0)

    def test_is_100_for_exact_poses_and_0_for_failures(self):
        self.assertAlmostEqual(metrics.auc([0.0, 0.0], 5.0), 100.0)
        self.assertEqual(metrics.auc([math.inf] * 3, 20.0), 0.0)

    def test_equals_the_published_formula_on_random_errors(self):
        random = np.random.default_rng(7)
        for num in (1, 2, 5, 40):
            errors = random.exponential(6.0, num)
            errors[random.random(num) < 0.2] = np.inf
            for threshold in metrics.THRESHOLDS_DEG:
                self.assertAlmostEqual(metrics.auc(errors, threshold),
                                       superglue_auc(errors.tolist(), threshold), places=9)

    def test_rows_are_independent(self):
        rows = metrics.auc_rows([[3.0, 1.0, math.inf], [0.0, 0.0, 0.0]], 5.0)
        self.assertAlmostEqual(rows[0], 50.0)
        self.assertAlmostEqual(rows[1], 100.0)


class TestPoseError(unittest.TestCase):
    def test_measures_a_turn_of_3_degrees(self):
        a = math.radians(3.0)
        R = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
        self.assertAlmostEqual(metrics.rotation_error_deg(R, np.eye(3)), 3.0, places=10)
        self.assertAlmostEqual(metrics.rotation_error_deg(np.diag([1.0, -1, -1]), np.eye(3)), 180.0)

    def test_translation_is_sign_free_and_the_signed_error_is_beside_it(self):
        found = metrics.pose_error(np.eye(3), [-1, 0, 0], np.eye(3), [2, 0, 0])
        self.assertAlmostEqual(found["translation_error_deg"], 0.0)
        self.assertAlmostEqual(found["translation_error_signed_deg"], 180.0)
        self.assertAlmostEqual(found["pose_error_deg"], 0.0)

    def test_takes_the_larger_of_the_two(self):
        t = [math.cos(math.radians(7)), math.sin(math.radians(7)), 0]
        self.assertAlmostEqual(
            metrics.pose_error(np.eye(3), t, np.eye(3), [1, 0, 0])["pose_error_deg"], 7.0)

    def test_is_infinite_without_a_pose(self):
        self.assertEqual(metrics.pose_error(None, None, np.eye(3), [1, 0, 0])["pose_error_deg"],
                         math.inf)


class TestPrecision(unittest.TestCase):
    def test_counts_matches_below_the_limit(self):
        # For sideways motion the epipolar error is the difference of y. The squared symmetric
        # distance is 2 dy^2, which is below 5e-4 for dy = 0.0158 and above it for 0.0159.
        points0 = np.array([[0.1, 0.2], [0.3, -0.1], [0.0, 0.0]])
        points1 = points0 + [[0.05, 0.0158], [0.02, 0.0159], [0.5, 0.0]]
        self.assertAlmostEqual(metrics.precision(points0, points1, np.eye(3), [1.0, 0, 0]), 2 / 3)

    def test_is_0_without_matches(self):
        none = np.zeros((0, 2))
        self.assertEqual(metrics.precision(none, none, np.eye(3), [1.0, 0, 0]), 0.0)


class TestBootstrap(unittest.TestCase):
    def test_finds_no_spread_when_every_pair_differs_alike(self):
        found = metrics.paired_bootstrap({"a": ([[0.0] * 20], [[math.inf] * 20])}, 200)
        for summary in (found["sets"]["a"]["5"], found["mean"]["5"], found["pooled"]["5"]):
            self.assertAlmostEqual(summary["difference"], 100.0)
            self.assertAlmostEqual(summary["standard_error"], 0.0)
            self.assertFalse(summary["worse"])

    def test_has_the_standard_error_of_a_mean(self):
        # Every error is 0 or a failure, so that AUC is the share of exact pairs: all of ours, every
        # second one of the peer's. The share's standard error is sqrt(p (1 - p) / n).
        num = 100
        peer = [0.0 if i % 2 else math.inf for i in range(num)]
        found = metrics.paired_bootstrap({"a": ([[math.inf] * num], [peer])}, 4000)
        summary = found["sets"]["a"]["10"]
        self.assertAlmostEqual(summary["difference"], -50.0)
        self.assertAlmostEqual(summary["standard_error"], 5.0, delta=0.25)
        self.assertAlmostEqual(summary["low"], -60.0, delta=1.5)
        self.assertAlmostEqual(summary["high"], -40.0, delta=1.5)
        self.assertTrue(summary["worse"])

    def test_pairing_removes_what_both_share(self):
        # Both systems fail on the same half of the pairs: AUC itself has a spread, the difference
        # has none.
        both = [0.0, math.inf] * 10
        found = metrics.paired_bootstrap({"a": ([both], [both])}, 100)
        self.assertEqual(found["sets"]["a"]["5"]["standard_error"], 0.0)

    def test_mean_weighs_sets_and_pooled_weighs_pairs(self):
        sets = {"small": ([[0.0]], [[math.inf]]), "large": ([[0.0] * 9], [[0.0] * 9])}
        found = metrics.paired_bootstrap(sets, 100)
        self.assertAlmostEqual(found["mean"]["5"]["difference"], 50.0)
        self.assertAlmostEqual(found["pooled"]["5"]["difference"], 10.0)

    def test_groups_weigh_the_same_whatever_their_sizes(self):
        exact, failed = [[0.0] * 4], [[math.inf] * 4]
        sets = {"a": (exact, failed), "b": (exact, exact), "c": (exact, exact),
                "d": (failed, exact)}
        found = metrics.paired_bootstrap(sets, 100, groups={"x": ["a"], "y": ["b", "c", "d"]})
        self.assertAlmostEqual(found["groups"]["x"]["5"]["difference"], 100.0)
        self.assertAlmostEqual(found["groups"]["y"]["5"]["difference"], -100.0 / 3)
        self.assertAlmostEqual(found["group_mean"]["5"]["difference"], 100.0 / 3)
        self.assertAlmostEqual(found["mean"]["5"]["difference"], 0.0)

    def test_a_group_has_the_standard_error_of_the_mean_of_its_sets(self):
        # As above, 5 for each of two independent sets: 5 / sqrt(2) for their mean.
        num = 100
        half = [0.0 if i % 2 else math.inf for i in range(num)]
        sets = {name: ([[math.inf] * num], [half]) for name in "ab"}
        found = metrics.paired_bootstrap(sets, 4000, groups={"x": ["a", "b"]})
        summary = found["groups"]["x"]["10"]
        self.assertAlmostEqual(summary["difference"], -50.0)
        self.assertAlmostEqual(summary["standard_error"], 5.0 / math.sqrt(2), delta=0.2)

    def test_averages_over_the_peers_seeds(self):
        found = metrics.paired_bootstrap({"a": ([[0.0] * 4], [[0.0] * 4, [math.inf] * 4])}, 100)
        self.assertAlmostEqual(found["sets"]["a"]["20"]["difference"], 50.0)

    def test_repeats_with_the_same_seed(self):
        sets = {"a": ([[1.0, 2.0, 9.0]], [[2.0, 1.0, 30.0]])}
        self.assertEqual(metrics.paired_bootstrap(sets, 100), metrics.paired_bootstrap(sets, 100))


class TestFinite(unittest.TestCase):
    def test_writes_infinity_as_null(self):
        self.assertEqual(metrics.finite({"a": [math.inf, 1.5, "x", np.float64(2)]}),
                         {"a": [None, 1.5, "x", 2.0]})


if __name__ == "__main__":
    unittest.main()
