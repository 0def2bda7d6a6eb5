#!/usr/bin/env python3
"""Tests of twoview evaluate: its report, SuperGlue's measures, and data sets with broken
entries."""
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import unittest
from pathlib import Path

import cli_support as cli
from cli_support import FOCAL, HEIGHT, WIDTH

PAIR_KEYS = """name0 name1 rotation_error_deg translation_error_deg translation_error_signed_deg
pose_error_deg num_matches num_inliers precision config verdict effort timings_ms
time_ms""".split()
K = [FOCAL, 0, (WIDTH - 1) / 2, 0, FOCAL, (HEIGHT - 1) / 2, 0, 0, 1]
SIDEWAYS = [1, 0, 0, -1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]


def pair_line(name0="a.png", name1="b.png", K0=None, K1=None, T=None, turns=(0, 0)):
    fields = [name0, name1, *turns, *(K0 or K), *(K1 or K), *(T or SIDEWAYS)]
    return " ".join(str(f) for f in fields) + "\n"


def auc(errors, threshold):
    """The area under the curve as SuperGlue's pose_auc defines it, in per cent; a second
    implementation, to compare evaluate's with."""
    errors = sorted(errors)
    points = [(0.0, 0.0)] + [
        (e, (i + 1) / len(errors)) for i, e in enumerate(errors) if e < threshold
    ]
    points.append((threshold, points[-1][1]))
    area = sum((e1 - e0) * (r0 + r1) / 2 for (e0, r0), (e1, r1) in zip(points, points[1:]))
    return 100 * area / threshold


class Evaluate(cli.CliTest):
    def evaluate(self, text, *more, out=None):
        pairs = self.write("set/pairs.txt", text)
        return self.run_program(
            "evaluate", pairs, "--images", self.folder, "-o", out or self.out, *more
        )

    def report(self, *arguments, **options):
        self.succeed(self.evaluate(*arguments, **options))
        return json.loads((self.out / "report.json").read_text())

    def test_the_report_has_every_key_and_small_errors(self):
        report = self.report("# a comment\n\n" + pair_line())
        for key in "auc auc_signed num_pairs pairs options seed version".split():
            self.assertIn(key, report)
        self.assertEqual(report["num_pairs"], 1)
        pair = report["pairs"][0]
        self.assertEqual([key for key in PAIR_KEYS if key in pair], PAIR_KEYS)
        self.assertLess(pair["pose_error_deg"], 0.5)
        self.assertGreater(pair["precision"], 0.9)
        self.assertEqual((pair["effort"], len(pair["timings_ms"]["rungs"])), (0, 1))
        self.assertEqual(report["options"]["effort"], "auto")
        self.assertEqual(
            pair["pose_error_deg"], max(pair["rotation_error_deg"], pair["translation_error_deg"])
        )
        self.assertGreater(report["auc"]["5"], 90)
        self.assertEqual(pair["reasons"], [])
        self.assertEqual(len(pair["covariance"]), 25)

    def test_verdicts_are_counted_and_their_reasons_told(self):
        lines = pair_line() + pair_line(name1="a.png") + pair_line(name1="none.png")
        done = self.succeed(self.evaluate(lines))
        report = json.loads((self.out / "report.json").read_text())
        self.assertEqual(report["verdict_counts"], {"ok": 1, "doubtful": 0, "refused": 1})
        self.assertEqual([p["reasons"] for p in report["pairs"]], [[], ["no_motion"], None])
        self.assertIsNone(report["pairs"][1]["covariance"])
        self.assertEqual(report["num_unreadable"], 1)
        self.assertIn(b"3 pairs: 1 ok, 0 doubtful, 1 refused, 1 not readable; median pose error",
                      done.stdout)

    def test_a_list_of_which_nothing_can_be_read_is_bad_input(self):
        self.assert_refused(self.evaluate(pair_line("gone.png") + pair_line("off.png")),
                            "none of the 2 pairs", "gone.png", "No such file")

    def test_names_are_printed_whole(self):
        name = "a_sequence_of_pictures_with_a_long_name/left_camera_000017.png"
        self.write(name, self.a.read_bytes())
        done = self.succeed(self.evaluate(pair_line(name) + pair_line()))
        lines = done.stdout.decode().splitlines()
        self.assertTrue(lines[1].startswith(name + " b.png "), lines[1])
        self.assertEqual(lines[0].index("image 1"), lines[2].index("b.png"))

    def test_large_images_are_brought_to_the_same_size_as_by_reconstruct(self):
        self.write("wide.png", cli.png(2049, 48, bytes(2049 * 48)))
        K_wide = [1000, 0, 1024, 0, 1000, 24, 0, 0, 1]
        line = pair_line("wide.png", "wide.png", K_wide, K_wide)
        done = self.succeed(self.evaluate(line, "--json"))
        self.one_line(done, "2049x48 at 1600x37")
        self.assertEqual(json.loads(done.stdout)["options"]["resize"], 1600)

    def test_a_K_of_pictures_of_another_size_is_refused(self):
        for scale in (0.5, 0.75, 2):
            other = [scale * value for value in K[:8]] + [1]
            done = self.evaluate(pair_line(K0=other, K1=other))
            size = f"{scale * (WIDTH - 1) + 1:.0f}x{scale * (HEIGHT - 1) + 1:.0f}"
            self.assert_refused(done, "a.png", "about " + size, f"this one is {WIDTH}x{HEIGHT}",
                                "--scale-camera")
        self.write("set/cameras.yaml", "cam: {fx: %g, fy: %g, cx: %g, cy: %g, image_width: %d, "
                   "image_height: %d}\n" % (FOCAL, FOCAL, K[2], K[5], WIDTH, HEIGHT))
        done = self.evaluate(pair_line(K0=other, K1=other))
        self.assert_refused(done, "a.png", f"fx {2 * FOCAL:g}", f"cameras.yaml has fx {FOCAL:g}")
        self.succeed(self.evaluate(pair_line()))

    def test_a_K_whose_centre_is_exchanged_is_refused(self):
        other = [FOCAL, 0, K[5], 0, FOCAL, K[2], 0, 0, 1]
        done = self.evaluate(pair_line(K1=other))
        self.assert_refused(done, "b.png", "are cx and cy exchanged")

    def test_auc_is_superglues_and_failures_are_infinite(self):
        wrong = lambda deg: [
            math.cos(math.radians(deg)),
            0,
            math.sin(math.radians(deg)),
            -1,
            0,
            1,
            0,
            0,
            -math.sin(math.radians(deg)),
            0,
            math.cos(math.radians(deg)),
            0,
            0,
            0,
            0,
            1,
        ]
        lines = [pair_line()] + [pair_line(T=wrong(deg)) for deg in (3, 7, 7, 15, 40)]
        lines.append(pair_line(name1="gone.png"))
        report = self.report("".join(lines))
        errors = [p["pose_error_deg"] for p in report["pairs"]]
        self.assertIsNone(errors[-1])
        self.assertIn("gone.png", report["pairs"][-1]["error"])
        errors = [math.inf if e is None else e for e in errors]
        self.assertAlmostEqual(errors[1], 3, delta=0.5)
        for threshold in (5, 10, 20):
            self.assertAlmostEqual(
                report["auc"][str(threshold)], auc(errors, threshold), delta=1e-9
            )

    def test_the_sign_of_the_translation_counts_in_auc_signed_only(self):
        backwards = list(SIDEWAYS)
        backwards[3] = 1
        report = self.report(pair_line(T=backwards))
        pair = report["pairs"][0]
        self.assertLess(pair["translation_error_deg"], 0.5)
        self.assertGreater(pair["translation_error_signed_deg"], 179.5)
        self.assertGreater(report["auc"]["20"], 95)
        self.assertEqual(report["auc_signed"]["20"], 0)

    def test_poses_of_the_other_direction_are_named(self):
        backwards = list(SIDEWAYS)
        backwards[3] = 1
        poses = self.write("mine.txt", "a.png b.png 1 0 0 1 0 1 0 0 0 0 1 0\n")
        own = b"most poses of mine fit the inverse"
        listed = b"is its T_0to1 T_1to0?"
        for T, is_own in ((SIDEWAYS, True), (backwards, False)):
            done = self.succeed(self.evaluate(pair_line(T=T), "--poses", poses))
            self.assertEqual((own in done.stdout, listed in done.stdout), (is_own, not is_own))

    def test_a_list_that_the_poses_contradict_or_that_stands_is_named(self):
        ahead, still = list(SIDEWAYS), list(SIDEWAYS)
        ahead[3], ahead[11], still[3] = 0, 1, 0
        done = self.succeed(self.evaluate(3 * pair_line(T=ahead) + 2 * pair_line(T=still)))
        self.assertIn(b"3 of 5 poses that are ok lie more than three of their", done.stdout)
        self.assertIn(b"the true poses of 2 of 5 pairs of ", done.stdout)
        done = self.succeed(self.evaluate(pair_line(T=ahead) + 2 * pair_line()))
        self.assertNotIn(b"note ", done.stdout)

    def test_without_truth_the_errors_are_null(self):
        line = " ".join(pair_line().split()[:22]) + "\n"
        report = self.report(line)
        pair = report["pairs"][0]
        for key in ("rotation_error_deg", "translation_error_deg", "pose_error_deg", "precision"):
            self.assertIsNone(pair[key])
        self.assertGreater(pair["num_inliers"], 50)
        self.assertIsNone(report["auc"]["5"])

    def test_a_broken_line_is_named_by_its_number(self):
        for line, words in ((pair_line() + "a.png b.png 0 0 1 2 3\n", ("line 2", "7 fields")),
                            ("\n#\n" + pair_line().replace("300.0", "wide", 1), ("line 3", "wide")),
                            (pair_line().replace("300.0", "0", 1), ("line 1", "K0")),
                            (pair_line(T=[2] + SIDEWAYS[1:]), ("line 1", "rotation")),
                            (pair_line(T=[1.03] + SIDEWAYS[1:]), ("line 1", "rotation", "0.03")),
                            (pair_line() + pair_line(T=[-1] + SIDEWAYS[1:]),
                             ("line 2", "reflection")),
                            (pair_line().replace("300.0", "nan", 1), ("line 1", "nan"))):
            with self.subTest(words=words):
                self.assert_refused(self.evaluate(line), "pairs.txt", *words)
        self.assert_refused(self.evaluate("# nothing\n"), "no pair")
        last = pair_line().split()[:-1] + ["inf"]
        self.assert_refused(self.evaluate(" ".join(last)), "line 1", "inf")
        last = pair_line().split()[:-4] + ["5", "0", "0", "1"]
        self.assert_refused(self.evaluate(" ".join(last)), "line 1", "0 0 0 1")
        self.assert_refused(self.evaluate(pair_line(), "--method", "upright"), "gravity")

    def test_a_rotation_of_few_digits_is_made_one(self):
        nearly = list(SIDEWAYS)
        nearly[0], nearly[5], nearly[6] = 1.004, 0.998, 0.0004
        pair = self.report(pair_line(T=nearly))["pairs"][0]
        exact = self.report(pair_line())["pairs"][0]
        # Half of the entry that has no counterpart across the diagonal is a turn: 0.0115 degrees.
        self.assertAlmostEqual(pair["pose_error_deg"], exact["pose_error_deg"], delta=0.013)

    def test_ctrl_c_keeps_the_pairs_that_are_done(self):
        pairs = self.write("set/pairs.txt", pair_line() * 500)
        with subprocess.Popen(
                [cli.program(), "evaluate", pairs, "--images", self.folder, "-o", self.out],
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                env={**os.environ, "TWOVIEW_PROGRESS_SECONDS": "0.001"}) as process:
            while "3 of 500" not in process.stderr.readline():
                self.assertIsNone(process.poll())
            process.send_signal(signal.SIGINT)
            said = process.communicate(timeout=60)[0]
        self.assertEqual(process.returncode, 130)
        report = json.loads((self.out / "report.json").read_text())
        count = report["num_pairs"]
        self.assertTrue(report["interrupted"])
        self.assertGreaterEqual(count, 2)
        self.assertLess(count, 500)
        self.assertEqual(len(report["pairs"]), count)
        self.assertIn(f"interrupted: the first {count} of 500 pairs", said)
        self.assertFalse(self.report(pair_line())["interrupted"])

    def test_missing_files_and_flags_are_refused(self):
        done = self.run_program("evaluate", "no.txt", "--images", ".", "-o", self.out)
        self.assert_refused(done, "no.txt")
        pairs = self.write("set/pairs.txt", pair_line())
        self.assert_refused(self.run_program("evaluate", pairs, "-o", self.out), "--images")

    def test_an_output_that_ends_in_json_is_the_file(self):
        self.succeed(self.evaluate(pair_line(), out=self.folder / "deep" / "r.json"))
        self.assertEqual(self.listing(self.folder / "deep"), ["r.json"])

    def test_max_pairs_takes_the_first(self):
        report = self.report(
            pair_line() + pair_line(name0="b.png", name1="a.png"), "--max-pairs", "1"
        )
        self.assertEqual([p["name0"] for p in report["pairs"]], ["a.png"])

    def test_json_prints_the_report_alone_and_quiet_prints_nothing(self):
        done = self.succeed(self.evaluate(pair_line(), "--json"))
        self.assertEqual(
            json.loads(done.stdout), json.loads((self.out / "report.json").read_text())
        )
        self.assertEqual(done.stderr, b"")
        done = self.succeed(self.evaluate(pair_line(), "--quiet"))
        self.assertEqual(done.stdout + done.stderr, b"")

    def test_quarter_turns_leave_the_errors_small(self):
        for turns in ((1, 0), (0, 1), (2, 3), (3, 2), (3, 3)):
            pair = self.report(pair_line(turns=turns))["pairs"][0]
            with self.subTest(turns=turns):
                self.assertLess(pair["pose_error_deg"], 1)
                self.assertGreater(pair["precision"], 0.85)

    def test_resized_images_keep_small_errors(self):
        pair = self.report(pair_line(), "--resize", "300")["pairs"][0]
        self.assertLess(pair["pose_error_deg"], 1)

    def test_a_camera_of_the_set_gives_the_distortion(self):
        entry = lambda name, k1, fx=FOCAL: (
            f"{name}:\n  {{fx: {fx}, fy: {FOCAL}, cx: {K[2]}, cy: {K[5]}, k1: {k1}, "
            "k2: 0, p1: 0, p2: 0, "
            f"k3: 0, image_width: {WIDTH}, image_height: {HEIGHT}}}\n"
        )
        # On level 0 the second image is the first one, shifted by whole pixels, so that the pose is
        # exact with corners at whole pixels; the pixels of coarser levels are averages over other
        # pixels, and the alignment moves corners by thousandths of a pixel.
        fine = ("--levels", "1", "--subpixel", "0", "--align-matches", "0")
        error = lambda: self.report(pair_line(), *fine)["pairs"][0]["pose_error_deg"]
        self.write("set/cameras.yaml", entry("cam", 0))
        straight = error()
        self.assertLess(straight, 1e-3)
        self.write("set/cameras.yaml", entry("cam", 0.4))
        self.assertGreater(error(), 1e-2)
        # Of several entries, evaluate takes the one whose name the image file's name begins with.
        self.write("set/cameras.yaml", entry("z", 0.4) + entry("a", 0) + entry("b", 0))
        self.assertEqual(error(), straight)
        # If no entry's name fits, evaluate takes the entry with the fx and cx of the pair's line.
        self.write("set/cameras.yaml", entry("y", 0.4, 999) + entry("z", 0))
        self.assertEqual(error(), straight)
        self.write("set/cameras.yaml", entry("y", 0, 999) + entry("z", 0, 998))
        shutil.rmtree(self.out)
        self.assert_refused(self.evaluate(pair_line()), "cameras.yaml")

    def test_a_camera_file_serves_a_list_of_names(self):
        expected = self.report(pair_line())["pairs"][0]
        self.write("set/cameras.yaml", "not: read\n")
        camera = self.write("mine.yaml", cli.camera_yaml())
        names = "a.png b.png\n"
        half = [v / 2 for v in K[:8]] + [1]
        for text in (names, pair_line(K0=half, K1=half)):  # the file comes before the list's K
            found = self.report(text, "--camera", camera)
            self.assertEqual(found["options"]["camera"], str(camera))
            for key in ("num_matches", "num_inliers", "verdict", "covariance"):
                self.assertEqual(found["pairs"][0][key], expected[key], key)
        (self.folder / "set" / "cameras.yaml").unlink()
        self.assertIsNone(self.report(pair_line())["options"]["camera"])
        self.assert_refused(self.evaluate(names, out=self.folder / "new"), "no K", "--camera",
                            out=self.folder / "new")
        small = self.write("small.yaml", cli.camera_yaml(WIDTH // 2, HEIGHT // 2))
        done = self.evaluate(names, "--camera", small, out=self.folder / "new")
        self.assert_refused(done, "small.yaml", "160x120", out=self.folder / "new")

    def test_the_calibration_is_as_sure_as_reconstruct_takes_it(self):
        sure = self.write("sure.yaml", cli.camera_yaml() + "focal_sigma: 0.001\ncenter_sigma: 0\n")
        covariances = []
        for options, camera in (((), self.camera), (("--camera", sure), sure)):
            self.succeed(self.run_program("reconstruct", self.a, self.b, "--camera", camera, "-o",
                                          self.out))
            covariances.append(self.result()["covariance"])
            self.assertEqual(self.report(pair_line(), *options)["pairs"][0]["covariance"],
                             covariances[-1])
        self.assertNotEqual(*covariances)

    def test_a_focal_length_stands_in_for_every_camera(self):
        self.write("set/cameras.yaml", "not: read\n")
        self.succeed(self.reconstruct("--focal-35mm", "32", camera=False))
        expected = self.result()
        half = [v / 2 for v in K[:8]] + [1]
        for text in ("a.png b.png\n", pair_line(K0=half, K1=half)):
            found = self.report(text, "--focal-35mm", "32")
            self.assertEqual(found["options"]["focal_35mm"], 32)
            for key in ("num_matches", "num_inliers", "verdict", "covariance"):
                self.assertEqual(found["pairs"][0][key], expected[key], key)
        new = self.folder / "new"
        done = self.evaluate(pair_line(), "--focal-35mm", "32", "--camera", self.camera, out=new)
        self.assert_refused(done, "without a camera file", out=new)
        done = self.evaluate(pair_line(), "--focal-35mm", "wide", out=new)
        self.assert_refused(done, "--focal-35mm", "'wide'", out=new)

    def test_a_camera_of_another_size_is_told_for_its_pair(self):
        self.write(
            "set/cameras.yaml",
            "c: {fx: 300, fy: 300, cx: 1, cy: 1, image_width: 9, image_height: 9}\n",
        )
        self.assert_refused(self.evaluate(pair_line()), "9x9")

    def test_a_broken_cameras_file_is_refused(self):
        self.write(
            "set/cameras.yaml",
            "c: {fx: 0, fy: 300, cx: 1, cy: 1, image_width: 9, image_height: 9}\n",
        )
        self.assert_refused(self.evaluate(pair_line()), "cameras.yaml", "fx", "is 0")

    def test_images_of_growing_size_share_one_context(self):
        small = [cli.stereo_pair()[0][y * WIDTH : y * WIDTH + 100] for y in range(80)]
        self.write("small.png", cli.png(100, 80, b"".join(small)))
        report = self.report(pair_line("small.png", "small.png") + pair_line() +
                             pair_line("small.png", "a.png") + pair_line())
        self.assertEqual(report["pairs"][1]["pose_error_deg"], report["pairs"][3]["pose_error_deg"])

    def test_an_unwritable_folder_is_told_before_the_work(self):
        done = self.evaluate(pair_line(), out=self.a / "out")
        self.assert_refused(done, "is not a folder", out=self.a / "out")


class RealData(cli.CliTest):
    def test_stereo_pairs_of_a_distorted_drone_camera(self):
        folder = Path(os.environ.get("TWOVIEW_DATA", "")) / "euroc_v101_start"
        if not (folder / "pairs.txt").exists():
            self.skipTest("no TWOVIEW_DATA with euroc_v101_start")
        self.succeed(
            self.run_program(
                "evaluate", folder / "pairs.txt", "--images", folder / "images", "-o", self.out
            )
        )
        report = json.loads((self.out / "report.json").read_text())
        self.assertEqual(report["num_pairs"], 5)
        self.assertGreater(report["auc"]["10"], 70)
        for pair in report["pairs"]:
            self.assertGreater(pair["precision"], 0.9)


if __name__ == "__main__":
    cli.main()
