#!/usr/bin/env python3
"""Tests of files of true poses: units of their times, commas and names of columns, and truths that
nothing can be compared with, of which no result is lost."""
from cli_support import CliTest, camera_yaml, main
from test_odometry import COUNT, FPS, PICTURES, TIMES


def lines(form):
    return "".join(form(t, 0.1 * i) + "\n" for i, t in enumerate(TIMES))


class Truths(CliTest):
    def setUp(self):
        super().setUp()
        for i, data in enumerate(PICTURES):
            self.write(f"frames/{i}.png", data)

    def run_with(self, truth):
        return self.run_program(
            "odometry", "frames", "-o", self.out, "--fps", FPS, "--camera",
            self.write("own.yaml", camera_yaml()), "--truth", self.write("truth.csv", truth))

    def compare(self, truth):
        self.succeed(self.run_with(truth))
        return self.result()

    def test_every_unit_and_form_gives_the_same_errors(self):
        right = self.compare(lines(lambda t, x: f"{t:.9f} {x} 0 0 0 0 0 1"))
        self.assertEqual(right["truth"]["num_compared"], COUNT)
        self.assertEqual(right["notes"], [])
        names = "timestamp,tx,ty,tz,qx,qy,qz,qw\n"
        for what, text, note in (
                ("ns", lines(lambda t, x: f"{round(t * 1e9)} {x} 0 0 0 0 0 1"), "nanoseconds"),
                ("us", lines(lambda t, x: f"{round(t * 1e6)} {x} 0 0 0 0 0 1"), "microseconds"),
                ("ms", lines(lambda t, x: f"{t * 1e3} {x} 0 0 0 0 0 1"), "milliseconds"),
                ("commas", lines(lambda t, x: f"{t:.6f},{x},0,0,0,0,0,1"), None),
                ("commas and blanks", lines(lambda t, x: f"{t:.6f}, {x}, 0, 0, 0, 0, 0, 1"), None),
                ("semicolons", lines(lambda t, x: f"{t:.6f};{x};0;0;0;0;0;1"), None),
                ("EuRoC", lines(lambda t, x: f"{round(t * 1e9)},{x},0,0,1,0,0,0"), None),
                ("names", names + lines(lambda t, x: f"{t:.6f},{x},0,0,0,0,0,1"), None),
                ("other names", "qw;qx;qy;qz;time_ms;px;py;pz;speed\n" +
                 lines(lambda t, x: f"1;0;0;0;{t * 1e3};{x};0;0;7"), None),
                ("EuRoC's names", "timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], "
                 "q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n" +
                 lines(lambda t, x: f"{round(t * 1e9)},{x},0,0,1,0,0,0"), None),
                ("4x4", lines(lambda t, x: f"1 0 0 {x} 0 1 0 0 0 0 1 0 0 0 0 1"), None)):
            with self.subTest(what=what):
                result = self.compare(text)
                self.assertEqual(result["truth"]["num_compared"], COUNT)
                for key in ("ate_rmse", "rpe_rotation_deg"):
                    self.assertAlmostEqual(result["truth"][key], right["truth"][key], 9)
                self.assertEqual([n.split(" as ")[1].split(":")[0] for n in result["notes"]],
                                 [note] if note else [])

    def test_times_that_do_not_meet_are_named(self):
        result = self.compare(lines(lambda t, x: f"{t + 1.7e9:.6f} {x} 0 0 0 0 0 1"))
        self.assertEqual(result["truth"]["num_compared"], 0)
        self.assertIn("the truth's times, 1700000000 to 1700000000.76 s, and the path's, 0 to 0.76",
                      result["notes"][0])

    def test_numbers_of_frames_are_no_seconds(self):
        numbered = "".join(f"{i} {0.1 * i} 0 0 0 0 0 1\n" for i in range(COUNT))
        result = self.compare(numbered)
        self.assertEqual(result["truth"]["num_compared"], COUNT)
        self.assertIn("the truth's times were taken as the numbers in the pictures' names",
                      result["notes"][0])

    def test_zeros_of_a_motion_capture_are_left_out(self):
        far = lines(lambda t, x: f"{t:.6f} {1 + x} 0 0 0 0 0 1").splitlines(True)
        for i in (7, 8, 12):
            far[i] = far[i].split()[0] + " 0 0 0 0 0 0 1\n"
        result = self.compare("".join(far))
        self.assertIn(f"3 of {COUNT} poses are exactly 0", result["notes"][0])
        self.assertEqual(result["truth"]["num_compared"], COUNT - 3)
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
        # A path that begins at the origin keeps its pose.
        result = self.compare(lines(lambda t, x: f"{t:.6f} {x} 0 0 0 0 0 1"))
        self.assertEqual((result["notes"], result["truth"]["num_compared"]), ([], COUNT))

    def test_poses_without_times_that_are_not_as_many_as_the_frames_are_named(self):
        poses = lines(lambda t, x: f"1 0 0 {x} 0 1 0 0 0 0 1 0").splitlines(True)
        for text, count in ((poses[2:], COUNT - 2), (poses + poses[-1:], COUNT + 1)):
            self.assertIn(f"the truth has {count} poses without times, but there are {COUNT} "
                          "frames", self.compare("".join(text))["notes"][0])

    def test_a_truth_that_stays_in_one_place_loses_no_result(self):
        done = self.run_with(lines(lambda t, x: f"{t:.6f} 1 2 3 0 0 0 1"))
        self.succeed(done)
        self.assertIn(b"the true path has no length", done.stdout)
        truth = self.result()["truth"]
        self.assertEqual((truth["num_compared"], truth["path_length"]), (COUNT, 0))
        for key in ("ate_rmse", "ate_rmse_percent_of_path", "ate_live_rmse", "scale_ratio"):
            self.assertIsNone(truth[key])
        self.assertIn("trajectory.txt", self.listing())

    def test_what_is_no_truth_is_named(self):
        for words, text in (
                (("line 1", "7 numbers", "angles"), "0 1 2 3 0 0 90\n"),
                (("line 1", "none is qx", "roll"), "time,x,y,z,roll,pitch,yaw\n0,0,0,0,0,0,0\n"),
                (("line 2", "length 90"), "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 90 0\n"),
                (("line 1", "no rotation"), "2 0 0 0 0 2 0 0 0 0 2 0\n"),
                (("line 1", "no rotation", "0.03"), "1.03 0 0 0 0 1 0 0 0 0 1 0\n"),
                (("binary file",), "ULog\1\x12\0\1\x1b[1m\n"),
                (("line 1", "reflection"), "1 0 0 0 0 1 0 0 0 0 -1 0\n")):
            self.assert_refused(self.run_with(text), "truth.csv", *words)


if __name__ == "__main__":
    main()
