#!/usr/bin/env python3
"""Tests of twoview triangulate: points from matched pixels and a known pose."""
import csv
import json
import math
import shutil
import struct
import unittest

import cli_support as cli
from cli_support import FOCAL, HEIGHT, WIDTH, camera_yaml

POINTS = [(0.5, -0.25, 4.0), (-1.0, 0.5, 6.0), (0.0, 0.0, 3.0), (1.5, 1.0, 9.0)]
T = (-1.0, 0.0, 0.0)


def pixel(point):
    cx, cy = (WIDTH - 1) / 2, (HEIGHT - 1) / 2
    return FOCAL * point[0] / point[2] + cx, FOCAL * point[1] / point[2] + cy


def seen(points, t=T):
    """Rows x0 y0 x1 y1: the pixels of points under x1 = x0 + t."""
    return [(*pixel(p), *pixel(tuple(a + b for a, b in zip(p, t)))) for p in points]


class Triangulate(cli.CliTest):
    def setUp(self):
        super().setUp()
        self.pose = self.write("pose.yaml", f"R: [1,0,0, 0,1,0, 0,0,1]\nt: {list(T)}\n")
        self.matches = self.write(
            "m.txt", "\n".join(" ".join(map(repr, row)) for row in seen(POINTS))
        )

    def triangulate(self, *more, matches=None, out=None):
        return self.run_program("triangulate", matches or self.matches, "--camera", self.camera,
                                "--pose", self.pose, "-o", out or self.out, *more)

    def rows(self, path):
        with open(path, newline="") as file:
            rows = list(csv.reader(file))
        self.assertEqual(rows[0], "x y z angle_deg error_px status".split())
        return rows[1:]

    def assert_points(self, rows, points, places=6):
        self.assertEqual(len(rows), len(points))
        for row, point in zip(rows, points):
            self.assertEqual(row[5], "ok")
            for cell, value in zip(row, point):
                self.assertAlmostEqual(float(cell), value, places)

    def test_points_are_written_as_a_table_and_a_cloud(self):
        for method in ("linear-ls", "iterative-ls", "midpoint"):
            with self.subTest(method=method):
                done = self.succeed(self.triangulate("--json", "--triangulation", method))
                result = json.loads(done.stdout)
                self.assertEqual(self.listing(), ["cloud.ply", "points.csv"])
                self.assert_points(self.rows(self.out / "points.csv"), POINTS)
                self.assertEqual(result["num_points"], 4)
                self.assertEqual(result["options"]["triangulation"], method)
                self.assertEqual([p["status"] for p in result["points"]], ["ok"] * 4)
                self.assertLess(result["rms_reprojection_px"], 1e-4)
                ply = (self.out / "cloud.ply").read_bytes()
                self.assertIn(b"element vertex 4\n", ply)
                x, y, z, *_, angle, error = struct.unpack("<fffBBBff", ply[-4 * 23 :][:23])
                for value, expected in zip((x, y, z), POINTS[0]):
                    self.assertAlmostEqual(value, expected, 5)
                self.assertAlmostEqual(angle, result["points"][0]["angle_deg"], 4)
                self.assertLess(error, 1e-3)

    def test_points_are_in_the_unit_of_t(self):
        self.pose.write_text("R: [1,0,0, 0,1,0, 0,0,1]\nt: [-0.2, 0, 0]\n")
        matches = self.write(
            "m.txt", "\n".join(" ".join(map(str, r)) for r in seen(POINTS, (-0.2, 0, 0)))
        )
        self.succeed(self.triangulate(matches=matches))
        self.assert_points(self.rows(self.out / "points.csv"), POINTS, 5)

    def test_each_match_has_a_row_with_its_status(self):
        rows = seen(POINTS)
        behind = (rows[0][0], rows[0][1], rows[0][0] + 20, rows[0][1])
        far = (100.0, 100.0, 100.0, 100.0)
        lines = [rows[0], behind, far, ("nan", 1, 2, 3), rows[1]]
        matches = self.write("m.csv", "\n".join(",".join(map(str, r)) for r in lines))
        result = json.loads(self.succeed(self.triangulate("--json", matches=matches)).stdout)
        table = self.rows(self.out / "points.csv")
        self.assertEqual([row[5] for row in table], ["ok", "behind", "infinite", "invalid", "ok"])
        self.assertEqual([float(c) for c in table[3][:5]], [0] * 5)
        self.assertEqual(
            [result["num_" + s] for s in ("ok", "infinite", "behind", "invalid")], [2, 1, 1, 1]
        )
        self.assertIn(b"element vertex 2\n", (self.out / "cloud.ply").read_bytes())

    def test_what_misses_its_pixels_is_left_out_of_the_cloud_only(self):
        row = seen(POINTS)[0]
        matches = self.write(
            "m.txt", f"{row[0]} {row[1]} {row[2]} {row[3] + 10}\n" + " ".join(map(str, row))
        )
        done = self.succeed(self.triangulate(matches=matches))
        self.assertTrue(
            done.stdout.startswith(b"1 points of 2 matches; 1 above 1 px,"), done.stdout
        )
        self.assertEqual(len(self.rows(self.out / "points.csv")), 2)
        self.assertIn(b"element vertex 1\n", (self.out / "cloud.ply").read_bytes())
        self.succeed(self.triangulate("--max-error-px", "20", matches=matches))
        self.assertIn(b"element vertex 2\n", (self.out / "cloud.ply").read_bytes())

    def test_match_and_reconstruct_give_what_it_reads(self):
        matches = self.folder / "matches"
        self.succeed(self.run_program("match", self.a, self.b, "-o", matches))
        self.succeed(self.reconstruct())
        self.pose = self.out / "result.json"
        cloud = self.folder / "new" / "cloud.ply"
        done = self.succeed(self.triangulate("--json", matches=matches / "matches.csv", out=cloud))
        self.assertEqual(self.listing(cloud.parent), ["cloud.ply"])
        points = [
            p
            for p in json.loads(done.stdout)["points"]
            if p["status"] == "ok" and p["error_px"] < 0.5
        ]
        self.assertGreater(len(points), 200)

    def test_what_is_read_is_not_written_over(self):
        matches = self.write("points.csv", "10 20 5 20\n")
        done = self.triangulate(matches=matches, out=self.folder)
        self.assertEqual(done.returncode, 2)
        self.one_line(done, "points.csv", "read by this run")
        self.assertEqual(matches.read_text(), "10 20 5 20\n")

    def test_o_names_one_file_by_its_ending(self):
        self.succeed(self.triangulate(out=self.out / "p.csv"))
        self.assertEqual(self.listing(), ["p.csv"])
        self.assert_points(self.rows(self.out / "p.csv"), POINTS)

    def test_columns_are_found_by_their_names(self):
        lines = ["idx0,y1,x1,note,y0,x0"] + [
            f"7,{y1},{x1},hm,{y0},{x0}" for x0, y0, x1, y1 in seen(POINTS)
        ]
        self.succeed(
            self.triangulate(matches=self.write("m.csv", "# made by hand\n" + "\r\n".join(lines)))
        )
        self.assert_points(self.rows(self.out / "points.csv"), POINTS)

    def test_bad_matches_are_named_by_their_line(self):
        for text, *words in (
            ("1 2 3\n", "line 1", "y1"),
            ("1 2 3 4\n1 2 x 4\n", "line 2", "x1", "'x'"),
            ("x0,y0,x1\n1,2,3\n", "line 1", "y1"),
            ("#\n\n", "no match"),
            ("", "empty"),
            ("1,2,,4\n", "line 1", "x1"),
        ):
            with self.subTest(text=text):
                self.assert_refused(
                    self.triangulate(matches=self.write("bad.txt", text)), "bad.txt", *words
                )
        self.assert_refused(self.triangulate(matches="none.csv"), "none.csv")

    def test_pixels_outside_the_cameras_image_are_refused(self):
        """Those of the images at twice the size, on both sides; pixels on the border are taken."""
        rows = [[2 * value for value in row] for row in seen(POINTS)]
        outside = self.write("twice.csv", "\n".join(" ".join(map(repr, row)) for row in rows))
        self.assert_refused(self.triangulate(matches=outside), "twice.csv", "cam.yaml",
                            f"{WIDTH}x{HEIGHT}", "in image")
        for x, y in ((-1.5, 10), (10, -1.5), (WIDTH + 0.5, 10), (10, HEIGHT + 0.5)):
            with self.subTest(x=x, y=y):
                one = self.write("one.csv", f"10 10 {x} {y}\n")
                self.assert_refused(self.triangulate(matches=one), "in image 1")
        self.succeed(self.triangulate(
            matches=self.write("edge.csv", f"-0.5 -0.5 {WIDTH} {HEIGHT}\nnan 1 2 3\n")))

    def test_bad_poses_and_cameras_are_refused(self):
        for text, word in (
            ("R: [1,0,0, 0,1,0, 0,0,1]\n", "t is missing"),
            ("t: [1,0,0]\n", "R is missing"),
            ('{"R": null, "t": null}', "R is missing"),
            ("R: [1,0,0, 0,1,0, 0,0,1]\nt: [0,0,0]\n", "t is 0"),
            ("R: [1,0,0, 0,1,0, 0,0,-1]\nt: [1,0,0]\n", "reflection"),
            ("R: [1,0,0, 0,1,0, 0,0,2]\nt: [1,0,0]\n", "no rotation"),
        ):
            with self.subTest(word=word):
                self.pose.write_text(text)
                self.assert_refused(self.triangulate(), "pose.yaml", word)
        self.pose.write_text("R: [1,0,0, 0,1,0, 0,0,1]\nt: [1,0,0]\n")
        done = self.run_program("triangulate", self.matches, "--pose", self.pose, "-o", self.out)
        self.assert_refused(done, "--camera")
        self.camera.write_text(camera_yaml(fx=0))
        self.assert_refused(self.triangulate(), "cam.yaml", "fx")
        for value in ("0", "nan", "2e9"):
            self.assert_refused(self.triangulate("--max-error-px", value), "--max-error-px")

    def test_a_pose_that_the_matches_contradict_is_refused(self):
        """Camera 1 is turned by 30 degrees about y, and looks at the same points from its side."""
        c, s = math.cos(math.radians(30)), math.sin(math.radians(30))
        R = ((c, 0, -s), (0, 1, 0), (s, 0, c))
        place = (-3.0, 0.1, 0.9)  # of camera 1 in camera 0
        turned = lambda p: tuple(sum(a * b for a, b in zip(row, p)) for row in R)
        t = tuple(-v for v in turned(place))
        points = [((k % 6 - 2.5) / 4, (k // 6 - 2) / 4, 4 + 0.3 * (k % 4)) for k in range(30)]
        rows = [(*pixel(p), *pixel(tuple(a + b for a, b in zip(turned(p), t)))) for p in points]
        matches = self.write("30.txt", "\n".join(" ".join(map(repr, row)) for row in rows))
        inverse = [[R[j][i] for j in range(3)] for i in range(3)]

        def pose(rotation, t):
            self.pose.write_text(f"R: {[v for row in rotation for v in row]}\nt: {list(t)}\n")
            return self.triangulate(matches=matches)

        self.assertIn(b"30 points of 30 matches", self.succeed(pose(R, t)).stdout)
        shutil.rmtree(self.out)
        self.assert_refused(pose(inverse, place), "pose.yaml", "0 % of them", "100 % if",
                            "cam0_from_cam1")
        self.assert_refused(pose(R, place), "100 % if", "the place of camera 1")
        # Of another pair, a little away; and the matches of pictures of 0.8 times the size.
        more = [((k * 37 % 23 - 11) / 8, (k * 17 % 19 - 9) / 8, 4 + (k * 29 % 13) / 6)
                for k in range(60)]
        rows = [(*pixel(p), *pixel(tuple(a + b for a, b in zip(turned(p), t)))) for p in more]

        def table(scale):
            return self.write("60.txt", "\n".join(
                " ".join(repr(scale * v) for v in row) for row in rows))

        self.pose.write_text(f"R: {[v for row in R for v in row]}\nt: {list(t)}\n")
        right = json.loads(self.succeed(self.triangulate("--json", matches=table(1))).stdout)
        self.assertEqual((right["verdict"], right["notes"]), ("ok", []))
        for what, scale, away in (("size", 0.8, t), ("pair", 1, (t[0], 0.4, t[2]))):
            with self.subTest(what=what):
                self.pose.write_text(f"R: {[v for row in R for v in row]}\nt: {list(away)}\n")
                done = self.triangulate("--json", matches=table(scale))
                self.assertEqual(done.returncode, 3, done.stderr)
                result = json.loads(done.stdout)
                self.assertEqual(result["verdict"], "doubtful")
                self.assertIn("the matches contradict the pose or the cameras",
                              result["notes"][0])

    def test_a_refined_focal_length_is_used_and_a_broken_one_refused(self):
        pose = self.pose.read_text()
        self.camera.write_text(camera_yaml(fx=FOCAL / 1.25, fy=FOCAL / 1.25))
        self.pose.write_text(pose + "focal_length: {scale: 1.25, sigma: 0.03, uncertain: true}\n")
        self.succeed(self.triangulate())
        self.assert_points(self.rows(self.out / "points.csv"), POINTS)
        self.camera.write_text(camera_yaml())
        for given in ("null", "{scale: null}", "{scale: 0}", "{scale: 1}", "{sigma: 0.1}"):
            with self.subTest(given=given):
                self.pose.write_text(pose + f"focal_length: {given}\n")
                self.succeed(self.triangulate())
                self.assert_points(self.rows(self.out / "points.csv"), POINTS)
        for given in ("26", "{scale: -1}", "{scale: .nan}", "{scale: wide}"):
            with self.subTest(given=given):
                self.pose.write_text(pose + f"focal_length: {given}\n")
                new = self.folder / "new"
                self.assert_refused(self.triangulate(out=new), "pose.yaml", "focal_length", out=new)

    def test_the_cloud_tells_its_unit(self):
        self.succeed(self.triangulate())
        self.assertIn(b"forward; unit: that of t\n", (self.out / "cloud.ply").read_bytes())

    def test_a_rotation_rounded_to_three_digits_is_made_one(self):
        self.pose.write_text("R: [0.995, 0, 0.0998, 0, 1, 0, -0.0998, 0, 0.995]\nt: [-1, 0, 0]\n")
        result = json.loads(self.succeed(self.triangulate("--json")).stdout)
        R = result["R"]
        self.assertAlmostEqual(R[0] ** 2 + R[2] ** 2, 1, 14)


if __name__ == "__main__":
    cli.main()
