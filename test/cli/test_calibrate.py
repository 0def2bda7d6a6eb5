#!/usr/bin/env python3
"""Tests of twoview calibrate: real boards, boards rendered with known cameras, and input that is
refused."""
import json
import os
import sys
import time
import unittest
import unittest.mock
from pathlib import Path

import cli_support as cli

try:
    import cv2
    import numpy as np

    import boards
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(cli.SKIP_CODE)

SHARED = Path(__file__).resolve().parents[2].parent / "shared"
DATA = Path(os.environ.get("TWOVIEW_DATA") or SHARED / "data")
DRONE_DATA = Path(os.environ.get("TWOVIEW_ARDRONE_FIXTURES") or SHARED / "ardrone/fixtures")
OPENCV_BOARDS = DATA / "chessboard_opencv"
DRONE_BOARDS = DRONE_DATA / "chessboard_ardrone1"
FILES = ["calibration.json", "camera.yaml", "camera_info.yaml", "coverage.png", "detections.png",
         "residuals.png"]


class CalibrateTest(cli.CliTest):
    def calibrate(self, *arguments, board="9x6", out=None, **options):
        options.setdefault("timeout", 120)
        return self.run_program("calibrate", *arguments, "--board", board, "-o", out or self.out,
                                **options)

    def calibrated(self, *arguments, out=None, **options):
        self.succeed(self.calibrate(*arguments, "--quiet", out=out, **options))
        return json.loads(((out or self.out) / "calibration.json").read_text())


def status_of(result):
    return {view["name"]: view["status"] for view in result["views"]}


def camera_of(result):
    i = result["intrinsics"]
    names = [n for n in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6") if n in i]
    return boards.matrix([i[n] for n in ("fx", "fy", "cx", "cy")]), np.array([i[n] for n in names])


def corners_of(view):
    return np.array(view["corners"], np.float32).reshape(-1, 1, 2)


class RealBoards(CalibrateTest):
    def images_of(self, folder, pattern):
        images = sorted(folder.glob(pattern))
        if not images:
            self.skipTest(f"no {folder}/{pattern}")
        return images

    def test_opencvs_boards_and_the_pose_between_its_cameras(self):
        results = {}
        for side in ("left", "right"):
            images = self.images_of(OPENCV_BOARDS / "images", f"{side}*.jpg")
            self.assertEqual(len(images), 13)
            result = self.calibrated(*images, "--square", "0.025", out=self.folder / side)
            self.assertEqual(self.listing(self.folder / side), FILES)
            self.assertLessEqual(result["rms_px"], 0.22)
            self.assertEqual(set(status_of(result).values()), {"used"})
            results[side] = result
        points = [(boards.board_points() / boards.SQUARE * 0.025).astype(np.float32)] * 13
        seen = [[corners_of(view) for view in results[side]["views"]] for side in results]
        (K0, k0), (K1, k1) = (camera_of(results[side]) for side in ("left", "right"))
        rms, *_, R, t, _, _ = cv2.stereoCalibrate(points, *seen, K0, k0, K1, k1, (640, 480),
                                                  flags=cv2.CALIB_FIX_INTRINSIC)
        self.assertLess(rms, 0.25)
        lines = (OPENCV_BOARDS / "stereo_left_to_right.txt").read_text().splitlines()
        truth = np.array(
            " ".join(l for l in lines if not l.startswith("#")).split(), float
        ).reshape(4, 4)
        turn = np.degrees(np.linalg.norm(cv2.Rodrigues(R @ truth[:3, :3].T)[0]))
        self.assertLess(turn, 0.3)
        self.assertLess(
            np.linalg.norm(t.ravel() - truth[:3, 3]), 0.01 * np.linalg.norm(truth[:3, 3])
        )
        # Each view's pose is metric, so two poses give the baseline without stereoCalibrate.
        lengths = []
        for a, b in zip(results["left"]["views"], results["right"]["views"]):
            turned = np.array(b["R"]).reshape(3, 3) @ np.array(a["R"]).reshape(3, 3).T
            lengths.append(np.linalg.norm(np.array(b["t"]) - turned @ np.array(a["t"])))
        self.assertAlmostEqual(np.median(lengths) / np.linalg.norm(truth[:3, 3]), 1, delta=0.03)

    def test_the_ar_drones_boards(self):
        images = self.images_of(DRONE_BOARDS, "image_*.png")
        result = self.calibrated(*images, board="8x6")
        self.assertEqual(result["num_views"], 11)
        self.assertLessEqual(result["rms_px"], 0.36)

    def test_the_numbers_agree_with_opencvs_own(self):
        images = self.images_of(OPENCV_BOARDS / "images", "left*.jpg")
        result = self.calibrated(*images)
        points = [(boards.board_points() / boards.SQUARE).astype(np.float32)] * len(images)
        seen = [corners_of(view) for view in result["views"]]
        rms, K, k, _, _, sigma, _, errors = cv2.calibrateCameraExtended(
            points, seen, (640, 480), None, None
        )
        self.assertAlmostEqual(result["rms_px"], rms, delta=1e-4)
        ours_K, ours_k = camera_of(result)
        np.testing.assert_allclose(ours_K, K, atol=0.02)
        np.testing.assert_allclose(list(result["sigma"].values()), sigma.ravel()[:9], rtol=0.02)
        np.testing.assert_allclose(
            [view["rms_px"] for view in result["views"]], errors.ravel(), atol=1e-3
        )
        # twoview reads both files that calibrate wrote, and they give undistort the same result.
        for name in ("camera.yaml", "camera_info.yaml"):
            self.succeed(self.run_program("undistort", images[0], "--camera", self.out / name, "-o",
                                          self.folder / name[:-5]))
        a, b = ((self.folder / n / "left01.png").read_bytes() for n in ("camera", "camera_info"))
        self.assertEqual(a, b)
        file = cv2.FileStorage(str(self.out / "camera.yaml"), cv2.FILE_STORAGE_READ)
        np.testing.assert_array_equal(file.getNode("camera_matrix").mat(), ours_K)


    def changed(self, images, change):
        """Writes the pictures, those that `change` has a function for changed; their names."""
        for i, image in enumerate(images):
            picture = cv2.imread(str(image), cv2.IMREAD_GRAYSCALE)
            cv2.imwrite(str(self.folder / f"l{i:02}.png"), change.get(i, np.array)(picture))
        return [f"l{i:02}.png" for i in range(len(images))]

    def test_a_half_of_other_pictures_is_refused_and_named(self):
        images = self.images_of(OPENCV_BOARDS / "images", "left*.jpg")
        kinds = {
            "turned": lambda p: p[::-1, ::-1],
            "zoomed": lambda p: cv2.resize(p[24:456, 32:608], (640, 480)),
        }
        for kind, change in kinds.items():
            with self.subTest(kind=kind):
                names = self.changed(images, {i: change for i in range(1, 13, 2)})
                self.assert_refused(
                    self.calibrate(*names), "6 of 13 views contradict the others",
                    "l01.png, l03.png, l05.png, l07.png, l09.png, l11.png", "is that of neither")

    def test_a_few_mirrored_pictures_are_left_out_and_named(self):
        images = self.images_of(OPENCV_BOARDS / "images", "left*.jpg")
        names = self.changed(images, {i: lambda p: p[:, ::-1] for i in (2, 6, 11)})
        result = self.calibrated(*names)
        outliers = [n for n, status in status_of(result).items() if status == "outlier"]
        self.assertEqual(outliers, ["l02.png", "l06.png", "l11.png"])
        self.assertEqual([w["name"] for w in result["warnings"]][:1], ["contradicting_views"])
        seen = [corners_of(v) for v in result["views"] if v["status"] == "used"]
        points = [(boards.board_points() / boards.SQUARE).astype(np.float32)] * len(seen)
        _, K, *_ = cv2.calibrateCamera(points, seen, (640, 480), None, None)
        np.testing.assert_allclose(camera_of(result)[0], K, atol=0.02)


class KnownCameras(CalibrateTest):
    def check_lens(self, lens, seed, model=None):
        model = model or lens[0]
        rng = np.random.default_rng(seed)
        rays = boards.ray_table(lens)
        truth = boards.poses(lens, 25, rng)
        images = []
        for i, (R, t) in enumerate(truth):
            images.append(self.folder / f"board{i:02}.png")
            cv2.imwrite(str(images[-1]), boards.render(rays, R, t, rng))
        result = self.calibrated(*images[:20], "--model", model, "--square", boards.SQUARE)
        held = self.calibrated(*images[20:], "--model", model, out=self.folder / "held")
        print(
            {
                n: (round(result["intrinsics"][n], 2), round(s, 3))
                for n, s in result["sigma"].items()
            },
            f"rms {result['rms_px']:.3f} coverage {result['coverage']:.2f}",
            [w["name"] for w in result["warnings"]],
            file=sys.stderr,
        )
        self.assertGreaterEqual(result["num_views"], 18, status_of(result))
        for name, value in zip(("fx", "fy"), lens[1]):
            self.assertAlmostEqual(result["intrinsics"][name] / value, 1, delta=0.003)
        for name, value in zip(("fx", "fy", "cx", "cy"), lens[1]):
            self.assertLess(abs(result["intrinsics"][name] - value), 4 * result["sigma"][name])
        K, k = camera_of(result)
        estimated = (lens[0], (K[0, 0], K[1, 1], K[0, 2], K[1, 2]), k)
        noise, left = 0.0, 0.0
        for view, (R, t) in zip(held["views"], truth[20:]):
            self.assertTrue(view["corners"], view["status"])
            seen = corners_of(view).reshape(-1, 2)
            exact = boards.project(lens, R, t, boards.board_points())
            if np.linalg.norm(seen[0] - exact[0]) > 5:
                exact = exact[::-1]
            noise += np.square(seen - exact).sum()
            left += np.square(seen - self.refitted(estimated, R, t, seen, exact)).sum()
        print(f"held out: {np.sqrt(left / noise):.3f} of the noise, "
              f"{np.sqrt(noise / 5 / 54):.3f} px", file=sys.stderr)
        self.assertLess(np.sqrt(left / noise), 1.1)
        return result

    def refitted(self, lens, R, t, seen, exact):
        """The board's corners projected with the lens `lens`, the board's pose fitted to the pixels
        `seen` by Gauss-Newton from the pose R, t."""
        points = boards.board_points()
        if np.linalg.norm(boards.project(lens, R, t, points)[0] - seen[0]) > 30:
            points = points[::-1]
        pose = np.r_[cv2.Rodrigues(R)[0].ravel(), t]
        at = lambda p: boards.project(lens, cv2.Rodrigues(p[:3])[0], p[3:], points).ravel()
        for _ in range(10):
            here = at(pose)
            J = np.stack([(at(pose + d) - here) / 1e-6 for d in 1e-6 * np.eye(6)], 1)
            pose = pose + np.linalg.lstsq(J, seen.ravel() - here, rcond=None)[0]
        return at(pose).reshape(-1, 2)

    def test_a_mild_lens(self):
        self.check_lens(boards.MILD, 1)

    def test_a_wide_brown_conrady_lens(self):
        self.check_lens(boards.WIDE, 2)

    def test_a_wide_lens_with_eight_coefficients(self):
        result = self.check_lens(boards.RATIONAL, 5, "rational")
        self.assertTrue(all(f"k{n}" in result["intrinsics"] for n in range(1, 7)))
        self.assertIn("cols: 8", (self.out / "camera.yaml").read_text())

    def test_a_kannala_brandt_lens(self):
        self.check_lens(boards.FISHEYE, 3)


class Views(CalibrateTest):
    """Tests of views that calibrate leaves out, and of its warnings."""

    lens = boards.MILD

    @classmethod
    def setUpClass(cls):
        rng = np.random.default_rng(4)
        cls.poses = boards.poses(cls.lens, 8, rng)
        cls.rays = boards.ray_table(cls.lens)
        cls.images = [boards.render(cls.rays, R, t, rng) for R, t in cls.poses]

    def setUp(self):
        super().setUp()
        self.names = [self.save(f"view{i}.png", image) for i, image in enumerate(self.images)]

    def save(self, name, image):
        cv2.imwrite(str(self.folder / name), image)
        return name

    def outline(self, i):
        R, t = self.poses[i]
        return boards.project(self.lens, R, t, boards.board_points())

    def test_each_view_that_is_left_out_has_its_reason(self):
        rng = np.random.default_rng(5)
        half = self.images[0].copy()
        x = int(self.outline(0)[:, 0].mean())
        half[:, x:] = 110
        again = np.clip(self.images[1] + rng.normal(0, 3, self.images[1].shape), 0, 255).astype(
            np.uint8
        )
        odd = {
            "half.png": (half, "partial_board"),
            "grey.png": (np.full((480, 640), 128, np.uint8), "no_board"),
            "noise.png": (rng.integers(0, 255, (480, 640), np.uint8), "no_board"),
            "dark.png": (rng.integers(0, 9, (480, 640), np.uint8), "too_dark"),
            "again.png": (again, "duplicate"),
            "blurred.png": (cv2.GaussianBlur(self.images[2], (0, 0), 4.5), "blurred"),
            "moved.png": (cv2.blur(self.images[3], (15, 1)), "blurred"),
        }
        for name, (image, _) in odd.items():
            self.save(name, image)
        found = status_of(self.calibrated(*self.names, *odd))
        self.assertEqual({n: found[n] for n in odd}, {n: reason for n, (_, reason) in odd.items()})
        self.assertEqual({found[n] for n in self.names}, {"used"})

    def test_a_good_set_may_begin_with_parts_of_the_board(self):
        half = self.images[0].copy()
        half[:, int(self.outline(0)[:, 0].mean()):] = 110
        parts = [self.save(f"part{i}.png", half) for i in range(4)]
        result = self.calibrated(*parts, *self.names)
        self.assertEqual(
            status_of(result),
            dict.fromkeys(parts, "partial_board") | dict.fromkeys(self.names, "used"),
        )
        plain = self.calibrated(*self.names, out=self.folder / "plain")
        for name, value in plain["intrinsics"].items():
            self.assertAlmostEqual(
                result["intrinsics"][name], value, delta=0.05 * plain["sigma"][name]
            )

    def test_a_view_far_above_the_others_is_left_out_and_named(self):
        plain = self.calibrated(*self.names)
        x, y = np.meshgrid(np.arange(640, dtype=np.float32), np.arange(480, dtype=np.float32))
        bent = cv2.remap(
            self.images[7], x + 6 * np.sin(y / 60), y + 5 * np.sin(x / 70), cv2.INTER_LINEAR
        )
        self.save(self.names[7], bent)
        result = self.calibrated(*self.names, out=self.folder / "again")
        self.assertEqual(status_of(result)[self.names[7]], "outlier")
        self.assertEqual(result["num_views"], 7)
        self.assertAlmostEqual(result["rms_px"], plain["rms_px"], delta=0.03)

    def test_warnings_name_what_is_weak(self):
        result = self.calibrated(*self.names[:3])
        names = [warning["name"] for warning in result["warnings"]]
        self.assertIn("few_views", names)
        self.assertFalse(result["trusted"])
        rng = np.random.default_rng(6)
        flat = []
        for i, x in enumerate(np.linspace(-0.2, 0.0, 12)):
            R, t = np.eye(3), np.array([x, -0.07 + 0.004 * (i % 3), 0.7])
            flat.append(self.save(f"flat{i}.png", boards.render(self.rays, R, t, rng)))
        result = self.calibrated(*flat, out=self.folder / "flat")
        names = [warning["name"] for warning in result["warnings"]]
        for name in ("poor_coverage", "little_tilt", "uncertain_focal_length"):
            self.assertIn(name, names)
        done = self.succeed(self.calibrate(*flat, "--square", "30", out=self.folder / "words"))
        self.assertIn("little_tilt", done.stdout.decode())
        self.assertIn("squares of 30 m: is --square in metres?", done.stdout.decode())

    def test_the_most_different_views_are_kept(self):
        result = self.calibrated(*self.names, "--max-views", "5")
        self.assertEqual(list(status_of(result).values()).count("surplus"), 3)
        self.assertEqual(result["num_views"], 5)

    def video(self, frames, name="v.avi"):
        writer = cv2.VideoWriter(
            str(self.folder / name), cv2.VideoWriter_fourcc(*"MJPG"), 8, (640, 480)
        )
        if not writer.isOpened():
            self.skipTest("this OpenCV writes no video")
        for frame in frames:
            writer.write(cv2.cvtColor(frame, cv2.COLOR_GRAY2BGR))
        writer.release()
        return self.folder / name

    def test_a_video_gives_what_its_frames_give(self):
        video = self.video([image for image in self.images for _ in range(4)])
        result = self.calibrated("--video", video)
        self.assertEqual(result["num_views"], 8)
        self.assertEqual(list(status_of(result).values()).count("duplicate"), 8)
        self.assertAlmostEqual(result["intrinsics"]["fx"] / self.lens[1][0], 1, delta=0.01)

    # The tests from here on give bad input, which calibrate must refuse.

    def refuse(self, *arguments, words, seconds=30, **options):
        start = time.monotonic()
        done = self.calibrate(*arguments, **options)
        self.assert_refused(done, *words, out=options.get("out"))
        self.assertLess(time.monotonic() - start, seconds)

    def test_no_board_in_any_image(self):
        rng = np.random.default_rng(7)
        names = [
            self.save(f"n{i}.png", rng.integers(0, 255, (480, 640), np.uint8)) for i in range(3)
        ]
        names.append(self.save("dark.png", rng.integers(0, 9, (480, 640), np.uint8)))
        self.refuse(
            *names, words=["no 9x6 board", "4 images", "1 too_dark", "3 no_board", "inner corners"]
        )

    def test_the_wrong_board_size_is_told_the_right_one(self):
        for board in ("8x5", "10x7", "6x5"):
            with self.subTest(board=board):
                self.refuse(self.names[0], board=board, words=[board, "--board 9x6"])
        self.refuse(*self.names, board="8x5", words=["in 8 images", "--board 9x6"])
        self.calibrated(*self.names, board="6x9")

    def test_a_larger_board_in_some_views_is_noted_where_the_others_serve(self):
        rng = np.random.default_rng(11)
        with unittest.mock.patch.object(boards, "INNER", (10, 7)):
            wide = [self.save(f"w{i}.png", boards.render(self.rays, R, 1.4 * t, rng))
                    for i, (R, t) in enumerate(self.poses[:2])]
        done = self.succeed(self.calibrate(*self.names, *wide))
        self.assertIn(b"\nnote         2 views show a board of 10x7 inner corners: "
                      b"is it --board 10x7?\n", done.stdout)
        done = self.succeed(self.calibrate(*self.names, wide[0], "--json"))
        self.assertIn(b"note: 1 view shows a board of 10x7", done.stderr)
        self.assertNotIn(b"note  ", self.succeed(self.calibrate(*self.names)).stdout)

    def test_a_folder_in_place_of_its_pictures(self):
        self.refuse(self.folder, words=["is a folder", f"{self.folder}/*.jpg"])

    def test_images_that_cannot_be_read_or_are_of_another_size_are_left_out(self):
        small = self.save("small.png", cv2.resize(self.images[0], (320, 240)))
        cut = self.write("cut.png", (self.folder / self.names[0]).read_bytes()[:5000])
        hidden = self.write("._0.png", b"\0\5\x16\7")
        given = (small, *self.names, cut, hidden)
        done = self.succeed(self.calibrate(*given))
        text = done.stdout.decode()
        for line in ("small.png  another size: 320x240, most are 640x480",
                     "cut.png    cannot be read: image ", "._0.png    cannot be read: image "):
            self.assertIn(line, text)
        result = json.loads((self.out / "calibration.json").read_text())
        status = {view["name"]: view["status"] for view in result["views"]}
        self.assertEqual([status[name] for name in ("small.png", "cut.png", "._0.png")],
                         ["other_size", "unreadable", "unreadable"])
        alone = self.calibrated(*self.names)
        self.assertEqual(result["intrinsics"], alone["intrinsics"])
        none = self.folder / "none"
        self.refuse(cut, hidden, words=["cut.png is truncated"], out=none)
        self.refuse(*self.names, "absent.png", words=["absent.png", "No such file"], out=none)

    def test_one_view_only(self):
        self.refuse(self.names[0], words=["only 1 different view", "in 1 image:", "at least 3"])
        self.refuse(*self.names[:2], words=["only 2 different views", "at least 3"])

    def test_all_views_alike(self):
        rng = np.random.default_rng(8)
        R, t = self.poses[0]
        names = [
            self.save(f"a{i}.png", boards.render(self.rays, R, t + 0.0002 * i, rng))
            for i in range(5)
        ]
        self.refuse(*names, words=["all 5 views", "alike", "move and tilt"])

    def test_a_video_that_ends_early(self):
        video = self.video([image for image in self.images for _ in range(4)])
        whole = video.read_bytes()
        for share in (0.8, 0.3):
            cut = self.write("cut.avi", whole[: int(len(whole) * share)])
            with self.subTest(share=share):
                self.refuse("--video", cut, words=["cut.avi", "again"])
        self.refuse("--video", self.write("head.avi", whole[:100]), words=["head.avi", "again"])
        few = self.video([self.images[0]] * 6, "few.avi")
        self.refuse("--video", few, words=["alike", "move and tilt"])
        two = self.video([i for i in self.images[:2] for _ in range(4)], "two.avi")
        self.refuse("--video", two, words=["only 2 different views", "ended too soon"])

    def test_no_video_at_all(self):
        self.refuse("--video", "none.avi", words=["none.avi", "No such file"])
        self.refuse("--video", self.write("t.avi", "hello there"), words=["t.avi", "no film"])
        self.refuse("--video", self.folder, words=["not a file"])
        self.refuse("--video", "/dev/video97", words=["/dev/video97", "cannot be opened"])
        self.refuse(words=["either images or --video"])
        self.refuse(self.names[0], "--video", "x.avi", words=["either images or --video"])

    def test_an_output_that_cannot_be_written(self):
        self.write("file", "x")
        self.refuse(*self.names[:4], words=["file"], out=self.folder / "file" / "out")
        if os.geteuid() != 0:
            closed = self.folder / "closed"
            closed.mkdir(mode=0o500)
            self.refuse(*self.names[:4], words=["closed"], out=closed / "out")
        self.refuse(*self.names[:4], words=["proc"], out=Path("/proc/out"))

    def test_bad_arguments(self):
        for board in ("9", "9x", "x6", "9x6x", "2x6", "9x101", "-9x6", "9X6", "0x0", ""):
            self.refuse(self.names[0], board=board, words=["--board"])
        for name in ("--square", "--duration"):
            for value in ("0", "nan", "inf", "1e9"):
                self.refuse(self.names[0], name, value, words=[name])
        self.refuse(self.names[0], "--model", "pinhole", words=["--model"])
        self.refuse(self.names[0], "--max-views", "2", words=["--max-views"])
        self.refuse("none.png", words=["none.png", "No such file"])

    def test_a_hopeless_image_costs_seconds(self):
        # Thousands of dark squares of all sizes, which cost the search for a board the most time.
        rng = np.random.default_rng(9)
        image = rng.integers(0, 4, (1200, 1600), np.uint8)
        for _ in range(6000):
            x, y, s = rng.integers(0, 1600), rng.integers(0, 1200), rng.integers(4, 30)
            cv2.rectangle(image, (x, y), (x + s, y + s), int(rng.integers(0, 25)), -1)
        board = (
            (np.indices((1200, 1600)) // 12).sum(0) % 2 * 12 + rng.integers(0, 6, (1200, 1600))
        ).astype(np.uint8)
        for name, picture in (("squares.png", image), ("tiles.png", board)):
            self.refuse(self.save(name, picture), words=["9x6"], seconds=45)


if __name__ == "__main__":
    cli.main()
