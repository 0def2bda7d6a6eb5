#!/usr/bin/env python3
"""Tests of twoview detect and twoview match."""
import csv
import json
import unittest

import cli_support as cli
from cli_support import HEIGHT, SHIFTS, WIDTH


def read_csv(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], [[float(cell) for cell in row] for row in rows[1:]]


class Detect(cli.CliTest):
    def detect(self, *more):
        return self.succeed(self.run_program("detect", self.a, "-o", self.out, *more))

    def test_keypoints_are_written_as_a_table_and_a_picture(self):
        result = json.loads(self.detect("--json").stdout)
        self.assertEqual(self.listing(), ["keypoints.csv", "keypoints.png"])
        header, rows = read_csv(self.out / "keypoints.csv")
        self.assertEqual(header, "x y size angle_rad score level".split())
        self.assertEqual(len(rows), result["num_keypoints"])
        self.assertGreater(len(rows), 200)
        for x, y, size, angle, score, level in rows:
            self.assertTrue(0 <= x < WIDTH and 0 <= y < HEIGHT and size > 0)
            self.assertTrue(-3.1416 <= angle <= 3.1416 and 1 <= score <= 254)
            self.assertTrue(level == int(level) and 0 <= level < 8)
        cli.png_size((self.out / "keypoints.png").read_bytes())

    def test_options_change_what_is_found(self):
        most = json.loads(self.detect("--json", "--max-keypoints", "50").stdout)
        self.assertLessEqual(most["num_keypoints"], 50)
        self.detect("--orientation", "upright")
        self.assertTrue(all(row[3] == 0 for row in read_csv(self.out / "keypoints.csv")[1]))

    def test_every_kernel_set_gives_the_same_file(self):
        self.detect("--kernels", "c")
        expected = (self.out / "keypoints.csv").read_bytes()
        self.detect("--kernels", "auto")
        self.assertEqual((self.out / "keypoints.csv").read_bytes(), expected)

    def test_a_blank_image_has_an_empty_table(self):
        blank = self.write("blank.png", cli.png(64, 48, bytes(64 * 48)))
        self.succeed(self.run_program("detect", blank, "-o", self.out))
        self.assertEqual(
            (self.out / "keypoints.csv").read_text(), "x,y,size,angle_rad,score,level\n"
        )

    def test_options_of_other_verbs_are_refused(self):
        self.assert_refused(
            self.run_program("detect", self.a, "-o", self.out, "--ratio", "0.8"), "--ratio"
        )


class Match(cli.CliTest):
    def test_matches_are_written_as_a_table_and_a_picture(self):
        done = self.succeed(self.run_program("match", self.a, self.b, "-o", self.out, "--json"))
        result = json.loads(done.stdout)
        self.assertEqual(self.listing(), ["matches.csv", "matches.png"])
        header, rows = read_csv(self.out / "matches.csv")
        self.assertEqual(header, "x0 y0 x1 y1 dist_sq ratio idx0 idx1".split())
        self.assertEqual(len(rows), result["num_matches"])
        right = 0
        for x0, y0, x1, y1, dist_sq, ratio, idx0, idx1 in rows:
            self.assertTrue(0 <= ratio < 1 and dist_sq >= 0)
            shift = SHIFTS[int(y0) * len(SHIFTS) // HEIGHT]
            right += abs(x0 - x1 - shift) < 1 and abs(y0 - y1) < 1
        self.assertGreater(right, 0.9 * len(rows))
        self.assertEqual(len({row[6] for row in rows}), len(rows))
        self.assertEqual(len({row[7] for row in rows}), len(rows))

    def test_the_rows_name_the_keypoints_of_detect(self):
        self.succeed(self.run_program("match", self.a, self.b, "-o", self.out))
        self.succeed(self.run_program("detect", self.a, "-o", self.out))
        keypoints = read_csv(self.out / "keypoints.csv")[1]
        for row in read_csv(self.out / "matches.csv")[1]:
            self.assertEqual(row[:2], keypoints[int(row[6])][:2])

    def test_swapped_images_give_swapped_matches(self):
        self.succeed(self.run_program("match", self.a, self.b, "-o", self.out))
        one = read_csv(self.out / "matches.csv")[1]
        self.succeed(self.run_program("match", self.b, self.a, "-o", self.out))
        two = read_csv(self.out / "matches.csv")[1]
        swapped = [[x1, y1, x0, y0, d, r, j, i] for x0, y0, x1, y1, d, r, i, j in two]
        self.assertEqual(sorted(one), sorted(swapped))

    def test_images_of_different_sizes_match(self):
        crop = [cli.stereo_pair()[1][y * WIDTH : y * WIDTH + 200] for y in range(150)]
        small = self.write("small.png", cli.png(200, 150, b"".join(crop)))
        done = self.succeed(self.run_program("match", self.a, small, "-o", self.out, "--json"))
        self.assertGreater(json.loads(done.stdout)["num_matches"], 50)

    def test_a_wall_at_a_slant_is_matched_in_squeezed_views(self):
        """Image 1 is image 0 with its columns averaged by four: a wall at 76 degrees."""
        width, height = 480, 200
        rows = cli.texture(width // 2, height // 2, seed=3)
        wide = [bytes(value for value in row for _ in range(2)) for row in rows for _ in range(2)]
        slim = [bytes(sum(row[4 * x : 4 * x + 4]) // 4 for x in range(width // 4)) for row in wide]
        images = [self.write("wide.png", cli.png(width, height, b"".join(wide))),
                  self.write("slim.png", cli.png(width // 4, height, b"".join(slim)))]
        found = {}
        for effort in ("fixed", "2", "auto"):
            done = self.succeed(self.run_program("match", *images, "-o", self.out, "--json",
                                                 "--effort", effort))
            found[effort] = json.loads(done.stdout)
            rows = read_csv(self.out / "matches.csv")[1]
            self.assertEqual(len(rows), found[effort]["num_matches"])
            right = sum(abs(x0 - 4 * x1 - 1.5) < 4 and abs(y0 - y1) < 2
                        for x0, y0, x1, y1, *_ in rows)
            found[effort]["right"] = right
        self.assertEqual([found[effort]["effort"] for effort in ("fixed", "2")], [0, 2])
        self.assertGreaterEqual(found["auto"]["effort"], 2)
        self.assertEqual(len(found["auto"]["timings_ms"]["rungs"]), found["auto"]["effort"])
        self.assertGreater(found["2"]["right"], 2 * found["fixed"]["right"] + 20)
        self.assertEqual(found["auto"]["options"]["effort"], "auto")

    def test_the_ladder_ends_early_where_no_view_can_help(self):
        self.assert_refused(self.run_program("match", self.a, self.b, "-o", self.out, "--effort",
                                             "4"), "--effort")
        width, height = 160, 120
        rows = [bytes(row) for row in cli.texture(width, height, seed=4)]
        stripes = [bytes(200 * (x // 8 % 2) for x in range(width))] * height
        small = [row[:40] for row in rows[:30]]
        pictures = {"blank": [bytes(width)] * height, "striped": stripes, "tiny": small,
                    "plain": rows}
        paths = {name: self.write(f"{name}.png", cli.png(len(p[0]), len(p), b"".join(p)))
                 for name, p in pictures.items()}
        for name, other in (("blank", "plain"), ("striped", "striped"), ("plain", "plain"),
                            ("tiny", "plain")):
            done = self.succeed(self.run_program("match", paths[name], paths[other], "-o", self.out,
                                                 "--json"))
            result = json.loads(done.stdout)
            found = result["effort"], len(result["timings_ms"]["rungs"])
            self.assertEqual(found, (0, 1), (name, other))

    def test_bad_images_are_refused(self):
        done = self.run_program("match", self.a, "nowhere.png", "-o", self.out)
        self.assert_refused(done, "nowhere.png")


if __name__ == "__main__":
    cli.main()
