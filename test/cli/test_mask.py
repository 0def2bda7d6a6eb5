#!/usr/bin/env python3
"""Tests of --mask: black is left out, in every verb that finds corners; one file or a folder; and
masks that do not fit."""
import csv
import json
import math
import random

import cli_support as cli
from cli_support import FOCAL, HEIGHT, WIDTH
import test_odometry as flight
from test_evaluate import pair_line

EDGE = 200  # the mask's columns from here on are left out


def half_mask(black=0, used=255, width=WIDTH, height=HEIGHT, edge=EDGE, channels=1):
    row = bytes([used]) * (edge * channels) + bytes([black]) * ((width - edge) * channels)
    return cli.png(width, height, row * height, channels)


TURN, TURNING_FRAMES, TEXT_EDGE = 0.012, 16, 70


def turning_flight():
    """The frames of a camera that flies to the right past five walls and turns by TURN radians a
    frame, with text over the left of its picture, which stands still."""
    wide = flight.smooth_noise(3 * WIDTH, HEIGHT + 80)
    rng = random.Random(5)
    text = [[rng.choice((5, 250)) for _ in range(WIDTH)] for _ in range(HEIGHT)]
    cx, cy = (WIDTH - 1) / 2, (HEIGHT - 1) / 2
    for i in range(TURNING_FRAMES):
        c, s = math.cos(TURN * i), math.sin(TURN * i)
        # Where the camera saw a column before it turned, and by how much it scales the rows.
        columns = [((c * (x - cx) + s * FOCAL) / (c - s * (x - cx) / FOCAL) + cx + 60,
                    1 / (c - s * (x - cx) / FOCAL)) for x in range(WIDTH)]
        rows = []
        for y in range(HEIGHT):
            row = bytearray(WIDTH)
            for x, (at_x, scale) in enumerate(columns):
                at_y = (y - cy) * scale + cy
                wall = min(max(int(at_y * 5 / HEIGHT), 0), 4)
                row[x] = wide[round(at_y) + 40][round(at_x) + i * flight.SHIFTS[wall]]
            if y % 40 >= 12 and y % 40 < 28:
                row[10:TEXT_EDGE] = bytes(text[y // 4][x // 4] for x in range(10, TEXT_EDGE))
            rows.append(bytes(row))
        yield cli.png(WIDTH, HEIGHT, b"".join(rows))


class Mask(cli.CliTest):
    def setUp(self):
        super().setUp()
        self.mask = self.write("mask.png", half_mask())

    def detect(self, *more, image=None):
        return self.run_program("detect", image or self.a, "-o", self.out, "--json", *more)

    def keypoints(self):
        with open(self.out / "keypoints.csv", newline="") as file:
            return [(float(row["x"]), float(row["y"])) for row in csv.DictReader(file)]

    def assert_left_out(self):
        found = self.keypoints()
        self.assertGreater(len(found), 100)
        self.assertLess(max(x for x, _ in found), EDGE)

    def test_no_corner_is_found_where_the_mask_is_black(self):
        result = json.loads(self.succeed(self.detect("--mask", self.mask)).stdout)
        self.assert_left_out()
        self.assertAlmostEqual(result["masked_share"], 1 - EDGE / WIDTH, 9)
        self.assertEqual(result["options"]["mask"], str(self.mask))
        without = json.loads(self.succeed(self.detect()).stdout)
        self.assertEqual((without["masked_share"], without["options"]["mask"]), (0, None))

    def test_as_many_corners_as_wanted_are_found_in_what_is_used(self):
        self.succeed(self.detect("--max-keypoints", 300, "--mask", self.mask))
        masked = len(self.keypoints())
        self.succeed(self.detect("--max-keypoints", 300))
        everywhere = sum(x < EDGE for x, _ in self.keypoints())
        self.assertGreater(masked, 1.2 * everywhere)

    def test_any_value_but_black_is_used_and_colours_are_read(self):
        for name, data in (("one.png", half_mask(used=1)),
                           ("colour.png", half_mask(used=7, channels=3)),
                           ("opaque.png", cli.png(WIDTH, HEIGHT, (
                               b"\1\0\0\xff" * EDGE + b"\0\0\0\xff" * (WIDTH - EDGE)) * HEIGHT, 4)),
                           ("deep.png", cli.png(WIDTH, HEIGHT, (
                               [1] * EDGE + [0] * (WIDTH - EDGE)) * HEIGHT, depth=16))):
            with self.subTest(name):
                self.succeed(self.detect("--mask", self.write(name, data)))
                self.assert_left_out()

    def test_a_folder_has_masks_by_the_names_of_the_images(self):
        for name in ("masks/a.png.png", "stems/a.png"):
            with self.subTest(name):
                folder = self.write(name, half_mask()).parent
                self.succeed(self.detect("--mask", folder))
                self.assert_left_out()
                self.assert_refused(self.detect("--mask", folder, image=self.b), "b.png.png",
                                    folder.name, out=self.folder / "none")

    def test_the_mask_is_scaled_down_with_the_image(self):
        self.succeed(self.detect("--mask", self.mask, "--resize", WIDTH // 2))
        found = self.keypoints()
        self.assertGreater(len(found), 50)
        self.assertLess(max(x for x, _ in found), EDGE / 2)

    def test_masks_that_do_not_fit_are_refused(self):
        cases = {
            "small.png": (half_mask(width=300), ("300x240", "320x240", "small.png")),
            "black.png": (half_mask(used=0), ("black all over",)),
            "clear.png": (cli.png(WIDTH, HEIGHT, b"\xff\xff\xff\0" * WIDTH * HEIGHT, 4),
                          ("transparent",)),
            "text.png": (b"no picture", ("text.png", "no image"))}
        for name, (data, words) in cases.items():
            with self.subTest(name):
                self.assert_refused(self.detect("--mask", self.write(name, data)), "--mask", *words)
        self.assert_refused(self.detect("--mask", self.folder / "none.png"), "--mask", "none.png")

    def test_a_mask_without_black_is_noted(self):
        mask = self.write("white.png", half_mask(black=255))
        done = self.succeed(self.detect("--mask", mask))
        self.one_line(done, "note", "leaves nothing out")

    def test_a_mask_of_more_than_half_a_picture_is_noted(self):
        done = self.succeed(self.detect("--mask", self.write("most.png", half_mask(edge=80))))
        self.one_line(done, "note", "of a.png leaves 75 % of the picture out: black is what is")

    def test_an_output_does_not_replace_the_mask(self):
        mask = self.write("out/keypoints.png", half_mask())
        before = mask.read_bytes()
        self.assertEqual(self.detect("--mask", mask).returncode, 2)
        self.assertEqual(mask.read_bytes(), before)

    def test_matches_and_poses_are_of_what_both_masks_use(self):
        found = self.folder / "matches"
        self.succeed(self.run_program("match", self.a, self.b, "-o", found, "--mask", self.mask))
        with open(found / "matches.csv", newline="") as file:
            rows = [[float(v) for v in row] for row in list(csv.reader(file))[1:]]
        self.assertGreater(len(rows), 50)
        self.assertLess(max(max(row[0], row[2]) for row in rows), EDGE)
        self.succeed(self.reconstruct("--mask", self.mask, "--dense", "500"))
        result = self.result()
        self.assertEqual(result["verdict"], "ok")
        self.assertEqual([round(share, 4) for share in result["masked_share"]],
                         [round(1 - EDGE / WIDTH, 4)] * 2)

    def test_a_turned_pair_has_its_mask_turned(self):
        pairs = self.write("set/pairs.txt", pair_line(turns=(1, 1)))
        self.succeed(self.run_program("evaluate", pairs, "--images", self.folder, "-o", self.out,
                                      "--mask", self.mask))
        pair = json.loads((self.out / "report.json").read_text())["pairs"][0]
        self.assertLess(pair["pose_error_deg"], 1)
        self.assertAlmostEqual(pair["masked_share"][1], 1 - EDGE / WIDTH, 9)


class OdometryMask(cli.CliTest):
    set_folder = flight.OdometryTest.set_folder
    odometry = flight.OdometryTest.odometry

    def test_frames_are_tracked_by_what_the_mask_uses(self):
        mask = self.write("mask.png", half_mask())
        self.succeed(self.odometry(self.set_folder(), "--mask", mask))
        result = self.result()
        self.assertAlmostEqual(result["masked_share"], 1 - EDGE / WIDTH, 9)
        self.assertEqual(result["options"]["mask"], str(mask))
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
        images = (self.out / "colmap" / "images.txt").read_text().splitlines()
        seen = [float(x) for line in images if not line.startswith("#")
                for x in line.split()[0::3] if len(line.split()) % 3 == 0]
        self.assertGreater(len(seen), 100)
        self.assertLess(max(seen), EDGE + 1)

    def test_masks_without_black_are_noted_for_frames_too(self):
        mask = self.write("white.png", half_mask(black=254))
        done = self.succeed(self.odometry(self.set_folder(), "--mask", mask))
        self.assertIn(b"the mask of all frames leaves nothing out", done.stdout)

    def test_each_frame_has_its_mask_in_a_folder(self):
        for i in range(len(flight.TIMES)):
            self.write(f"masks/{i:05}.png.png", half_mask())
        source = self.set_folder()
        self.succeed(self.odometry(source, "--mask", "masks"))
        self.assertAlmostEqual(self.result()["masked_share"], 1 - EDGE / WIDTH, 9)
        (self.folder / "masks" / "00007.png.png").unlink()
        done = self.succeed(self.odometry(source, "--mask", "masks"))
        self.assertEqual(self.result()["num_unreadable"], 1)
        self.assertIn(b"has no mask of images/00007.png", b" ".join(done.stdout.split()))

    def test_text_over_a_flight_is_left_out_and_said(self):
        source = self.set_folder(truth=None)
        for i, picture in enumerate(turning_flight()):
            self.write(f"set/images/{i:05}.png", picture)
        (source / "frames.txt").write_text("".join(
            f"{i / 25} images/{i:05}.png\n" for i in range(TURNING_FRAMES)))
        done = self.succeed(self.odometry(source))
        result = self.result()
        self.assertTrue(0.01 < result["still_share"] < 0.3, result["still_share"])
        self.assertIn(b"stand still while the scene moves", done.stdout)
        self.assertIn(b"at the left edge", done.stdout)
        mask = cli.png_samples((self.out / "still_mask.png").read_bytes())
        rows = [mask[y * WIDTH:(y + 1) * WIDTH] for y in range(HEIGHT)]
        self.assertTrue(any(0 in row[:TEXT_EDGE] for row in rows))
        self.assertFalse(any(0 in row[TEXT_EDGE + 24:] for row in rows))
        # It is a mask for the next run.
        again = self.write("still.png", (self.out / "still_mask.png").read_bytes())
        self.succeed(self.odometry(source, "--mask", again))
        self.assertAlmostEqual(self.result()["masked_share"], result["still_share"], 9)
        # A run without text leaves no mask of an earlier one.
        self.succeed(self.odometry(self.set_folder("other")))
        self.assertEqual(self.result()["still_share"], 0)
        self.assertNotIn("still_mask.png", self.listing())

    def test_a_pair_with_text_has_the_pose_of_the_scene(self):
        pictures = list(turning_flight())
        a, b = self.write("a.png", pictures[0]), self.write("b.png", pictures[8])
        self.succeed(self.reconstruct(a=a, b=b))
        result = self.result()
        self.assertGreaterEqual(result["num_still_matches"], 8)
        turned = math.degrees(math.acos((sum(result["R"][::4]) - 1) / 2))
        self.assertAlmostEqual(turned, math.degrees(8 * TURN), delta=0.5)
        report = (self.out / "report.html").read_text()
        self.assertIn("stand still while the rest of the picture moves", report)

    def test_a_mask_of_another_size_is_refused(self):
        mask = self.write("mask.png", half_mask(width=300))
        self.assert_refused(self.odometry(self.set_folder(), "--mask", mask), "300x240", "320x240")


if __name__ == "__main__":
    cli.main()
