#!/usr/bin/env python3
"""Tests of -o: a verb replaces the results of its own earlier run and nothing else."""
from cli_support import CliTest, camera_yaml, main, png, stereo_pair
from test_odometry import FPS, PICTURES


class Outputs(CliTest):
    def setUp(self):
        super().setUp()
        for i, data in enumerate(PICTURES[:6]):
            self.write(f"frames/{i}.png", data)
        self.own = self.write("own.yaml", camera_yaml())
        self.images = [self.write(f"{k}.png", png(320, 240, data))
                       for k, data in enumerate(stereo_pair())]
        self.write("pairs.txt", "0.png 1.png\n")

    def run_verb(self, verb, out):
        camera = ("--camera", self.own)
        words = {
            "odometry": ("odometry", "frames", "--fps", FPS, *camera),
            "reconstruct": ("reconstruct", *self.images, *camera),
            "match": ("match", *self.images),
            "detect": ("detect", self.images[0]),
            "undistort": ("undistort", self.images[0], *camera),
            "evaluate": ("evaluate", "pairs.txt", "--images", self.folder, *camera),
        }[verb]
        return self.run_program(*words, "-o", out)

    def content(self, out):
        return {path.relative_to(out): path.read_bytes()
                for path in sorted(out.rglob("*")) if path.is_file()}

    def test_a_verb_runs_again_into_its_own_folder(self):
        for verb in ("odometry", "reconstruct", "match", "detect", "undistort", "evaluate"):
            out = self.folder / f"out_{verb}"
            for _ in range(2):
                done = self.run_verb(verb, out)
                self.assertIn(done.returncode, (0, 3), done.stderr)

    def test_the_results_of_another_verb_are_neither_replaced_nor_mixed(self):
        for first, second, name in (("odometry", "reconstruct", "result.json"),
                                    ("reconstruct", "odometry", "cloud.ply"),
                                    ("reconstruct", "match", "matches.png")):
            with self.subTest(first=first, second=second):
                out = self.folder / f"out_{first}_{second}"
                self.run_verb(first, out)
                before = self.content(out)
                done = self.run_verb(second, out)
                self.assertEqual(done.returncode, 2)
                self.one_line(done, f"folder {out} holds ",
                              f"not of an earlier run of twoview {second}: give another -o")
                self.assertEqual(self.content(out), before)
                del name

    def test_verbs_whose_files_have_other_names_share_a_folder(self):
        out = self.folder / "both"
        for verb in ("detect", "match", "detect", "match"):
            self.succeed(self.run_verb(verb, out))

    def test_a_users_own_file_is_not_replaced(self):
        for verb, name in (("odometry", "report.html"), ("odometry", "colmap/cameras.txt"),
                           ("reconstruct", "cloud.ply"), ("evaluate", "report.json")):
            with self.subTest(verb=verb, name=name):
                out = self.folder / f"own_{verb}_{name[0]}"
                self.write(f"{out.name}/{name}", b"{\"mine\": 1}")
                before = self.content(out)
                done = self.run_verb(verb, out)
                self.assertEqual(done.returncode, 2)
                self.assertEqual(self.content(out), before)

    def test_undistort_keeps_the_camera_of_a_calibration(self):
        out = self.folder / "calibration"
        self.write("calibration/camera.yaml", "mine")
        self.write("calibration/calibration.json", "{}")
        done = self.run_verb("undistort", out)
        self.assert_refused(done, "camera.yaml", "twoview undistort", out=self.folder / "none")
        self.assertEqual((out / "camera.yaml").read_text(), "mine")


if __name__ == "__main__":
    main()
