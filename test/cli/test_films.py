#!/usr/bin/env python3
"""Tests of films as a source of `twoview odometry`: the container's own times, turns, pixels that
are not square, and films that are cut off or hold no pictures."""
import math
import pathlib
import shutil

from cli_support import CliTest, camera_yaml, main, png
from films import MIRROR, QUARTERS, atom, full, mov
from test_odometry import COUNT, FOCAL, FPS, HEIGHT, LUMA, PICTURES, TIMES, TUM_TRUTH, WIDTH

# Two rates, as phones film when the light goes: 25 and then 10 pictures a second.
UNEVEN = [i / 25 if i < COUNT // 2 else (COUNT // 2) / 25 + (i - COUNT // 2) / 10
          for i in range(COUNT)]
FOCAL_35MM = FOCAL * math.hypot(36, 24) / math.hypot(WIDTH, HEIGHT)


def truth_at(times):
    return "".join(f"{t:.9f} {0.1 * i} 0 0 0 0 0 1\n" for i, t in enumerate(times))


def rows_of(luma):
    return [luma[y * WIDTH:(y + 1) * WIDTH] for y in range(HEIGHT)]


def turned(luma, width, height, degrees):
    """(the bytes, the width, the height) of a picture turned clockwise."""
    rows = [luma[y * width:(y + 1) * width] for y in range(height)]
    for _ in range(degrees // 90):
        rows = [bytes(column) for column in zip(*reversed(rows))]
    return b"".join(rows), len(rows[0]), len(rows)


class Films(CliTest):
    def odometry(self, source, *more):
        return self.run_program("odometry", source, "-o", self.out, *more)

    def track(self, film, *more, camera=None, truth=TUM_TRUTH, ending=".mov"):
        path = self.write("film" + ending, film)
        camera = ("--camera", self.write("film.yaml", camera or camera_yaml()))
        if "--focal-35mm" in more:
            camera = ()
        done = self.odometry(path, *camera, "--truth", self.write("truth", truth), *more)
        self.succeed(done)
        return self.result()

    def assert_right(self, result, percent=1.0):
        self.assertEqual(result["truth"]["num_compared"], COUNT)
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], percent)

    def times(self):
        rows = (self.out / "frames.csv").read_text().splitlines()[1:]
        return [float(row.split(",")[0]) for row in rows]

    def test_pictures_have_the_times_of_the_container(self):
        result = self.track(mov(PICTURES, UNEVEN), truth=truth_at(UNEVEN))
        self.assert_right(result)
        for time, true in zip(self.times(), UNEVEN):
            self.assertAlmostEqual(time, true, 4)
        film = result["film"]
        self.assertEqual((film["times"], film["variable_rate"]), ("container", True))
        self.assertAlmostEqual(film["rate_hz"], (COUNT - 1) / UNEVEN[-1], 3)
        self.assertIn("rate varies, 0.04 to 0.1 s", " ".join(result["notes"]))

    def test_a_steady_film_has_no_notes(self):
        for timescale in (90000, 1000, 600):  # milliseconds round each time
            result = self.track(mov(PICTURES, [i / 30 for i in range(COUNT)], timescale=timescale),
                                truth=truth_at([i / 30 for i in range(COUNT)]))
            self.assert_right(result)
            self.assertEqual(result["notes"], [])
            self.assertEqual(result["film"]["variable_rate"], False)
            self.assertAlmostEqual(result["film"]["rate_hz"], 30, 1)

    def test_times_count_from_the_first_picture(self):
        film = mov(PICTURES, TIMES, start_s=5)
        for truth in (truth_at(TIMES), truth_at([t + 5 for t in TIMES])):
            result = self.track(film, truth=truth)
            self.assert_right(result)
            self.assertEqual(self.times()[0], 0)
            self.assertAlmostEqual(result["film"]["clock_start_s"], 5, 3)
            self.assertIn("clock begins at 5 s", " ".join(result["notes"]))

    def test_a_given_rate_stands_in_place_of_the_films_times(self):
        result = self.track(mov(PICTURES, UNEVEN), "--fps", FPS)
        self.assert_right(result)
        self.assertEqual(result["film"]["times"], "given")
        self.assertIn("--fps stands in place of the film's own times", result["notes"][0])

    def test_a_raw_mpeg_2_film_has_the_rate_of_its_header(self):
        try:
            import cv2
            import numpy as np
        except ImportError as missing:
            self.skipTest(str(missing))
        path = self.folder / "raw.m2v"
        film = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter_fourcc(*"mpg2"), FPS,
                               (WIDTH, HEIGHT))
        if not film.isOpened():
            self.skipTest("this OpenCV writes no MPEG-2")
        for luma in LUMA:
            grey = np.frombuffer(luma, np.uint8).reshape(HEIGHT, WIDTH)
            film.write(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
        film.release()
        result = self.track(path.read_bytes(), ending=".m2v")
        self.assertEqual((result["film"]["times"], result["film"]["rate_hz"]), ("rate", FPS))
        self.assertEqual(result["truth"]["num_compared"], COUNT)
        for time, true in zip(self.times(), TIMES):
            self.assertAlmostEqual(time, true, 6)

    def test_every_and_max_frames_keep_the_times(self):
        self.track(mov(PICTURES, UNEVEN), "--every", 2, "--max-frames", 9, truth=truth_at(UNEVEN))
        for time, true in zip(self.times(), UNEVEN[0:18:2]):
            self.assertAlmostEqual(time, true, 4)

    def test_a_picture_of_a_time_that_was_or_of_another_size_is_left_out(self):
        times = list(TIMES)
        times[5] = times[4]
        pictures = list(PICTURES)
        half = [row[::2] for row in rows_of(LUMA[9])[::2]]
        pictures[9] = png(WIDTH // 2, HEIGHT // 2, b"".join(half))
        result = self.track(mov(pictures, times), truth=truth_at(TIMES))
        film = result["film"]
        self.assertEqual((film["num_left_out"], film["num_other_size"]), (1, 1))
        self.assertEqual(result["num_frames"], COUNT - 2)
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
        self.assertIn("1 picture of the film is left out: of another size (160x120) than the "
                      "film's 320x240", result["notes"])
        self.assertIn("1 picture of the film is left out", " ".join(result["notes"]))

    def test_pictures_that_are_given_again_while_the_camera_moves_have_no_pose(self):
        shown = [min(k, 8) if k < 12 else k for k in range(COUNT)]  # it stands for three pictures
        result = self.track(mov([PICTURES[k] for k in shown], TIMES))
        self.assertEqual(result["num_repeated"], 3)
        self.assertEqual(result["num_tracked"], COUNT - 3)
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
        self.assertIn("3 pictures are the one before again, the first frame_000009.png",
                      " ".join(result["notes"]))
        rows = (self.out / "frames.csv").read_text().splitlines()[1:]
        self.assertEqual([k for k, row in enumerate(rows) if row.split(",")[3] == "repeated"],
                         [9, 10, 11])

    def test_a_film_whose_clock_begins_anew_goes_on(self):
        # Two recordings in one file: the clock falls by more than a second. The first picture
        # after that is left out, since it may be one that is out of order.
        half = COUNT // 2
        for start in (0.3, 0.4):
            times = [i / 5 for i in range(half)] + [start + i / 5 for i in range(COUNT - half)]
            film = mov(PICTURES, times)
            self.track(film)
            seen = self.times()
            shown = [k for k in range(COUNT) if k != half]
            truth = "".join(f"{t:.9f} {0.1 * k} 0 0 0 0 0 1\n" for t, k in zip(seen, shown))
            result = self.track(film, truth=truth)
            self.assertEqual(result["truth"]["num_compared"], COUNT - 1)
            self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
            self.assertEqual((result["film"]["num_left_out"], result["film"]["num_begun_anew"]),
                             (1, 1))
            # OpenCV 4.6 has another time for the first picture of such a film.
            steps = [round(b - a, 6) for a, b in zip(seen[1:], seen[2:])]
            self.assertEqual(steps, [0.2] * (half - 2) + [1] + [0.2] * (half - 2))
            self.assertIn("the clock of the film begins anew after ", " ".join(result["notes"]))

    def test_a_turned_film_is_used_as_it_is_stored(self):
        for degrees in (90, 180, 270):
            with self.subTest(degrees=degrees):
                result = self.track(mov(PICTURES, TIMES, turn=QUARTERS[degrees]))
                self.assert_right(result)
                self.assertEqual(result["film"]["rotation_deg"], degrees)
                self.assertIn(f"a player turns them by {degrees} degrees clockwise",
                              result["notes"][0])
        result = self.track(mov(PICTURES, TIMES, turn=MIRROR))
        self.assert_right(result)
        self.assertTrue(result["film"]["mirrored"])
        self.assertIn("a player mirrors them", result["notes"][0])

    def test_a_turned_film_fits_a_camera_of_the_turned_size(self):
        # The principal point lies off the middle, so that a turn to the wrong side shows.
        for degrees in (90, 270):
            with self.subTest(degrees=degrees):
                stored = []
                for luma in LUMA:  # what a player turns back
                    data, width, height = turned(luma, WIDTH, HEIGHT, 360 - degrees)
                    stored.append(png(width, height, data))
                result = self.track(mov(stored, TIMES, turn=QUARTERS[degrees]))
                self.assert_right(result)
                self.assertIn("are turned by", result["notes"][0])
                # Upright, the camera flies along x; lying, along y.
                rows = (self.out / "trajectory.txt").read_text().splitlines()
                x, y = (abs(float(rows[-1].split()[k])) for k in (1, 2))
                self.assertLess(y, 0.05 * x)

    def test_pixels_that_are_not_square_are_those_of_the_camera(self):
        narrow = []  # three quarters as wide: 240 x 240
        for luma in LUMA:
            rows = [luma[y * WIDTH:(y + 1) * WIDTH] for y in range(HEIGHT)]
            narrow.append(png(WIDTH * 3 // 4, HEIGHT, b"".join(
                bytes((row[4 * k // 3] * (3 - k % 3) + row[4 * k // 3 + 1] * (1 + k % 3)) // 4
                      for k in range(WIDTH * 3 // 4)) for row in rows)))
        film = mov(narrow, TIMES, pixel_aspect=(4, 3))
        stored = camera_yaml(width=240, height=240, fx=0.75 * FOCAL, fy=FOCAL, cx=119.5, cy=119.5)
        runs = [self.track(film, camera=stored), self.track(film, camera=camera_yaml()),
                self.track(film, "--focal-35mm", FOCAL_35MM)]
        for result in runs:
            self.assert_right(result)
            self.assertAlmostEqual(result["film"]["pixel_aspect"], 4 / 3, 6)
            self.assertIn("pixels are 1.333 times as wide as high", result["notes"][0])
            self.assertAlmostEqual(result["truth"]["ate_rmse"], runs[0]["truth"]["ate_rmse"], 6)
        self.assertIn("the camera, of square pixels, was scaled", runs[1]["notes"][0])

    def test_an_interlaced_film_is_named(self):
        result = self.track(mov(PICTURES, TIMES, fields=2))
        self.assert_right(result)
        self.assertTrue(result["film"]["interlaced"])
        self.assertIn("the film is interlaced by its container", " ".join(result["notes"]))

    def test_films_of_360_degrees_and_of_two_eyes_are_refused(self):
        equirectangular = atom(
            b"sv3d", full(b"svhd", b"a test\0"),
            atom(b"proj", full(b"prhd", bytes(12)), full(b"equi", bytes(16))))
        for words, more in ((("360 degrees", "equirectangular"), equirectangular),
                            (("two eyes", "side by side"), full(b"st3d", b"\2")),
                            (("two eyes", "top"), full(b"st3d", b"\1"))):
            with self.subTest(words):
                path = self.write("film.mov", mov(PICTURES, TIMES, more=more))
                self.assert_refused(self.odometry(path, "--focal-35mm", 26), "film.mov", *words)
        self.assert_right(self.track(mov(PICTURES, TIMES, more=full(b"st3d", b"\0"))))

    def test_a_film_with_two_eyes_in_its_pictures_is_doubtful(self):
        def beside(a, b):
            rows = range(0, WIDTH * HEIGHT, WIDTH)
            return png(2 * WIDTH, HEIGHT, b"".join(a[y:y + WIDTH] + b[y:y + WIDTH] for y in rows))
        film = mov([beside(a, b) for a, b in zip(LUMA, LUMA[2:])], TIMES[:-2])
        done = self.succeed(self.odometry(self.write("film.mov", film), "--focal-35mm", 21,
                                          "--no-pictures"))
        self.assertIn(b"doubtful     the pictures are of two eyes", done.stdout)
        self.assertEqual(self.result()["two_eyes"], "side_by_side")
        self.assertIn("ffmpeg -vf crop=iw/2", self.result()["notes"][0])

    def test_films_that_were_joined_as_bytes_are_named(self):
        half = COUNT // 2
        first = mov(PICTURES[:half], TIMES[:half])
        result = self.track(first + mov(PICTURES[half:], TIMES[:COUNT - half]))
        self.assertTrue(result["film"]["joined"])
        self.assertEqual(result["num_frames"], half)
        self.assertIn("several films one behind the other", " ".join(result["notes"]))

    def test_a_film_that_is_cut_off_is_tracked_as_far_as_it_goes(self):
        times = [i / 5 for i in range(COUNT)]
        whole = mov(PICTURES, times, index_first=True)
        result = self.track(whole, truth=truth_at(times))
        self.assert_right(result)
        self.assertEqual(result["notes"], [])
        result = self.track(whole[:-sum(map(len, PICTURES[-8:])) - 100], truth=truth_at(times))
        self.assertEqual(result["truth"]["num_compared"], COUNT - 9)
        self.assertIn("s before its header says: it may be cut off", " ".join(result["notes"]))
        self.assertEqual(result["film"]["num_damaged"], 1)
        self.assertIn(f"1 of the film's {COUNT - 8} packets are damaged", " ".join(result["notes"]))

    def test_damaged_pictures_that_the_decoder_conceals_are_named(self):
        bad = bytearray(PICTURES[7])
        for at in range(len(bad) // 2, len(bad) // 2 + 40):
            bad[at] ^= 0x5A
        result = self.track(mov(PICTURES[:7] + [bytes(bad)] + PICTURES[8:], TIMES))
        self.assertGreater(result["film"]["num_decoder_errors"], 0)
        self.assertIn("the film's decoder reports ", " ".join(result["notes"]))

    def test_archives_and_documents_are_no_films(self):
        self.write("seq/a.png", PICTURES[0])
        tar = pathlib.Path(shutil.make_archive(self.folder / "a", "tar", self.folder, "seq"))
        packed = pathlib.Path(shutil.make_archive(self.folder / "a", "zip", self.folder, "seq"))
        for name, data, kind in (
                ("a.tar", tar.read_bytes(), "a tar archive"),
                ("b.mp4", packed.read_bytes(), "a ZIP archive"),
                ("c.tgz", b"\x1f\x8b\x08" + bytes(600), "a gzip archive"),
                ("d.7z", b"7z\xbc\xaf\x27\x1c" + bytes(600), "a 7z archive"),
                ("e.rar", b"Rar!\x1a\x07\x01" + bytes(600), "a RAR archive"),
                ("f.pdf", b"%PDF-1.7\n" + PICTURES[0], "a PDF document")):
            self.assert_refused(self.odometry(self.write(name, data), "--fps", 10), name,
                                f"is {kind}, and no film: ")

    def test_what_is_no_film_with_pictures_is_named(self):
        sound = self.write("sound.mov", mov([PICTURES[0]], [0], sound_only=True))
        self.assert_refused(self.odometry(sound, "--focal-35mm", 26), "sound.mov",
                            "no pictures, only sound")
        cut = self.write("cut.mov", mov(PICTURES, TIMES)[:40000])
        self.assert_refused(self.odometry(cut, "--focal-35mm", 26), "cut.mov", "cut off")


if __name__ == "__main__":
    main()
