"""Tests of twoview_tools.accuracy.identical and system_python: thresholds, verdicts, the cache, and
the subprocess that runs the system's Python."""

import tempfile
import unittest
from unittest import mock

try:
    import cv2
    import numpy as np
except ImportError:
    np = None

if np is not None:
    from twoview_tools.accuracy import estimators, identical, metrics, peers, system_python


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy or cv2: run scripts/bootstrap test")


def rows(errors, num_seeds=1):
    return [{"seed": s, "pose_error_deg": e, "rotation_error_deg": e / 2,
             "translation_error_deg": e} for e in errors for s in range(num_seeds)]


def scene(seed=4, count=300):
    random = np.random.default_rng(seed)
    points = random.uniform([-2, -1.5, 4], [2, 1.5, 8], (count, 3))
    R, _ = cv2.Rodrigues(np.array([0.05, -0.1, 0.02]))
    t = np.array([-0.8, 0.1, 0.2]) / np.linalg.norm([-0.8, 0.1, 0.2])
    K = np.array([[500.0, 0, 320], [0, 505, 240], [0, 0, 1]])
    pixels = []
    for view in (points, points @ R.T + t):
        image = view @ K.T
        pixels.append(image[:, :2] / image[:, 2:])
    pixels[1][::5] = random.uniform([0, 0], [640, 480], (len(pixels[1][::5]), 2))
    matches = estimators.Matches(*pixels, ((K, [0.0] * 5),) * 2, ((640, 480),) * 2)
    return matches, R, t


class TestVerdicts(unittest.TestCase):
    def test_the_best_threshold_is_chosen_over_all_sets_together(self):
        by_threshold = {0.5: {"a": rows([1.0] * 4), "b": rows([9.0] * 4)},
                        1.0: {"a": rows([2.0] * 4), "b": rows([3.0] * 4)},
                        2.0: {"a": rows([15.0] * 4), "b": rows([1.0] * 4)}}
        self.assertEqual(identical.best_threshold(by_threshold), 1.0)

    def test_a_lower_mean_or_a_worse_set_is_not_reached(self):
        random = np.random.default_rng(5)
        base = random.uniform(1, 4, 20)
        good, bad = {"a": rows(base), "b": rows(base)}, {"a": rows(base + 2), "b": rows(base + 2)}
        reached, _ = identical.judge(good, {"PoseLib": bad}, "PoseLib", 200)
        self.assertEqual(len(reached), 3 + 2 + 2)  # sentences: 3 of means, 2 of sets, 2 of medians
        self.assertTrue(all(r for r, _ in reached))
        failed, _ = identical.judge(bad, {"PoseLib": good}, "PoseLib", 200)
        self.assertFalse(any(r for r, _ in failed))
        mixed, _ = identical.judge(good, {"worse": bad, "better": {"a": rows(base - 0.9),
                                                                   "b": rows(base + 3)}}, None, 200)
        sentences = {text.split(":")[0]: ok for ok, text in mixed}
        self.assertFalse(sentences["a"])  # the best peer on set a beats ours
        self.assertTrue(sentences["b"])

    def test_small_sets_do_not_count_by_themselves(self):
        found, _ = identical.judge({"a": rows([9.0] * 5)}, {"peer": {"a": rows([1.0] * 5)}}, None,
                                   100)
        self.assertEqual(len(found), 3)


class TestRows(unittest.TestCase):
    def test_a_second_run_reads_what_the_first_wrote_and_only_that(self):
        matches, R, t = scene()
        pair = mock.Mock(R=R, t=t, name0="a", name1="b")
        data = mock.Mock(pairs=[pair])
        data.name = "scene"
        system = identical.Estimator("magsac", cv2.__version__, system=False)
        with tempfile.TemporaryDirectory() as folder, \
                mock.patch.object(peers, "CACHE_DIR", folder):
            first = identical.peer_rows(system, data, [(matches, {})], [1.0], 2)
            self.assertEqual([r["seed"] for r in first[1.0]], [0, 1])
            self.assertLess(first[1.0][0]["pose_error_deg"], 0.1)
            with mock.patch.object(system, "run", side_effect=AssertionError("ran")):
                self.assertEqual(identical.peer_rows(system, data, [(matches, {})], [1.0], 2),
                                 first)
                with self.assertRaises(AssertionError):
                    identical.peer_rows(system, data, [(matches, {})], [2.0], 2)
                other, _, _ = scene(seed=6)
                with self.assertRaises(AssertionError):
                    identical.peer_rows(system, data, [(other, {})], [1.0], 2)

    def test_what_the_systems_python_has_is_run_there(self):
        have = system_python.versions()
        if not have:
            self.skipTest("the system's Python has neither python3-opencv nor python3-opengv")
        matches, R, t = scene()
        few = estimators.Matches(np.zeros((4, 2)), np.zeros((4, 2)), matches.cameras,
                                 matches.sizes)
        for kind, (name, module, _) in estimators.PEERS.items():
            if module not in have:
                continue
            found, nothing = system_python.run(kind, [matches, few], 1.0, 2)
            self.assertEqual(len(found), 2)
            for R_found, t_found, inliers, ms in found:
                error = metrics.pose_error(R_found, t_found, R, t)
                self.assertLess(error["pose_error_deg"], 0.5, name)
                self.assertLess(error["translation_error_signed_deg"], 0.5, name)
                self.assertGreaterEqual(inliers, 200, name)
                self.assertGreater(ms, 0)
            self.assertIsNone(nothing[0][0])

    def test_an_absent_peer_is_named(self):
        with mock.patch.object(system_python, "versions", return_value={}):
            _, absent = identical.available(["opengv_refined", "magsac"])
        self.assertTrue(any("python3-opengv" in line for line in absent))
        self.assertTrue(any("python3-opencv" in line for line in absent))


if __name__ == "__main__":
    unittest.main()
