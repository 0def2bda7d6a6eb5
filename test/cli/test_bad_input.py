#!/usr/bin/env python3
"""Bad input and a full or read-only disk: one clear line, the right exit status, no incomplete
file."""
import base64
import os
import resource
import signal
import struct
import subprocess
import time
import unittest
from pathlib import Path

import cli_support as cli
from cli_support import HEIGHT, WIDTH, camera_yaml, png

# A JPEG file: a grey gradient of 16 x 16 pixels.
JPEG = base64.b64decode(
    "/9j/4AAQSkZJRgABAQAAAQABAAD/2wBDABQODxIPDRQSEBIXFRQYHjIhHhwcHj0sLiQySUBMS0dARkVQWnNiUFVt"
    "VkVGZIhlbXd7gYKBTmCNl4x9lnN+gXz/wAALCAAQABABAREA/8QAFQABAQAAAAAAAAAAAAAAAAAABQL/xAAXEAEA"
    "AwAAAAAAAAAAAAAAAAAEACEx/9oACAEBAAA/AATFyosYuVLMXKi5i5U//9k="
)


def grey(width, height, value=128):
    return bytes([value]) * (width * height)


class Images(cli.CliTest):
    def test_a_missing_image_is_named(self):
        self.assert_refused(self.reconstruct(a="nowhere.png"), "nowhere.png", "No such file")

    def test_an_empty_image_is_refused(self):
        self.assert_refused(self.reconstruct(b=self.write("e.png", b"")), "e.png", "empty")

    def test_a_folder_is_no_image(self):
        self.assert_refused(self.reconstruct(a=self.folder), "folder")

    def test_a_device_is_no_image(self):
        self.assert_refused(self.reconstruct(a="/dev/zero"), "/dev/zero", "not a file")

    def test_text_is_no_image(self):
        self.assert_refused(
            self.reconstruct(a=self.write("t.png", "hello there")), "t.png", "no image"
        )

    def test_a_png_cut_anywhere_is_truncated(self):
        whole = self.a.read_bytes()
        for share in (0.02, 0.5, 0.999):
            cut = self.write("cut.png", whole[: int(len(whole) * share)])
            with self.subTest(share=share):
                self.assert_refused(self.reconstruct(a=cut), "cut.png", "truncated")

    def test_a_png_with_a_broken_byte_is_damaged(self):
        whole = bytearray(self.a.read_bytes())
        whole[len(whole) // 2] ^= 255
        self.assert_refused(
            self.reconstruct(a=self.write("d.png", bytes(whole))), "d.png", "damaged"
        )

    def test_a_jpeg_cut_anywhere_is_truncated(self):
        for share in (0.3, 0.9):
            cut = self.write("cut.jpg", JPEG[: int(len(JPEG) * share)])
            with self.subTest(share=share):
                done = self.run_program("detect", cut, "-o", self.out)
                self.assert_refused(done, "cut.jpg", "truncated")

    def test_a_pgm_that_ends_early_is_truncated(self):
        cut = self.write("cut.pgm", b"P5\n# a comment\n64 64\n255\n" + bytes(64 * 63))
        self.assert_refused(self.run_program("detect", cut, "-o", self.out), "cut.pgm", "truncated")

    def test_headers_that_claim_huge_images_are_refused_before_decoding(self):
        def limit():  # 1 GiB of memory, too little to decode any of these images
            resource.setrlimit(resource.RLIMIT_DATA, (1 << 30, 1 << 30))

        is_asan = b"__asan" in Path(cli.program()).read_bytes()
        side = 60000
        ihdr = struct.pack(">IIBBBBB", side, side, 8, 6, 0, 0, 0)
        images = {
            "h.png": b"\x89PNG\r\n\x1a\n"
            + cli.png_chunk(b"IHDR", ihdr)
            + cli.png_chunk(b"IEND", b""),
            "h.pgm": b"P5\n60000 60000\n255\n" + bytes(100),
            "h.bmp": b"BM"
            + struct.pack("<IIIIiiHH", 999, 0, 54, 40, side, -side, 1, 24)
            + bytes(99),
            "h.tif": b"II*\0"
            + struct.pack("<IHHHIIHHIII", 8, 2, 256, 4, 1, side, 257, 4, 1, side, 0),
            "h.jpg": JPEG.replace(struct.pack(">HH", 16, 16), struct.pack(">HH", side, side), 1),
        }
        for name, data in images.items():
            with self.subTest(name=name):
                done = self.run_program("detect", self.write(name, data), "-o", self.out,
                                        preexec_fn=None if is_asan else limit)
                self.assert_refused(done, name, "too large", "60000x60000", "16384")

    def test_one_side_above_the_limit_is_refused(self):
        image = self.write("w.png", png(16385, 1, grey(16385, 1)))
        self.assert_refused(self.run_program("detect", image, "-o", self.out), "16385x1")

    def test_a_one_pixel_image_has_no_pose(self):
        dot = self.write("dot.png", png(1, 1, [128]))
        self.camera.write_text(camera_yaml(1, 1, cx=0.25, cy=0.25))
        result = self.assert_no_pose(self.reconstruct(a=dot, b=dot))
        self.assertEqual(result["num_keypoints"], [0, 0])

    def test_sixteen_bits_colour_and_alpha_find_what_grey_finds(self):
        values = list(cli.stereo_pair()[0])
        images = {
            "grey16.png": png(WIDTH, HEIGHT, [257 * v for v in values], depth=16),
            "rounded16.png": png(
                WIDTH, HEIGHT, [min(257 * v + 128, 65535) for v in values], depth=16
            ),
            "rgb.png": png(WIDTH, HEIGHT, [v for v in values for _ in range(3)], channels=3),
            "rgba.png": png(
                WIDTH,
                HEIGHT,
                [c for i, v in enumerate(values) for c in (v, v, v, i & 255)],
                channels=4,
            ),
            "rgb16.png": png(WIDTH, HEIGHT, [257 * v for v in values for _ in range(3)], 3, 16),
            "grey_alpha.png": png(
                WIDTH, HEIGHT, [c for i, v in enumerate(values) for c in (v, i & 255)], channels=2
            ),
        }
        self.succeed(self.run_program("detect", self.a, "-o", self.out))
        expected = (self.out / "keypoints.csv").read_bytes()
        self.assertGreater(expected.count(b"\n"), 100)
        for name, data in images.items():
            with self.subTest(name=name):
                self.succeed(self.run_program("detect", self.write(name, data), "-o", self.out))
                self.assertEqual((self.out / "keypoints.csv").read_bytes(), expected)

    def test_float_samples_are_refused(self):
        image = self.write("f.pfm", cli.pfm(8, 8, lambda x, y: 1.0))
        self.assert_refused(
            self.run_program("detect", image, "-o", self.out), "f.pfm", "8 or 16 bits"
        )

    def test_a_name_with_a_line_break_still_gives_one_line(self):
        self.assert_refused(self.reconstruct(a="two\nlines.png"), "two lines.png")


class Cameras(cli.CliTest):
    def refuse_camera(self, text, *words):
        self.camera.write_text(text)
        self.assert_refused(self.reconstruct(), "cam.yaml", *words)

    def test_images_of_another_size_than_the_camera_name_both_sizes(self):
        small = self.write("small.png", png(160, 120, grey(160, 120)))
        done = self.reconstruct(b=small)
        self.assert_refused(done, "small.png", "160x120", f"{WIDTH}x{HEIGHT}", "--resize")

    def test_a_missing_camera_file_is_named(self):
        self.assert_refused(self.reconstruct("--camera", "no.yaml", camera=False), "no.yaml")

    def test_an_empty_camera_file_is_refused(self):
        self.refuse_camera("", "empty")

    def test_missing_entries_are_named(self):
        for entry in ("image_width", "image_height", "camera_matrix"):
            lines = camera_yaml().replace(f"\n{entry}:", "\nother:")
            with self.subTest(entry=entry):
                self.refuse_camera(lines, entry, "missing")

    def test_zero_entries_are_named(self):
        for text, word in (
            (camera_yaml(fx=0), "fx"),
            (camera_yaml(fy="0."), "fy"),
            (camera_yaml(width=0), "image_width"),
            (camera_yaml(height=0), "image_height"),
        ):
            with self.subTest(word=word):
                self.refuse_camera(text, word, "is 0")

    def test_a_matrix_of_zeros_is_refused(self):
        self.refuse_camera(camera_yaml(fx=0, fy=0, cx=0, cy=0), "camera_matrix[0]", "is 0")

    def test_entries_that_are_not_finite_are_named(self):
        for text, word in ((camera_yaml(fx=".Nan"), "camera_matrix[0]"),
                           (camera_yaml(cy=".nan"), "camera_matrix[5]"),
                           (camera_yaml(cx="-.Inf"), "camera_matrix[2]"),
                           (camera_yaml(k=(0, ".nan", 0, 0, 0)), "distortion_coefficients[1]"),
                           (camera_yaml(width=".nan"), "image_width")):
            with self.subTest(word=word):
                self.refuse_camera(text, word, "not finite")

    def test_words_where_numbers_belong_are_named(self):
        self.refuse_camera(camera_yaml(fx="wide"), "camera_matrix[0]", "not a number")

    def test_too_short_lists_say_how_long_they_are(self):
        self.refuse_camera(camera_yaml().replace("0., 0., 1. ]", "0. ]"), "camera_matrix has 7")
        self.refuse_camera(camera_yaml(k=(1, 2, 3)), "distortion_coefficients has 3")

    def test_shapes_that_are_not_those_of_their_data_are_refused(self):
        self.refuse_camera(
            camera_yaml().replace("rows: 3", "rows: 2"), "camera_matrix", "rows x cols = 2 x 3"
        )
        self.refuse_camera(
            camera_yaml().replace("rows: 3", "rows: 1").replace("cols: 3", "cols: 9"),
            "camera_matrix",
            "rows is not 3",
        )
        self.refuse_camera(
            camera_yaml().replace("cols: 5", "cols: 4"),
            "distortion_coefficients has 5",
            "rows x cols = 1 x 4",
        )
        self.refuse_camera(
            camera_yaml().replace("   data: [ 300", "   dat: [ 300"), "camera_matrix has no data"
        )
        self.refuse_camera(camera_yaml().replace("cols: 5", "cols: many"), "cols", "not a number")

    def test_a_name_given_twice_is_refused_with_its_line(self):
        self.refuse_camera(
            camera_yaml() + "image_width: 320\n", "line 15", "image_width is given twice"
        )
        self.refuse_camera(camera_yaml().replace("   rows: 3\n", "   rows: 3\n   rows: 3\n"),
                           "line 7", "rows is given twice")

    def test_aliases_are_refused_for_a_few_lines_could_hold_endless_numbers(self):
        lines = ["a: &a [1,1,1,1,1,1,1,1,1,1]"]
        for name, last in zip("bcdefghij", "abcdefghi"):
            lines.append(f"{name}: &{name} [{','.join(['*' + last] * 10)}]")
        self.refuse_camera("\n".join(lines) + "\ncamera_matrix: *j\n" + camera_yaml()[14:], "alias")

    def test_skew_and_negative_focal_lengths_are_refused(self):
        self.refuse_camera(camera_yaml(fx=-300), "negative")
        self.refuse_camera(camera_yaml().replace("300.0, 0.,", "300.0, 2.,", 1), "skew")

    def test_an_unknown_lens_is_refused(self):
        self.refuse_camera(camera_yaml() + "distortion_model: mirror\n", "mirror")
        self.refuse_camera(camera_yaml() + "distortion_model: [plumb_bob]\n", "distortion_model")

    def test_broken_yaml_is_named_by_its_line(self):
        self.refuse_camera("image_width: 320\nimage_height: [240\n", "line")

    def test_one_camera_alone_is_refused(self):
        done = self.reconstruct("--camera0", self.camera, camera=False)
        self.assert_refused(done, "--camera1")
        self.assert_refused(self.reconstruct("--camera0", self.camera), "not both")


class Scenes(cli.CliTest):
    def test_a_blank_wall_has_no_pose(self):
        wall = self.write("wall.png", png(WIDTH, HEIGHT, grey(WIDTH, HEIGHT)))
        result = self.assert_no_pose(self.reconstruct(a=wall, b=wall))
        self.assertEqual(result["num_matches"], 0)
        self.assertEqual(result["verdict"], "refused")
        self.assertIn("too_few_matches", result["reasons"])

    def test_the_same_image_twice_is_no_motion(self):
        result = self.assert_no_pose(self.reconstruct(b=self.a))
        self.assertEqual(result["config"], "no_motion")
        self.assertIn("no_motion", result["reasons"])

    def test_fewer_than_five_matches_have_no_pose(self):
        def squares(shift):
            image = bytearray(grey(WIDTH, HEIGHT, 40))
            for i, (x0, y0) in enumerate(((60, 60), (200, 80), (120, 170))):
                for y in range(y0, y0 + 14):
                    for x in range(x0 + shift, x0 + shift + 14):
                        image[y * WIDTH + x] = 120 + 60 * ((x + i * y) // 5 & 1)
            return bytes(image)

        done = self.reconstruct("--ratio", "0.3", "--effort", "fixed",
                                a=self.write("s0.png", png(WIDTH, HEIGHT, squares(0))),
                                b=self.write("s1.png", png(WIDTH, HEIGHT, squares(8))))
        result = self.assert_no_pose(done)
        self.assertLess(result["num_matches"], 5)
        self.assertIn("too_few_matches", result["reasons"])


class Arguments(cli.CliTest):
    def test_values_outside_their_range_are_refused(self):
        cases = (
            ("--arc", "8"),
            ("--threshold", "0"),
            ("--threshold", "255"),
            ("--levels", "9"),
            ("--ratio", "0"),
            ("--ratio", "1.01"),
            ("--ratio", "nan"),
            ("--confidence", "1"),
            ("--max-error-px", "0"),
            ("--max-error-px", "inf"),
            ("--max-iterations", "0"),
            ("--max-iterations", "1e3"),
            ("--seed", "-1"),
            ("--seed", "18446744073709551616"),
            ("--max-keypoints", "99999999999"),
            ("--scale-factor", "1.0"),
            ("--resize", "-5"),
            ("--method", "six-point"),
            ("--kernels", "mmx"),
            ("--triangulation", "guess"),
            ("--descriptor", "orb"),
            ("--orientation", "down"),
            ("--levels", ""),
            ("--arc", "9x"),
        )
        for flag, value in cases:
            with self.subTest(flag=flag, value=value):
                self.assert_refused(self.reconstruct(flag, value), flag)

    def test_unknown_flags_verbs_and_missing_arguments_are_refused(self):
        self.assert_refused(self.reconstruct("--colour"), "--colour")
        self.assert_refused(self.run_program("rebuild"), "rebuild")
        self.assert_refused(self.run_program())
        self.assert_refused(self.run_program("reconstruct", self.a, "-o", self.out), "B")
        self.assert_refused(self.run_program("detect", self.a), "-o")

    def test_the_folder_of_a_calibration_is_answered_with_its_camera(self):
        self.write("mine/camera.yaml", camera_yaml())
        self.assert_refused(self.reconstruct("--camera", "mine", camera=False),
                            "it is a folder; its camera is mine/camera.yaml")
        self.assert_refused(self.reconstruct("--camera", self.folder, camera=False),
                            "it is a folder\n")

    def test_a_misspelt_option_or_verb_is_named_beside_what_is_near_it(self):
        run = ("reconstruct", self.a, self.b)
        help_ = "(see twoview reconstruct --help)"
        for words, *told in (
                # Named before what is missing: -o.
                ((*run, "--focal", "26"),
                 "no option --focal; did you mean --focal-35mm or --focal-sigma? " + help_),
                ((*run, "--focal_35mm=26", "-o", self.out), "did you mean --focal-35mm? "),
                ((*run, "--output-dir", self.out), "did you mean --output? "),
                ((*run, "--colour", "red", "-o", self.out), "no option --colour " + help_),
                ((*run, "-f", "26", "-o", self.out), "no option -f " + help_),
                ((*run, "c.png", "d.png", "-o", self.out), "not expected: c.png d.png " + help_),
                ((), "a verb is required: reconstruct, detect, ", " (see twoview --help)"),
                (("map",), "a verb is required after map: info, export or merge (see twoview map "),
                (("reconstuct", self.a, self.b), "no verb 'reconstuct'; did you mean reconstruct?"),
                (("unknown", "--help"), "no verb 'unknown' (see twoview --help)"),
                (("map", "inf", "x.twm"), "no verb 'map inf'; did you mean info? (see twoview map ")
        ):
            with self.subTest(words=words):
                self.assert_refused(self.run_program(*words), *told)
        self.succeed(self.reconstruct("--gravity0=-0.1,1,0", "--gravity1", "-0.1,1,0",
                                      "--gravity-sigma-deg", "5"))

    def test_kernels_that_this_machine_lacks_are_refused(self):
        wrong = "neon" if os.uname().machine == "x86_64" else "avx2"
        self.assert_refused(self.reconstruct("--kernels", wrong), f"--kernels {wrong}")

    def test_what_the_library_refuses_is_told_in_one_line(self):
        self.assert_refused(self.reconstruct("--method", "upright"), "upright")

    def test_bad_truth_is_refused(self):
        for text, word in (("t: [1, 0, 0]\n", "R"), ("R: [1,0,0, 0,1,0, 0,0,1]\n", "t"),
                           ("R: [1,0,0, 0,1,0, 0,0,2]\nt: [1,0,0]\n", "R holds no rotation"),
                           ("R: [1,0,0, 0,1,0, 0,0,1.03]\nt: [1,0,0]\n", "differs by 0.03"),
                           ("R: [1,0,0, 0,1,0, 0,0,-1]\nt: [1,0,0]\n", "reflection"),
                           ("R: [1,0,0, 0,1,0, 0,0,1]\nt: [0,0,0]\n", "t is 0"),
                           ("R: [1,0,0, 0,1,0, 0,0,1]\nt: [1,0]\n", "2 numbers"),
                           ("R: [1,0,0, 0,1,0, 0,0,1]\nt: [1,0,0]\ndepth0: no.pfm\n", "no.pfm")):
            with self.subTest(word=word):
                truth = self.write("truth.yaml", text)
                self.assert_refused(self.reconstruct("--truth", truth), word)

    def test_a_depth_map_of_another_size_is_refused(self):
        self.write("depth.pfm", cli.pfm(4, 4, lambda x, y: 1.0))
        truth = self.write(
            "truth.yaml", "R: [1,0,0, 0,1,0, 0,0,1]\nt: [-1,0,0]\ndepth0: depth.pfm\n"
        )
        self.assert_refused(self.reconstruct("--truth", truth), "4x4", f"{WIDTH}x{HEIGHT}")


class Surroundings(cli.CliTest):
    def test_a_folder_below_a_file_cannot_be_made(self):
        self.assert_refused(
            self.reconstruct(out=self.a / "out"), "is not a folder", out=self.a / "out"
        )

    def test_a_folder_that_cannot_be_made_leaves_nothing(self):
        self.assert_refused(self.reconstruct(out="/proc/nowhere/out"), "/proc/nowhere/out")

    def test_a_folder_without_permission_is_refused(self):
        closed = self.folder / "closed"
        closed.mkdir(mode=0o555)
        before = []
        if os.geteuid() == 0:  # root may write everywhere, so setpriv takes that capability away
            before = ["setpriv", "--bounding-set", "-dac_override,-dac_read_search"]
        done = self.reconstruct(out=closed / "out", before=before)
        self.assert_refused(done, "Permission", out=closed / "out")

    def test_folders_made_on_the_way_go_again_on_failure(self):
        done = self.reconstruct("--threshold", "0", out=self.out / "x" / "y")
        self.assert_refused(done)
        done = self.limited(1000, out=self.out / "x" / "y")
        self.assert_refused(done, "cannot write")

    def limited(self, num_bytes, **options):
        """Limits the size of files: a write fails after this many bytes, as on a full disk."""

        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (num_bytes, num_bytes))

        return self.reconstruct(preexec_fn=limit, **options)

    def test_a_file_that_cannot_be_finished_is_not_left(self):
        for num_bytes in (0, 100, 20000):
            with self.subTest(num_bytes=num_bytes):
                self.assert_refused(self.limited(num_bytes), "cannot write", "File too large")

    def test_earlier_results_survive_a_failure_whole(self):
        self.succeed(self.reconstruct())
        before = {name: (self.out / name).read_bytes() for name in self.listing()}
        done = self.limited(20000)
        self.assertEqual(done.returncode, 2)
        self.one_line(done, "cannot write")
        self.assertEqual({name: (self.out / name).read_bytes() for name in self.listing()}, before)

    def test_a_target_on_a_full_device_is_told(self):
        self.out.mkdir()
        os.symlink("/dev/full", self.out / "matches.png")
        done = self.reconstruct()
        self.assertEqual(done.returncode, 2)
        self.one_line(done, "matches.png", "No space left")
        self.assertEqual(self.listing(), ["matches.png"])

    def test_what_is_read_is_not_written_over(self):
        for verb, name in (("detect", "keypoints.png"), ("match", "matches.png"),
                           ("reconstruct", "matches.png")):
            with self.subTest(verb=verb):
                image = self.write(name, png(64, 48, [128] * (64 * 48)))
                before = image.read_bytes(), sorted(os.listdir(self.folder))
                more = [] if verb == "detect" else [name]
                more += ["--method", "eight-point"] if verb == "reconstruct" else []
                done = self.run_program(verb, name, *more, "-o", self.folder)
                self.assertEqual(done.returncode, 2)
                self.one_line(done, name, "read by this run")
                self.assertEqual((image.read_bytes(), sorted(os.listdir(self.folder))), before)

    def test_a_folder_in_the_place_of_a_file_is_told(self):
        (self.out / "views.png").mkdir(parents=True)
        done = self.reconstruct()
        self.assertEqual(done.returncode, 2)
        self.one_line(done, "views.png", "is a folder")
        self.assertEqual(self.listing(), ["views.png"])

    def test_a_signal_leaves_nothing_behind(self):
        self.out.mkdir()
        # opening a FIFO waits for a reader, so the run does not end by itself
        os.mkfifo(self.out / "epipolar.png")
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            with self.subTest(signal=number):
                run = subprocess.Popen(
                    [
                        cli.program(),
                        "reconstruct",
                        self.a,
                        self.b,
                        "--camera",
                        self.camera,
                        "-o",
                        self.out,
                        "--quiet",
                    ],
                    stderr=subprocess.PIPE,
                    cwd=self.folder,
                )
                deadline = time.monotonic() + 60
                while not any("matches.png" in name for name in self.listing()):
                    self.assertLess(time.monotonic(), deadline)
                    time.sleep(0.01)
                # Temporary files exist now, and the signal must make the program remove them.
                self.assertGreater(len(self.listing()), 3)
                run.send_signal(number)
                self.assertEqual(run.wait(timeout=60), -number)
                run.stderr.close()
                self.assertEqual(self.listing(), ["epipolar.png"])

    def test_nohup_is_obeyed(self):
        run = subprocess.Popen(
            [cli.program(), "detect", self.a, "-o", self.out, "--quiet"],
            preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
        run.send_signal(signal.SIGHUP)
        self.assertEqual(run.wait(timeout=60), 0)

    def test_a_full_stdout_is_told(self):
        with open("/dev/full", "w") as full:
            done = subprocess.run(
                [
                    cli.program(),
                    "reconstruct",
                    self.a,
                    self.b,
                    "--camera",
                    self.camera,
                    "-o",
                    self.out,
                    "--json",
                ],
                stdout=full,
                stderr=subprocess.PIPE,
                cwd=self.folder,
                timeout=300,
            )
        self.assertEqual(done.returncode, 2)
        self.one_line(done, "stdout", "No space left")
        self.assertFalse(self.out.exists())

    def test_a_full_disk_keeps_no_partial_file(self):
        mount = self.folder / "disk"
        mount.mkdir()
        inside = (f'mount -t tmpfs -o size=64k tmpfs "{mount}" || exit 99; "$@"; status=$?; '
                  f'echo status $status; ls -A "{mount}"')
        done = subprocess.run(
            ["unshare", "-rm", "sh", "-c", inside, "sh", cli.program(), "reconstruct", str(self.a),
             str(self.b), "--camera", str(self.camera), "--quiet", "-o", str(mount / "out")],
            capture_output=True, timeout=300)
        if not done.stdout.startswith(b"status"):
            self.skipTest("no tmpfs can be mounted here: " + done.stderr.decode().strip())
        self.assertEqual(done.stdout, b"status 2\n", done.stderr)
        self.one_line(done, "cannot write", "No space left")


if __name__ == "__main__":
    cli.main()
