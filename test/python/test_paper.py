"""Tests of twoview_tools.paper: the numbers behind the figures, compared with independent
references. scripts/paper also makes the drone's flights, which take long; this test makes
everything else."""

import contextlib
import io
import json
import os
import pathlib
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("TWOVIEW_PROGRAM", "")
BUILD = pathlib.Path(PROGRAM).parent.parent if PROGRAM else ROOT / "build" / "release"
os.environ.setdefault("TWOVIEW_LIBRARY", str(BUILD / "lib" / "libtwoview.so"))

try:
    import cv2
    import jinja2  # noqa: F401  (needed to write the page)
    import matplotlib  # noqa: F401  (needed to draw the figures)
    import numpy as np
    from skimage.feature import corner_fast
except ImportError as missing:
    raise unittest.SkipTest(f"{missing}: run scripts/bootstrap test")

from twoview_tools.paper import calibration, cloud, corners, descriptor, experiment, inputs, motion
from twoview_tools.paper import cli as paper
from twoview_tools.paper import ransac, triangulation


def setUpModule():
    if not inputs.MOTORCYCLE.is_dir():
        raise unittest.SkipTest("no Motorcycle pair: run scripts/bootstrap")
    if not os.path.exists(os.environ["TWOVIEW_LIBRARY"]):
        raise unittest.SkipTest(f"no {os.environ['TWOVIEW_LIBRARY']}: build it first")


class Case(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.given = inputs.from_environment(BUILD, scratch.name)
        cls.pair = cls.given.motorcycle


class Figures1bAnd4(Case):
    def setUp(self):
        try:
            self.folder = calibration.ARDRONE.calibrated(self.given)
        except experiment.Missing as missing:
            self.skipTest(str(missing))
        self.found = inputs.read_json(self.folder / "calibration.json")

    def test_the_error_is_opencvs_of_the_same_camera(self):
        i = self.found["intrinsics"]
        K = np.array([[i["fx"], 0, i["cx"]], [0, i["fy"], i["cy"]], [0, 0, 1]])
        k = np.array([i[name] for name in ("k1", "k2", "p1", "p2", "k3")])
        # The board's corners computed independently: row by row, 8 in a row.
        board = np.array([(x * 0.02485, y * 0.02485, 0) for y in range(6) for x in range(8)])
        squares = []
        for view in self.found["views"]:
            turn = cv2.Rodrigues(np.reshape(view["R"], (3, 3)))[0]
            seen = cv2.projectPoints(board, turn, np.array(view["t"]), K, k)[0][:, 0]
            squares.append(((seen - view["corners"]) ** 2).sum(axis=1))
        ours = calibration.figure4(self.given).numbers["rms_px"]
        self.assertAlmostEqual(np.sqrt(np.mean(squares)), ours, delta=1e-5)
        self.assertTrue(0.1 < ours < 0.36, ours)

    def test_undistortion_straightens_the_board(self):
        for title, off in calibration.figure1b(self.given).numbers["off_straight_px"].items():
            self.assertLess(off["undistorted"], 0.75 * off["raw"], title)

    def test_straightness_is_the_distance_from_a_line(self):
        grid = np.array([(x, y) for y in range(3) for x in range(3)], float)
        self.assertAlmostEqual(calibration.straightness(grid, (3, 3)), 0)
        # The middle corner moves along its column: its row deviates by 0.1 0.2 0.1 from a line.
        grid[4] += (0, 0.3)
        self.assertAlmostEqual(
            calibration.straightness(grid, (3, 3)), np.sqrt(0.06 / 18), delta=1e-3
        )


class Figures5And6(Case):
    def test_the_circle_is_the_pixels_at_a_rounded_distance_of_three(self):
        reach = range(-4, 5)
        self.assertEqual({(x, y) for x in reach for y in reach if round(np.hypot(x, y)) == 3},
                         {tuple(p) for p in corners.CIRCLE.tolist()})
        turns = np.diff(np.unwrap(np.arctan2(corners.CIRCLE[:, 1], corners.CIRCLE[:, 0])))
        # The circle runs clockwise in the image (y is down), so each angle is positive.
        self.assertTrue((turns > 0).all() and (turns < 0.5).all())

    def test_the_drawn_corner_is_one_up_to_its_score(self):
        numbers = corners.figure5(self.given).numbers
        image = self.pair.grey[0]
        x, y = numbers["x"], numbers["y"]

        def passes(t):
            circle = [int(image[y + dy, x + dx]) for dx, dy in corners.CIRCLE.tolist()] * 2
            p = int(image[y, x])
            return any(
                all(v > p + t for v in circle[s : s + 12])
                or all(v < p - t for v in circle[s : s + 12])
                for s in range(16)
            )
        self.assertTrue(passes(numbers["score"]))
        self.assertFalse(passes(numbers["score"] + 1))
        self.assertEqual(numbers["score"], numbers["library_score"])
        self.assertGreaterEqual(numbers["arc_length"], 12)

    def test_counts_are_scikit_images_and_opencvs(self):
        image = self.pair.grey[0]
        counted = corners.count(image)["arcs"]
        # scikit-image compares floats; half a grey level is added to the threshold, since the
        # differences are integers.
        reference = corner_fast(image.astype(float), n=12, threshold=corners.THRESHOLD + 0.5)
        self.assertEqual(int((reference > 0).sum()), counted["12"]["segment_test"])
        opencv = cv2.FastFeatureDetector_create(corners.THRESHOLD, nonmaxSuppression=True).detect(
            image
        )
        self.assertEqual(len(opencv), counted["9"]["library"])
        for arc, entry in counted.items():
            self.assertTrue(entry["library_equals_definition"], arc)


class Figure7(Case):
    def test_the_drawn_histograms_are_the_librarys_bytes(self):
        image = self.pair.grey[0]
        keypoints, described = descriptor.described_keypoints(image, 150)
        for kind, off in descriptor.differences(image, keypoints, described).items():
            self.assertLessEqual(np.median(off), 1, kind)
            # 8 of 255 grey levels may differ: a weight of 0.5 becomes 127, and sums are truncated.
            self.assertLessEqual(np.percentile(off, 99), 8, kind)
            own = described[kind] + 0.0
            cosine = (own * (own - off)).sum() / (np.linalg.norm(own) * np.linalg.norm(own - off))
            self.assertGreater(cosine, 0.99, kind)

    def test_figure_5s_corner_is_among_them(self):
        image = self.pair.grey[0]
        keypoints, _ = descriptor.described_keypoints(image, 500)
        corner, found = corners.example_corner(image), descriptor.example(image, keypoints)
        self.assertEqual([keypoints[found][axis] for axis in ("x", "y")],
                         [corner["x"], corner["y"]])

    def test_a_ramp_to_the_right_is_direction_0_and_one_upwards_direction_2(self):
        ramp = np.tile(np.arange(16.0), (16, 1))
        for samples, direction in ((ramp, 0), (ramp.T[::-1], 2), (ramp[:, ::-1], 4), (ramp.T, 6)):
            found = descriptor.histograms(samples).sum(axis=(0, 1))
            self.assertEqual(int(found.argmax()), direction)
            self.assertLess(found.sum() - found.max(), 1e-9)


class Figure8(Case):
    def test_as_many_are_found_as_the_noise_lets(self):
        runs = [ransac.line_run(seed) for seed in range(60)]
        expected = 300 * 0.98758  # 98.758 per cent of normal errors are below 2.5 sigma
        self.assertAlmostEqual(np.mean([r["right"] for r in runs]), expected, delta=2.0)
        for run in runs:
            # The best fit to those 300 points that are known to belong to the line.
            x = run["points"][run["truth"]]
            direction = np.linalg.eigh(np.cov(x.T))[1][:, 1]
            across = np.array([-direction[1], direction[0]])
            oracle = int((np.abs((x - x.mean(axis=0)) @ across) < 2.5).sum())
            self.assertLessEqual(abs(run["right"] - oracle), 8)
            # By chance, 1 to 2 per cent of the 200 wrong points lie this near to the line.
            self.assertLessEqual(run["wrong"], 15)
            self.assertEqual(int(run["found"].sum()), run["right"] + run["wrong"])
            self.assertEqual(int(run["truth"].sum()), 300)


class Figure9(Case):
    def test_inliers_are_right_by_the_rectified_pairs_own_rows(self):
        pixels0, pixels1, ratios = ransac.matches_of(self.pair)
        level = np.abs(pixels0[:, 1] - pixels1[:, 1]) < 2
        self.assertLessEqual(
            int(ransac.true_matches(self.pair, pixels0, pixels1).sum()), int(level.sum())
        )
        estimates = ransac.estimates(self.pair, pixels0, pixels1, ratios)
        for name, (inliers, _) in estimates.items():
            self.assertGreater((inliers & level).sum() / inliers.sum(), 0.97, name)
            self.assertGreater((inliers & level).sum() / level.sum(), 0.85, name)


class Figures14And15(Case):
    def test_the_sideways_pair_has_its_epipoles_far_away(self):
        numbers = motion.reconstructed(self.pair).numbers
        self.assertLess(numbers["rotation_error_deg"], 0.05)
        self.assertLess(numbers["translation_error_deg"], 1)
        self.assertGreater(numbers["motion_off_axis_deg"], 89)
        for x, y in numbers["epipoles_px"]:
            self.assertGreater(np.hypot(x, y), 10000)

    def test_an_epipole_is_where_the_other_camera_is_seen(self):
        pair, *_ = triangulation.scene("forward")
        self.assertLess(
            np.abs(motion.epipole(pair.cameras[0].K, [0, 0, 1]) - (319.5, 239.5)).max(), 1e-9
        )
        null = np.linalg.svd(pair.true_F)[2][-1]  # the epipole e0 of image 0, since F e0 = 0
        center1 = -pair.R.T @ pair.t
        self.assertLess(
            np.abs(null[:2] / null[2] - motion.epipole(pair.cameras[0].K, center1)).max(), 1e-6
        )

    def test_a_drones_step_to_the_right_is_the_cameras_x(self):
        # A state of the drone: number, seconds, place x y z, quaternion x y z w, velocity x y z.
        level = [0, 0, 0, 0, -1, 0, 0, 0, 1, 0, 0, 0]
        right = [1, 1, 0, 2, -1, 0, 0, 0, 1, 0, 0, 0]
        R, t = motion.true_motion([np.array(level, float), np.array(right, float)])
        self.assertTrue(np.allclose(R, np.eye(3)) and np.allclose(t, [-2, 0, 0]))
        half = np.sqrt(0.5)  # after a turn by 90 degrees clockwise, the former right is ahead
        turned = [1, 1, 0, 0, -1, 0, 0, half, half, 0, 0, 0]
        R, t = motion.true_motion([np.array(level, float), np.array(turned, float)])
        self.assertTrue(np.allclose(R @ [1, 0, 0], [0, 0, 1]) and np.allclose(t, 0))


class Figure13(Case):
    def setUp(self):
        self.scene, _, *self.pixels = triangulation.scene("forward", num=300)
        self.points, self.weights = triangulation.iterative_ls(self.scene, *self.pixels)

    def test_each_weight_is_one_over_the_last_rounds_depth(self):
        self.assertTrue((self.weights[0] == 1).all())
        for before, weights in zip(self.points, self.weights[1:]):
            # The depth of X in each view is p3 . X, where p3 is the last row of K [R t].
            depths = before[:, 2], (before @ self.scene.R.T + self.scene.t)[:, 2]
            for view in (0, 1):
                self.assertLess(np.abs(weights[:, view] * depths[view] - 1).max(), 1e-9)

    def test_each_round_solves_its_normal_equations(self):
        K = self.scene.cameras[0].K
        P = [K @ np.eye(3, 4), K @ np.column_stack([self.scene.R, self.scene.t])]
        for points, weights in zip(self.points, self.weights):
            for i in range(0, 300, 29):
                rows = np.array([weights[i, v] * (self.pixels[v][i, k] * P[v][2] - P[v][k])
                                 for v in (0, 1) for k in (0, 1)])
                gradient = rows[:, :3].T @ (rows @ np.append(points[i], 1))
                self.assertLess(np.abs(gradient).max(), 1e-6 * np.abs(rows).max() ** 2)

    def test_the_error_falls_and_ends_at_the_librarys(self):
        numbers = triangulation.weights_study(self.scene, *self.pixels)[0]
        rms = np.array(numbers["rms_px"])
        self.assertLess(rms[1], 0.999 * rms[0])
        self.assertTrue((np.diff(rms) <= 1e-4 * rms[0]).all(), rms)
        self.assertAlmostEqual(rms[-1], numbers["library_rms_px"], delta=1e-5)
        self.assertLess(numbers["library_difference_p99"], 1e-8)


class Table1(Case):
    def test_linear_eigen_is_numpys_and_opencvs(self):
        for kind in ("sideways", "forward", "converging"):
            scene, _, *pixels = triangulation.scene(kind, num=200)
            ours = triangulation.ours("Linear-Eigen", scene, *pixels)["position"]
            for reference in (
                triangulation.dlt(scene, *pixels),
                triangulation.opencv(scene, *pixels),
            ):
                off = np.linalg.norm(ours - reference, axis=1) / np.linalg.norm(reference, axis=1)
                self.assertLess(np.percentile(off, 99), 1e-7, kind)

    def test_errors_are_those_of_opencvs_projection(self):
        scene, truth, *pixels = triangulation.scene("converging", num=200)
        positions = triangulation.dlt(scene, *pixels)
        told = triangulation.accuracy(scene, truth, positions, *pixels)
        turn = cv2.Rodrigues(scene.R)[0]
        squares = [
            ((cv2.projectPoints(positions, r, t, scene.cameras[0].K, None)[0][:, 0] - p) ** 2).sum(
                axis=1
            )
            for r, t, p in ((np.zeros(3), np.zeros(3), pixels[0]), (turn, scene.t, pixels[1]))
        ]
        self.assertAlmostEqual(told["rms_px"], np.sqrt(np.mean(squares)), delta=1e-9)
        percent = [
            100 * np.sqrt(((p - x) ** 2).sum() / (x**2).sum()) for p, x in zip(positions, truth)
        ]
        self.assertAlmostEqual(told["percent_median"], np.median(percent), delta=1e-9)

    def test_the_lens_of_the_times_distorts_nothing(self):
        scene, _, *pixels = triangulation.scene("forward", num=100)
        lensed = triangulation.through_a_lens(scene)
        for method in triangulation.METHODS:
            plain, seen = (
                triangulation.ours(method, s, *pixels)["error_px"] for s in (scene, lensed)
            )
            self.assertLess(np.abs(plain - seen).max(), 1e-4, method)

    def test_poly_has_the_least_pixel_error(self):
        errors = triangulation.errors_table({k: triangulation.scene(k, num=300)
                                             for k in ("sideways", "forward", "converging")})
        for kind, methods in errors.items():
            for name, entry in methods.items():
                self.assertLessEqual(
                    methods["Poly"]["rms_px"], entry["rms_px"] * (1 + 1e-9), (kind, name)
                )


class Figure16(Case):
    def test_depth_errors_are_those_of_the_disparity_map(self):
        numbers = cloud.figure16(self.given).numbers
        with np.load(inputs.MOTORCYCLE / "motorcycle_disp.npz") as archive:
            disparity = archive[archive.files[0]]
        stages, pixels, _ = cloud.reconstructed(self.pair, "default")
        points = stages["before"][2]
        errors = []
        for point, (x, y) in zip(points, pixels[0]):
            d = float(disparity[round(y), round(x)])
            if np.isfinite(d) and point["status"] == 0:
                depth = 994.978 * 0.193001 / (d + 342.279 - 311.193)
                errors.append(abs(100 * (point["position"][2] * 0.193001 / depth - 1)))
        told = numbers["default"]["before"]
        self.assertAlmostEqual(told["depth_error_median_percent"], np.median(errors), delta=1e-6)
        self.assertLess(told["depth_error_median_percent"], 1)
        # Bundle adjustment corrects a pose that nobody refined; its depths may be right by chance.
        unrefined = numbers["unrefined"]
        for key in ("rotation_error_deg", "reprojection_rms_px"):
            before, adjusted = (unrefined[stage][key] for stage in ("before", "adjusted, 0.2 px"))
            self.assertLess(adjusted, before / 2, key)


class Page(Case):
    def run_paper(self, *words):
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
            status = paper.main(["-o", folder, "--build", str(BUILD), *words])
            text = pathlib.Path(folder, "paper.html").read_text(encoding="utf-8")
            with open(os.path.join(folder, "paper.json"), encoding="utf-8") as f:
                return status, text, json.load(f), sorted(os.listdir(folder))

    def test_it_holds_its_pictures_and_needs_no_network(self):
        status, text, told, files = self.run_paper("--only", "figure5,figure8,table1")
        self.assertEqual(status, 0)
        self.assertEqual(text.count('src="data:image/'), 3)
        self.assertNotIn("http", text.replace("http-equiv", ""))
        self.assertEqual(set(told["experiments"]), {"figure5", "figure8", "table1"})
        self.assertEqual(told["experiments"]["figure8"]["inliers"], 300)
        self.assertEqual(files, ["paper.html", "paper.json"])

    def test_missing_data_is_told_and_the_rest_is_made(self):
        data = os.environ.get("TWOVIEW_DATA")
        os.environ["TWOVIEW_DATA"] = "/nowhere"
        try:
            status, text, told, _ = self.run_paper("--only", "figure5,figure13")
            partly = self.run_paper("--only", "figure9")
        finally:
            os.environ.pop("TWOVIEW_DATA")
            if data is not None:
                os.environ["TWOVIEW_DATA"] = data
        self.assertEqual(status, 1)
        self.assertIn("kitti00_turn", told["experiments"]["figure13"]["problem"])
        self.assertIn("Not made", text)
        self.assertEqual(text.count('src="data:image/'), 1)
        self.assertEqual(partly[0], 1)
        self.assertIn("Without", partly[1])
        self.assertIn("tum_fr3_office", partly[2]["experiments"]["figure9"]["missing"][0])

    def test_an_experiment_that_fails_leaves_the_others_alone(self):
        def failing(_inputs):
            raise RuntimeError("broken on purpose")
        broken = experiment.Experiment("broken", "Section", "Title", "", "", failing)
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            outcome = paper.run(broken, self.given)
        self.assertIn("broken on purpose", outcome["problem"])
        self.assertFalse(paper.is_whole(outcome))

    def test_an_unknown_name_is_refused_in_a_line(self):
        with self.assertRaises(SystemExit) as refused:
            paper.main(["--only", "figure99"])
        self.assertIn("no experiment figure99", str(refused.exception.code))

    def test_every_experiment_of_the_paper_is_there(self):
        self.assertEqual(
            [e.id for e in paper.experiments()],
            [
                "figure1b",
                "figure4",
                "figure5",
                "figure6",
                "figure7",
                "figure8",
                "figure9",
                "figure13",
                "table1",
                "figure14",
                "figure15",
                "figure16",
            ],
        )


if __name__ == "__main__":
    unittest.main()
