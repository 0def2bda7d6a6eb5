#!/usr/bin/env python3
"""Tests of folders of pictures: their order, and what is left out of them."""
import shutil
import struct

from cli_support import CliTest, camera_yaml, main, png
from test_odometry import COUNT, FPS, HEIGHT, LUMA, PICTURES, TIMES, TUM_TRUTH, WIDTH
from test_photographs import ASCII, exif, with_exif

HIDDEN = "is a hidden file (its name begins with a dot)"

COPY = "is a copy of another picture, by its name and its look"


class Folders(CliTest):
    def fill(self, name="frames", first=1, pattern="frame{}.png"):
        for i, data in enumerate(PICTURES):
            self.write(f"{name}/" + pattern.format(first + i), data)

    def track(self, *more, name="frames", truth=TUM_TRUTH):
        camera = self.write("own.yaml", camera_yaml())
        self.succeed(self.run_program("odometry", name, "-o", self.out, "--fps", FPS, "--camera",
                                      camera, "--truth", self.write("truth", truth), *more))
        return self.result()

    def names(self):
        rows = (self.out / "frames.csv").read_text().splitlines()[1:]
        return [row.split(",")[1] for row in rows]

    def test_digits_count_as_numbers(self):
        self.fill()
        result = self.track()
        self.assertEqual(self.names(), [f"frame{i}.png" for i in range(1, COUNT + 1)])
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
        self.assertEqual(result["notes"], [])

    def test_numbers_that_are_too_long_for_a_machine_word_count_too(self):
        self.fill(first=99999999999999999990, pattern="t{}.png")
        result = self.track(truth="\ufeff" + TUM_TRUTH)
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)

    def fill_as(self, names):
        for name, data in zip(names, PICTURES):
            self.write(f"frames/{name}", data)
        return list(names)

    def test_names_that_are_times_or_have_a_sign_come_in_their_order(self):
        for names in ([f"{t}.png" for t in TIMES],  # 0.0, 0.06666666666666667, ..., 0.4
                      [f"t_{round(100 + t, 3)}_left.png" for t in TIMES],
                      [f"{i - 9}.png" for i in range(COUNT)],
                      [f"1.{i}.png" for i in range(COUNT)]):  # 1.10 is behind 1.9
            with self.subTest(first=names[:3]):
                for file in (self.folder / "frames").glob("*"):
                    file.unlink()
                self.fill_as(names)
                result = self.track()
                self.assertEqual(self.names(), names)
                self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
                self.assertEqual(result["notes"], [])

    def test_of_two_pictures_of_a_name_one_is_a_frame(self):
        self.fill()
        for i in (1, 5):
            self.write(f"frames/frame{i}.bmp", PICTURES[i])
        result = self.track()
        self.assertEqual(self.names(), [f"frame{i}.png" for i in range(1, COUNT + 1)])
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
        self.assertEqual(result["notes"], [
            "2 pictures of frames are left out: frame1.bmp has the name of another picture, but "
            "for the ending (so are 1 more)"])

    def test_copies_are_left_out_whether_stored_anew_or_not(self):
        self.fill()
        anew = png(WIDTH, HEIGHT, bytes(max(v, 2) for v in LUMA[8]))
        darker = png(WIDTH, HEIGHT, bytes(v // 2 for v in LUMA[9]))
        for name, data in (("frame4 (1)", PICTURES[3]), ("frame5 - Copy", PICTURES[4]),
                           ("frame6 copy 2", PICTURES[5]), ("Kopie von frame7", PICTURES[6]),
                           ("frame8 2", PICTURES[7]), ("frame9~2", anew),
                           ("frame10 - Copy (2)", darker)):
            self.write(f"frames/{name}.png", data)
        result = self.track()
        self.assertEqual(self.names(), [f"frame{i}.png" for i in range(1, COUNT + 1)])
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
        self.assertEqual(result["notes"], [
            f"7 pictures of frames are left out: frame4 (1).png {COPY} (so are 6 more)"])

    def test_a_series_is_none_of_copies_though_it_stands_still(self):
        """The names that a browser or Windows gives; the third picture is the second again."""
        names = ["room.png"] + [f"room ({i}).png" for i in range(1, COUNT)]
        for name, data in zip(names, PICTURES[:1] + PICTURES[:1] + PICTURES[2:]):
            self.write(f"frames/{name}", data)
        self.write("frames/room (1) copy.png", PICTURES[12])
        result = self.track()
        self.assertEqual(self.names()[:2] + self.names()[3:], names)
        self.assertIn("room (1) copy.png has the name of a copy of room (1).png, but shows "
                      "something else", " ".join(result["notes"]))

    def test_two_films_in_one_folder_are_named(self):
        self.fill()
        for i in (3, 4):
            self.write(f"frames/frame{i} (1).png", PICTURES[i + 9])
        note = " ".join(self.track()["notes"])
        self.assertIn("frame3 (1).png (and 1 more) has the name of a copy of frame3.png", note)
        self.assertIn("where the folder holds two films", note)

    def test_pictures_of_two_sequences_are_refused_by_their_names(self):
        def odometry(*more):
            return self.run_program("odometry", "frames", "-o", self.out, "--fps", FPS, "--camera",
                                    self.write("own.yaml", camera_yaml()), *more)

        for a, b in (("left_{}", "right_{}"), ("{}_rgb", "{}_depth"), ("cam0_{}", "cam1_{}"),
                     ("{}", "{}_thumb")):
            with self.subTest(a):
                shutil.rmtree(self.folder / "frames", ignore_errors=True)
                for k, data in enumerate(PICTURES):
                    self.write(f"frames/{a.format(k)}.png", data)
                    if k < 8:
                        self.write(f"frames/{b.format(f'{k:03}')}.png", PICTURES[k + 1])
                self.assert_refused(odometry(), "same numbers", a.format("#"), b.format("#"))
        for other in ("clip{}_7", "0{:x}"):  # counters of one sequence, of which one is a constant
            shutil.rmtree(self.folder / "frames", ignore_errors=True)
            for k, data in enumerate(PICTURES):
                self.write(f"frames/{other.format(k)}.png", data)
            self.assertNotEqual(odometry("--max-frames", "2").returncode, 2)

    def test_a_link_to_nothing_is_a_missing_frame(self):
        self.fill()
        link = self.folder / "frames/frame9.png"
        link.unlink()
        link.symlink_to("gone.png")
        result = self.track()
        self.assertEqual((result["num_frames"], result["num_unreadable"]), (COUNT, 1))
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
        self.assertIn("cannot read frames/frame9.png", " ".join(result["notes"]))

    def test_numbers_that_jump_are_named(self):
        self.fill()
        for i in (5, 6, 11):
            (self.folder / f"frames/frame{i}.png").unlink()
        self.assertEqual(self.track()["notes"], [
            "the numbers of the pictures' names jump from frame4.png to frame7.png (and in 1 more "
            "place): they are taken as evenly spaced in time; where some are missing, list the "
            "times in frames.txt"])

    def test_a_counter_that_began_anew_goes_on(self):
        # Each second of EXIF has two pictures, also that in which it began anew.
        names = [f"DSC_{(9992 + i - 1) % 9999 + 1:04}.png" for i in range(COUNT)]
        self.refill(names, [10 + i // 2 for i in range(COUNT)])
        self.assertLess(self.track()["truth"]["ate_rmse_percent_of_path"], 1)
        self.assertEqual(self.names(), names)
        self.assertEqual(self.result()["notes"], [
            "the pictures are taken in the order of their counter, which began anew, in which "
            "neighbours look alike, and not of the numbers in their names: DSC_0001.png behind "
            "DSC_9999.png, not as the first"])

    def refill(self, names, times=()):
        """The pictures under these names, with these times of EXIF, in seconds."""
        shutil.rmtree(self.folder / "frames", ignore_errors=True)
        for i, (name, data) in enumerate(zip(names, PICTURES)):
            if times:
                time = (0x9003, ASCII, f"2026:01:01 12:00:{times[i]:02}")
                data = with_exif(data, exif(time=time))
            self.write(f"frames/{name}", data)
        return list(names)

    def test_names_that_do_not_sort_as_numbers_are_read_by_what_the_pictures_show(self):
        half = COUNT // 2
        for names, by in (
                ([f"{i + 5:x}.png" for i in range(COUNT)], "counters with letters"),
                ([f"{'31-12-2025' if i < half else '01-01-2026'}_{i:02}.png"
                  for i in range(COUNT)], "(day, month, year)")):
            with self.subTest(first=names[:2]):
                self.refill(names)
                result = self.track()
                self.assertEqual(self.names(), names)
                self.assertIn(by, result["notes"][0])
                self.assertEqual(len(result["notes"]), 1)

    def test_exif_times_that_the_pictures_refute_are_not_heeded(self):
        names = self.refill([f"{i:02}.png" for i in range(COUNT)],
                            [30 if i == 6 else 10 + i for i in range(COUNT)])
        self.assertEqual(self.track()["notes"], [])
        self.assertEqual(self.names(), names)

    def test_orders_that_the_pictures_leave_open_are_named(self):
        for i in range(6):  # equal pictures
            time = (0x9003, ASCII, f"2026:01:01 12:00:{20 - i}")
            data = with_exif(PICTURES[0], exif(time=time))
            self.write(f"frames/{i}.png", data)
        self.run_program("odometry", "frames", "-o", self.out, "--fps", FPS, "--focal-35mm", 30)
        self.assertIn("4.png behind 5.png, not behind 3.png by these", self.result()["notes"][0])

    def test_one_picture_is_no_film(self):
        self.fill()
        self.assert_refused(self.run_program("odometry", "frames/frame1.png", "-o", self.out,
                                             "--focal-35mm", 26), "it is one picture", "folder")
        animated = b"RIFF\x20\0\0\0WEBPVP8X\x0a\0\0\0\x02\0\0\0" + bytes(16)
        self.assert_refused(self.run_program("odometry", self.write("a.webp", animated), "-o",
                                             self.out), "is an animated picture", "folder")

    def test_what_is_no_frame_is_left_out_and_named(self):
        self.fill()
        for i in range(1, 4):
            self.write(f"frames/._frame{i}.png", b"\0\5\x16\7" + bytes(60))
        self.write("frames/.DS_Store", b"x")
        self.write("frames/Thumbs.db", b"x")
        self.write("frames/readme.txt", b"x")
        self.write("frames/frame0.png", png(64, 48, bytes(64 * 48)))  # would be the first
        self.write("frames/below/frame5.png", PICTURES[0])
        self.write("frames/frame3b.NEF", b"II*\0" + bytes(60))
        result = self.track()
        self.assertEqual(result["num_frames"], COUNT)
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
        self.assertEqual(result["notes"], [
            "not used: 1 picture in the subfolder below",
            f"5 pictures of frames are left out: ._frame1.png {HIDDEN} (so are 2 more); "
            "frame3b.NEF is a camera's raw picture, which is not read: develop it to TIFF, PNG or "
            f"JPEG; frame0.png is 64x48, not {WIDTH}x{HEIGHT} as most are"])

    def test_a_picture_that_is_cut_off_is_a_missing_frame_also_the_first_one(self):
        self.fill()
        for i in (1, 9):
            self.write(f"frames/frame{i}.png", PICTURES[i - 1][:3000])
        result = self.track()
        self.assertEqual((result["num_frames"], result["num_unreadable"]), (COUNT, 2))
        self.assertEqual(result["truth"]["num_compared"], COUNT - 2)
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)
        self.assertIn("2 frames could not be used, the first: image frames/frame1.png is truncated",
                      result["notes"])

    def test_a_list_keeps_the_times_of_pictures_that_it_cannot_use(self):
        self.fill("set/images", first=0, pattern="{:05}.png")
        self.write("set/frames.txt", "\ufeff" + "".join(
            f"{t:.9f} images/{i:05}.png\n" for i, t in enumerate(TIMES))
            + f"{TIMES[-1] + 1} images/00001.png\n")
        self.write("set/images/00000.png", png(32, 24, bytes(32 * 24)))
        camera = self.write("own.yaml", camera_yaml())
        self.succeed(self.run_program("odometry", "set", "-o", self.out, "--camera", camera))
        result = self.result()
        self.assertEqual((result["num_frames"], result["num_unreadable"]), (COUNT + 1, 1))
        self.assertIn("00000.png is 32x24, not 320x240 as most are", " ".join(result["notes"]))
        self.assertIn("names 1 picture again, the first images/00001.png", result["notes"][0])

    def test_a_folder_of_which_nothing_is_left_is_refused(self):
        self.write("none/._0.png", PICTURES[0])
        run = ("odometry", "none", "-o", self.out, "--fps", 10, "--focal-35mm", 26)
        self.assert_refused(self.run_program(*run), "no image that is read", HIDDEN)
        self.write("none/0.png", PICTURES[0][:2000])
        self.assert_refused(self.run_program(*run), "could be used", "0.png is truncated")


class Pictures(CliTest):
    def luma_of(self, data, name):
        """The keypoints that detect finds in a picture."""
        self.succeed(self.run_program("detect", self.write(name, data), "-o", self.out))
        return (self.out / "keypoints.csv").read_bytes()

    def test_a_pnm_files_own_white_is_white(self):
        grey = [value // 16 for value in self.left()]  # 0 to 15
        plain = self.luma_of(png(WIDTH, HEIGHT, bytes(17 * v for v in grey)), "plain.png")
        head = b"P5\n# white is small\n%d %d\n%d\n"
        for white, size in ((15, 1), (60, 1), (4095, 2), (15 * 257, 2)):
            step = white // 15
            data = b"".join((v * step).to_bytes(size, "big") for v in grey)
            with self.subTest(white=white):
                self.assertEqual(self.luma_of(head % (WIDTH, HEIGHT, white) + data, "p.pgm"), plain)
        data = b"".join((v * 4369).to_bytes(2, "big") for v in grey)
        self.assertEqual(self.luma_of(head % (WIDTH, HEIGHT, 65535) + data, "p.pgm"), plain)

    def test_more_pictures_than_the_first_are_named_by_every_verb(self):
        """A grey TIFF of two pages, the second of another picture."""
        def page(at, data, follows):
            tags = [(256, WIDTH), (257, HEIGHT), (258, 8), (259, 1), (262, 1),
                    (273, at + 102), (277, 1), (278, HEIGHT)]
            entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
            return struct.pack("<H", 8) + entries + struct.pack("<I", follows) + data
        second = 8 + 102 + WIDTH * HEIGHT
        camera = self.write("own.yaml", camera_yaml())
        from cli_support import stereo_pair
        for name, data in zip("ab", stereo_pair()):
            self.write(f"p/{name}.tif", b"II*\0\x08\0\0\0" + page(8, data, second)
                       + page(second, bytes(WIDTH * HEIGHT), 0))
        a, b = "p/a.tif", "p/b.tif"
        for verb in (("detect", a), ("match", a, b), ("reconstruct", a, b, "--camera", camera),
                     ("undistort", a, b, "--camera", camera),
                     ("odometry", "p", "--fps", 10, "--camera", camera)):
            with self.subTest(verb=verb[0]):
                done = self.run_program(*verb, "-o", self.folder / verb[0])
                self.assertIn(b"files that hold several pictures", done.stdout + done.stderr)

    def test_sixteen_bits_of_which_few_are_used_are_stretched(self):
        left = self.left()
        plain = png(WIDTH, HEIGHT, left)
        thermal = png(WIDTH, HEIGHT, [7000 + 3 * v for v in left], depth=16)
        self.luma_of(plain, "plain.png")
        most = len((self.out / "keypoints.csv").read_text().splitlines())
        done = self.run_program("detect", self.write("t.png", thermal), "-o", self.out)
        self.assertIn(b"note         16-bit pictures that use less than half", done.stdout)
        count = len((self.out / "keypoints.csv").read_text().splitlines())
        self.assertGreater(count, 0.8 * most)

    def left(self):
        from cli_support import stereo_pair
        return list(stereo_pair()[0])


if __name__ == "__main__":
    main()
