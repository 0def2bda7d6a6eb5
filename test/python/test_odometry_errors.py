"""The errors of trajectories: against evo, against errors that were made by hand, and readers."""
import importlib.util
import os
import tempfile
import unittest

import numpy as np

from twoview_tools import ply
from twoview_tools.odometry import alignment, covariance, errors, poses, surfaces
from twoview_tools.odometry.errors import FrameState

HAS_EVO = importlib.util.find_spec("evo") is not None


def turn(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def random_path(random, count=120, segments=None):
    """A smooth path of some metres with turning attitudes, 30 Hz."""
    phases = random.uniform(0, 6, (3, 2))
    s = np.linspace(0, 4, count)
    positions = np.stack([np.sin(s * random.uniform(0.5, 2) + a) + 0.4 * np.cos(3 * s + b)
                          for a, b in phases], 1)
    axis = random.normal(size=3)
    return poses.Trajectory(10 + np.arange(count) / 30, positions,
                            np.stack([turn(axis, a) for a in 0.7 * s]), segments)


def noisy(random, truth, position_sigma, angle_sigma):
    turns = np.stack([turn(random.normal(size=3), angle)
                      for angle in random.normal(0, angle_sigma, len(truth))])
    return poses.Trajectory(
        truth.times, truth.positions + random.normal(0, position_sigma, (len(truth), 3)),
        truth.rotations @ turns, truth.segments)


def similar(random, truth):
    """The truth in another frame and unit: what a perfect monocular odometry gives."""
    scale, R, t = random.uniform(0.2, 4), turn(random.normal(size=3), 1.2), random.normal(size=3)
    return truth.moved((scale, R, t)), scale


def all_tracking(truth):
    return {round(float(time), 6): FrameState("tracking") for time in truth.times}


@unittest.skipUnless(HAS_EVO, "no evo: run scripts/bootstrap test")
class Evo(unittest.TestCase):
    """The same figures as evo 1.38.1 (M. Grupp)."""

    def trajectories(self, seed):
        random = np.random.default_rng(seed)
        truth = random_path(random)
        estimate, _ = similar(random, noisy(random, truth, 0.02, 0.01))
        estimate.times = estimate.times + random.uniform(-0.004, 0.004, len(truth))
        kept = np.sort(random.choice(len(truth), 90, replace=False))
        return estimate[kept], truth

    @staticmethod
    def as_evo(path):
        from evo.core.trajectory import PoseTrajectory3D
        q = poses.quaternions_of(path.rotations)
        return PoseTrajectory3D(path.positions.copy(), q[:, [3, 0, 1, 2]], path.times.copy())

    def test_a_similarity_is_evos(self):
        from evo.core.geometry import umeyama_alignment
        for seed in range(20):
            random = np.random.default_rng(seed)
            x, y = random.normal(size=(2, 30, 3))
            for with_scale in (True, False):
                R, t, c = umeyama_alignment(x.T, y.T, with_scale)
                scale, ours, shift = alignment.umeyama(x, y, with_scale)
                np.testing.assert_allclose(scale, c, rtol=1e-12)
                np.testing.assert_allclose(ours, R, atol=1e-12)
                np.testing.assert_allclose(shift, t, atol=1e-12)

    def test_ate_and_rpe_are_evos(self):
        from evo.core import metrics, sync
        for seed in range(10):
            estimate, truth = self.trajectories(seed)
            ours = errors.ate(estimate, truth)
            reference, theirs = sync.associate_trajectories(self.as_evo(truth),
                                                            self.as_evo(estimate))
            self.assertEqual(ours["num_compared"], theirs.num_poses)
            _, _, scale = theirs.align(reference, correct_scale=True)
            self.assertAlmostEqual(1 / scale, ours["scale_ratio"], 10)
            ape = metrics.APE(metrics.PoseRelation.translation_part)
            ape.process_data((reference, theirs))
            self.assertAlmostEqual(ape.get_statistic(metrics.StatisticsType.rmse),
                                   ours["ate_rmse"], 10)
            for relation, name in ((metrics.PoseRelation.translation_part, "rpe_translation_rmse"),
                                   (metrics.PoseRelation.rotation_angle_deg, "rpe_rotation_deg")):
                rpe = metrics.RPE(relation, 1, metrics.Unit.frames)
                rpe.process_data((reference, theirs))
                self.assertAlmostEqual(rpe.get_statistic(metrics.StatisticsType.rmse), ours[name],
                                       6)

    def test_a_straight_path_is_evos_after_the_same_formula(self):
        # evo refuses a line: its positions leave the rotation about the line open. A path that is
        # bent by a micrometre is accepted, and must give nearly the same error.
        from evo.core.geometry import GeometryException, umeyama_alignment
        random = np.random.default_rng(4)
        truth = np.outer(np.arange(50.0), [0.15, 0, 0])
        estimate = 0.5 * truth + np.outer(random.normal(0, 0.01, 50), [1, 0, 0])
        with self.assertRaises(GeometryException):
            umeyama_alignment(estimate.T, truth.T, True)
        scale, R, t = alignment.umeyama(estimate, truth)
        line = errors.rms(np.linalg.norm(scale * estimate @ R.T + t - truth, axis=1))
        bend = 1e-6 * np.sin(np.arange(50))[:, None] * np.array([[0, 1, 0]])
        R, t, c = umeyama_alignment((estimate + 0.5 * bend).T, (truth + bend).T, True)
        bent = errors.rms(np.linalg.norm(c * (estimate + 0.5 * bend) @ R.T + t - truth - bend,
                                         axis=1))
        self.assertAlmostEqual(line, bent, 6)
        self.assertAlmostEqual(np.linalg.det(alignment.umeyama(estimate, truth)[1]), 1, 12)


class MadeByHand(unittest.TestCase):
    def test_a_similar_path_has_no_error_and_its_scale(self):
        random = np.random.default_rng(1)
        truth = random_path(random)
        estimate, scale = similar(random, truth)
        found = errors.ate(estimate, truth, 240)
        self.assertLess(found["ate_rmse"], 1e-12)
        self.assertLess(found["rpe_rotation_deg"], 1e-6)
        self.assertAlmostEqual(found["scale_ratio"], scale, 9)
        self.assertAlmostEqual(found["coverage"], 0.5)
        self.assertLess(found["loop_end_percent"], 1e-9)

    def test_a_known_error_is_found(self):
        # A square whose corners are moved along the diagonals by +d and -d in turn: the best
        # similarity is the identity, and each error is d.
        corners = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.0]])
        moved = corners * np.array([1.1, 0.9, 1.1, 0.9])[:, None]
        I = np.tile(np.eye(3), (4, 1, 1))
        found = errors.ate(poses.Trajectory(range(4), moved, I),
                           poses.Trajectory(range(4), corners, I))
        self.assertAlmostEqual(found["scale_ratio"], (1.1 ** 2 + 0.9 ** 2) / 2, 12)
        # A mirrored path does not fit: a similarity has no reflection.
        mirrored = random_path(np.random.default_rng(2))
        flipped = poses.Trajectory(mirrored.times, mirrored.positions * [1, 1, -1],
                                   mirrored.rotations)
        self.assertGreater(errors.ate(flipped, mirrored)["ate_rmse"], 0.05)

    def test_ate_of_isotropic_noise_is_its_size(self):
        random = np.random.default_rng(3)
        truth = random_path(random, 3000)
        found = errors.ate(noisy(random, truth, 0.01, 0.0), truth)
        self.assertAlmostEqual(found["ate_rmse"], 0.01 * np.sqrt(3), delta=6e-4)  # 4.6 sigmas

    def test_only_the_longest_segment_counts(self):
        random = np.random.default_rng(5)
        truth = random_path(random)
        estimate = poses.Trajectory(truth.times, truth.positions.copy(), truth.rotations,
                                    [0] * 40 + [1] * 80)
        estimate.positions[:40] += 5
        found = errors.ate(estimate, truth, 120)
        self.assertEqual(found["segment"], 1)
        self.assertAlmostEqual(found["coverage"], 80 / 120)
        self.assertLess(found["ate_rmse"], 1e-12)

    def test_a_gap_at_the_end_of_a_loop_is_found(self):
        angles = np.linspace(0, 2 * np.pi, 200)
        circle = np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
        I = np.tile(np.eye(3), (200, 1, 1))
        drift = np.outer(np.linspace(0, 0.05, 200), [0, 0, 1])
        truth = poses.Trajectory(np.arange(200) / 30, circle, I)
        found = errors.ate(poses.Trajectory(truth.times, circle + drift, I), truth)
        self.assertAlmostEqual(found["loop_end_percent"], 100 * 0.05 / truth.path_length(),
                               delta=0.05)

    def test_too_few_poses_have_no_error(self):
        truth = random_path(np.random.default_rng(6))
        self.assertIsNone(errors.ate(truth[:2], truth, 120)["ate_rmse"])
        self.assertIsNone(errors.ate(truth[:0], truth, 120)["ate_rmse"])


class SilentErrors(unittest.TestCase):
    def setUp(self):
        self.random = np.random.default_rng(7)
        self.truth = random_path(self.random, 300)
        self.estimate = noisy(self.random, self.truth, 0.002, 0.002)
        self.states = all_tracking(self.truth)

    def found(self, **options):
        return errors.silent_errors(self.estimate, self.truth, self.states, **options)

    def test_a_good_path_is_not_wrong(self):
        found = self.found()
        self.assertEqual((found["num_wrong"], found["unflagged_jumps"]), (0, 0))
        self.assertEqual(found["num_compared"], 300)

    def test_a_step_of_the_position_is_wrong_and_a_jump(self):
        self.estimate.positions[150:] += 0.6 * self.truth.path_length()
        found = self.found()
        self.assertGreater(found["num_wrong"], 100)
        self.assertGreaterEqual(found["unflagged_jumps"], 1)

    def test_a_flag_makes_a_jump_a_flagged_one(self):
        self.estimate.positions[150:] += 0.6 * self.truth.path_length()
        key = round(float(self.truth.times[150]), 6)
        self.states[key] = FrameState("tracking", "loop_closed")
        found = self.found()
        self.assertEqual((found["unflagged_jumps"], found["flagged_jumps"]), (0, 1))

    def test_a_turned_attitude_is_wrong_and_weak_is_not_silent(self):
        self.estimate.rotations[290:] = self.estimate.rotations[290:] @ turn([0, 1, 0], 0.12)
        self.assertEqual(self.found()["num_wrong"], 10)
        for time in self.truth.times[290:]:
            self.states[round(float(time), 6)] = FrameState("weak")
        self.assertEqual(self.found()["num_wrong"], 0)

    def test_the_truths_own_error_is_allowed(self):
        self.estimate.rotations[290:] = self.estimate.rotations[290:] @ turn([0, 1, 0], 0.1)
        self.assertEqual(self.found(sigma=(0, 0.5))["num_wrong"], 0)

    def test_a_pose_in_another_place_is_wrong_unless_its_segment_is_its_own(self):
        interval = (self.truth.times[100], self.truth.times[119])
        self.assertEqual(self.found(elsewhere=[interval])["num_wrong"], 20)
        self.estimate.segments[100:120] = 1
        self.assertEqual(self.found(elsewhere=[interval])["num_wrong"], 0)

    def test_segments_are_compared_on_their_own(self):
        self.estimate.segments[150:] = 1
        self.estimate.positions[150:] = 3 * self.estimate.positions[150:] + 7
        self.assertEqual(self.found()["num_wrong"], 0)


class Covariances(unittest.TestCase):
    def test_the_ellipsoid_holds_95_percent_of_its_own_errors(self):
        random = np.random.default_rng(8)
        A = random.normal(size=(6, 6)) * np.array([.001, .001, .001, .02, .02, .02])[:, None]
        matrix = A @ A.T
        factor = np.linalg.cholesky(matrix)
        items = []
        for _ in range(3000):
            R, t = turn(random.normal(size=3), random.uniform(0, 2)), random.normal(size=3)
            error = factor @ random.normal(size=6)
            dR = turn(error[:3], np.linalg.norm(error[:3]))
            items.append((matrix, (R, t), (dR @ R, dR @ t + error[3:])))
        share, count = covariance.coverage(items)
        self.assertEqual(count, 3000)
        self.assertAlmostEqual(share, 0.95, delta=0.015)
        share, _ = covariance.coverage([(matrix / 4, *item[1:]) for item in items])
        self.assertLess(share, 0.6)

    def test_keyframes_are_joined_by_their_times_and_scaled(self):
        random = np.random.default_rng(9)
        truth = random_path(random)
        keyframes = truth[::10]
        half = poses.Trajectory(keyframes.times, keyframes.positions / 2, keyframes.rotations)
        rows = [(a, b, np.diag([1e-6] * 6))
                for a, b in zip(keyframes.times[:-1], keyframes.times[1:])]
        self.assertEqual(covariance.of_keyframes(rows, half, truth, 2.0), (1.0, len(rows)))
        self.assertEqual(covariance.of_keyframes(rows, half, truth, 1.0)[0], 0.0)

    def test_logarithms_of_small_and_large_turns(self):
        for angle in (0, 1e-9, 0.3, 3.1, np.pi):
            axis = np.array([0.6, 0, 0.8])
            np.testing.assert_allclose(covariance.logarithm(turn(axis, angle)), axis * angle,
                                       atol=1e-7)


class Surfaces(unittest.TestCase):
    boxes = [{"centre": [0, 0, -1.5], "half": [4, 3, 1.5], "yaw_rad": 0.3, "is_room": True},
             {"centre": [1, 1, -0.5], "half": [0.5, 0.2, 0.5], "yaw_rad": -0.7, "is_room": False}]

    def test_points_on_sides_have_no_distance_and_others_their_own(self):
        random = np.random.default_rng(10)
        for box in self.boxes:
            c, s = np.cos(box["yaw_rad"]), np.sin(box["yaw_rad"])
            local = random.uniform(-1, 1, (60, 3)) * box["half"]
            axis = random.integers(0, 3, 60)
            local[np.arange(60), axis] = np.array(box["half"])[axis]
            points = local @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + box["centre"]
            self.assertLess(surfaces.distances(self.boxes, points).max(), 1e-12)
        away = surfaces.distances(self.boxes, [[0, 0, -2.9], [0, 0, 0.2], [1, 1, -0.5]])
        np.testing.assert_allclose(away, [0.1, 0.2, 0.2], atol=1e-12)

    def test_a_map_of_noisy_points_has_the_noises_median(self):
        random = np.random.default_rng(11)
        points = np.column_stack([random.uniform(-2, 2, (2000, 2)), random.normal(0, 0.05, 2000)])
        points[:100, 2] = -1.3
        found = surfaces.map_accuracy([self.boxes[0]], points)
        self.assertAlmostEqual(found["median_percent"], 100 * 0.6745 * 0.05 / 8, delta=0.05)
        self.assertAlmostEqual(found["outlier_percent"], 5, delta=0.2)

    def test_both_forms_of_a_cloud_are_read(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "cloud.ply")
            header = ("ply\nformat {}\ncomment x\nelement vertex 2\nproperty float x\n"
                      "property float y\nproperty float z\nproperty uchar red\nend_header\n")
            rows = np.array([(1, 2, 3, 4), (5, 6, 7, 8)],
                            [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1")])
            with open(path, "wb") as file:
                file.write(header.format("binary_little_endian 1.0").encode() + rows.tobytes())
            self.assertEqual(ply.read_ply(path)["z"].tolist(), [3, 7])
            with open(path, "w", encoding="utf-8") as file:
                file.write(header.format("ascii 1.0") + "1 2 3 4\n5 6 7 8\n")
            self.assertEqual(ply.read_ply(path)["red"].tolist(), [4, 8])
            first = "element edge 1\nproperty float x\nelement vertex"
            with open(path, "w", encoding="utf-8") as file:
                file.write(header.format("ascii 1.0").replace("element vertex", first) +
                           "9\n1 2 3 4\n5 6 7 8\n")
            with self.assertRaisesRegex(ValueError, "its points are not first, but 'edge'"):
                ply.read_ply(path)

    def test_a_mesh_is_read_whole_or_not_at_all(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "room.ply")
            vertices = np.arange(9, dtype="<f4").reshape(3, 3)
            whole = (b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
                     b"property float y\nproperty float z\nelement face 2\n"
                     b"property list uchar int vertex_indices\nend_header\n" + vertices.tobytes() +
                     b"".join(b"\3" + np.array(t, "<i4").tobytes() for t in ((0, 1, 2), (2, 1, 0))))
            with open(path, "wb") as file:
                file.write(whole)
            read, triangles = ply.read_mesh(path)
            self.assertEqual(read["y"].tolist(), [1, 4, 7])
            self.assertEqual(triangles.tolist(), [[0, 1, 2], [2, 1, 0]])
            with open(path, "wb") as file:
                file.write(whole[:-1])
            with self.assertRaisesRegex(ValueError, "not 2 triangles"):
                ply.read_mesh(path)


class Readers(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = os.path.join(self.folder.name, "poses.txt")
        self.truth = random_path(np.random.default_rng(12), 20, [0] * 12 + [3] * 8)

    def write(self, text):
        with open(self.path, "w", encoding="utf-8") as file:
            file.write(text)

    def assert_same(self, found, segments=True):
        np.testing.assert_allclose(found.times, self.truth.times, atol=1e-8)
        np.testing.assert_allclose(found.positions, self.truth.positions, atol=1e-9)
        np.testing.assert_allclose(found.rotations, self.truth.rotations, atol=1e-9)
        if segments:
            self.assertEqual(found.segments.tolist(), self.truth.segments.tolist())

    def test_tum_is_read_back_with_its_segments(self):
        poses.write_tum(self.path, self.truth)
        self.assert_same(poses.read_poses(self.path))

    def test_a_comment_that_names_the_columns_gives_their_order(self):
        poses.write_tum(self.path, self.truth)
        with open(self.path, encoding="utf-8") as file:
            lines = [line.split() for line in file if not line.startswith("#")]
        for names in ("# timestamp tx ty tz qw qx qy qz", "#time [s], x [m], y [m], z [m], q_w, "
                      "q_x, q_y, q_z", "# qw first, as timestamp tx ty tz qw qx qy qz"):
            self.write(names + "\n" + "".join(
                " ".join((*line[:4], line[7], *line[4:7])) + "\n" for line in lines))
            if "first" in names:  # a sentence is no list of names
                self.assertGreater(abs(poses.read_poses(self.path).rotations
                                       - self.truth.rotations).max(), 0.1)
            else:
                self.assert_same(poses.read_poses(self.path), segments=False)

    def test_euroc_is_the_bodys_path_moved_to_the_camera(self):
        body_from_cam = np.eye(4)
        body_from_cam[:3, :3], body_from_cam[:3, 3] = turn([1, 2, 3], 1.0), [0.1, -0.2, 0.3]
        R = self.truth.rotations @ body_from_cam[:3, :3].T
        t = self.truth.positions - R @ body_from_cam[:3, 3]
        q = poses.quaternions_of(R)
        self.write("#timestamp, p_x ...\n" + "".join(
            f"{round(time * 1e9):019d}," + ",".join(
                f"{v:.15g}" for v in (*p, r[3], *r[:3], 0.1, 0.2)) + "\n"
            for time, p, r in zip(self.truth.times, t, q)))
        self.assert_same(poses.read_poses(self.path, body_from_cam=body_from_cam), segments=False)

    def test_kitti_takes_its_times_from_elsewhere(self):
        self.write("".join(" ".join(f"{v:.15g}" for v in np.column_stack([R, p]).ravel()) + "\n"
                           for R, p in zip(self.truth.rotations, self.truth.positions)))
        self.assert_same(poses.read_poses(self.path, times=self.truth.times), segments=False)
        with self.assertRaisesRegex(poses.PoseError, "20 poses, and 19 times"):
            poses.read_poses(self.path, times=self.truth.times[1:])

    def test_bad_lines_are_named(self):
        for text, message in (("0 1 2 3 0 0 0 0\n", "line 1: not time"),
                              ("0 1 2 3 0 0 0 1\n1 2 3\n", "line 2: not time"),
                              ("0 1 2 nan 0 0 0 1\n", "line 1: a number is not finite"),
                              ("0 1 2 x 0 0 0 1\n", "line 1: not a list of numbers"),
                              ("1 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n", "times do not increase")):
            self.write(text)
            with self.assertRaisesRegex(poses.PoseError, message):
                poses.read_tum(self.path)
        self.write("# nothing was tracked\n")
        self.assertEqual(len(poses.read_tum(self.path)), 0)


if __name__ == "__main__":
    unittest.main()
