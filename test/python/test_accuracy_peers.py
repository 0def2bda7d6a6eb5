"""Tests of twoview_tools.accuracy.peers and estimators: the peers get the input that they need."""

import os
import tempfile
import unittest
from unittest import mock

try:
    import cv2
    import numpy as np
except ImportError:
    np = None

if np is not None:
    from twoview_tools.accuracy import datasets, estimators, metrics, peers


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy or cv2: run scripts/bootstrap test")


def texture(seed, size=160):
    noise = np.random.default_rng(seed).uniform(0, 255, (size, size)).astype(np.float32)
    return cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 2.0), None, 0, 255,
                         cv2.NORM_MINMAX).astype(np.uint8)


class TestFrontEnd(unittest.TestCase):
    def test_orientation_runs_clockwise_from_x(self):
        ramp = np.tile(np.arange(64, dtype=np.uint8) * 3, (64, 1))  # grey levels rise to the right
        for turns, degrees in ((0, 0), (1, 270), (2, 180), (3, 90)):
            gray = np.ascontiguousarray(np.rot90(ramp, turns))
            (_, found), = peers.orientations(gray, np.array([[32.0, 32.0]]), 5)
            self.assertAlmostEqual(abs((found - degrees + 180) % 360 - 180), 0.0, delta=0.5)

    def test_an_oriented_descriptor_survives_a_quarter_turn_and_an_upright_one_does_not(self):
        gray = texture(11)
        turned = np.ascontiguousarray(np.rot90(gray))  # (x, y) moves to (y, width - 1 - x)
        shares = {}
        for orientation in ("upright", "gradient"):
            config = {**peers.FAST, "orientation": orientation}
            (p0, d0), (p1, d1) = (peers.extract(g, config) for g in (gray, turned))
            i0, i1, _ = peers.match(d0, d1)
            where = np.column_stack([p0[i0, 1], gray.shape[1] - 1 - p0[i0, 0]])
            right = np.hypot(*(p1[i1] - where).T) < 1.5
            shares[orientation] = np.count_nonzero(right) / len(p0)
        self.assertGreater(shares["gradient"], 0.4)
        self.assertLess(shares["upright"], 0.02)

    def test_affine_views_match_a_wall_from_the_side_better_than_one_view(self):
        wall = texture(12)
        side = cv2.resize(cv2.GaussianBlur(wall, (0, 0), sigmaX=1.3, sigmaY=0.01),
                          (wall.shape[1] // 3, wall.shape[0]), interpolation=cv2.INTER_AREA)
        right = {}
        for config in (peers.SIFT, {**peers.ASIFT, "cap": 2000}):
            (p0, d0), (p1, d1) = (peers.extract(g, config) for g in (wall, side))
            self.assertLessEqual(len(p0), 2048)
            i0, i1, _ = peers.match(d0, d1)
            away = p1[i1] * [3, 1] + [1, 0] - p0[i0]
            right[config["front"]] = np.count_nonzero(np.hypot(*away.T) < 4)
        self.assertGreater(right["asift"], 3 * max(right["sift"], 3))

    def test_keeps_the_cap_and_the_strongest(self):
        points = np.array([[x, y] for y in range(0, 100) for x in range(0, 100)], float)
        scores = np.random.default_rng(2).permutation(len(points)).astype(float)
        kept = peers._strongest(points, scores, 0, (100, 100))
        self.assertEqual(len(kept), peers.CAP)
        self.assertEqual(set(scores[kept]), set(range(len(points) - peers.CAP, len(points))))

    def test_a_grid_spreads_what_is_kept(self):
        points = np.array([[x, y] for y in range(0, 128) for x in range(0, 128)], float)
        scores = np.where(points[:, 0] < 64, 100.0, 1.0)  # the left half has the stronger corners
        share = lambda grid: np.mean(
            points[peers._strongest(points, scores, grid, (128, 128))][:, 0] < 64)
        self.assertEqual(share(0), 1.0)
        self.assertEqual(share(64), 0.5)

    def test_matching_is_mutual_and_obeys_the_ratio(self):
        random = np.random.default_rng(3)
        d0 = random.integers(0, 20, (40, 128)).astype(np.float32)
        d1 = np.concatenate([d0[:10] + 1, random.integers(0, 20, (30, 128))]).astype(np.float32)
        d1 = np.concatenate([d1, d1[:1]])  # a second copy of row 0 makes its match ambiguous
        i0, i1, ratios = peers.match(d0, d1)
        self.assertEqual(list(i0), list(range(1, 10)))
        self.assertEqual(list(i1), list(range(1, 10)))
        self.assertTrue((ratios < peers.RATIO).all())


    def test_colmaps_matches_at_any_ratio_are_those_of_its_own_matcher(self):
        try:
            estimators.module_version("pycolmap")
        except ImportError:
            self.skipTest("no pycolmap")
        gray = texture(9, 240)
        other = cv2.addWeighted(np.roll(gray, 5, axis=1), 0.7, texture(10, 240), 0.3, 0)
        f0, f1 = (peers.extract(g, peers.COLMAP)[1] for g in (gray, other))
        index0, index1, ratios = peers.match_angles(f0, f1)
        counts = []
        for ratio in (0.7, 0.8, 0.9):
            i0, i1, _ = peers.match_pycolmap(f0, f1, ratio)
            keep = ratios < ratio
            self.assertEqual(set(zip(index0[keep], index1[keep])), set(zip(i0, i1)))
            counts.append(len(i0))
        self.assertTrue(20 < counts[0] < counts[1] < counts[2], counts)


class TestEstimators(unittest.TestCase):
    def test_every_installed_peer_finds_an_exact_pose_through_two_lenses(self):
        random = np.random.default_rng(4)
        points = random.uniform([-2, -1.5, 4], [2, 1.5, 8], (300, 3))
        R, _ = cv2.Rodrigues(np.array([0.05, -0.1, 0.02]))
        t = np.array([-0.8, 0.1, 0.2])
        cameras = ((np.array([[500.0, 0, 320], [0, 505, 240], [0, 0, 1]]),
                    [-0.1, 0.02, 0.001, -0.002, 0.0]),
                   (np.array([[450.0, 0, 300], [0, 452, 250], [0, 0, 1]]),
                    [-0.2, 0.05, 0.0, 0.001, 0.0]))
        zero = np.zeros(3)
        pixels0 = cv2.projectPoints(points, zero, zero, cameras[0][0],
                                    np.array(cameras[0][1]))[0].reshape(-1, 2)
        pixels1 = cv2.projectPoints(points, cv2.Rodrigues(R)[0], t, cameras[1][0],
                                    np.array(cameras[1][1]))[0].reshape(-1, 2)
        pixels1[::5] = random.uniform([0, 0], [640, 480], (60, 2))
        matches = estimators.Matches(pixels0, pixels1, cameras, ((640, 480), (640, 480)))
        ran = 0
        for kind, (name, module, _) in estimators.PEERS.items():
            try:
                estimators.module_version(module)
            except ImportError:
                continue
            found = estimators.run_peer(kind, matches, 1.0, 1)
            self.assertIsNotNone(found, name)
            error = metrics.pose_error(found[0], found[1], R, t)
            self.assertLess(error["pose_error_deg"], 0.1, name)
            self.assertLess(error["translation_error_signed_deg"], 0.1, name)
            self.assertGreaterEqual(found[2], 235, name)
            ran += 1
        self.assertGreaterEqual(ran, 3)

    def test_too_few_matches_is_a_failure(self):
        cameras = ((np.diag([500.0, 500, 1]), [0.0] * 5),) * 2
        matches = estimators.Matches(np.zeros((4, 2)), np.zeros((4, 2)), cameras,
                                     ((640, 480),) * 2)
        self.assertIsNone(estimators.run_peer("magsac", matches))


class TestCache(unittest.TestCase):
    def test_a_second_run_reads_what_the_first_wrote(self):
        with tempfile.TemporaryDirectory() as folder:
            images = os.path.join(folder, "images")
            os.mkdir(images)
            gray = texture(5)
            cv2.imwrite(os.path.join(images, "a.png"), gray)
            cv2.imwrite(os.path.join(images, "b.png"), np.roll(gray, 4, axis=1))
            K = "200 0 80 0 200 80 0 0 1"
            with open(os.path.join(folder, "pairs.txt"), "w", encoding="utf-8") as f:
                f.write(f"a.png b.png 0 0 {K} {K} 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1\n")
            kept, peers.CACHE_DIR = peers.CACHE_DIR, os.path.join(folder, "cache")
            self.addCleanup(setattr, peers, "CACHE_DIR", kept)
            peer = peers.Peer({**peers.FAST, "estimator": "magsac"}, num_seeds=2)
            first = peer.run(datasets.Set(folder))
            self.assertEqual(len(first), 2)
            original = peers.extract
            self.addCleanup(setattr, peers, "extract", original)
            peers.extract = None  # calling None would fail, so the result must come from the cache
            self.assertEqual(peer.run(datasets.Set(folder)), first)
            cv2.imwrite(os.path.join(images, "b.png"), np.roll(gray, 5, axis=1))
            with self.assertRaises(TypeError):  # a changed image is not in the cache
                peer.run(datasets.Set(folder))


class TestBestOptions(unittest.TestCase):
    def test_every_combination_is_tried_and_the_usual_one_is_among_them(self):
        options = peers.options_of("poselib", True)
        self.assertEqual(len(options), 2 * len(peers.RATIOS) * len(peers.THRESHOLDS_PX))
        usual, = peers.options_of("poselib", False)
        self.assertEqual(options.count(usual), 1)
        self.assertEqual(usual, ({**peers.SIFT, "estimator": "poselib"}, 0.8, 1.0))
        self.assertEqual(peers.options_of("colmap", False, 4096)[0][0]["cap"], 4096)

    def test_the_best_is_chosen_over_both_groups_alike(self):
        rows = lambda error: [{"seed": 0, "pose_error_deg": error}]
        found = [{"kitti00_turn": rows(1.0), "pc_room": rows(9.0), "tankard": rows(9.0)},
                 {"kitti00_turn": rows(6.0), "pc_room": rows(6.0), "tankard": rows(6.0)},
                 {"kitti00_turn": rows(1.0), "pc_room": rows(8.0), "tankard": rows(8.0)}]
        best, scores = peers.best_options(["a", "b", "c"], found)
        self.assertEqual(best, 2)
        self.assertEqual(len(scores), 3)

    def test_features_and_matches_are_shared_and_a_ratio_is_a_cut(self):
        K = np.array([[200.0, 0, 80], [0, 200, 80], [0, 0, 1]])
        gray = texture(7)
        grays = {"a": gray, "b": np.roll(gray, 4, axis=1)}
        data = mock.Mock()
        data.gray = lambda name: (grays[name], 1.0, 1.0)
        data.camera = lambda pair, side: (K, [0.0] * 5)
        pair = mock.Mock(text="a b", name0="a", name1="b")
        config = {**peers.FAST, "estimator": "magsac"}
        shared, calls = {}, []
        for name in ("extract", "match"):
            function = getattr(peers, name)
            patch = mock.patch.object(peers, name, side_effect=lambda *a, f=function, n=name:
                                      calls.append(n) or f(*a))
            patch.start()
            self.addCleanup(patch.stop)
        found = {ratio: peers.Peer(config, ratio=ratio).matches(data, pair, shared)[0]
                 for ratio in (0.9, 0.6)}
        self.assertEqual(calls, ["extract", "extract", "match"])
        for ratio, matches in found.items():
            i0, i1, _ = peers.match(*(peers.extract(g, config)[1] for g in grays.values()), ratio)
            self.assertEqual(len(matches), len(i0))
        self.assertLess(len(found[0.6]), len(found[0.9]))


if __name__ == "__main__":
    unittest.main()
