"""Tests of twoview_tools.accuracy.belief, truth, lens, reliability, belief_tables and
match_evidence: the choice of pairs, errors, the ellipsoid test and the counting, against values
computed otherwise."""

import itertools
import json
import math
import os
import re
import tempfile
import types
import unittest
import unittest.mock

try:
    import numpy as np
except ImportError:
    np = None

if np is not None:
    from twoview_tools import DEFAULT_LIBRARY
    from twoview_tools.accuracy import (belief, belief_fit, belief_tables, datasets, lens,
                                        match_evidence, reliability, truth)


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy: run scripts/bootstrap test")


def cross_matrix(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]], float)


def exponential(w):
    """exp([w]x) by its power series: independent of any formula for angles."""
    X, term, total = cross_matrix(w), np.eye(3), np.eye(3)
    for k in range(1, 60):
        term = term @ X / k
        total = total + term
    return total


def random_pose(random):
    t = random.normal(size=3)
    return exponential(random.normal(size=3)), t / np.linalg.norm(t)


def moved(R, t, x):
    """The pose that lies (w0 w1 w2 a b) from R, t, as two_view.h words it."""
    k = min(range(3), key=lambda i: (abs(t[i]), i))
    b1 = np.cross(np.eye(3)[k], t)
    b1 = b1 / math.sqrt(b1 @ b1)
    b2 = np.cross(t, b1)
    direction = t + x[3] * b1 + x[4] * b2
    return exponential(x[:3]) @ R, direction / math.sqrt(direction @ direction)


class TestChoice(unittest.TestCase):
    def test_shares_never_exceed_what_there_is_and_add_up(self):
        shares = belief.share_out({"small": 3, "a": 1000, "b": 1000, "none": 0}, 103)
        self.assertEqual(shares, {"small": 3, "a": 50, "b": 50, "none": 0})
        self.assertEqual(sum(belief.share_out({"a": 5, "b": 7}, 1000).values()), 12)

    def test_few_images_give_every_pair_once(self):
        pairs = belief.choose_pairs(list("abcdef"), 100, np.random.default_rng(0))
        self.assertEqual({frozenset(p) for p in pairs},
                         {frozenset(p) for p in itertools.combinations("abcdef", 2)})
        self.assertEqual(len(pairs), 15)

    def test_many_images_give_gaps_and_random_pairs_without_repetition(self):
        images = [f"{i:03d}" for i in range(200)]
        pairs = belief.choose_pairs(images, 160, np.random.default_rng(0))
        self.assertEqual(len({frozenset(p) for p in pairs}), 160)
        gaps = [abs(int(a) - int(b)) for a, b in pairs]
        for gap in (1, 2, 4, 8, 16, 32, 64, 128):  # 80 pairs over eight gaps
            self.assertGreaterEqual(gaps.count(gap), 10)
        self.assertGreater(sum(g & (g - 1) != 0 for g in gaps), 60)
        self.assertEqual(pairs, belief.choose_pairs(images, 160, np.random.default_rng(0)))
        self.assertTrue(40 < sum(a < b for a, b in pairs) < 120)

    def test_an_enlarged_picture_keeps_its_middle(self):
        gray = np.zeros((101, 201), np.uint8)
        gray[50, 100] = gray[40, 110] = 255  # the middle, and 10 pixels from it
        try:
            large = belief.enlarged(gray, 2.0)
        except ImportError:
            self.skipTest("no cv2: run scripts/bootstrap test")
        self.assertEqual(large.shape, gray.shape)
        self.assertEqual(large[50, 100], 255)
        self.assertEqual(large[30, 120], 255)
        self.assertEqual(belief.mirrored(gray)[40, 90], 255)


class TestReliability(unittest.TestCase):
    def test_the_limits_are_those_of_chi_square(self):
        for freedom, x in reliability.CHI2_95.items():
            half, tail = x / 2, math.exp(-x / 2)
            share = 1 - tail
            if freedom > 2:  # closed forms for odd degrees of freedom
                share = math.erf(math.sqrt(half)) - math.sqrt(2 * x / math.pi) * tail
                share -= math.sqrt(2 * x / math.pi) * tail * x / 3 if freedom == 5 else 0
            self.assertAlmostEqual(share, 0.95, 12)

    def test_the_deviation_is_that_of_the_header(self):
        random = np.random.default_rng(1)
        for scale in (1e-9, 1e-3, 0.5):
            for _ in range(50):
                R, t = random_pose(random)
                x = scale * random.normal(size=5)
                np.testing.assert_allclose(reliability.deviation(R, t, *moved(R, t, x)), x,
                                           rtol=1e-6, atol=1e-14)

    def test_an_opposite_direction_has_no_deviation(self):
        R, t = random_pose(np.random.default_rng(2))
        self.assertIsNone(reliability.deviation(R, t, R, -t))

    def test_a_rotation_vector_survives_half_a_turn(self):
        for w in ([0, 0, math.pi], [math.pi - 1e-9, 0, 0], [1.0, -2, 2]):
            R = exponential(w)
            np.testing.assert_allclose(exponential(reliability.rotation_vector(R)), R, atol=1e-7)

    def judged(self, x, C, stated, R=None, t=None, baseline=1.0):
        if R is None:
            R, t = random_pose(np.random.default_rng(3))
        R_true, t_true = moved(R, t, x)
        return reliability.judge(R, t, C.ravel(), R_true, baseline * t_true, stated)

    def test_the_ellipsoid_ends_where_its_quadratic_form_says(self):
        random = np.random.default_rng(4)
        exact = truth.Stated("room", 0.0, 0.0)
        for _ in range(20):
            A = random.normal(size=(5, 5)) * 1e-3
            C = A @ A.T + 1e-8 * np.eye(5)
            x = random.normal(size=5)
            edge = x * math.sqrt(11.070497693516351 / (x @ np.linalg.inv(C) @ x))
            for factor, inside in ((0.999, True), (1.001, False)):
                found = self.judged(edge * factor, C, exact)
                self.assertIs(found["inside"], inside)
                self.assertEqual(found["chi2_freedom"], 5)
                self.assertAlmostEqual(found["chi2"], 11.0705 * factor ** 2, 2)

    def test_draws_from_the_covariance_lie_inside_in_95_of_100(self):
        random = np.random.default_rng(5)
        A = random.normal(size=(5, 5)) * 1e-3
        C = A @ A.T
        draws = random.multivariate_normal(np.zeros(5), C, 2000)
        for stated, freedom in ((truth.Stated("room", 0.0, 0.0), 5),
                                (truth.Stated("room", 0.0, 90.0), 3)):
            found = [self.judged(x, C, stated) for x in draws]
            self.assertEqual(found[0]["chi2_freedom"], freedom)
            share = np.mean([f["inside"] for f in found])
            self.assertTrue(0.93 < share < 0.97, share)

    def test_the_truth_s_error_enlarges_the_ellipsoid_by_its_mean_square(self):
        stated = truth.Stated("room", 0.5, 1.0)
        random = np.random.default_rng(6)
        A = random.normal(size=(5, 5)) * 1e-3
        C = A @ A.T
        x = 0.01 * random.normal(size=5)
        T = np.diag([math.radians(0.5) ** 2 / 3] * 3 + [math.radians(1.0) ** 2 / 2] * 2)
        found = self.judged(x, C, stated)
        self.assertAlmostEqual(found["chi2_with_truth"], x @ np.linalg.inv(C + T) @ x, 6)
        # A truth whose angle has this root mean square: draw it and measure the angle.
        angles = np.linalg.norm(random.multivariate_normal(np.zeros(3), T[:3, :3], 20000), axis=1)
        self.assertAlmostEqual(math.degrees(math.sqrt(np.mean(angles ** 2))), 0.5, 2)

    def test_wrong_and_right_begin_where_the_text_says(self):
        stated, C = truth.Stated("room", 0.5, 1.0), 1e-6 * np.eye(5)
        for angle, wrong, right in ((2.49, False, True), (2.51, False, False),
                                    (5.49, False, False), (5.51, True, False)):
            found = self.judged([math.radians(angle), 0, 0, 0, 0], C, stated)
            self.assertAlmostEqual(found["rotation_error_deg"], angle, 9)
            self.assertEqual((found["wrong"], found["wrong_rotation"], found["right"]),
                             (wrong, wrong, right))
        for angle, wrong, right in ((2.99, False, True), (3.01, False, False),
                                    (10.99, False, False), (11.01, True, False)):
            found = self.judged([0, 0, 0, math.tan(math.radians(angle)), 0], C, stated)
            self.assertAlmostEqual(found["direction_error_deg"], angle, 9)
            self.assertEqual((found["wrong"], found["wrong_rotation"], found["right"]),
                             (wrong, False, right))

    def test_the_direction_has_a_sign_and_counts_only_on_a_long_baseline(self):
        stated = truth.Stated("room", 0.0, 0.0, position=0.01)
        R, t = random_pose(np.random.default_rng(7))
        far = reliability.judge(R, t, None, R, -t, stated)  # 1.4 cm in a metre: 0.8 degrees
        self.assertEqual((far["direction_counts"], far["wrong"], far["wrong_rotation"]),
                         (True, True, False))
        self.assertAlmostEqual(far["direction_error_deg"], 180.0, 6)
        self.assertAlmostEqual(far["truth_direction_deg"],
                               math.degrees(math.atan(0.01 * math.sqrt(2))), 9)
        near = reliability.judge(R, t, None, R, -0.1 * t, stated)  # 8 degrees
        self.assertEqual((near["direction_counts"], near["wrong"], near["right"]),
                         (False, False, None))

    def test_no_pose_is_neither_right_nor_wrong(self):
        found = reliability.judge(None, None, None, np.eye(3), np.ones(3),
                                  truth.Stated("room", 0, 0))
        self.assertEqual((found["wrong"], found["right"], found["rotation_error_deg"]),
                         (None, None, None))

    def test_sigmas_are_roots_of_the_traces(self):
        C = np.diag([1.0, 4, 4, 9, 16]) * math.radians(1) ** 2
        found = reliability.sigmas(C.ravel())
        for key, value in (("rotation", 3), ("direction", 5), ("largest", 4)):
            self.assertAlmostEqual(found[f"sigma_{key}_deg"], value, 12)


def row(**values):
    """A row with a right and "ok" pose, changed by `values`."""
    return {"kind": "related", "trusted": True, "set": "a", "verdict": "ok", "reasons": [],
            "rotation_error_deg": 0.1, "direction_error_deg": 1.0, "wrong": False,
            "wrong_rotation": False, "right": True, "num_inliers": 50, "inlier_share": 0.5,
            "median_parallax_deg": 5.0, "coverage": 0.5, "chi2_freedom": 5, "inside": True,
            "inside_with_truth": True, "direction_counts": True, "sigma_rotation_deg": 0.1,
            "sigma_direction_deg": 0.5, **values}


def bad(**values):
    return row(rotation_error_deg=50.0, wrong=True, wrong_rotation=True, right=False, inside=False,
               inside_with_truth=False, **values)


class TestCounts(unittest.TestCase):
    def test_a_bound_belongs_to_the_class_above_it(self):
        self.assertEqual([belief_tables.class_of(v, (1, 2, 5)) for v in (0, 1, 1.9, 2, 4.9, 5, 9)],
                         [0, 1, 1, 2, 2, 3, 3])
        self.assertEqual(belief_tables.class_names((1, 2, 5)), ["< 1", "1 - 2", "2 - 5", ">= 5"])

    def test_each_error_is_counted_once(self):
        rows = [row(), row(rotation_error_deg=0.5), row(rotation_error_deg=19.9),
                row(rotation_error_deg=20.0), row(verdict="refused", rotation_error_deg=None)]
        table = belief_tables.error_table(rows, "rotation_error_deg")
        self.assertEqual(table["ok"], [1, 1, 0, 0, 0, 1, 1, 0])
        self.assertEqual(table["refused"], [0] * 7 + [1])

    def test_reasons_alone_and_together(self):
        rows = [row(), bad(verdict="doubtful", reasons=["low_parallax", "second_motion"]),
                row(verdict="doubtful", reasons=["low_parallax"]),
                row(verdict="refused", rotation_error_deg=None, reasons=["no_motion"])]
        table = belief_tables.reason_table(rows)
        self.assertEqual(table["low_parallax"], {"pairs": 2, "wrong": 1, "right": 1, "alone": 1,
                                                 "alone_wrong": 0, "alone_right": 1})
        self.assertEqual(table["second_motion"]["alone"], 0)
        self.assertEqual(table["none (ok)"]["pairs"], 1)
        self.assertNotIn("no_motion", table)

    def test_features_split_ok_and_right(self):
        rows = [row(num_inliers=19), bad(num_inliers=20), row(num_inliers=20, verdict="doubtful"),
                row(num_inliers=200, right=False, wrong=True)]
        table = belief_tables.feature_table(rows, "num_inliers", (20, 200))
        self.assertEqual(table, [[1, 0, 0, 1, 1], [1, 1, 1, 1, 0], [1, 0, 1, 0, 0]])

    def test_reliability_is_medians_and_shares(self):
        rows = [row(), row(rotation_error_deg=0.3, inside=False),
                row(rotation_error_deg=0.2, direction_counts=False, direction_error_deg=70.0)]
        found = belief_tables.reliability(rows)
        self.assertEqual((found["pairs"], found["directions"]), (3, 2))
        self.assertAlmostEqual(found["rotation_ratio"], 2.0)
        self.assertAlmostEqual(found["direction_ratio"], 2.0)
        self.assertAlmostEqual(found["inside"], 2 / 3)
        self.assertAlmostEqual(found["inside_with_truth"], 1.0)

    def test_the_check_counts_trusted_ok_pairs_alone(self):
        rows = [row()] * 98 + [bad(), row(wrong=True, right=False), bad(trusted=False),
                               bad(verdict="doubtful"), bad(kind="zoomed")]
        for key, share in (("wrong", 0.02), ("wrong_rotation", 0.01)):
            self.assertTrue(belief_tables.check(rows, key, share)[0])
            self.assertFalse(belief_tables.check(rows, key, share - 1e-6)[0])

    def test_the_summary_counts(self):
        found = belief_tables.summary([row(), bad(), row(verdict="doubtful"),
                                       row(wrong=True, right=False)])
        self.assertEqual(found, {"pairs": 4, "ok": 3, "wrong_rotation": 1, "wrong": 2, "right": 2,
                                 "right_ok": 1})

    def test_the_command_reads_rows_and_its_status_follows_the_check(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "rows.jsonl")
            impossible = {"kind": "unrelated", "verdict": "refused", "set": "a", "trusted": True}
            with open(path, "w", encoding="utf-8") as file:
                for one in [row()] * 9 + [bad(), impossible]:
                    file.write(json.dumps(one) + "\n")
            quiet = unittest.mock.patch("sys.stdout")
            with quiet:
                belief.main(["--from", path, "--check", "0.1"])
                belief.main(["--from", path, "--table"])
                with self.assertRaises(SystemExit) as caught:
                    belief.main(["--from", path, "--check-rotation", "0.09"])
        self.assertEqual(caught.exception.code, 1)


class TestEvidence(unittest.TestCase):
    def setUp(self):
        random = np.random.default_rng(8)
        self.R, self.t = exponential([0.1, -0.2, 0.7]), np.array([0.3, 0.1, 0.9])
        self.t /= np.linalg.norm(self.t)
        points = np.column_stack([random.uniform(-2, 2, (60, 2)), random.uniform(4, 8, 60)])
        other = points @ self.R.T + self.t
        K = np.diag([500.0, 500.0, 1.0])
        self.matches = types.SimpleNamespace(
            rays0=points[:, :2] / points[:, 2:], rays1=other[:, :2] / other[:, 2:],
            cameras=((K, ()), (K, ())), sizes=((640, 480),) * 2)
        kind = [("x", "f4"), ("y", "f4"), ("size", "f4"), ("angle_rad", "f4")]
        self.keypoints = np.zeros(60, kind), np.zeros(60, kind)
        self.keypoints[0]["size"] = 8.0
        self.keypoints[1]["size"] = 8.0 * points[:, 2] / other[:, 2]
        # What an edge does that lies in the plane of both centres and the point.
        step = 1e-6 * (-self.R.T @ self.t)
        for rays, k, from_world in ((self.matches.rays0, 0, lambda p: p),
                                    (self.matches.rays1, 1, lambda p: p @ self.R.T + self.t)):
            there = from_world(points + step)
            change = there[:, :2] / there[:, 2:] - rays
            self.keypoints[k]["angle_rad"] = np.arctan2(change[:, 1], change[:, 0])

    def test_keypoints_that_follow_the_pose_agree_with_it(self):
        every = np.ones(60, bool)
        found = match_evidence.of_pose(self.matches, *self.keypoints, every, self.R, self.t)
        self.assertEqual((found["scale_agreement"], found["orientation_agreement"]), (1.0, 1.0))
        self.assertEqual((found["in_front_share"], found["within_1px"]), (1.0, 60))

    def test_keypoints_that_do_not_disagree(self):
        every = np.ones(60, bool)
        self.keypoints[1]["size"] *= 2
        self.keypoints[1]["angle_rad"] += np.pi / 2
        found = match_evidence.of_pose(self.matches, *self.keypoints, every, self.R, self.t)
        self.assertEqual((found["scale_agreement"], found["orientation_agreement"]), (0.0, 0.0))
        self.assertAlmostEqual(found["scale_offset"], 1.0, 5)

    def test_a_cluster_is_few_places(self):
        pixels = np.array([[10.0 + i / 10, 10] for i in range(9)] + [[600.0, 400]])
        links = np.zeros(10, [("ratio", "f4"), ("dist_sq", "i4")])
        matches = types.SimpleNamespace(pixels0=pixels, pixels1=pixels, sizes=((640, 480),) * 2)
        found = match_evidence.of_matches(matches, links, np.ones(10, bool))
        self.assertEqual((found["inlier_places"], found["cluster_share"]), (2, 0.9))


ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def model_of_the_library():
    """[bias, coefficients] as lib/src/robust/belief.cc has them."""
    with open(os.path.join(ROOT, "lib/src/robust/belief.cc"), encoding="utf-8") as file:
        text = file.read()
    names = ("Disagreement", "Noise", "Places", "RegionShift")
    first = [float(re.search(rf"k{name} = {{(-?[0-9.]+),", text)[1]) for name in names]
    bias, alternative = (float(re.search(rf"k{name} = (-?[0-9.]+);", text)[1])
                         for name in ("Bias", "Alternative"))
    return np.array([bias, *first, alternative])


class TestFit(unittest.TestCase):
    """The fit of probability_wrong, on evidence that is drawn from a model that is known."""

    def drawn(self, coefficients, num, seed=1):
        random = np.random.default_rng(seed)
        rows = []
        for k in range(num):
            row = {"kind": "related", "trusted": True, "set": f"s{k % 6}", "num_inliers": 100,
                   "rotation_error_deg": 1.0, "right": True,
                   "region_shift_rad": float(np.exp(random.uniform(-7, -1.2))),
                   "agreement": random.uniform(0, 1), "noise_px": random.uniform(0, 1),
                   "num_places": int(random.integers(1, 60)),
                   "reasons": ["two_planar_solutions"] * int(random.integers(0, 2))}
            p = belief_fit.probabilities(np.array([belief_fit.parts_of(row)]), coefficients)[0]
            row["wrong_rotation"] = bool(random.uniform() < p)
            rows.append(row)
        return rows

    def arrays(self, rows):
        return (np.array([belief_fit.parts_of(r) for r in rows]),
                np.array([float(r["wrong_rotation"]) for r in rows]), np.ones(len(rows)))

    def test_the_fit_finds_the_model_that_the_pairs_were_drawn_from(self):
        true = np.array([6.0, 1.2, 3.0, -2.5, 0.5, 1.3])
        found = belief_fit.fit(*self.arrays(self.drawn(true, 20000)))
        np.testing.assert_allclose(found[1:], true[1:], atol=0.2)

    def test_each_rung_that_was_run_multiplies_the_odds(self):
        row = dict(self.drawn(np.array([6.0, 1.2, 3.0, -2.5, 0.5, 1.3]), 1)[0], num_rungs=3)
        X, model = np.array([belief_fit.parts_of(row)]), np.array([0.5, 1, 1, -1, 0.5, 1])
        once, thrice = (belief_fit.probabilities(X, model, offset)[0]
                        for offset in (0.0, belief_fit.offsets_of([row])))
        self.assertAlmostEqual(thrice / (1 - thrice), 3 * once / (1 - once))
        self.assertEqual(belief_fit.offsets_of([{}, {"num_rungs": 1}]).tolist(), [0, 0])

    def test_a_part_of_the_wrong_sign_is_left_out(self):
        found = belief_fit.fit(*self.arrays(self.drawn(np.array([2, 1.2, -3, -1, 0.5, 0]), 5000)))
        self.assertEqual(found[2], 0)
        self.assertTrue((found[[1, 4]] > 0).all() and found[3] < 0)

    def test_a_set_is_judged_without_its_own_pairs(self):
        rows = self.drawn(np.array([6.0, 1.2, 3.0, -2.5, 0.5, 1.3]), 1200)
        before = belief_fit.left_out(rows)
        for row in rows:
            if row["set"] == "s2":
                row["wrong_rotation"] = not row["wrong_rotation"]
        after = belief_fit.left_out(rows)
        own = np.array([r["set"] == "s2" for r in rows])
        np.testing.assert_array_equal(before[own], after[own])
        self.assertTrue((before[~own] != after[~own]).all())

    def test_sets_of_one_place_are_left_out_together(self):
        self.assertEqual(*(belief_fit.place_of(n) for n in ("kitti00_turn",
                                                            "seq_kitti00_first200")))

    def test_a_wrong_lens_is_fitted_and_not_judged(self):
        rows = self.drawn(np.array([6.0, 1.2, 3.0, -2.5, 0.5, 1.3]), 600)
        for row in rows:
            row["probability_wrong"] = 0.2
        wrong = [{**r, "kind": "file-lens", "wrong_rotation": True} for r in rows
                 if r["set"] == "s1"]
        by_set = belief_fit.left_out_tables(rows)[0][2]
        with_wrong = belief_fit.left_out_tables(rows + wrong)[0][2]
        self.assertEqual([line[1] for line in by_set], [line[1] for line in with_wrong])
        at = [line[0] for line in by_set].index("s1")
        self.assertEqual(by_set[at], with_wrong[at])  # of one place: left out together
        self.assertGreater(sum(line[2] for line in by_set), sum(line[2] for line in with_wrong))
        self.assertNotEqual(belief_fit.constants(rows), belief_fit.constants(rows + wrong))

    def test_no_set_outweighs_the_others(self):
        weights = belief_fit.weights_of(["a"] * 1000 + ["b"] * 5)
        self.assertAlmostEqual(weights[:1000].sum(), belief_fit.MOST_WEIGHT)
        self.assertEqual(weights[-1], 1)

    def test_the_limit_is_that_of_the_library(self):
        with open(os.path.join(ROOT, "lib/src/robust/belief.h"), encoding="utf-8") as file:
            limit = re.search(r"kMostProbabilityWrong = ([0-9.]+);", file.read())[1]
        self.assertEqual(float(limit), belief_fit.MOST_PROBABILITY_WRONG)

    def test_what_is_certain_is_not_believed_whatever_the_probability(self):
        row = {"reasons": [], "num_inliers": 100, "probability_wrong": 0.3,
               "region_shift_rad": 0.04}
        self.assertTrue(belief_fit.believed(row, 0.01))
        self.assertFalse(belief_fit.believed(row, 0.9))
        for change in ({"reasons": ["second_motion"]}, {"num_inliers": 14},
                       {"probability_wrong": 0.5},  # doubted for its descriptors
                       {"region_shift_rad": 0.044}):
            self.assertFalse(belief_fit.believed({**row, **change}, 0.01), change)

    def test_tenths_count_each_pose_once(self):
        rows = [{"wrong_rotation": k >= 25} for k in range(30)]
        lines = belief_tables.tenths(rows, [0.01 * k for k in range(30)])
        self.assertEqual([line[1] for line in lines], [3] * 10)
        self.assertEqual([line[3] for line in lines], [0] * 8 + [2, 3])
        self.assertAlmostEqual(lines[3][2], 10)


class TestLens(unittest.TestCase):
    """The lens that matches ask for under true poses: drawn points, seen through a known lens."""
    LENS = (-0.28, 0.08, 0.001, -0.002, -0.01)
    K = np.array([[420.0, 0, 355], [0, 420, 250], [0, 0, 1]]) if np is not None else None

    def seen(self, points):
        """Brown and Conrady's model, forward, as OpenCV documents it."""
        x, y = (points[:, :2] / points[:, 2:]).T
        k1, k2, p1, p2, k3 = self.LENS
        r = x ** 2 + y ** 2
        radial = 1 + k1 * r + k2 * r ** 2 + k3 * r ** 3
        return np.column_stack([
            420 * (x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x)) + 355,
            420 * (y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y) + 250])

    def sample(self, num_pairs, seed):
        random = np.random.default_rng(seed)
        pixels, E = ([], []), []
        for _ in range(num_pairs):
            R, t = exponential(random.normal(0, 0.05, 3)), random.normal(0, 0.2, 3)
            points = random.uniform((-4, -2.5, 2), (4, 2.5, 5), (300, 3))
            both = points, points @ R.T + t
            near = np.all([(np.abs(p[:, :2]) < np.array([0.9, 0.6]) * p[:, 2:]).all(axis=1)
                           for p in both], axis=0)
            for view, p in zip(pixels, both):
                view.append(self.seen(p[near]) + random.normal(0, 0.2, (near.sum(), 2)))
            E.append(np.repeat(lens.essential(R, t)[None], near.sum(), axis=0))
        wrong = random.uniform(size=sum(map(len, E))) < 0.1
        pixels = [np.concatenate(view) for view in pixels]
        pixels[1][wrong] += random.normal(0, 50, (wrong.sum(), 2))
        return lens.Sample(*pixels, np.concatenate(E), self.K)

    def test_the_lens_is_found_and_judged_on_other_pairs(self):
        start = (-0.3, 0.09, 0, 0, 0)
        found = lens.fit(self.sample(20, 1), start)
        other = self.sample(20, 2)
        outer = other.outer(0.6)

        def residual(coefficients):
            return np.median(np.abs(other.residuals_px(coefficients)[outer]))

        self.assertLess(residual(self.LENS), 0.25)
        self.assertLess(residual(found), 1.05 * residual(self.LENS))
        self.assertGreater(residual(start), 1.3 * residual(self.LENS))

    def test_a_set_has_the_better_lens_unless_the_file_s_is_asked_for(self):
        for name, coefficients in truth.LENSES.items():
            root = os.path.join(datasets.data_dir(), name)
            if not os.path.isdir(root):
                self.skipTest(f"no {name} in {datasets.data_dir()}")
            data = truth.PosedSet(root)
            image = data.images[0]
            self.assertEqual(tuple(data.view(image)[1][1]), coefficients)
            self.assertNotEqual(tuple(data.view(image, file_lens=True)[1][1]), coefficients)
            kinds = [job[0] for job in belief.plan({name: data}, 6, 3, 1)]
            self.assertEqual((kinds.count("related"), kinds.count("file-lens")), (6, 6))


class TestBelievedPairs(unittest.TestCase):
    """A small fixed sample of real pairs: what "ok" and probability_wrong are worth on it, and that
    the evidence is what the header says."""
    SETS = ("desk_monitors", "strecha_Herz_Jesus_P8")

    @classmethod
    def setUpClass(cls):
        if not os.path.isfile(os.environ.get("TWOVIEW_LIBRARY", DEFAULT_LIBRARY)):
            raise unittest.SkipTest("no library: build build/release")
        missing = set(cls.SETS) - set(truth.posed_sets())
        if missing:
            raise unittest.SkipTest(f"no {', '.join(sorted(missing))} in {datasets.data_dir()}")
        cls.folder = tempfile.TemporaryDirectory()
        with unittest.mock.patch("sys.stderr"):
            cls.rows = belief.run(list(cls.SETS), 56, 24, folder=cls.folder.name,
                                  library=os.environ.get("TWOVIEW_LIBRARY"))
        cls.posed = [r for r in cls.rows if r["t"] is not None]

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def matches(self, row):
        file, i = row["matches"]
        with np.load(os.path.join(self.folder.name, file)) as arrays:
            return {key: arrays[f"{key}_{i}"]
                    for key in ("links", "keypoints0", "keypoints1", "inliers")}

    def test_ok_is_right_and_right_is_ok(self):
        related = belief_tables.related(self.rows)
        good = belief_tables.ok(related)
        right = [r for r in related if r["right"]]
        self.assertEqual([r["image0"] for r in good if r["wrong_rotation"]], [])
        self.assertGreater(len(right), 40)
        self.assertGreaterEqual(len(belief_tables.ok(right)), 0.9 * len(right))

    def test_unrelated_pictures_are_not_believed(self):
        unrelated = [r for r in self.rows if r["kind"] == "unrelated"]
        self.assertEqual(len(unrelated), 24)
        self.assertEqual({r["verdict"] for r in unrelated}, {"refused"})
        self.assertEqual({r["probability_wrong"] for r in unrelated}, {1.0})

    def test_the_probability_is_the_model_of_the_evidence(self):
        model = model_of_the_library()
        for r in self.posed:
            p = belief_fit.probabilities(np.array([belief_fit.parts_of(r)]), model)[0]
            # 0.5 at least where tv_reconstruct found that the pictures match better mirrored, or
            # that another place looks the same
            if {"low_inlier_ratio", "repeated_structure"} & set(r["reasons"]) and \
                    r["probability_wrong"] == 0.5:
                p = max(p, 0.5)
            self.assertAlmostEqual(r["probability_wrong"], p, 12)
            if r["verdict"] == "ok":
                self.assertLessEqual(r["probability_wrong"], belief_fit.MOST_PROBABILITY_WRONG)

    def test_a_doubtful_pose_has_a_reason_besides_its_probability(self):
        for r in self.posed:
            if r["probability_wrong"] <= belief_fit.MOST_PROBABILITY_WRONG:
                continue
            self.assertTrue({"too_few_matches", "low_inlier_ratio", "crowded_matches"}
                            & set(r["reasons"]))

    def test_the_agreement_is_the_weighted_share_of_inliers(self):
        for r in self.posed:
            found = self.matches(r)
            weights = (1 - found["links"]["ratio"].astype(float)) ** 2
            share = weights[found["inliers"]].sum() / weights.sum()
            # The library counts repeated matches once.
            self.assertAlmostEqual(r["agreement"], share, delta=0.02)


class TestRealPairs(unittest.TestCase):
    def sets(self):
        names = truth.posed_sets()
        if not names:
            self.skipTest(f"no data in {datasets.data_dir()}")
        return [truth.PosedSet(os.path.join(datasets.data_dir(), n)) for n in names]

    def test_the_poses_are_those_of_the_pairs_files(self):
        for data in self.sets():
            for (a, b), line in data.lines.items():
                if {a, b} <= set(data.poses):
                    R, t = data.motion(a, b)
                    np.testing.assert_allclose(R, line.R, atol=2e-6)
                    np.testing.assert_allclose(t, line.t, atol=1e-5 * np.linalg.norm(line.t))

    def test_a_row_holds_the_error_of_its_pose(self):
        names = [data.name for data in self.sets()]
        if not os.path.isfile(os.environ.get("TWOVIEW_LIBRARY", DEFAULT_LIBRARY)):
            self.skipTest("no library: build build/release")
        if "strecha_Herz_Jesus_P8" not in names:
            self.skipTest("no strecha_Herz_Jesus_P8")
        with unittest.mock.patch("sys.stderr"):
            rows = belief.run(["strecha_Herz_Jesus_P8"], 6, 2,
                              library=os.environ.get("TWOVIEW_LIBRARY"))
        related = [r for r in rows if r["kind"] == "related"]
        self.assertEqual(len(related), 6)
        self.assertEqual([r["kind"] for r in rows[6:]].count("mirrored"), 2)
        for r in related:
            if r["rotation_error_deg"] is None:
                continue
            R, R_true = (np.reshape(r[key], (3, 3)) for key in ("R", "R_true"))
            cosine = np.clip((np.trace(R @ R_true.T) - 1) / 2, -1, 1)
            self.assertAlmostEqual(r["rotation_error_deg"], math.degrees(math.acos(cosine)), 4)
            self.assertAlmostEqual(r["inlier_share"], r["num_inliers"] / r["num_matches"])
        self.assertTrue(any(r["right"] for r in related))
        json.dumps(related, allow_nan=False)


if __name__ == "__main__":
    unittest.main()
